"""Confidence limits of an Allan variance: noise type, degrees of freedom, chi-squared limits.

An Allan variance over its mean is sum_i w_i x_i, where each x_i is chi-squared with one degree of
freedom, and w_i are the eigenvalues of the covariance of its differences over their sum. For equal
w_i it is chi-squared. Otherwise the chi-squared variate with the same variance, which has
1 / sum w_i^2 degrees of freedom, has too long a lower tail, which determines the upper limit.
"""

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import gammaincinv, ndtr, ndtri

from imubench_pipeline.typing import Array

_MIN_CLUSTERS = 30
_MAX_CLUSTERS = 1 << 12
_MAX_SINGLE_LAGS = 2048
_CONFIDENCE_EXPONENT = 1.4
_LOWER_TAIL = 0.025  # quantile that defines the degrees of freedom of the lower tail

_MIN_DEGREES, _MAX_DEGREES = 1e-3, 1e4
"""Range of the search for the degrees of freedom of the lower tail."""

_MAX_SADDLEPOINT = 1e8  # largest magnitude of the saddlepoint in the search for a quantile


def noise_exponent(theta: Array, present: NDArray[np.integer[Any]] | None, n: int) -> int | None:
    """Return the noise type, 2 to -2 (see `AllanCurve`), from lag-1 autocorrelation of means.

    ``theta``, shape (m + 1,): cumulative sums of the samples at the edges of m clusters of n
    samples; ``present``: cumulative counts of samples there (None: no sample is missing). Returns
    None for fewer than 30 clusters. (W. Riley and C. Greenhall, "Power law noise identification
    using the lag 1 autocorrelation", EFTF 2004.)
    """
    theta = theta[: _MAX_CLUSTERS + 1]
    if present is None:
        means = np.diff(theta) / n
    else:
        counts = np.diff(present[: _MAX_CLUSTERS + 1])
        enough = counts >= 0.9 * n
        means = np.where(enough, np.diff(theta) / np.maximum(counts, 1), np.nan)
    good = np.isfinite(means)
    if good.sum() < _MIN_CLUSTERS:
        return None
    time = np.arange(len(means), dtype=np.float64)
    time -= time[good].mean()
    level = means[good].mean()
    slope = (time[good] @ (means[good] - level)) / (time[good] @ time[good])
    # A missing mean is set to 0 after subtracting the line, and its products are not counted.
    series = np.where(good, means - level - slope * time, 0.0)
    for differenced in range(3):
        pairs, number = np.count_nonzero(good[1:] & good[:-1]), np.count_nonzero(good)
        centred = np.where(good, series - series.sum() / number, 0.0)
        power = float(centred @ centred) / number
        if pairs < _MIN_CLUSTERS - 3 or not power > 0:
            return None
        correlation = max(float(centred[1:] @ centred[:-1]) / pairs / power, -0.999)
        delta = correlation / (1.0 + correlation)
        if delta < 0.25 or differenced == 2:
            return int(np.clip(round(-2.0 * (delta + differenced)), -2, 2))
        good = good[1:] & good[:-1]
        series = np.where(good, np.diff(series), 0.0)
    raise AssertionError("the loop returns at its last turn")


@lru_cache(maxsize=4096)
def equivalent_degrees(exponent: int, n: int, terms: int) -> float:
    """Return the equivalent degrees of freedom of a fully overlapping Allan variance.

    edf = M / (1 + 2 sum_k (1 - k/M) r_k^2), where r_k is the autocorrelation at lag k of the second
    differences of noise of this ``exponent`` (`noise_exponent`) at ``n`` samples per cluster, and M
    is their number, ``terms``. (C. Greenhall and W. Riley, "Uncertainty of stability variances
    based on finite differences", PTTI 2003, which has tables instead of the long sums.)
    """
    longest = min(terms - 1, 3 * n)
    if longest < 1:
        return 1.0
    lags = np.arange(1, longest + 1, dtype=np.int64)
    if longest > _MAX_SINGLE_LAGS:
        # A grid that is refined where the correlation bends.
        near = np.unique(np.rint(np.geomspace(1, n / 2 + 1, 160)).astype(np.int64))
        offsets = np.concatenate((-near[::-1], [0], near))
        lags = np.unique(np.concatenate([centre * n + offsets for centre in range(4)]))
        lags = np.union1d(lags[(lags >= 1) & (lags <= longest)], [longest])
    at_zero = _evaluate_difference_covariance(np.zeros(1), exponent, n)[0]
    correlation = _evaluate_difference_covariance(lags.astype(np.float64), exponent, n) / at_zero
    weighted = (1.0 - lags / terms) * correlation**2
    # The sum over all lags of its linear interpolation.
    between = np.diff(lags) * (weighted[1:] + weighted[:-1]) / 2.0
    total = float(between.sum() + (weighted[0] + weighted[-1]) / 2.0)
    return float(terms / (1.0 + 2.0 * total))


