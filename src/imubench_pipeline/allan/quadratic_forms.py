"""Distribution of a sum of squares of correlated Gaussian variates, for confidence limits.

The sum over its mean is sum_i w_i x_i, where each x_i is chi-squared with one degree of freedom,
and w_i are the eigenvalues of the covariance over their sum. For equal w_i it is chi-squared.
Otherwise the chi-squared variate with the same variance, which has 1 / sum w_i^2 degrees of
freedom, has too long a lower tail. The lower tail determines the upper confidence limit.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.optimize import brentq
from scipy.special import gammaincinv, ndtr

from imubench_pipeline.typing import Array

LOWER_TAIL = 0.025
"""Probability of the quantile that defines the degrees of freedom of the lower tail."""

_MIN_DEGREES, _MAX_DEGREES = 1e-3, 1e4
"""Range of the search for the degrees of freedom of the lower tail."""

_MAX_SADDLEPOINT = 1e8
"""Largest magnitude of the saddlepoint in the search for a quantile."""


def variance_degrees(weights: Array) -> float:
    """Return the degrees of freedom of the chi-squared variate with the same relative variance."""
    return float(weights.sum() ** 2 / (weights @ weights))


def tail_degrees(weights: Array) -> float:
    """Return the degrees of freedom of the chi-squared variate with the same lower tail.

    Relative to its mean it has the same 2.5 % quantile. The weights w_i >= 0 have any common
    factor.
    """
    if len(weights) == 1:
        return 1.0
    quantile = lower_quantile(weights, LOWER_TAIL)

    def over(degrees: float) -> float:
        return float(2.0 * gammaincinv(degrees / 2.0, LOWER_TAIL) / degrees - quantile)

    return float(brentq(over, _MIN_DEGREES, _MAX_DEGREES, rtol=1e-6))


def lower_quantile(weights: Array, chance: float) -> float:
    """Return a quantile below the mean of a weighted sum of chi-squared variates over its mean.

    The relative error of the probability in the saddlepoint approximation is below a tenth, for
    probabilities below a third. The error of the quantile is below 1 % if more than three weights
    are significant. The weights w_i >= 0 have any common factor.

    References
    ----------
    R. Lugannani and S. Rice, "Saddle point approximation for the distribution of the sum of
    independent random variables", Advances in Applied Probability 12, 1980.
    """
    w = weights / weights.sum()

    def below(log_s: float) -> float:
        return _evaluate_lower_tail(w, -math.exp(log_s))[1] - chance

    log_s = float(brentq(below, math.log(1e-2), math.log(_MAX_SADDLEPOINT), rtol=1e-8))
    return _evaluate_lower_tail(w, -math.exp(log_s))[0]


def _evaluate_lower_tail(w: Array, s: float) -> tuple[float, float]:
    """Return the point with its saddlepoint at s < 0, and the probability below it."""
    gap = 1.0 - 2.0 * s * w
    share = w / gap
    x = float(share.sum())
    curvature = 2.0 * float(share @ share)
    z = -math.sqrt(max(2.0 * (s * x + 0.5 * float(np.log(gap).sum())), 1e-300))
    u = s * math.sqrt(curvature)
    density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    return x, float(ndtr(z)) + density * (1.0 / z - 1.0 / u)
