"""The date of the first sample, told from stamps that count from 1970."""

from __future__ import annotations

import numpy as np

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
