"""How the errors of an integration grow from a moment at which all is known.

A filter that knows the states of its noise model at a moment predicts from there on, without a
measurement, the variance of the angle or velocity (the first integral of the noise) and of the
position (the second integral of an accelerometer's), t later. With h(s) the response of the noise
to its driving white noise of density S, integrated once or twice,

    Var(t) = S int_0^t h(s)^2 ds:

white noise N^2 t and N^2 t^3 / 3, a random walk K^2 t^3 / 3 and K^2 t^5 / 20, a Gauss-Markov
process h = T_B (1 - e^(-s/T_B)) and h = T_B s - T_B^2 (1 - e^(-s/T_B)).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.noise import GaussMarkov, NoiseModel, RandomWalk, Term, WhiteNoise
from imubench_pipeline.typing import Array

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)

_PIECES = (0.0, 0.003, 0.03, 0.2, 1.0)
"""Ends of the pieces of the integral: the response of a short process bends early."""

_BEYOND_HORIZON = 4.0
"""Flicker noise is followed up to so many times the longest time asked for."""


@dataclass(frozen=True)
class Growth:
    """Variance of the integrals of the noise.

    Attributes
    ----------
    time : ndarray, shape (m,)
        Since all was known, s.
    first : ndarray, shape (m,)
        Of angle, rad^2, or velocity, (m/s)^2.
    second : ndarray, shape (m,)
        Of the integral of that: rad^2 s^2, or position, m^2.
    """

    time: Array
    first: Array
    second: Array


def growth(model: NoiseModel, time: ArrayLike, rate: float) -> Growth:
    """Return the variances of the integrals of the noise of a model.

    Parameters
    ----------
    model : NoiseModel
    time : array_like, shape (m,)
        Since all was known, s.
    rate : float
        Hz; the processes that stand for flicker noise begin at half its period.

    Returns
    -------
    Growth
        Of white noise, Gauss-Markov processes, random walk and flicker noise. What is
        deterministic (ramp, lines) and what does not grow (quantization) has no part in it.
    """
    t = np.atleast_1d(np.asarray(time, dtype=np.float64))
    first, second = np.zeros_like(t), np.zeros_like(t)
    for term in model.realised(1.0 / rate, max(_BEYOND_HORIZON * float(t.max()), 2.0 / rate)):
        part = growth_of(term, t)
        first += part.first
        second += part.second
    return Growth(t, first, second)


def growth_of(term: Term, time: Array) -> Growth:
    """Return the variances of the integrals of one term at times in s, shape (k,).

    They are 0 for terms that do not grow so.
    """
    if isinstance(term, WhiteNoise):
        return Growth(time, term.N**2 * time, term.N**2 * time**3 / 3.0)
    if isinstance(term, RandomWalk):
        return Growth(time, term.K**2 * time**3 / 3.0, term.K**2 * time**5 / 20.0)
    if isinstance(term, GaussMarkov):
        T_B = term.T_B
        first = _squared(lambda s: -T_B * np.expm1(-s / T_B), time)
        second = _squared(lambda s: T_B**2 * _second_response(s / T_B), time)
        return Growth(time, term.density * first, term.density * second)
    return Growth(time, np.zeros_like(time), np.zeros_like(time))


def _second_response(x: Array) -> Array:
    """Return x - 1 + e^(-x), which cancels for small x."""
    series = x**2 / 2.0 * (1.0 - x / 3.0 * (1.0 - x / 4.0 * (1.0 - x / 5.0 * (1.0 - x / 6.0))))
    return np.where(x < 1e-2, series, x + np.expm1(-x))


def _squared(response: Callable[[Array], Array], time: Array) -> Array:
    """Integrate the square of a response from 0 to each time."""
    total = np.zeros_like(time)
    for start, stop in pairwise(_PIECES):
        half = (stop - start) / 2.0
        at = time[:, None] * (start + half * (1.0 + _NODES))
        total += time * half * (response(at) ** 2 @ _WEIGHTS)
    return total
