"""A first-order lag between the temperature that is measured and the one that acts."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from imubench_pipeline.estimators.thermal.path import TemperaturePath
from imubench_pipeline.typing import Array


@njit(cache=True)
def _lagged(times: Array, values: Array, lag: float) -> Array:
    result = np.empty_like(values)
    if values.size == 0:
        return result
    result[0] = values[0]
    # T_lag - T, as it decays and as a ramp of the temperature adds to it: weights of T_lag itself
    # would be differences of nearly equal numbers over short steps.
    behind = 0.0
    for i in range(1, values.size):
        h = (times[i] - times[i - 1]) / lag
        behind = math.exp(-h) * behind + math.expm1(-h) / h * (values[i] - values[i - 1])
        result[i] = values[i] + behind
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

    Returns
    -------
    ndarray, shape (k,)
        °C.

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
        s; 0: none.

    Returns
    -------
    ndarray, shape (k,)
        °C.

    Raises
    ------
    ValueError
        If the lag is below 0 or not finite.
    """
    return np.concatenate(
        [lagged(path.sample[part] / rate, values[part], lag) for part in path.parts]
    )
