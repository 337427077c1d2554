"""Posterior intervals of the parameters of a model: adaptive Metropolis on the Whittle likelihood.

Flat in the amplitudes Q, N, B and K, in R, and in log T_B up to a fifth of the log. (Flat in log N
has no lower end: where another term explains the spectrum without N, all of it would go there.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.estimators.whittle import Maximum, Whittle
from imubench_pipeline.estimators.whittle_kernels import Bins, ShapeTable, cost_of, shape_at

Array = NDArray[np.float64]

DRAWS = 20_000
"""Draws that are kept, unless fewer are asked for."""

_BURN_IN = 4_000
_ADAPT_EVERY = 250
_WIDEST = 1.0
"""Largest relative standard deviation that the first proposals assume."""


@dataclass(frozen=True)
class Posterior:
    """Draws from the posterior of a model.

    Attributes
    ----------
    parameters : ndarray, shape (draws, p)
        The linear parameters in their order, then B of each process; SI.
    times : ndarray, shape (draws, g)
        T_B of each process, rising, s.
    ramps : ndarray, shape (draws,)
        R; zeros where the model has none.
    accepted : float
        Share of the proposals that were taken.
    """

    parameters: Array
    times: Array
    ramps: Array
    accepted: float


def sample(
    whittle: Whittle, found: Maximum, rng: np.random.Generator, draws: int = DRAWS
) -> Posterior:
    """Draw from the posterior of a model around its best fit.

    Parameters
    ----------
    whittle : Whittle
    found : Maximum
        The best fit of the model; a term that it has at 0 is drawn all the same.
    rng : numpy.random.Generator
    draws : int
        Draws to keep.

    Returns
    -------
    Posterior

    References
    ----------
    H. Haario, E. Saksman and J. Tamminen, "An adaptive Metropolis algorithm", Bernoulli 7, 2001.
    """
    start = _start(whittle, found)
    terms = found.terms
    linear = len(terms.linear)
    p, g = linear + terms.gauss_markov, terms.gauss_markov
    fixed = np.column_stack([whittle.column(letter) for letter in terms.linear])
    ramp_unit = float(np.sqrt(1.0 / max(_ramp_information(whittle, start), 1e-300)))
    at = [*np.log(np.sqrt(start.powers)), *np.log(start.times)]
    if terms.ramp:
        at.append(start.ramp / ramp_unit)
    information = whittle.information(start)
    if terms.ramp:
        information[-1, -1] *= ramp_unit**2
    spread = _first_spread(information)
    kept, accepted = _metropolis(
        np.array(at),
        spread,
        rng.standard_normal((_BURN_IN + draws, len(at))),
        np.log(rng.random(_BURN_IN + draws)),
        fixed / whittle.scale,
        whittle.bins(ramp_unit),
        g,
        terms.ramp,
        whittle.shape_table(whittle.scale),
    )
    times = np.exp(kept[:, p : p + g])
    order = np.argsort(times, axis=1)
    biases = np.take_along_axis(np.exp(kept[:, linear:p]), order, axis=1)
    return Posterior(
        np.concatenate([np.exp(kept[:, :linear]), biases], axis=1),
        np.take_along_axis(times, order, axis=1),
        kept[:, -1] * ramp_unit if terms.ramp else np.zeros(len(kept)),
        accepted,
    )


def _start(whittle: Whittle, found: Maximum) -> Maximum:
    """Return the best fit with terms that are 0 at the size that the log could just show."""
    total = whittle.density(found)
    matrix = whittle.matrix(found.terms, found.times)
    powers = found.powers.copy()
    for j, column in enumerate(matrix.T):
        smallest = 1.0 / np.sqrt(np.sum(whittle.spectrum.ordinates / 2.0 * (column / total) ** 2))
        powers[j] = max(powers[j], 0.3 * smallest)
    return Maximum(found.terms, powers, found.times, found.ramp, found.cost)


def _ramp_information(whittle: Whittle, found: Maximum) -> float:
    spectrum = whittle.spectrum
    return float(np.sum(spectrum.ordinates * spectrum.ramp / whittle.density(found)))


def _first_spread(information: Array) -> Array:
    """Return a root of the covariance of the first proposals."""
    prior = np.eye(len(information)) / _WIDEST**2
    covariance = np.linalg.inv(information + prior)
    return np.asarray(np.linalg.cholesky(covariance) * 2.4 / np.sqrt(len(information)))


@njit(cache=True)
def _log_posterior(
    x: Array,
    fixed: Array,
    bins: Bins,
    processes: int,
    with_ramp: bool,
    table: ShapeTable,
    model: Array,
    data: Array,
    shape: Array,
) -> float:
    nu, density, cross, ramp = bins
    linear = fixed.shape[1]
    p = linear + processes
    last = table.first + table.step * (table.logarithms.shape[0] - 1)
    prior = 0.0
    for j in range(p):
        prior += x[j]  # flat in the amplitude a is e^x in x = log a
    for i in range(nu.size):
        total = 0.0
        for j in range(linear):
            total += np.exp(2.0 * x[j]) * fixed[i, j]
        model[i] = total
    for g in range(processes):
        where = x[p + g]
        if where < table.first or where > last:
            return -np.inf
        shape_at(where, table, shape)
        power = np.exp(2.0 * x[linear + g])
        for i in range(nu.size):
            model[i] += power * shape[i]
    if not with_ramp:
        return prior - cost_of(nu, density, model)
    R = x[-1]
    for i in range(nu.size):
        data[i] = density[i] - 2.0 * R * cross[i] + R * R * ramp[i]
    return prior - cost_of(nu, data, model)


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
    b = fixed.shape[0]
    model, data, shape = np.empty(b), np.empty(b), np.empty(b)
    arguments = (fixed, bins, processes, with_ramp, table, model, data, shape)
    x = start.copy()
    here = _log_posterior(x, *arguments)
    mean, covariance = x.copy(), root @ root.T * d / 5.76
    kept = np.empty((n - _BURN_IN, d))
    accepted, recent = 0, 0
    scale = 1.0
    for k in range(n):
        proposal = x + scale * (root @ normals[k])
        there = _log_posterior(proposal, *arguments)
        if log_uniforms[k] < there - here:
            x, here = proposal, there
            recent += 1
            if k >= _BURN_IN:
                accepted += 1
        if k >= _BURN_IN:
            kept[k - _BURN_IN] = x
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
    return kept, accepted / (n - _BURN_IN)
