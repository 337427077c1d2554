"""Flicker noise as a bank of Gauss-Markov processes, for simulation and for filters."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from scipy.optimize import nnls

from imubench_pipeline.noise.terms import (
    PEAK_TAU,
    Flicker,
    GaussMarkov,
    Term,
    WhiteNoise,
    sampled_gauss_markov_shape,
)
from imubench_pipeline.typing import Array

_MEMBERS_A_DECADE = 2.5
_POINTS_A_DECADE = 20
_BEYOND = 4.0
"""How far the correlation times of the bank go beyond the one that peaks at the end of its band."""


def bank(B: float, interval: float, longest: float) -> list[Term]:
    """Return Gauss-Markov processes whose samples have the Allan variance of flicker noise.

    Their correlation times are spaced evenly on a log scale from half a sampling interval, five
    in two decades; a white part stands for the shorter ones. The variances are fitted to the
    Allan variance of sampled flicker noise by non-negative least squares.

    Parameters
    ----------
    B : float
        Bias instability, rad/s or m/s²; the plateau is 0.664 B.
    interval : float
        Sampling interval, s: the shortest tau of the band.
    longest : float
        Longest tau of the band, s.

    Returns
    -------
    list of Term
        Gauss-Markov processes, and white noise.

    Raises
    ------
    ValueError
        If the band is empty.
    """
    if not 0 < interval < longest:
        raise ValueError(f"the band from {interval} to {longest} s is empty")
    times, levels, white = _unit_bank(round(math.log10(longest / interval), 6))
    terms: list[Term] = [
        GaussMarkov(B * level, interval * time)
        for time, level in zip(times, levels, strict=True)
        if level > 0
    ]
    return [*terms, WhiteNoise(B * white * math.sqrt(interval))] if white else terms


def ripple(interval: float, longest: float) -> tuple[float, float]:
    """Return the largest relative errors of a bank inside its band.

    Returns
    -------
    (float, float)
        Of the sampled Allan variance at tau from ``interval`` to ``longest``, and of the
        spectrum of the samples at frequencies from 1 / (2 longest) to Nyquist, both against
        sampled flicker noise.
    """
    terms = bank(1.0, interval, longest)
    points = math.ceil(math.log10(longest / interval) * _POINTS_A_DECADE * 2)
    n = np.unique(np.rint(np.geomspace(1.0, longest / interval, points)))
    omega = np.pi / n
    variance = np.sum([term.sampled_allan_variance(n, interval) for term in terms], axis=0)
    density = np.sum([term.sampled_spectrum(omega, interval) for term in terms], axis=0)
    flicker = Flicker(1.0)
    return (
        float(np.max(np.abs(variance / flicker.sampled_allan_variance(n, interval) - 1.0))),
        float(np.max(np.abs(density / flicker.sampled_spectrum(omega, interval) - 1.0))),
    )


@lru_cache(maxsize=16)
def _unit_bank(decades: float) -> tuple[Array, Array, float]:
    """Return correlation times, their B, and N, for B = 1 and tau from 1 s to 10^decades s."""
    first, last = 0.5, max(10.0**decades / PEAK_TAU * _BEYOND, 1.0)
    members = 1 + math.ceil(math.log10(last / first) * _MEMBERS_A_DECADE)
    times = np.geomspace(first, last, members)
    n = np.unique(np.rint(np.geomspace(1.0, 10.0**decades, 2 + int(decades * _POINTS_A_DECADE))))
    wanted = Flicker(1.0).sampled_allan_variance(n, 1.0)
    shapes = [
        GaussMarkov(1.0, time).density * sampled_gauss_markov_shape(n, 1.0, time) for time in times
    ]
    powers, _ = nnls(np.column_stack([*shapes, 1.0 / n]) / wanted[:, None], np.ones_like(n))
    return times, np.sqrt(powers[:-1]), math.sqrt(powers[-1])
