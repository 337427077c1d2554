"""Convert numeric stamps: s since the first one, its date, and unwrapping of counters."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.batch import SECONDS, LogFile
from imubench_pipeline.settings.sensor import TimeSource
from imubench_pipeline.tables.findings import RecordingError

_YEAR_2001 = 978_307_200 * 10**9
_YEAR_2100 = 4_102_444_800 * 10**9


class Clock:
    """Converts the stamps of a file to s since the first one, and sets ``started`` of the file.

    ``wraps``: value at which stamps wrap to 0, or None. ``started``: returns the date of a stamp.
    """

    def __init__(
        self, file: LogFile, wraps: float | None, started: Callable[[Any], str | None]
    ) -> None:
        self._file = file
        self._wraps = wraps
        self._started = started
        self._state = WrapState()
        self.first: Any = None

    def seconds(self, stamps: NDArray[Any], present: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Return s since the first stamp, shape (n,); NaN where a stamp is not ``present``.

        Raises `RecordingError` if the first block has no stamp.
        """
        if self._wraps is not None:
            stamps = stamps.copy()
            stamps[present] = unwrap(stamps[present], self._wraps, self._state)
        if self.first is None:
            if not present.any():
                raise RecordingError(
                    f"{self._file.path.name}: no time stamp in the first {len(stamps)} records; "
                    "correct 'column' of 'time' in the sensor file, or drop 'time' and state 'rate'"
                )
            self.first = stamps[present.argmax()]
            self._file.started = self._started(self.first) or self._file.started
        seconds = self._file.seconds(stamps, self.first)
        return seconds if present.all() else np.where(present, seconds, np.nan)


@dataclass
class WrapState:
    """State of a counter after the stamps read so far."""

    last: Any = None  # the last present stamp, as written
    turns: int = 0  # number of wraps of the counter


def unwrap(stamps: NDArray[Any], wraps: float, state: WrapState) -> NDArray[Any]:
    """Return the stamps of a counter without wraps; int64 if integers, else float64 with NaN.

    ``wraps``: value at which the counter returns to 0. A step back by more than half of it is a
    wrap. A step forward by more than half of it undoes a wrap, so that a late record or a damaged
    stamp does not affect later ones. ``state``: after the last block; updated in place.
    """
    whole = stamps.dtype.kind in "iu" and float(wraps).is_integer()
    going_on = stamps.astype(np.int64 if whole else np.float64)
    present = np.ones(len(stamps), bool) if whole else ~np.isnan(going_on)
    written = going_on[present]
    if not len(written):
        return going_on
    before = written[0] if state.last is None else state.last
    steps = np.diff(written, prepend=before)
    half = wraps / 2
    turns = state.turns + np.cumsum((steps < -half).astype(np.int64) - (steps > half))
    going_on[present] = written + turns * (int(wraps) if whole else wraps)
    state.last, state.turns = written[-1], int(turns[-1])
    return going_on


def format_date(nanoseconds: int) -> str | None:
    """Return ISO 8601 date and time (UTC) of ns since 1970; None outside of 2001 to 2099."""
    if not _YEAR_2001 <= nanoseconds < _YEAR_2100:
        return None
    return format_nanoseconds(nanoseconds)


def format_date_of_stamp(first: float, source: TimeSource) -> str | None:
    """Return ISO 8601 date and time of a stamp as written; None as in `format_date`."""
    if source.unit not in SECONDS:
        return None
    if source.unit == "ns" and source.scale == 1:
        return format_date(int(first))
    nanoseconds = float(first) * SECONDS[source.unit] * source.scale * 1e9
    return format_date(round(nanoseconds)) if math.isfinite(nanoseconds) else None


def format_nanoseconds(since_1970: Any) -> str:
    """Return ISO 8601 date and time of ns since 1970, in any year, to the millisecond."""
    return str(np.datetime64(int(since_1970), "ns"))[:23]
