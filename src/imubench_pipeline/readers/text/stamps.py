"""Read time stamps of a text log: numbers, ISO 8601 or patterns, in one or two columns."""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from itertools import chain, product
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from imubench_pipeline.readers.batch import LogFile
from imubench_pipeline.readers.stamps import Clock, format_date_of_stamp, format_nanoseconds
from imubench_pipeline.readers.text.cells import is_missing
from imubench_pipeline.readers.text.layout import TextLayout
from imubench_pipeline.settings.sensor import TimeSource

DAY = 24 * 3600 * 10**9  # length of a day, ns

_ISO_STAMP = re.compile(
    r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(?P<seconds>:\d\d(?:\.\d{1,9})?)?(?P<zone>Z|[+-]\d\d(?::?\d\d)?)?"
)
_ISO_PATTERN = (
    r"(?P<Y>\d{4})-(?P<m>\d\d)-(?P<d>\d\d)(?:(?:T|\s+)(?P<H>\d\d):(?P<M>\d\d)"
    r"(?::(?P<S>\d\d)(?:[.,](?P<f>\d{1,9})\d*)?)?\s*(?P<z>Z|UTC|[+-]\d\d(?::?\d\d)?)?)?"
)
_FIELD_PATTERNS: Mapping[str, str] = {
    "Y": r"(?P<Y>\d{4})", "y": r"(?P<y>\d\d)", "m": r"(?P<m>\d{1,2})", "b": r"(?P<b>[A-Za-z]{3})",
    "d": r"(?P<d>\d{1,2})", "j": r"(?P<j>\d{1,3})", "H": r"(?P<H>\d{1,2})",
    "I": r"(?P<I>\d{1,2})", "p": r"(?P<p>[AaPp][Mm])", "M": r"(?P<M>\d{1,2})",
    "S": r"(?P<S>\d{1,2})", "f": r"(?P<f>\d{1,9})\d*", "%": "%",
    "z": r"(?P<z>Z|UTC|[+-]\d\d(?::?\d\d)?)",
}  # fmt: skip
_MONTH_NAMES = ("jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec")


class StampError(Exception):
    """A stamp that cannot be read: its row in the block, and its text."""

    def __init__(self, row: int, text: str) -> None:
        super().__init__(text)
        self.row = row
        self.text = text


