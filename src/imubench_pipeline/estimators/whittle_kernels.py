"""The compiled inner loops of the Whittle likelihood; data and densities are scaled to about 1.

The loops are over scalars: numba takes longer to compile NumPy functions (`max`, `flatnonzero`,
`@`, assignments of slices) than the kernel.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.typing import Array

TOLERANCE = 1e-7  # Of the cost
_MOST_STEPS = 60
_NEAR = 0.1  # Gain of the cost by a step from which the next ones are Newton's


class Bins(NamedTuple):
    """The bins of a spectrum, each of shape (b,): nu, mean density, and the ramp's products."""

    nu: Array
    density: Array
    cross: Array
    ramp: Array


class ShapeTable(NamedTuple):
    """Logarithms of densities, shape (t, b), of processes at log T_B = ``first`` + i ``step``."""

    first: float
    step: float
    logarithms: Array


class Problem(NamedTuple):
    """Terms to fit to bins: densities of linear terms, shape (b, p), a ramp, processes."""

    fixed: Array
    bins: Bins
    with_ramp: bool
    table: ShapeTable


@njit(cache=True)
def interpolate_shape(where: float, table: ShapeTable, shape: Array) -> None:
    """Set ``shape`` at log T_B = ``where``; its logarithm is interpolated linearly."""
    logarithms = table.logarithms
    place = min(max((where - table.first) / table.step, 0.0), logarithms.shape[0] - 1.000001)
    i = int(place)
    part = place - i
    for j in range(shape.size):
        shape[j] = np.exp(logarithms[i, j] + part * (logarithms[i + 1, j] - logarithms[i, j]))


@njit(cache=True)
def compute_cost(nu: Array, data: Array, density: Array) -> float:
    """Return 1/2 sum nu (log S + I / S) of data I, density S; infinite if an S is not above 0."""
    total = 0.0
    for i in range(nu.size):
        if not density[i] > 0.0:
            return np.inf
        total += nu[i] * (np.log(density[i]) + data[i] / density[i])
    return 0.5 * total


@njit(cache=True)
def fit_ramp(bins: Bins, model: Array) -> tuple[float, float]:
    """Return the best R given the density of the noise, shape (b,), and its information."""
    nu, _, cross, ramp = bins
    above, below = 0.0, 0.0
    for i in range(nu.size):
        above += nu[i] * cross[i] / model[i]
        below += nu[i] * ramp[i] / model[i]
    return (above / below, below) if below > 0.0 else (0.0, 0.0)


@njit(cache=True)
def _solved(gram: Array, target: Array, free: NDArray[np.bool_]) -> Array:
    """Return x with gram x = target over the free variables, 0 elsewhere (Cholesky)."""
    p = target.size
    chosen = np.empty(p, dtype=np.int64)
    m = 0
    for j in range(p):
        if free[j]:
            chosen[m] = j
            m += 1
    root = np.empty((p, p))
    y = np.empty(p)
    for a in range(m):
        for b in range(a + 1):
            total = gram[chosen[a], chosen[b]]
            if a == b:
                least = 1e-14 * total
                total *= 1.0 + 1e-12
            for c in range(b):
                total -= root[a, c] * root[b, c]
            if a == b:
                # Terms that look alike must not divide by nothing.
                root[a, a] = np.sqrt(max(total, least, 1e-300))
            else:
                root[a, b] = total / root[b, b]
        total = target[chosen[a]]
        for c in range(a):
            total -= root[a, c] * y[c]
        y[a] = total / root[a, a]
    x = np.empty(p)
    x[:] = 0.0
    for a in range(m - 1, -1, -1):
        total = y[a]
        for c in range(a + 1, m):
            total -= root[c, a] * x[chosen[c]]
        x[chosen[a]] = total / root[a, a]
    return x


