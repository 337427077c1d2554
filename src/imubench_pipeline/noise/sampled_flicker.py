"""Sampled flicker noise: integrals that have no closed form, as sums."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.typing import Array

_TABLE = 1 << 12
"""Cluster sizes up to which the Allan variance of sampled flicker is summed up exactly."""


def sampled_flicker_shape(n: ArrayLike) -> Array:
    """Return n^-2 times the integral of sin^4(n x) / sin^3(x) from 0 to pi/2; ln 2 for large n."""
    sizes = np.asarray(n, dtype=np.float64)
    table = _flicker_integrals()
    # 1/sin^3(x) = 1/x^3 + 1/(2x) + ...: the second term adds (3/16) ln n and a constant.
    beyond = table[-1] - math.log(2.0) * _TABLE**2 - 3.0 / 16.0 * math.log(_TABLE)
    index = np.clip(np.rint(sizes), 1, _TABLE).astype(np.int64)
    large = math.log(2.0) + (3.0 / 16.0 * np.log(sizes) + beyond) / sizes**2
    return np.where(sizes <= _TABLE, table[index - 1] / index**2, large)


def sampled_flicker_sums(lags: Array) -> Array:
    """Return the covariance of cumulative sums at whole lags from 0, up to a square of the lag.

    Minus half the integral of (1 - cos(2 k x)) / sin^3(x) from 0 to pi/2, which for long lags is
    k^2 ln(k), as in continuous time. All lags of a call are taken alike.
    """
    if lags.max() <= 2 * _TABLE:
        return -0.5 * _flicker_sums()[np.rint(lags).astype(np.int64)]
    return np.asarray(lags**2 * np.log(np.maximum(lags, 1.0)))


@lru_cache(maxsize=1)
def _flicker_integrals() -> Array:
    """Return the integral of sin^4(n x) / sin^3(x) from 0 to pi/2 for n = 1 to `_TABLE`.

    sin^4(n x) = (3 - 4 cos(2 n x) + cos(4 n x)) / 8.
    """
    integral = _flicker_sums()
    sizes = np.arange(1, _TABLE + 1)
    return np.asarray((4.0 * integral[sizes] - integral[2 * sizes]) / 8.0)


@lru_cache(maxsize=1)
def _flicker_sums() -> Array:
    """Return the integral of (1 - cos(2 m x)) / sin^3(x) from 0 to pi/2, m to 2 `_TABLE`.

    Its second difference over m is a constant, which drops out of the second differences of
    sums, less 8 (1 + 1/3 + ... + 1/(2m - 1)).
    """
    m = np.arange(1, 2 * _TABLE)
    steps = np.cumsum(np.concatenate(([0.0], -8.0 * np.cumsum(1.0 / (2.0 * m - 1.0)))))
    return np.concatenate(([0.0, 0.0], np.cumsum(steps)[1:]))  # of m = 0, 1, 2 ...
