"""The time of the records of an array format, from its column of stamps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.arrays.table import DATES, UnusableError
from imubench_pipeline.readers.batch import LogFile
from imubench_pipeline.readers.stamps import Clock, date_of_nanoseconds, date_of_stamp
from imubench_pipeline.settings.sensor import TimeSource

_NANOSECONDS = {
    "D": 86_400 * 10**9,
    "h": 3_600 * 10**9,
    "m": 60 * 10**9,
    "s": 10**9,
    "ms": 10**6,
    "us": 10**3,
    "ns": 1,
}
_LARGEST = 2**63 - 1


class ArrayTime:
    """Makes seconds of the stamps of an array; integers and dates lose no digit."""

    def __init__(self, file: LogFile, source: TimeSource) -> None:
        self._source = source
        self._clock = Clock(file, source.wraps, self._started)
        self._dated = False

    def seconds(self, raw: NDArray[Any]) -> NDArray[np.float64]:
        """Return s since the first stamp of the file; NaN where the stamp is missing.

        Raises
        ------
        UnusableError
            If dates do not fit into nanoseconds.
        RecordingError
            If the first records have no stamp.
        """
        missing = np.ma.getmaskarray(raw).copy()
        values = np.ma.getdata(raw)
        self._dated = values.dtype.kind == DATES
        if self._dated:
            missing |= np.isnat(values)
            stamps = _nanoseconds(values, missing)
        elif values.dtype.kind == "f":
            stamps = values.astype(np.float64)
            missing |= ~np.isfinite(stamps)
        else:
            # The differences of uint64 are right in int64 too, and may be negative there.
            stamps = values.astype(np.int64)
        return self._clock.seconds(stamps, ~missing)

    def _started(self, first: Any) -> str | None:
        return date_of_nanoseconds(first) if self._dated else date_of_stamp(first, self._source)


def _nanoseconds(dates: NDArray[Any], missing: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return dates as ns since 1970."""
    unit, count = np.datetime_data(dates.dtype)
    if unit not in _NANOSECONDS:
        raise UnusableError(
            f"time stamps are dates in units of {unit}; expected "
            f"{', '.join(_NANOSECONDS)}: convert them"
        )
    factor = _NANOSECONDS[unit] * count
    whole = dates.astype(f"M8[{count}{unit}]", copy=False).view(np.int64)
    limit = _LARGEST // factor
    if np.any(~missing & ((whole > limit) | (whole < -limit))):
        raise UnusableError(
            "time stamps are dates before 1678 or after 2262, expected the time of a log; mend "
            "'column' of 'time' in the sensor file, or copy the file again"
        )
    return np.where(missing, 0, whole) * np.int64(factor)
