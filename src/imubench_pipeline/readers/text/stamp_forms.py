"""In which pattern stamps are written that are text."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import chain, product

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from imubench_pipeline.readers.text.cells import is_missing
from imubench_pipeline.readers.text.stamps import StampError, TextStamps

_DATES = (
    *("%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%Y:%m:%d", "%Y%m%d"),
    *("%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y"),
    *("%d-%b-%Y", "%d %b %Y", "%b %d %Y"),
)
_TIMES = ("%H:%M:%S.%f", "%I:%M:%S.%f %p", "%H:%M:%S:%f", "%H:%M")
_BETWEEN = (" ", "T", "_", "-", " - ", ", ")
_SHORTEST, _LONGEST = 5, 40
_NO_SIGN = re.compile(r"%\w|[^\W_]+")


def _by_signs() -> dict[str, list[str]]:
    """Return the patterns by the signs between their fields."""
    found: dict[str, list[str]] = {}
    whole = (date + sign + time for date, sign, time in product(_DATES, _BETWEEN, _TIMES))
    for form in chain(_TIMES, _DATES, whole):
        for written in dict.fromkeys((form, form.replace(".%f", ""))):
            found.setdefault(_NO_SIGN.sub("", written), []).append(form)
    return found


_BY_SIGNS = _by_signs()


def stamp_forms(texts: Sequence[str]) -> tuple[str, ...]:
    """Return the patterns that all stamps fit, the likeliest first; none where they are no stamps.

    A pattern with a date alone or a time of day alone is a part of one, that of a column. Where
    day and month may be either, those are right that lie nearest together.

    Parameters
    ----------
    texts : sequence of str
        As written; missing ones are passed over.
    """
    stamps = [text.strip() for text in texts if not is_missing(text)]
    if not stamps or not all(_SHORTEST <= len(stamp) <= _LONGEST for stamp in stamps):
        return ()
    if not all(any(sign.isdigit() for sign in stamp) for stamp in stamps):
        return ()
    forms = _BY_SIGNS.get(_NO_SIGN.sub("", stamps[0]), [])
    if ":" in stamps[0]:
        forms = ["iso8601", *forms]
    written = pa.array(stamps)
    fitting = {form: found for form in forms if (found := _fitting(form, written)) is not None}
    spans = {form: np.ptp(found) for form, found in fitting.items()}
    return tuple(form for form in fitting if spans[form] == min(spans.values()))


def stamps_of(form: str, texts: Sequence[str]) -> NDArray[np.float64]:
    """Return ns since 1970 or since midnight of stamps in a pattern; NaN where one is missing."""
    found, present = TextStamps(form).nanoseconds(pa.array(texts))
    return np.where(present, found, np.nan)


def _fitting(form: str, texts: pa.Array) -> NDArray[np.int64] | None:
    """Return stamps in a pattern; None where one is not."""
    try:
        found, present = TextStamps(form).nanoseconds(texts)
    except StampError:
        return None
    return found if present.all() else None
