"""Growth of the variance of integrated noise, from known initial states.

With h(s) the impulse response from the driving white noise of density S to the noise, integrated
once (angle or velocity) or twice (position), Var(t) = S int_0^t h(s)^2 ds. For white noise this is
N^2 t and N^2 t^3 / 3; for other terms see `noise.terms.base.Term.growth_from_known`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_FLICKER_TAU_RATIO = 4.0
"""Longest tau of the approximation of flicker noise, over the longest time of the growth."""


@dataclass(frozen=True)
class Growth:
    """Variance of the integrals of the noise, each of shape (m,)."""

    time: Array  # since the states were known, s
    first: Array  # of angle, rad^2, or velocity, (m/s)^2
    second: Array  # of the integral of angle, rad^2 s^2, or of velocity (position), m^2


def growth(model: NoiseModel, time: ArrayLike, rate: float) -> Growth:
    """Return the variances of the integrals of the noise of a model at times, shape (m,), s.

    The states were known at time 0. White noise, Gauss-Markov processes, random walk and flicker
    noise contribute; the processes that approximate flicker noise begin at half the period of the
    rate, Hz. Deterministic terms (ramp, lines) and quantization noise, which does not grow, do not
    contribute.
    """
    t = np.atleast_1d(np.asarray(time, dtype=np.float64))
    first, second = np.zeros_like(t), np.zeros_like(t)
    for term in model.realised(1.0 / rate, max(_FLICKER_TAU_RATIO * float(t.max()), 2.0 / rate)):
        of_first, of_second = term.growth_from_known(t)
        first += of_first
        second += of_second
    return Growth(t, first, second)