@njit(cache=True)
def _non_negative(gram: Array, target: Array, guess: Array) -> Array:
    """Minimise x' gram x / 2 - target' x over x >= 0 (active sets of Lawson and Hanson)."""
    p = target.size
    free = np.empty(p, dtype=np.bool_)
    made = np.empty(p)  # gram x
    largest = 0.0
    number = 0
    for j in range(p):
        free[j] = guess[j] > 0.0
        number += free[j]
        if abs(target[j]) > largest or np.isnan(target[j]):
            largest = abs(target[j])
    small = 1e-12 * largest
    if number > 0:
        x = _solved(gram, target, free)
        np.dot(gram, x, made)
        right = True
        for j in range(p):
            right &= x[j] > 0.0 if free[j] else target[j] - made[j] <= small
        if right:
            return x
    x = np.empty(p)
    x[:] = 0.0
    free[:] = False
    number = 0
    for _ in range(10 * p):
        np.dot(gram, x, made)
        best, steepest = -1, small
        for j in range(p):
            if not free[j] and target[j] - made[j] > steepest:
                best, steepest = j, target[j] - made[j]
        if best < 0:
            return x
        free[best] = True
        number += 1
        while True:
            solution = _solved(gram, target, free)
            step, blocking = 1.0, -1
            for j in range(p):
                if free[j] and solution[j] <= 0.0:
                    reach = x[j] / (x[j] - solution[j]) if x[j] > 0.0 else 0.0
                    if reach < step or blocking < 0:
                        step, blocking = min(step, reach), j
            for j in range(p):
                if free[j]:
                    x[j] += step * (solution[j] - x[j])
            if blocking < 0:
                break
            x[blocking] = 0.0
            free[blocking] = False
            number -= 1
            if number == 0:
                break
    return x


@njit(cache=True)
def fit_powers(
    columns: Array, bins: Bins, with_ramp: bool, tolerance: float
) -> tuple[Array, float, float]:
    """Return the squared parameters, R and the cost that fit best, to a tolerance of the cost.

    Fisher scoring, with the expected information, is robust, but slow near the end where the data
    deviate from the model; there the observed information is used (Newton steps).
    """
    nu, density, cross, ramp = bins
    b, p = columns.shape
    R = 0.0
    data, model, tried_model = np.empty(b), np.empty(b), np.empty(b)
    for i in range(b):
        data[i] = density[i]
        # From above: the weights of a first guess must not be ruled by bins that happen to be low.
        model[i] = density[i] + 1e-3
    powers, gram, target = np.empty(p), np.empty((p, p)), np.empty(p)
    powers[:] = 1.0
    cost = np.inf
    observed, allowed = False, True
    for iteration in range(_MOST_STEPS):
        if with_ramp and iteration > 0:
            R = fit_ramp(bins, model)[0]
            for i in range(b):
                data[i] = max(density[i] - 2.0 * R * cross[i] + R * R * ramp[i], 0.0)
            cost = compute_cost(nu, data, model)
        gram[:] = 0.0
        target[:] = 0.0
        for i in range(b):
            weight = nu[i] / (model[i] * model[i])
            towards = data[i]
            if observed:
                ratio = data[i] / model[i]
                towards = (3.0 * ratio - 2.0) * model[i]
                curvature = 2.0 * ratio - 1.0
            for j in range(p):
                left = weight * columns[i, j]
                target[j] += left * towards
                if observed:
                    left *= curvature
                for k in range(j + 1):
                    gram[j, k] += left * columns[i, k]
        for j in range(p):
            for k in range(j):
                gram[k, j] = gram[j, k]
        wanted = _non_negative(gram, target, powers)
        if iteration == 0:
            powers = wanted
            np.dot(columns, powers, model)
            largest = model[0]
            for i in range(b):
                if model[i] > largest or np.isnan(model[i]):
                    largest = model[i]
            for i in range(b):
                model[i] = max(model[i], 1e-12 * largest)
            cost = compute_cost(nu, data, model)
            continue
        step = 1.0
        moved = False
        tried = np.empty(p)
        for _ in range(14):
            for j in range(p):
                tried[j] = powers[j] + step * (wanted[j] - powers[j])
            np.dot(columns, tried, tried_model)
            tried_cost = compute_cost(nu, data, tried_model)
            if tried_cost <= cost:
                moved = True
                break
            step *= 0.5
        if not moved:
            if not observed:
                break
            observed, allowed = False, False
            continue
        gain = cost - tried_cost
        powers, cost = tried, tried_cost
        model, tried_model = tried_model, model
        if observed and step < 1.0:  # far from the information: no step to end with
            observed, allowed = False, False
            continue
        if gain < tolerance:
            break
        observed = allowed and gain < _NEAR
    return powers, R, cost


@njit(cache=True)
def profile_cost(places: Array, problem: Problem, tolerance: float) -> float:
    """Return the cost at logarithms of correlation times, minimised over other parameters."""
    fixed, bins, with_ramp, table = problem
    b, p = fixed.shape
    columns = np.empty((b, p + places.size))
    shape = np.empty(b)
    for i in range(b):
        for j in range(p):
            columns[i, j] = fixed[i, j]
    for g in range(places.size):
        interpolate_shape(places[g], table, shape)
        total = 0.0
        for i in range(b):
            total += shape[i]
        mean = total / b
        for i in range(b):
            columns[i, p + g] = shape[i] / mean
    return fit_powers(columns, bins, with_ramp, tolerance)[2]
