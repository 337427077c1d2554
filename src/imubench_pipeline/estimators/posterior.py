"""Draws from the posterior of a model, for the intervals of its parameters.

Flat in the amplitudes Q, N, B and K, in R, and in log T_B up to a fifth of the log. (Flat in log N
has no lower end: where another term explains the spectrum without N, all of it would go there.)

Importance sampling: for each of a grid of correlation times the posterior of the amplitudes is
nearly normal, and its mode is a few steps away. Where the draws are not worth enough, as along thin
curved ridges between terms that stand for each other, an adaptive Metropolis chain takes over.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.estimators.importance import Mixture, sample_adaptively
from imubench_pipeline.estimators.posterior_kernels import chain, log_posteriors, mode_at
from imubench_pipeline.estimators.whittle import Maximum, Whittle
from imubench_pipeline.estimators.whittle_kernels import Problem, shape_at
from imubench_pipeline.typing import Array

DRAWS = 80_000
"""Draws that are kept, unless fewer are asked for: the 2.5 % of them in a tail are 2,000."""

_WORTH = 6
"""Draws for which one independent point is wanted: limits of two seeds then agree within 3 %."""

_LEAST_WORTH = 80
"""Draws for which one independent point must be had: a chain, worth about as much, takes over."""

_ROUNDS = 4
_GRID = (0, 20, 9)
"""Correlation times of the first mixture along each axis, by the number of processes."""

_WIDE = 0.7
"""Standard deviation of its components in log T_B, distances in the grid."""

_WIDEST = 2.0
"""Largest one about the best fit."""

_AT_BEST_FIT = 0.3
"""Least weight of the component at the best fit."""

_LEAST, _FLOOR = 1e-6, 5e-3
_WEAK = 0.15
"""Relative standard deviation of a squared amplitude from which it may as well be near 0."""

_NEARLY_GONE, _GONE_SPREAD = 0.7, 0.8
"""Amplitude over its unit, asinh, and standard deviation of its logarithm, in components of such a
term."""

_GONE_WEIGHT = 0.03
_ALIKE = 1e-4
"""Terms that are more alike are told apart no better."""

_LEAST_START = 0.3


@dataclass(frozen=True)
class Posterior:
    """Draws from the posterior of a model, equally weighted and in random order."""

    parameters: Array
    """(draws, p): the linear parameters in their order, then B of each process; SI."""
    times: Array  # (draws, g): T_B of each process, rising, s
    ramps: Array  # (draws,): R; zeros where the model has none
    effective: float  # number of independent draws that they are worth; NaN of a chain


def sample(
    whittle: Whittle, maximum: Maximum, rng: np.random.Generator, draws: int = DRAWS
) -> Posterior:
    """Draw from the posterior of a model around its best fit.

    A term that the best fit has at 0 is drawn all the same.
    """
    target = _Target(whittle, maximum)
    wanted = draws / _WORTH
    size = 1 << max(9, math.ceil(math.log2(wanted)))
    points = sample_adaptively(
        target.log_density, target.first(), rng, size=size, wanted=wanted, most=_ROUNDS * size
    )
    effective = points.effective
    if effective * _LEAST_WORTH >= draws:
        which = points.drawn(draws, rng)
        amplitudes = target.amplitudes(points.points[which])
    else:
        effective = math.nan
        start, covariance = target.start()
        amplitudes = chain(start, covariance, rng, draws, target.problem)
    return target.posterior(amplitudes, effective, rng)


class _Target:
    """The posterior of a model, in coordinates in which it is nearly normal.

    They are log T_B, and z with amplitude = unit sinh z > 0: linear where an amplitude may be 0,
    its logarithm where it is known.
    """

    def __init__(self, whittle: Whittle, maximum: Maximum) -> None:
        terms = maximum.terms
        self.maximum = maximum
        self.linear, self.processes = len(terms.linear), terms.gauss_markov
        self.terms = self.linear + self.processes
        fixed = np.column_stack([whittle.column(letter) for letter in terms.linear])
        density = whittle.density(maximum)
        spectrum = whittle.spectrum
        ramp_information = float(np.sum(spectrum.ordinates * spectrum.ramp / density))
        self.ramp_unit = 1.0 / math.sqrt(max(ramp_information, 1e-300))
        self.problem = Problem(
            np.ascontiguousarray(fixed / whittle.scale),
            whittle.bins(self.ramp_unit),
            terms.ramp,
            whittle.shape_table(whittle.scale),
        )
        # How well the square of each amplitude is known: alone, and beside the other terms.
        parts = whittle.matrix(terms, maximum.times) / density[:, None]
        parts *= np.sqrt(spectrum.ordinates / 2.0)[:, None]
        size = np.linalg.norm(parts, axis=0)
        parts /= size
        inverse = np.linalg.inv(parts.T @ parts + _ALIKE * np.eye(self.terms))
        error = np.sqrt(np.diag(inverse)) / size
        self.log_unit = 0.5 * np.log(0.25 * error)
        self.weak = np.flatnonzero(error > _WEAK * maximum.powers).tolist()
        self.log_fitted = 0.5 * np.log(np.maximum(maximum.powers, _LEAST_START / size))

    def log_density(self, points: Array) -> Array:
        """Return the logarithm of the posterior at points, up to a constant."""
        result = np.full(len(points), -np.inf)
        inside = (points[:, : self.terms] > 0.0).all(axis=1)
        if inside.any():
            values, _, _ = log_posteriors(self.amplitudes(points[inside]), self.problem)
            # d log sinh z = coth z dz
            result[inside] = values - np.log(np.tanh(points[inside, : self.terms])).sum(axis=1)
        return result

    def amplitudes(self, points: Array) -> Array:
        """Return (log amplitude ..., log T_B ...) of points."""
        result = points.copy()
        z = points[:, : self.terms]
        # log sinh z, which does not overflow.
        result[:, : self.terms] = self.log_unit + z + np.log(-0.5 * np.expm1(-2.0 * z))
        return result

    def first(self) -> Mixture:
        """Return a mixture that covers the posterior: a normal one for each T_B of a grid."""
        first, step, logarithms = self.problem.table
        last = first + step * (len(logarithms) - 1)
        number = _GRID[self.processes]
        apart = (last - first) / max(number, 1)
        grid = first + apart * (np.arange(number) + 0.5)
        places = [np.log(self.maximum.times)]
        if self.processes == 1:
            places += [np.array([place]) for place in grid]
        elif self.processes == 2:
            places += [np.array([a, b]) for i, a in enumerate(grid) for b in grid[i + 1 :]]
        widths = [_WIDEST] + [_WIDE * apart] * (len(places) - 1)
        components = [self._component(at, width) for at, width in zip(places, widths, strict=True)]
        if self.terms > 1:
            components += [self._without(term) for term in self.weak]
        means, scales = (np.array(part) for part in zip(*components, strict=True))
        values, _, _ = log_posteriors(means, self.problem)
        mass = values + 0.5 * np.linalg.slogdet(scales)[1]
        weights = np.exp(mass - mass.max())
        weights /= weights.sum()
        heavy = weights > _LEAST
        heavy[0] = True
        heavy[len(places) :] = True
        weights = np.maximum(weights, _FLOOR)
        weights[len(places) :] = np.maximum(weights[len(places) :], _GONE_WEIGHT)
        weights[0] = max(weights[0], _AT_BEST_FIT)
        # From log amplitudes to z = asinh(amplitude / unit): dz = tanh z d log amplitude.
        slope = np.ones_like(means)
        z = np.arcsinh(np.exp(means[:, : self.terms] - self.log_unit))
        means[:, : self.terms], slope[:, : self.terms] = z, np.tanh(z)
        scales *= slope[:, :, None] * slope[:, None, :]
        return Mixture(weights[heavy] / weights[heavy].sum(), means[heavy], scales[heavy])

    def start(self) -> tuple[Array, Array]:
        """Return the mode of the amplitudes at the best T_B, and the covariance there."""
        return self._component(np.log(self.maximum.times), 1.0)

    def _component(self, places: Array, width: float) -> tuple[Array, Array]:
        """Return mean and covariance of a normal one about correlation times."""
        return self._normal(self.log_fitted, places, width, self.problem)

    def _without(self, term: int) -> tuple[Array, Array]:
        """Return those of the posterior where one term is nearly gone."""
        places, problem = np.log(self.maximum.times), self.problem
        new = [term]
        if term < self.linear:
            fixed = np.ascontiguousarray(np.delete(problem.fixed, term, axis=1))
            problem = problem._replace(fixed=fixed)
        else:
            places = np.delete(places, term - self.linear)
            new.append(self.terms + term - self.linear)
        mean, covariance = self._normal(np.delete(self.log_fitted, term), places, _WIDEST, problem)
        old = np.delete(np.arange(self.terms + self.processes), new)
        full_mean, full = np.empty(len(old) + len(new)), np.zeros((len(old) + len(new),) * 2)
        full_mean[old], full[np.ix_(old, old)] = mean, covariance
        full_mean[term] = self.log_unit[term] + math.log(math.sinh(_NEARLY_GONE))
        full[term, term] = _GONE_SPREAD**2
        if term >= self.linear:
            # Its correlation time may be any.
            first, step, logarithms = self.problem.table
            across = step * (len(logarithms) - 1)
            full_mean[new[1]], full[new[1], new[1]] = first + 0.5 * across, (0.3 * across) ** 2
        return full_mean, full

    def _normal(
        self, start: Array, places: Array, width: float, problem: Problem
    ) -> tuple[Array, Array]:
        """Return mean and covariance of a normal one, of some of the linear terms and processes."""
        log_amplitudes, curvature, parts = mode_at(start, places, problem)
        p, g, linear = len(start), len(places), problem.fixed.shape[1]
        information = np.zeros((p + g, p + g))
        information[:p, :p] = curvature
        if g:
            slopes = np.column_stack(
                [
                    0.5 * parts[:, linear + k] * self._slope(float(place))
                    for k, place in enumerate(places)
                ]
            )
            half = 0.5 * self.problem.bins.nu[:, None]
            information[p:, :p] = slopes.T @ (half * parts)
            information[:p, p:] = information[p:, :p].T
            information[p:, p:] = slopes.T @ (half * slopes) + np.eye(g) / width**2
        return np.append(log_amplitudes, places), np.asarray(np.linalg.inv(information))

    def _slope(self, place: float) -> Array:
        """Return the change of the logarithm of a shape with log T_B."""
        first, step, logarithms = self.problem.table
        last = first + step * (len(logarithms) - 1)
        low, high = max(place - 0.5 * step, first), min(place + 0.5 * step, last)
        ends = np.empty((2, len(self.problem.bins.nu)))
        shape_at(low, self.problem.table, ends[0])
        shape_at(high, self.problem.table, ends[1])
        return np.asarray(np.log(ends[1] / ends[0]) / (high - low))

    def posterior(self, amplitudes: Array, effective: float, rng: np.random.Generator) -> Posterior:
        """Return equally weighted points as draws of the parameters."""
        p = self.terms
        ramps = np.zeros(len(amplitudes))
        if self.maximum.terms.ramp:
            # Given the noise R is normal.
            _, first, again = np.unique(amplitudes[:, 0], return_index=True, return_inverse=True)
            _, best, information = log_posteriors(amplitudes[first], self.problem)
            ramps = best[again] + rng.standard_normal(len(amplitudes)) / np.sqrt(information[again])
        times = np.exp(amplitudes[:, p:])
        order = np.argsort(times, axis=1)
        biases = np.take_along_axis(np.exp(amplitudes[:, self.linear : p]), order, axis=1)
        return Posterior(
            np.concatenate([np.exp(amplitudes[:, : self.linear]), biases], axis=1),
            np.take_along_axis(times, order, axis=1),
            ramps * self.ramp_unit,
            effective,
        )