class TextStamps:
    """Reads stamps in text; ``form``: ``iso8601`` or a ``strptime`` pattern."""

    def __init__(self, form: str) -> None:
        pattern = _ISO_PATTERN if form == "iso8601" else _convert_to_regex(form)
        self._expression = rf"^\s*{pattern}\s*$"
        self._fields = re.compile(self._expression).groupindex
        # Without a date, stamps wrap to 0 at midnight.
        self.dated = "d" in self._fields or "j" in self._fields
        self._zoned: bool | None = None

    def nanoseconds(self, texts: pa.Array) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return ns since 1970 or midnight, and a mask of the stamps that are present.

        Raise `StampError` if a stamp does not match the pattern and is not missing.
        """
        texts = pc.fill_null(texts, "")
        fields = pc.extract_regex(texts, self._expression)
        time, sound = self._composed(fields)
        sound &= np.asarray(fields.is_valid())
        if "z" in self._fields:
            # All stamps must have a zone, or none: a mixture would be wrong by hours.
            zoned = np.asarray(pc.fill_null(pc.not_equal(fields.field("z"), ""), False))
            if self._zoned is None and sound.any():
                self._zoned = bool(zoned[sound.argmax()])
            sound &= zoned == self._zoned
        for row in np.flatnonzero(~sound):
            text = texts[int(row)].as_py()
            if not is_missing(text):
                raise StampError(int(row), text)
        return time, sound

    def _composed(self, fields: pa.StructArray) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        def figures(name: str, default: int) -> NDArray[np.int64]:
            if name not in self._fields:
                return np.full(len(fields), default, np.int64)
            text = fields.field(name)
            if name == "f":
                text = pc.utf8_rpad(text, 9, "0")
            digits = pc.if_else(pc.equal(text, ""), str(default), text)
            return np.asarray(pc.fill_null(digits, str(default)).cast(pa.int64()))

        year = figures("Y", 1970)
        if "y" in self._fields:
            short = figures("y", 70)
            year = np.where(short < 69, 2000, 1900) + short
        month = figures("m", 1)
        if "b" in self._fields:
            names = pc.utf8_lower(pc.fill_null(fields.field("b"), ""))
            month = np.asarray(pc.fill_null(pc.index_in(names, pa.array(_MONTH_NAMES)), -1)) + 1
        day = figures("d", 1)
        hour = figures("H", 0)
        if "I" in self._fields:
            hour = figures("I", 12) % 12
        if "p" in self._fields:
            after_noon = pc.equal(pc.utf8_lower(pc.fill_null(fields.field("p"), "")), "pm")
            hour = hour + 12 * np.asarray(after_noon)
        minute, second = figures("M", 0), figures("S", 0)
        months = (year - 1970) * 12 + month - 1
        first = months.astype("datetime64[M]").astype("datetime64[D]").astype(np.int64)
        following = (months + 1).astype("datetime64[M]").astype("datetime64[D]").astype(np.int64)
        sound = (month >= 1) & (month <= 12) & (day >= 1) & (first + day <= following)
        sound &= (hour < 24) & (minute < 60) & (second <= 60)  # 59.9996 s may be rounded
        sound &= (year > 1700) & (year < 2200)  # otherwise ns overflow
        days = first + day - 1 + figures("j", 1) - 1
        seconds = days * 86_400 + hour * 3600 + minute * 60 + second
        if "z" in self._fields:
            zones = pc.fill_null(fields.field("z"), "").dictionary_encode()
            offsets = np.zeros(len(zones.dictionary), np.int64)  # from UTC, s
            for place, zone in enumerate(zones.dictionary.to_pylist()):
                digits = zone.lstrip("+-").replace(":", "")
                if digits.isdigit():
                    offset = int(digits[:2]) * 3600 + int(digits[2:] or 0) * 60
                    offsets[place] = -offset if zone.startswith("-") else offset
            seconds -= offsets[np.asarray(zones.indices)]
        return seconds * 10**9 + figures("f", 0), sound


def _convert_to_regex(form: str) -> str:
    form = form.replace("%T", "%H:%M:%S").replace("%F", "%Y-%m-%d").replace("%R", "%H:%M")
    expression = ""
    for part in re.findall(r"[.,]%f|%.|\s+|[^%\s]", form):
        if part[1:] == "%f":
            expression += rf"(?:[.,]{_FIELD_PATTERNS['f']})?"  # loggers omit a fraction of zero
        elif part.startswith("%"):
            expression += _FIELD_PATTERNS[part[1:]]
        else:
            expression += r"\s+" if part.isspace() else re.escape(part)
    return expression


_DATE_FORMS = (
    *("%Y-%m-%d", "%Y/%m/%d", "%Y.%m.%d", "%Y:%m:%d", "%Y%m%d"),
    *("%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%d-%m-%Y", "%m-%d-%Y"),
    *("%d-%b-%Y", "%d %b %Y", "%b %d %Y"),
)
_TIME_FORMS = ("%H:%M:%S.%f", "%I:%M:%S.%f %p", "%H:%M:%S:%f", "%H:%M")
_DATE_TIME_SEPARATORS = (" ", "T", "_", "-", " - ", ", ")
_MIN_STAMP_LENGTH, _MAX_STAMP_LENGTH = 5, 40
_FIELD_OR_WORD = re.compile(r"%\w|[^\W_]+")


def _group_forms_by_signs() -> dict[str, list[str]]:
    patterns: dict[str, list[str]] = {}
    whole = (
        date + sign + time
        for date, sign, time in product(_DATE_FORMS, _DATE_TIME_SEPARATORS, _TIME_FORMS)
    )
    for form in chain(_TIME_FORMS, _DATE_FORMS, whole):
        for written in dict.fromkeys((form, form.replace(".%f", ""))):
            patterns.setdefault(_FIELD_OR_WORD.sub("", written), []).append(form)
    return patterns


_FORMS_BY_SIGNS = _group_forms_by_signs()


def find_stamp_forms(texts: Sequence[str]) -> tuple[str, ...]:
    """Return the patterns that match all stamps and give the shortest time span; may be empty."""
    stamps = [text.strip() for text in texts if not is_missing(text)]
    if not stamps or not all(
        _MIN_STAMP_LENGTH <= len(stamp) <= _MAX_STAMP_LENGTH for stamp in stamps
    ):
        return ()
    if not all(any(sign.isdigit() for sign in stamp) for stamp in stamps):
        return ()
    forms = _FORMS_BY_SIGNS.get(_FIELD_OR_WORD.sub("", stamps[0]), [])
    if ":" in stamps[0]:
        forms = ["iso8601", *forms]
    written = pa.array(stamps)
    spans = {}
    for form in forms:
        with suppress(StampError):
            times, present = TextStamps(form).nanoseconds(written)
            if present.all():
                spans[form] = np.ptp(times)
    return tuple(form for form, span in spans.items() if span == min(spans.values()))


def parse_stamps(form: str, texts: Sequence[str]) -> NDArray[np.float64]:
    """Return stamps in a pattern as ns since 1970 or since midnight; NaN where missing."""
    times, present = TextStamps(form).nanoseconds(pa.array(texts))
    return np.where(present, times, np.nan)


_INTEGER = re.compile(r"-?\d{1,19}")


class TextTime:
    """Converts the stamps of a text log to seconds.

    ``types``: pyarrow types by column position; a separate column of dates comes first.
    ``expected``: description of a stamp, for messages.
    """

    _text: TextStamps | None = None

    def __init__(self, file: LogFile, layout: TextLayout) -> None:
        assert file.log.time is not None  # constructed only for logs with stamps
        source = file.log.time
        self._source = source
        positions = [layout.position(column, "time") for column in list_time_columns(source)]
        self.position = positions[-1]
        stamps = [row[self.position] for row in layout.rows if self.position < len(row)]
        present = [stamp for stamp in stamps if not is_missing(stamp)]
        self.types = dict.fromkeys(positions, self._type(present))
        daily = self._text is not None and not self._text.dated
        self._clock = Clock(file, DAY if daily else source.wraps, self._started)
        self.expected = f"a time stamp in {source.format or source.unit!r}"
        if present:
            self.expected += f", like {present[0]!r}"

    def _type(self, stamps: list[str]) -> pa.DataType:
        if self._source.format is None:
            # Nanoseconds since 1970 do not fit into the 53 bits of a float64.
            whole = self._source.unit == "ns" and all(_INTEGER.fullmatch(s.strip()) for s in stamps)
            return pa.int64() if whole else pa.float64()
        if self._source.format == "iso8601" and self._source.date is None:
            # pyarrow itself is much faster, but reads no decimal commas, and no spaces around the
            # stamp or before the zone.
            matches = [_ISO_STAMP.fullmatch(text) for text in stamps]
            zones = {bool(match["zone"]) for match in matches if match}
            if all(matches) and len(zones) == 1:
                return pa.timestamp("ns", "UTC" if zones.pop() else None)
        self._text = TextStamps(self._source.format)
        return pa.string()

    def seconds(self, part: pa.RecordBatch) -> NDArray[np.float64]:
        """Return s since the first stamp of the file, NaN where missing; raise `StampError`."""
        columns = [part.column(str(position)) for position in self.types]
        if self._text is not None:
            texts = columns[0] if len(columns) == 1 else pc.binary_join_element_wise(*columns, " ")
            return self._clock.seconds(*self._text.nanoseconds(texts))
        (column,) = columns
        present = np.asarray(column.is_valid())
        if pa.types.is_timestamp(column.type):
            column = column.cast(pa.int64())
        stamps = np.asarray(column.fill_null(0) if column.null_count else column)
        if stamps.dtype.kind == "f":
            present &= np.isfinite(stamps)
        return self._clock.seconds(stamps, present)

    def _started(self, first: Any) -> str | None:
        if self._source.format is not None:
            return format_nanoseconds(first) if self._text is None or self._text.dated else None
        return format_date_of_stamp(first, self._source)


def list_time_columns(source: TimeSource | None) -> list[str | int]:
    """Return the columns of the stamps: a separate date, if any, and the time."""
    if source is None:
        return []
    return [column for column in (source.date, source.column) if column is not None]
