"""Flicker noise as a bank of Gauss-Markov processes, for simulation and for filters."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from scipy.optimize import nnls

from imubench_pipeline.noise_terms import (
    FLOOR,
    PEAK_TAU,
    Array,
    Flicker,
    GaussMarkov,
    gauss_markov_shape,
)

_MEMBERS_A_DECADE = 2.5
_POINTS_A_DECADE = 20
_BEYOND = 4.0
"""How far the correlation times of the bank go beyond those that peak at the ends of its band."""


def bank(B: float, shortest: float, longest: float) -> list[GaussMarkov]:
    """Return Gauss-Markov processes whose sum has the Allan variance of flicker noise in a band.

    Their correlation times are spaced evenly on a log scale, five in two decades, and their
    variances are fitted by non-negative least squares.

    Parameters
    ----------
    B : float
        Bias instability, rad/s or m/s²; the plateau is 0.664 B.
    shortest, longest : float
        Tau at the ends of the band, s.

    Returns
    -------
    list of GaussMarkov

    Raises
    ------
    ValueError
        If the band is empty.
    """
    if not 0 < shortest < longest:
        raise ValueError(f"the band from {shortest} to {longest} s is empty")
    times, levels = _unit_bank(round(math.log10(longest / shortest), 6))
    return [
        GaussMarkov(B * level, shortest * time)
        for time, level in zip(times, levels, strict=True)
        if level > 0
    ]


def ripple(shortest: float, longest: float) -> tuple[float, float]:
    """Return the largest relative errors of a bank inside its band.

    Returns
    -------
    (float, float)
        Of the Allan variance at tau from ``shortest`` to ``longest``, and of the power spectral
        density at frequencies from 1 / (2 longest) to 1 / (2 shortest), both against flicker
        noise.
    """
    terms = bank(1.0, shortest, longest)
    points = math.ceil(math.log10(longest / shortest) * _POINTS_A_DECADE * 2)
    tau = np.geomspace(shortest, longest, points)
    frequency = 0.5 / tau
    variance = np.sum([term.allan_variance(tau) for term in terms], axis=0)
    density = np.sum([term.psd(frequency) for term in terms], axis=0)
    return (
        float(np.max(np.abs(variance / FLOOR**2 - 1.0))),
        float(np.max(np.abs(density / Flicker(1.0).psd(frequency) - 1.0))),
    )


@lru_cache(maxsize=16)
def _unit_bank(decades: float) -> tuple[Array, Array]:
    """Return correlation times and B of a bank for B = 1 from tau = 1 s to 10^decades s."""
    first, last = 1.0 / PEAK_TAU / _BEYOND, 10.0**decades / PEAK_TAU * _BEYOND
    members = 1 + math.ceil(math.log10(last / first) * _MEMBERS_A_DECADE)
    times = np.geomspace(first, last, members)
    tau = np.geomspace(1.0, 10.0**decades, 1 + math.ceil(decades * _POINTS_A_DECADE))
    shapes = [GaussMarkov(1.0, time).density * gauss_markov_shape(tau, time) for time in times]
    powers, _ = nnls(np.column_stack(shapes) / FLOOR**2, np.ones_like(tau))
    return times, np.sqrt(powers)
