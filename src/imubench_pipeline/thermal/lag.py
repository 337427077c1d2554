"""A first-order lag between the temperature that is measured and the one that acts."""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.thermal.path import TemperaturePath

Array = NDArray[np.float64]

_SHORT = 1e-4
"""Step over lag below which the exact weights lose digits, and their series is taken."""


@njit(cache=True)
def _lagged(times: Array, values: Array, lag: float) -> Array:
    result = np.empty_like(values)
    if values.size == 0:
        return result
    result[0] = values[0]
    for i in range(1, values.size):
        h = (times[i] - times[i - 1]) / lag
        decay = math.exp(-h)
        # (1 - e^-h) / h: the part of the new value that a ramp to it has reached.
        mean = -math.expm1(-h) / h if h > _SHORT else 1.0 - h / 2.0 + h * h / 6.0
        result[i] = (
            decay * result[i - 1] + (mean - decay) * values[i - 1] + (1.0 - mean) * values[i]
        )
    return result


def lagged(times: Array, values: Array, lag: float) -> Array:
    """Return a temperature behind a first-order lag: L dT_lag/dt = T - T_lag.

    Exact at the knots for a temperature that is linear between them. It is in equilibrium at the
    first knot.

    Parameters
    ----------
    times : ndarray, shape (k,)
        Knots, s, rising.
    values : ndarray, shape (k,)
        Temperature, °C.
    lag : float
        L, s; 0: none.

    Raises
    ------
    ValueError
        If the lag is below 0 or not finite.
    """
    if not (lag >= 0.0 and math.isfinite(lag)):
        raise ValueError(f"the lag is {lag} s, expected a time from 0")
    values = np.asarray(values, dtype=np.float64)
    if lag == 0.0:
        return values.copy()
    return np.asarray(_lagged(np.asarray(times, dtype=np.float64), values, lag))


def lagged_path(path: TemperaturePath, values: Array, rate: float, lag: float) -> Array:
    """Return a path's knots behind a lag; each segment begins in equilibrium.

    Parameters
    ----------
    path : TemperaturePath
    values : ndarray, shape (k,)
        Temperatures at its knots, °C: its own, or one of its draws.
    rate : float
        Of the log, Hz.
    lag : float
        s.
    """
    return np.concatenate(
        [lagged(path.sample[part] / rate, values[part], lag) for part in path.parts]
    )
