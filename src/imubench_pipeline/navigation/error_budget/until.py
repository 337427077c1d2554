"""How long dead reckoning stays within a limit."""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq

from imubench_pipeline.navigation.error_budget.budget import Start, budget
from imubench_pipeline.navigation.error_budget.in_use import NO_FIGURES, NO_USE, Figures, Use
from imubench_pipeline.navigation.error_budget.parts import Quantity
from imubench_pipeline.noise import NoiseModel

_SHORTEST = 1e-6
_LONGEST = 1e9
_POINTS = 4096
"""Where lines let the error swing, it is looked at so often."""


def time_until(
    limit: float,
    quantity: Quantity,
    *,
    gyro: NoiseModel,
    accel: NoiseModel,
    start: Start,
    use: Use = NO_USE,
    gyro_figures: Figures = NO_FIGURES,
    accel_figures: Figures = NO_FIGURES,
) -> float | None:
    """Return the time after which an error reaches a limit.

    The total of a `budget` rises with time, because the errors at two times never have a negative
    correlation: the covariance of every random term falls with the lag. Lines may swing; then the
    first crossing is taken of 4096 times up to one at which the limit is surely passed.

    Parameters
    ----------
    limit : float
        1 sigma, rad, m/s or m.
    quantity : {"attitude", "heading", "velocity", "position"}
    gyro, accel : NoiseModel
    start : Start
    use : Use
    gyro_figures, accel_figures : mapping of str to Figure
        All as in `budget`.

    Returns
    -------
    float or None
        s; 0 where the error is beyond the limit from the beginning, None where it is not within
        30 years.

    Raises
    ------
    ValueError
        If the limit is not above 0, or the quantity is not known.
    """
    if not (math.isfinite(limit) and limit > 0):
        raise ValueError(f"limit is {limit}, expected a number above 0")

    def excess(time: float) -> float:
        found = budget(
            quantity,
            time,
            gyro=gyro,
            accel=accel,
            start=start,
            use=use,
            gyro_figures=gyro_figures,
            accel_figures=accel_figures,
        )
        return found.total - limit

    if excess(_SHORTEST) >= 0:
        return 0.0
    earlier, later = _SHORTEST, 2.0 * _SHORTEST
    while excess(later) < 0:
        if later > _LONGEST:
            return None
        earlier, later = later, 2.0 * later
    if gyro.sinusoids or accel.sinusoids:
        times = np.linspace(0.0, later, _POINTS + 1)[1:]
        first = next(i for i, time in enumerate(times) if excess(float(time)) >= 0)
        earlier, later = (float(times[first - 1]) if first else _SHORTEST), float(times[first])
    return float(brentq(excess, earlier, later, xtol=1e-12, rtol=1e-12))
