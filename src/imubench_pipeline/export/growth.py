"""How the errors of an integration grow from a moment at which all is known.

A filter that knows the states of its noise model at a moment predicts from there on, without a
measurement, the variance of the angle or velocity (the first integral of the noise) and of the
position (the second integral of an accelerometer's), t later. With h(s) the response of the noise
to its driving white noise of density S, integrated once or twice,

    Var(t) = S int_0^t h(s)^2 ds:

white noise N^2 t and N^2 t^3 / 3, and so for each term (`noise.terms.Term.growth_from_known`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_BEYOND_HORIZON = 4.0
"""Flicker noise is followed up to so many times the longest time asked for."""


@dataclass(frozen=True)
class Growth:
    """Variance of the integrals of the noise, each of shape (m,).

    Attributes
    ----------
    time : ndarray
        Since all was known, s.
    first : ndarray
        Of angle, rad^2, or velocity, (m/s)^2.
    second : ndarray
        Of the integral of that: rad^2 s^2, or position, m^2.
    """

    time: Array
    first: Array
    second: Array


def growth(model: NoiseModel, time: ArrayLike, rate: float) -> Growth:
    """Return the variances of the integrals of the noise of a model.

    They are of white noise, Gauss-Markov processes, random walk and flicker noise. What is
    deterministic (ramp, lines) and what does not grow (quantization) has no part in it.

    Parameters
    ----------
    model : NoiseModel
    time : array_like, shape (m,)
        Since all was known, s.
    rate : float
        Hz; the processes that stand for flicker noise begin at half its period.
    """
    t = np.atleast_1d(np.asarray(time, dtype=np.float64))
    first, second = np.zeros_like(t), np.zeros_like(t)
    for term in model.realised(1.0 / rate, max(_BEYOND_HORIZON * float(t.max()), 2.0 / rate)):
        of_first, of_second = term.growth_from_known(t)
        first += of_first
        second += of_second
    return Growth(t, first, second)
