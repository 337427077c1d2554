"""The distribution of a sum of squares of correlated Gaussian numbers, for its limits.

Such a sum over its mean is sum_i w_i x_i with x_i chi-squared of one degree of freedom each, and
w_i the eigenvalues of the covariance over their sum. With equal w_i it is chi-squared; else a
chi-squared variate of as many degrees of freedom as give its variance, 1 / sum w_i^2, has too
long a tail at its lower end, from which an upper limit follows.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq
from scipy.special import gammaincinv, ndtr

from imubench_pipeline.typing import Array

LOWER_TAIL = 0.025
"""Chance at which the degrees of freedom of the lower tail are those of the quantile."""

_FEWEST, _MOST = 1e-3, 1e4
_STEEPEST = 1e8


def variance_degrees(weights: Array) -> float:
    """Return the degrees of freedom of the chi-squared variate with the same relative variance."""
    return float(weights.sum() ** 2 / (weights @ weights))


def tail_degrees(weights: Array) -> float:
    """Return the degrees of freedom of the chi-squared variate with the same lower tail.

    Over its mean it has the same quantile of chance 2.5 %. The weights w_i >= 0 are to a factor.
    """
    if len(weights) == 1:
        return 1.0
    quantile = lower_quantile(weights, LOWER_TAIL)

    def over(degrees: float) -> float:
        return float(2.0 * gammaincinv(degrees / 2.0, LOWER_TAIL) / degrees - quantile)

    return float(brentq(over, _FEWEST, _MOST, rtol=1e-6))


def lower_quantile(weights: Array, chance: float) -> float:
    """Return a quantile below the mean of a weighted sum of chi-squared variates over its mean.

    The saddlepoint approximation is within a tenth of the chance, which is below a third; the
    quantile within 1 % where more than three weights count. The weights w_i >= 0 are to a factor.

    References
    ----------
    R. Lugannani and S. Rice, "Saddle point approximation for the distribution of the sum of
    independent random variables", Advances in Applied Probability 12, 1980.
    """
    w = weights / weights.sum()

    def below(log_s: float) -> float:
        return _lower_tail(w, -math.exp(log_s))[1] - chance

    log_s = float(brentq(below, math.log(1e-2), math.log(_STEEPEST), rtol=1e-8))
    return _lower_tail(w, -math.exp(log_s))[0]


def _lower_tail(w: Array, s: float) -> tuple[float, float]:
    """Return the point whose saddle is at s < 0, and the chance below it."""
    gap = 1.0 - 2.0 * s * w
    share = w / gap
    x = float(share.sum())
    curvature = 2.0 * float(share @ share)
    z = -math.sqrt(max(2.0 * (s * x + 0.5 * float(np.log(gap).sum())), 1e-300))
    u = s * math.sqrt(curvature)
    density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    return x, float(ndtr(z)) + density * (1.0 / z - 1.0 / u)
