"""The compiled inner loops of the posterior, and of importance sampling from it.

A point is (log amplitude of each term ..., log T_B of each process ...). The posterior is flat in
the amplitudes and in R, over which it is integrated, and flat in log T_B within the table of
shapes.
"""

import math

import numpy as np
from numba import njit

from imubench_pipeline.estimators.whittle_kernels import (
    Bins,
    Problem,
    ShapeTable,
    compute_cost,
    fit_powers,
    fit_ramp,
    interpolate_shape,
    profile_cost,
)
from imubench_pipeline.typing import Array

_MOST_STEPS = 40
_TOLERANCE = 1e-3
_LONGEST_STEP = 1.5


@njit(cache=True)
def compute_log_posterior(
    point: Array, problem: Problem, model: Array, shape: Array
) -> tuple[float, float, float]:
    """Return log posterior, best R and its Fisher information at a point; overwrite ``model``."""
    fixed, bins, with_ramp, table = problem
    b, linear = fixed.shape
    processes = (point.size - linear) // 2
    last = table.first + table.step * (table.logarithms.shape[0] - 1)
    for j in range(linear):
        power = math.exp(2.0 * point[j])
        for i in range(b):
            model[i] = power * fixed[i, j] + (model[i] if j else 0.0)
    for g in range(processes):
        where = point[linear + processes + g]
        if where < table.first or where > last:
            return -np.inf, 0.0, 0.0
        interpolate_shape(where, table, shape)
        power = math.exp(2.0 * point[linear + g])
        for i in range(b):
            model[i] += power * shape[i]
    value = -compute_cost(bins.nu, bins.density, model)
    for j in range(linear + processes):
        value += point[j]  # flat in the amplitude a is e^x in x = log a
    if not with_ramp:
        return value, 0.0, 0.0
    best, information = fit_ramp(bins, model)
    if information > 0.0:
        value += 0.5 * (best * best * information - math.log(information))
    return value, best, information


@njit(cache=True)
def compute_log_posteriors(points: Array, problem: Problem) -> tuple[Array, Array, Array]:
    """Return `compute_log_posterior` at points, each of shape (n,)."""
    n = points.shape[0]
    values, best, information = np.empty(n), np.empty(n), np.empty(n)
    model, shape = np.empty(problem.bins.nu.size), np.empty(problem.bins.nu.size)
    for k in range(n):
        values[k], best[k], information[k] = compute_log_posterior(points[k], problem, model, shape)
    return values, best, information


def find_mode(start: Array, times: Array, problem: Problem) -> tuple[Array, Array, Array]:
    """Return the mode of the log amplitudes for given log T_B, the curvature and D there.

    ``start``: log amplitudes; D_j, shape (b, p), is the density of a term over the density of
    the model, times 2. The curvature of the posterior is sum nu D_j D_k / 2, and 2 from a flat
    amplitude, which bounds an absent term away from 0. Raises LinAlgError if the curvature is not
    finite, or has no inverse.
    """
    fixed, bins, with_ramp, table = problem
    b, linear = fixed.shape
    p = linear + len(times)
    columns, shape = np.empty((b, p)), np.empty(b)
    columns[:, :linear] = fixed
    for g, time in enumerate(times):
        interpolate_shape(time, table, shape)
        columns[:, linear + g] = shape
    x, best, step = start.copy(), -math.inf, np.zeros(p)
    gradient, curvature, parts = np.empty(p), np.eye(p), np.empty((b, p))
    for _ in range(_MOST_STEPS):
        value = _climb(x, best, step, columns, bins, with_ramp, gradient, curvature, parts)
        if math.isnan(value):
            break
        gained, best = value - best, value
        if gained < _TOLERANCE:
            break
        step = np.linalg.solve(curvature, gradient)
        longest = np.abs(step).max()
        if not math.isfinite(longest):
            raise np.linalg.LinAlgError("the curvature of the posterior is not finite")
        if longest > _LONGEST_STEP:
            step *= _LONGEST_STEP / longest
    return x, curvature, parts


