"""Flicker noise in continuous time, as it enters a filter: a bank of Gauss-Markov processes.

`noise.terms.flicker.bank` has the Allan variance of flicker noise that is sampled without a
filter. Before a filter whose cut-off may lie above Nyquist, the density B^2 / (2 pi f) itself is
needed, far beyond the cut-off. Processes of equal variance (ln r / pi) B^2 whose correlation
times have the ratio r make up that density: the ripple is 4 e^(-pi^2 / ln r), below 1e-3 for two
a decade.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from scipy.optimize import nnls

from imubench_pipeline.noise.terms import GaussMarkov, bias_instability
from imubench_pipeline.typing import Array

ABOVE = 30.0
"""How far above the cut-off frequency the density is followed: there, a filter of first order has
taken away 99.9 % of the power."""

_MEMBERS_A_DECADE = 2.0
_POINTS_A_DECADE = 20
_BEYOND = 4.0
"""How far the correlation times go beyond both ends of the band, in 1 / (2 pi f)."""


def bank(B: float, lowest: float, highest: float) -> list[GaussMarkov]:
    """Return Gauss-Markov processes that together have the density of flicker noise.

    The variances are fitted by non-negative least squares of the relative error. B is the bias
    instability, rad/s or m/s^2, whose plateau is 0.664 B; the band is in Hz.

    Raises
    ------
    ValueError
        If the band is empty.
    """
    if not 0 < lowest < highest:
        raise ValueError(f"the band from {lowest} to {highest} Hz is empty")
    times, variances = _unit_bank(round(math.log10(highest / lowest), 6))
    processes = []
    for time, variance in zip(times / (2.0 * math.pi * lowest), variances, strict=True):
        if variance > 0:
            density = 2.0 * B**2 * variance / time  # of the driving noise
            processes.append(GaussMarkov(bias_instability(density, time), time))
    return processes


def ripple(lowest: float, highest: float) -> float:
    """Return the largest relative error of the density of a bank inside its band, Hz, of any B."""
    terms = bank(1.0, lowest, highest)
    decades = math.log10(highest / lowest)
    f = np.geomspace(lowest, highest, 2 + math.ceil(decades * 10 * _POINTS_A_DECADE))
    density = np.sum([term.psd(f) for term in terms], axis=0)
    return float(np.max(np.abs(density * 2.0 * np.pi * f - 1.0)))


def mixture(shortest: float, longest: float) -> tuple[Array, float]:
    """Return correlation times of equal processes that make up flicker noise of B = 1.

    They go from the shortest to the longest, s, well beyond the band in which the sum is needed,
    evenly spaced in log, five a decade: a ripple below 1e-8. Beside them stands the variance of
    each.
    """
    count = 2 + math.ceil(5.0 * math.log10(longest / shortest))
    times = np.geomspace(shortest, longest, count)
    return times, math.log(times[1] / times[0]) / math.pi


@lru_cache(maxsize=16)
def _unit_bank(decades: float) -> tuple[Array, Array]:
    """Return correlation times and variances for B = 1 from 1 to 10^decades rad/s."""
    first, last = 10.0**-decades / _BEYOND, _BEYOND
    members = 2 + math.ceil(math.log10(last / first) * _MEMBERS_A_DECADE)
    times = np.geomspace(first, last, members)
    omega = np.geomspace(1.0, 10.0**decades, 2 + int(decades * _POINTS_A_DECADE))
    # Relative to 1 / omega.
    shapes = 2.0 * times * omega[:, None] / (1.0 + (omega[:, None] * times) ** 2)
    variances, _ = nnls(shapes, np.ones_like(omega))
    return times, variances
