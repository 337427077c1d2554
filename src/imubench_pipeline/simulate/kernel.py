"""The recursion of one axis, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from imubench_pipeline.typing import Array

STARTED, INPUT, TEMPERATURE, LAG = range(4)
"""Places in the memory of a recursion: has it begun, and what it had at the sample before."""


# Sums may be taken in another order: with many slow states that is twice as fast.
@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def run(
    log: Array,
    given: Array,
    temperature: Array,
    normal: Array,
    memory: Array,
    x: Array,
    e: Array,
    decay: Array,
    own: Array,
    coupling: Array,
    shared: Array,
    transition: Array,
    factor: Array,
    output: Array,
    white: float,
    step: Array,
    lag: Array,
    lag_coupling: Array,
    lagged_step: Array,
    drift: Array,
) -> None:
    """Write samples; the states are left as they are at the last of them.

    Parameters
    ----------
    log : ndarray, shape (L,)
        Written: what comes out of the filter.
    given : ndarray, shape (L,)
        The input at the samples without noise and drift; linear in between.
    temperature : ndarray, shape (L,)
        °C; empty: no drift.
    normal : ndarray, shape (L, n + max(m, 1))
        Normal deviates. The first row ever is not used by the states.
    memory, x, e : ndarray, shapes (4,), (n,), (m,)
        The states, changed in place.
    decay, own, coupling, shared : ndarray, shapes (n,), (n,), (m, n), (m, n)
        Of the slow states.
    transition, factor, output : ndarray, shapes (m, m), (m, m), (m,)
        Of the filter; its own noise is normal @ factor.
    white : float
        Standard deviation of white noise a sample, where there is no filter.
    step : ndarray, shape (m,)
        What the filter's lack gains of a unit change of the input (`discretisation.Held`).
    lag : ndarray, shape (2,)
        Decay of the lag of the temperature over a sample, and what it gains of a change of 1 K.
    lag_coupling, lagged_step : ndarray, shape (m,)
        What the filter's lack gains of a lag of 1 K and of a change of 1 K, of a drift of 1 SI a K.
    drift : ndarray, shape (3,)
        Sensitivity, SI/K, quadratic, SI/K², and reference, °C.
    """
    n, m = x.size, e.size
    before = np.empty(m)
    for i in range(log.size):
        u = given[i]
        present = 0.0
        change_of_temperature = 0.0
        if temperature.size:
            present = temperature[i]
            if memory[STARTED] > 0.0:
                change_of_temperature = present - memory[TEMPERATURE]
        behind = memory[LAG]
        ahead = lag[0] * behind + lag[1] * change_of_temperature
        lagged = present + ahead - drift[2]
        if temperature.size:
            u += drift[1] * lagged * lagged
        if memory[STARTED] > 0.0:
            change = u - memory[INPUT]
            for a in range(m):
                gained = step[a] * change + drift[0] * (
                    lag_coupling[a] * behind + lagged_step[a] * change_of_temperature
                )
                for j in range(n):
                    gained += coupling[a, j] * x[j] + shared[a, j] * normal[i, j]
                for b in range(m):
                    gained += transition[a, b] * e[b] + factor[b, a] * normal[i, n + b]
                before[a] = gained
            for j in range(n):
                x[j] = decay[j] * x[j] + own[j] * normal[i, j]
            for a in range(m):
                e[a] = before[a]
        memory[LAG] = ahead
        memory[INPUT] = u
        memory[TEMPERATURE] = present
        memory[STARTED] = 1.0
        total = u
        if temperature.size:
            total += drift[0] * lagged
        for j in range(n):
            total += x[j]
        for a in range(m):
            total += output[a] * e[a]
        if m == 0:
            total += white * normal[i, n]
        log[i] = total
