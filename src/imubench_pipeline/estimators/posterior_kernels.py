"""The compiled inner loops of the posterior: its logarithm, its modes for given T_B, and a chain.

A point is (log amplitude of each term ..., log T_B of each process ...). The posterior is flat in
the amplitudes and in R, over which it is integrated, and flat in log T_B within the table of
shapes. The chain is an adaptive Metropolis one, for where importance sampling fails.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from imubench_pipeline.estimators.whittle_kernels import Bins, Problem, cost_of, shape_at
from imubench_pipeline.typing import Array

_MOST_STEPS = 40
_TOLERANCE = 1e-3
_LONGEST_STEP = 1.5

_BURN_IN = 4_000
_ADAPT_EVERY = 250


@njit(cache=True)
def _model_at(point: Array, problem: Problem, model: Array, shape: Array) -> bool:
    """Set the density of a point; return whether its correlation times lie in the table."""
    fixed, table = problem.fixed, problem.table
    bins, linear = fixed.shape
    processes = (point.size - linear) // 2
    last = table.first + table.step * (table.logarithms.shape[0] - 1)
    for j in range(linear):
        power = math.exp(2.0 * point[j])
        for i in range(bins):
            model[i] = power * fixed[i, j] + (model[i] if j else 0.0)
    for g in range(processes):
        where = point[linear + processes + g]
        if where < table.first or where > last:
            return False
        shape_at(where, table, shape)
        power = math.exp(2.0 * point[linear + g])
        for i in range(bins):
            model[i] += power * shape[i]
    return True


@njit(cache=True)
def _ramp_at(bins: Bins, model: Array) -> tuple[float, float]:
    """Return the best R given the noise, and its information."""
    nu, _, cross, ramp = bins
    above, below = 0.0, 0.0
    for i in range(nu.size):
        above += nu[i] * cross[i] / model[i]
        below += nu[i] * ramp[i] / model[i]
    return (above / below, below) if below > 0.0 else (0.0, 0.0)


@njit(cache=True)
def log_posterior(
    point: Array, problem: Problem, model: Array, shape: Array
) -> tuple[float, float, float]:
    """Return the logarithm of the posterior at a point, the best R there and its information.

    ``model`` and ``shape`` are working memory, shape (b,).
    """
    if not _model_at(point, problem, model, shape):
        return -np.inf, 0.0, 0.0
    bins, linear = problem.bins, problem.fixed.shape[1]
    value = -cost_of(bins.nu, bins.density, model)
    for j in range((point.size + linear) // 2):
        value += point[j]  # flat in the amplitude a is e^x in x = log a
    if not problem.with_ramp:
        return value, 0.0, 0.0
    best, information = _ramp_at(bins, model)
    if information > 0.0:
        value += 0.5 * (best * best * information - math.log(information))
    return value, best, information


@njit(cache=True)
def log_posteriors(points: Array, problem: Problem) -> tuple[Array, Array, Array]:
    """Return those of points, each of shape (n,)."""
    n = points.shape[0]
    values, best, information = np.empty(n), np.empty(n), np.empty(n)
    model, shape = np.empty(problem.bins.nu.size), np.empty(problem.bins.nu.size)
    for k in range(n):
        values[k], best[k], information[k] = log_posterior(points[k], problem, model, shape)
    return values, best, information


@njit(cache=True)
def mode_at(start: Array, times: Array, problem: Problem) -> tuple[Array, Array, Array]:
    """Return the mode of the log amplitudes for given log T_B, the curvature and D there.

    ``start`` holds log amplitudes; D_j, shape (b, p), is the density of a term over that of the
    model, times 2. The curvature of the posterior is sum nu D_j D_k / 2, and 2 from a flat
    amplitude: it keeps a term that is absent from running off to 0.
    """
    fixed, bins, with_ramp, table = problem
    nu, density, cross, ramp = bins
    b, linear = fixed.shape
    p = linear + times.size
    columns = np.empty((b, p))
    shape = np.empty(b)
    for i in range(b):
        for j in range(linear):
            columns[i, j] = fixed[i, j]
    for g in range(times.size):
        shape_at(times[g], table, shape)
        for i in range(b):
            columns[i, linear + g] = shape[i]
    x = start.copy()
    model, data, parts = np.empty(b), density.copy(), np.empty((b, p))
    best = -np.inf
    curvature = np.eye(p)
    step = np.zeros(p)
    for _ in range(_MOST_STEPS):
        size = 1.0
        moved = False
        for _ in range(8):
            proposal = x + size * step
            powers = np.exp(2.0 * proposal)
            for i in range(b):
                total = 0.0
                for j in range(p):
                    total += powers[j] * columns[i, j]
                model[i] = total
            if with_ramp:
                R, _ = _ramp_at(bins, model)
                for i in range(b):
                    data[i] = max(density[i] - 2.0 * R * cross[i] + R * R * ramp[i], 0.0)
            value = proposal.sum() - cost_of(nu, data, model)
            if value >= best:
                moved = True
                break
            size *= 0.5
        if not moved:
            break
        gained = value - best
        x, best = proposal, value
        gradient = np.ones(p)
        curvature[:] = 0.0
        for i in range(b):
            excess = 0.5 * nu[i] * (1.0 - data[i] / model[i])
            for j in range(p):
                parts[i, j] = 2.0 * powers[j] * columns[i, j] / model[i]
                gradient[j] -= excess * parts[i, j]
                for k in range(j + 1):
                    curvature[j, k] += 0.5 * nu[i] * parts[i, j] * parts[i, k]
        for j in range(p):
            for k in range(j):
                curvature[k, j] = curvature[j, k]
        for j in range(p):
            curvature[j, j] += 2.0
        if gained < _TOLERANCE:
            break
        step = np.linalg.solve(curvature, gradient)
        longest = np.max(np.abs(step))
        if longest > _LONGEST_STEP:
            step *= _LONGEST_STEP / longest
    return x, curvature, parts


def chain(
    start: Array, covariance: Array, rng: np.random.Generator, draws: int, problem: Problem
) -> Array:
    """Return draws of a point, shape (draws, d).

    ``covariance``, shape (d, d), is that of the first proposals; the draws in which the chain
    learns are not kept.

    References
    ----------
    H. Haario, E. Saksman and J. Tamminen, "An adaptive Metropolis algorithm", Bernoulli 7, 2001.
    """
    number = _BURN_IN + draws
    root = np.linalg.cholesky(covariance) * 2.4 / np.sqrt(len(start))
    normals = rng.standard_normal((number, len(start)))
    return _metropolis(start, root, normals, np.log(rng.random(number)), problem)


@njit(cache=True)
def _metropolis(
    start: Array, root: Array, normals: Array, log_uniforms: Array, problem: Problem
) -> Array:
    n, d = normals.shape
    model, shape = np.empty(problem.bins.nu.size), np.empty(problem.bins.nu.size)
    x = start.copy()
    current = log_posterior(x, problem, model, shape)[0]
    mean, covariance = x.copy(), root @ root.T * d / 5.76
    draws = np.empty((n - _BURN_IN, d))
    recent, scale = 0, 1.0
    for k in range(n):
        proposal = x + scale * (root @ normals[k])
        proposed = log_posterior(proposal, problem, model, shape)[0]
        if log_uniforms[k] < proposed - current:
            x, current = proposal, proposed
            recent += 1
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
    return draws
