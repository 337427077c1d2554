"""Adaptive Metropolis: a chain of draws from a posterior, where importance sampling fails."""

from __future__ import annotations

import numpy as np
from numba import njit

from imubench_pipeline.estimators.posterior_kernels import log_posterior
from imubench_pipeline.estimators.whittle_kernels import Bins, ShapeTable
from imubench_pipeline.typing import Array

_BURN_IN = 4_000
_ADAPT_EVERY = 250


def chain(
    start: Array,
    covariance: Array,
    rng: np.random.Generator,
    draws: int,
    fixed: Array,
    bins: Bins,
    processes: int,
    with_ramp: bool,
    table: ShapeTable,
) -> tuple[Array, float]:
    """Return draws of a point, shape (draws, d), and the share of proposals that were taken.

    Parameters
    ----------
    start : ndarray, shape (d,)
    covariance : ndarray, shape (d, d)
        Of the first proposals.
    rng : numpy.random.Generator
    draws : int
        Draws to keep, after those in which the chain learns.
    fixed, bins, processes, with_ramp, table
        As in `imubench_pipeline.estimators.posterior_kernels`.

    References
    ----------
    H. Haario, E. Saksman and J. Tamminen, "An adaptive Metropolis algorithm", Bernoulli 7, 2001.
    """
    number = _BURN_IN + draws
    return _metropolis(
        start,
        np.linalg.cholesky(covariance) * 2.4 / np.sqrt(len(start)),
        rng.standard_normal((number, len(start))),
        np.log(rng.random(number)),
        fixed,
        bins,
        processes,
        with_ramp,
        table,
    )


@njit(cache=True)
def _metropolis(
    start: Array,
    root: Array,
    normals: Array,
    log_uniforms: Array,
    fixed: Array,
    bins: Bins,
    processes: int,
    with_ramp: bool,
    table: ShapeTable,
) -> tuple[Array, float]:
    n, d = normals.shape
    model, shape = np.empty(fixed.shape[0]), np.empty(fixed.shape[0])
    arguments = (fixed, bins, processes, with_ramp, table, model, shape)
    x = start.copy()
    current = log_posterior(x, *arguments)[0]
    mean, covariance = x.copy(), root @ root.T * d / 5.76
    draws = np.empty((n - _BURN_IN, d))
    accepted, recent = 0, 0
    scale = 1.0
    for k in range(n):
        proposal = x + scale * (root @ normals[k])
        proposed = log_posterior(proposal, *arguments)[0]
        if log_uniforms[k] < proposed - current:
            x, current = proposal, proposed
            recent += 1
            if k >= _BURN_IN:
                accepted += 1
        if k >= _BURN_IN:
            draws[k - _BURN_IN] = x
            continue
        # Learn the covariance, and the scale, while burning in only.
        gain = 1.0 / (k / 2.0 + 50.0)
        change = x - mean
        mean = mean + gain * change
        for a in range(d):
            for c in range(d):
                covariance[a, c] += gain * (change[a] * change[c] - covariance[a, c])
        if k % _ADAPT_EVERY == _ADAPT_EVERY - 1:
            rate = recent / _ADAPT_EVERY
            scale *= min(2.0, max(0.5, np.exp(2.0 * (rate - 0.27))))
            recent = 0
            stable = covariance.copy()
            for a in range(d):
                stable[a, a] = stable[a, a] * (1.0 + 1e-6) + 1e-14
            root = np.linalg.cholesky(stable) * 2.4 / np.sqrt(d)
    return draws, accepted / (n - _BURN_IN)
