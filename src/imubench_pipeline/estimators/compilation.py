"""Compile the kernels of noise estimates in advance."""

from __future__ import annotations

import numpy as np

from imubench_pipeline.estimators.posterior_kernels import (
    compute_log_posteriors,
    find_mode,
    fit_mixture,
    set_densities,
)
from imubench_pipeline.estimators.whittle_kernels import (
    Bins,
    Problem,
    ShapeTable,
    fit_powers,
    profile_cost,
)


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
