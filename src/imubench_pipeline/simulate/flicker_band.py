"""Approximate flicker noise at the input of a filter by a bank of Gauss-Markov processes.

`noise.terms.flicker.fit_flicker_bank` approximates the Allan variance of flicker noise that is
sampled without a filter. At the input of a filter, whose cut-off may lie above the Nyquist
frequency, the density B^2 / (2 pi f) itself must be approximated far beyond the cut-off. Processes
of equal variance (ln r / pi) B^2 whose correlation times have the ratio r approximate this density.
The relative ripple is 4 e^(-pi^2 / ln r), below 1e-3 for two processes per decade.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from scipy.optimize import nnls

from imubench_pipeline.noise.terms import GaussMarkov, compute_bias_instability
from imubench_pipeline.typing import Array

MAX_FREQUENCY_RATIO = 30.0
"""Highest frequency of the approximation, over the cut-off frequency. There a filter of first order
attenuates the power by 99.9 %."""

_MEMBERS_PER_DECADE = 2.0
_POINTS_PER_DECADE = 20
_BAND_EXTENSION = 4.0
"""Factor by which the correlation times extend the band 1 / (2 pi f) at both ends."""


def fit_density_bank(B: float, lowest: float, highest: float) -> list[GaussMarkov]:
    """Return Gauss-Markov processes whose sum has the density of flicker noise.

    The variances are fitted by non-negative least squares of the relative error. B is the bias
    instability, rad/s or m/s^2, whose plateau is 0.664 B; the band is in Hz.

    Raises ValueError if the band is empty.
    """
    if not 0 < lowest < highest:
        raise ValueError(f"the band from {lowest} to {highest} Hz is empty")
    times, variances = _fit_unit_bank(round(math.log10(highest / lowest), 6))
    processes = []
    for time, variance in zip(times / (2.0 * math.pi * lowest), variances, strict=True):
        if variance > 0:
            density = 2.0 * B**2 * variance / time  # of the driving noise
            processes.append(GaussMarkov(compute_bias_instability(density, time), time))
    return processes


@lru_cache(maxsize=16)
def _fit_unit_bank(decades: float) -> tuple[Array, Array]:
    """Return correlation times and variances for B = 1 from 1 to 10^decades rad/s."""
    first, last = 10.0**-decades / _BAND_EXTENSION, _BAND_EXTENSION
    members = 2 + math.ceil(math.log10(last / first) * _MEMBERS_PER_DECADE)
    times = np.geomspace(first, last, members)
    omega = np.geomspace(1.0, 10.0**decades, 2 + int(decades * _POINTS_PER_DECADE))
    # Density of each process relative to 1 / omega.
    shapes = 2.0 * times * omega[:, None] / (1.0 + (omega[:, None] * times) ** 2)
    variances, _ = nnls(shapes, np.ones_like(omega))
    return times, variances
