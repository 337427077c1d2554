"""The time of the records of an array format, from its column of stamps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.arrays.table import DATES, UnusableError
from imubench_pipeline.readers.batch import LogFile
from imubench_pipeline.readers.started import date_of_stamp
from imubench_pipeline.readers.wrapping import WrapState, unwrapped

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
    """Makes seconds of the stamps of an array; integers and dates lose no digit.

    Parameters
    ----------
    file : LogFile
        Gets ``started`` with the first stamp.
    """

    def __init__(self, file: LogFile) -> None:
        self._file = file
        self._wrap = WrapState()
        self._first: Any = None

    def seconds(self, raw: NDArray[Any]) -> NDArray[np.float64]:
        """Return s since the first stamp of the file; NaN where the stamp is missing.

        Raises
        ------
        UnusableError
            If the first records have no stamp, or dates do not fit into nanoseconds.
        """
        assert self._file.log.time is not None  # made where there are stamps
        missing = np.ma.getmaskarray(raw).copy()
        values = np.ma.getdata(raw)
        if values.dtype.kind == DATES:
            missing |= np.isnat(values)
            stamps = _nanoseconds(values, missing)
        elif values.dtype.kind == "f":
            stamps = values.astype(np.float64)
            missing |= ~np.isfinite(stamps)
        else:
            # The differences of uint64 are right in int64 too, and may be negative there.
            stamps = values.astype(np.int64)
        if self._file.log.time.wraps is not None:
            wraps = self._file.log.time.wraps
            stamps[~missing] = unwrapped(stamps[~missing], wraps, self._wrap)
        if self._first is None:
            if missing.all():
                raise UnusableError(
                    f"no time stamp in the first {len(stamps)} records; mend 'column' of 'time' in "
                    "the sensor file, or drop 'time' and state 'rate'"
                )
            self._first = stamps[missing.argmin()]
            self._file.started = self._started(values.dtype.kind == DATES)
        return np.where(missing, np.nan, self._file.seconds(stamps, self._first))

    def _started(self, dated: bool) -> str | None:
        if dated:
            return str(np.datetime64(int(self._first), "ns"))[:23]
        source = self._file.log.time
        return None if source is None else date_of_stamp(self._first, source)


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