@njit(cache=True)
def _climb(
    x: Array,
    best: float,
    step: Array,
    columns: Array,
    bins: Bins,
    with_ramp: bool,
    gradient: Array,
    curvature: Array,
    parts: Array,
) -> float:
    """Take a step, or a part of it, to no lower a log posterior; return it, or NaN if none."""
    nu, density, cross, ramp = bins
    b, p = columns.shape
    proposal, powers = np.empty(p), np.empty(p)
    model, data = np.empty(b), np.empty(b)
    value, size = np.nan, 1.0
    moved = False
    for _ in range(8):
        total = 0.0
        for j in range(p):
            proposal[j] = x[j] + size * step[j]
            powers[j] = math.exp(2.0 * proposal[j])
            total += proposal[j]
        for i in range(b):
            density_i = 0.0
            for j in range(p):
                density_i += powers[j] * columns[i, j]
            model[i] = density_i
        R = fit_ramp(bins, model)[0] if with_ramp else 0.0
        for i in range(b):
            data[i] = density[i]
            if with_ramp:
                data[i] = max(density[i] - 2.0 * R * cross[i] + R * R * ramp[i], 0.0)
        value = total - compute_cost(nu, data, model)
        if value >= best:
            moved = True
            break
        size *= 0.5
    if not moved:
        return np.nan
    for j in range(p):
        x[j] = proposal[j]
    gradient[:] = 1.0
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
        curvature[j, j] += 2.0
    return value


@njit(cache=True)
def _square(point: Array, mean: Array, inverse: Array) -> float:
    total = 0.0
    for a in range(point.size):
        z = 0.0
        for e in range(a + 1):
            z += inverse[a, e] * (point[e] - mean[e])
        total += z * z
    return total


@njit(cache=True)
def set_densities(
    points: Array, weights: Array, means: Array, inverses: Array, freedom: int, densities: Array
) -> None:
    """Set ``densities``, (n, c), to weight times density of each component at each point."""
    n, d = points.shape
    for k in range(weights.size):
        factor = weights[k]
        for a in range(d):
            factor *= inverses[k, a, a]
        for i in range(n):
            base = 1.0 / (1.0 + _square(points[i], means[k], inverses[k]) / freedom)
            value = factor
            for _ in range((freedom + d) // 2):
                value *= base
            densities[i, k] = value


@njit(cache=True)
def fit_mixture(
    points: Array,
    parts: Array,
    means: Array,
    inverses: Array,
    freedom: int,
    least: float,
    new_weights: Array,
    new_means: Array,
    new_scales: Array,
) -> int:
    """Fit a mixture to points by expectation maximisation; return the number of components.

    One step. ``parts``: weight times density of each old component at each point, (n, c);
    overwritten. Components with a mass up to ``least``, or with too few effective points, are
    dropped; the others fill the start of the ``new_`` arrays. ``new_scales`` must be 0 at first.
    """
    n, d = points.shape
    near = np.empty(n)
    for i in range(n):
        total = 0.0
        for k in range(new_weights.size):
            total += parts[i, k]
        for k in range(new_weights.size):
            parts[i, k] /= n * max(total, 1e-300)
    count = 0
    for k in range(new_weights.size):
        mass, squares = 0.0, 0.0
        for i in range(n):
            mass += parts[i, k]
            squares += parts[i, k] ** 2
        if mass <= least or mass**2 <= (2 * d + 2) * squares:
            continue
        mean, scale = new_means[count], new_scales[count]
        near_total = 0.0
        for i in range(n):
            square = _square(points[i], means[k], inverses[k])
            near[i] = parts[i, k] * (freedom + d) / (freedom + square)
            near_total += near[i]
        for a in range(d):
            total = 0.0
            for i in range(n):
                total += near[i] * points[i, a]
            mean[a] = total / near_total
        for i in range(n):
            for a in range(d):
                for e in range(a + 1):
                    scale[a, e] += near[i] * (points[i, a] - mean[a]) * (points[i, e] - mean[e])
        for a in range(d):
            for e in range(a + 1):
                scale[a, e] /= mass
                scale[e, a] = scale[a, e]
        for a in range(d):
            # The covariance of few points is too narrow in some direction.
            scale[a, a] = scale[a, a] * (1.0 + d * squares / mass**2) + 1e-14
        new_weights[count] = mass
        count += 1
    return count


def compile_kernels() -> None:
    """Compile the kernels, or load them from numba's cache.

    Only numba is imported, so that a separate process can begin during the other imports. The calls
    have the types of an estimate (see `tests/estimators/test_compilation`).
    """
    bins = Bins(*np.ones((4, 8)))
    problem = Problem(np.ones((8, 1)), bins, False, ShapeTable(0.0, 1.0, np.zeros((2, 8))))
    place = np.zeros(1)
    profile_cost(place, problem, 1.0)
    fit_powers(problem.fixed, bins, False, 1.0)
    find_mode(np.zeros(2), place, problem)
    compute_log_posteriors(np.zeros((1, 3)), problem)
    weights, means, scales = np.ones(1), np.zeros((1, 1)), np.ones((1, 1, 1))
    points, densities = np.arange(3.0)[:, None], np.empty((3, 1))
    set_densities(points, weights, means, scales, 5, densities)
    fit_mixture(points, densities, means, scales, 5, 0.0, weights, means.copy(), scales.copy())
