"""The compiled inner loops of importance sampling; ``inverses`` are of roots of the scales."""

from __future__ import annotations

import numpy as np
from numba import njit

from imubench_pipeline.typing import Array


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
    """Set weight times density of each component of a mixture, up to a constant, shape (n, c)."""
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
def fit(
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
    """Set the components that are kept, from the densities at points; return their number."""
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
