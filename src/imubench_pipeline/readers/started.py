"""The date of the first sample, told from stamps that count from 1970."""

from __future__ import annotations

import math

import numpy as np

from imubench_pipeline.readers.batch import SECONDS
from imubench_pipeline.settings.sensor import TimeSource

_YEAR_2001 = 978_307_200 * 10**9
_YEAR_2100 = 4_102_444_800 * 10**9


def date_of(nanoseconds: int) -> str | None:
    """Return ISO 8601 date and time (UTC) of ns since 1970.

    None where the figure lies outside the years 2001 to 2099: then it counts from something
    else, such as the start of the device or of a simulation.
    """
    if not _YEAR_2001 <= nanoseconds < _YEAR_2100:
        return None
    return str(np.datetime64(nanoseconds, "ns"))[:23]


def date_of_stamp(first: float, source: TimeSource) -> str | None:
    """Return ISO 8601 date and time (UTC) of a numeric stamp, as `date_of` does.

    Parameters
    ----------
    first : float or int
        As written, in ticks of ``source``; integer ns lose no digit.
    source : TimeSource
        Its unit and scale; None is returned for a count of samples.
    """
    if source.unit not in SECONDS:
        return None
    if source.unit == "ns" and source.scale == 1:
        return date_of(int(first))
    nanoseconds = float(first) * SECONDS[source.unit] * source.scale * 1e9
    return date_of(round(nanoseconds)) if math.isfinite(nanoseconds) else None