def _evaluate_difference_covariance(lags: Array, exponent: int, n: int) -> Array:
    """Return the autocovariance of theta_{i+2n} - 2 theta_{i+n} + theta_i, up to a factor."""
    total = np.zeros(len(lags))
    for shift, weight in ((-2, 1.0), (-1, -4.0), (0, 6.0), (1, -4.0), (2, 1.0)):
        total += weight * _evaluate_phase_covariance(np.abs(lags + shift * n), exponent, n)
    return total


def _evaluate_phase_covariance(lags: Array, exponent: int, n: int) -> Array:
    """Return the generalised autocovariance of the phase of power-law noise, up to a factor."""
    t = lags / n
    if exponent == 2:  # white phase
        return np.asarray(lags == 0, dtype=np.float64)
    if exponent == 1:  # flicker phase, sampled: averaged over one sampling interval
        far = lags > 1000.0
        k = np.where(far, 1.0, lags)
        beside = _evaluate_square_log(k + 1) + _evaluate_square_log(np.abs(k - 1))
        near = -(beside - 2 * _evaluate_square_log(k))
        return np.where(far, -2.0 * np.log(np.where(far, lags, 1.0)) - 3.0, near)
    if exponent == 0:
        return -t
    if exponent == -1:
        return _evaluate_square_log(t)
    return np.asarray(t**3)


def _evaluate_square_log(t: Array) -> Array:
    """Return t^2 ln t, with the limit 0 at 0."""
    return np.asarray(t**2 * np.log(np.where(t > 0, t, 1.0)))


def deviation_limits(
    deviation: Array, edf: Array, confidence: float, edf_upper: Array | None = None
) -> tuple[Array, Array]:
    """Return the chi-squared limits of an Allan deviation, with equal tails; all have shape (m,).

    The lower limit has ``edf`` degrees of freedom. The upper limit at 95 % has ``edf_upper``, by
    default ``edf``: with few differences, an Allan variance far below its mean is rarer than for a
    chi-squared variate of the same variance (`match_lower_tail`). At another confidence, the upper
    limit has edf + (edf_upper - edf) (z / 1.96)^1.4, with z the normal quantile. The coverage of
    68 % limits is then exact to 0.4 % for white, flicker, random walk and Gauss-Markov noise.
    """
    tail = (1.0 - confidence) / 2.0
    below = edf
    if edf_upper is not None:
        quantiles = ndtri(tail) / ndtri(_LOWER_TAIL)
        below = edf + (edf_upper - edf) * quantiles**_CONFIDENCE_EXPONENT
    high = 2.0 * gammaincinv(edf / 2.0, 1.0 - tail)
    low = 2.0 * gammaincinv(below / 2.0, tail)
    return deviation * np.sqrt(edf / high), deviation * np.sqrt(below / low)


def match_variance(weights: Array) -> float:
    """Return the chi-squared degrees of freedom with the relative variance of sum_i w_i x_i.

    The w_i are ``weights``, shape (m,); the x_i are chi-squared with one degree of freedom.
    """
    return float(weights.sum() ** 2 / (weights @ weights))


def match_lower_tail(weights: Array) -> float:
    """Return degrees of freedom matched to the lower 2.5 % tail (see `match_variance`)."""
    if len(weights) == 1:
        return 1.0
    quantile = find_lower_quantile(weights, _LOWER_TAIL)

    def over(degrees: float) -> float:
        return float(2.0 * gammaincinv(degrees / 2.0, _LOWER_TAIL) / degrees - quantile)

    return float(brentq(over, _MIN_DEGREES, _MAX_DEGREES, rtol=1e-6))


def find_lower_quantile(weights: Array, chance: float) -> float:
    """Return a lower quantile of a weighted sum of chi-squared variates, divided by its mean.

    ``chance`` is the probability below the quantile. The saddlepoint approximation gives this
    probability within a tenth of it, if it is below a third. The error of the quantile is
    below 1 % if more than three weights are significant. A common factor of the weights w_i >= 0,
    shape (m,), has no effect. (R. Lugannani and S. Rice, "Saddle point approximation for the
    distribution of the sum of independent random variables", Adv. Appl. Probab. 12, 1980.)
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
