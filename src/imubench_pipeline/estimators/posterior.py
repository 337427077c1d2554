"""Draws from the posterior of a model, and joint draws over the models that the log allows.

The prior is uniform in the amplitudes Q, N, B and K, in R, and in log T_B up to a fifth of the log.
The draws are by adaptive importance sampling.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, ndtri
from scipy.stats import qmc

from imubench_pipeline.estimators.estimate import FAMILY, JointDraws
from imubench_pipeline.estimators.model_choice import (
    BIC_PENALTY_RARE_TERM,
    BIC_PENALTY_UNIT_ROOT,
    WALK_LIKE_TIME_FRACTION,
    Candidate,
)
from imubench_pipeline.estimators.posterior_kernels import (
    compute_log_posteriors,
    find_mode,
    fit_mixture,
    set_densities,
)
from imubench_pipeline.estimators.whittle import Maximum, Terms, Whittle
from imubench_pipeline.estimators.whittle_kernels import Problem, interpolate_shape
from imubench_pipeline.typing import Array

_MIN_DEGREES = 5
_FIRST_MIXTURE_WEIGHT = 0.15  # In later mixtures, to keep the whole support covered
_MIN_COMPONENT_MASS = 0.01
_LEARNING_POINTS = 2048  # Number of points to which a mixture is fitted
_EM_STEPS = 3  # Expectation-maximisation steps between two rounds


@dataclass(frozen=True)
class Mixture:
    """A mixture of multivariate Student's t distributions."""

    weights: Array  # (c,): they sum up to 1
    means: Array  # (c, d)
    scales: Array  # (c, d, d): positive definite

    def draw(self, number: int, rng: np.random.Generator) -> Array:
        """Return points, shape (number, d); ``number`` is a power of 2 (Sobol sequence)."""
        uniform = qmc.Sobol(self.means.shape[1] + 2, seed=rng).random(number)
        uniform = np.clip(uniform, 1e-12, 1.0 - 1e-12)
        ends = np.cumsum(self.weights)
        which = np.minimum(np.searchsorted(ends / ends[-1], uniform[:, 0]), len(ends) - 1)
        normal = ndtri(uniform[:, 2:])
        freedom = _get_degrees(self.means.shape[1])
        normal /= np.sqrt(chdtri(freedom, uniform[:, 1]) / freedom)[:, None]
        roots = np.linalg.cholesky(self.scales)
        return np.asarray(self.means[which] + np.einsum("nij,nj->ni", roots[which], normal))

    def densities(self, points: Array) -> Array:
        """Return weight times density of each component at n points, up to a constant, (n, c)."""
        densities = np.empty((len(points), len(self.weights)))
        freedom = _get_degrees(points.shape[1])
        set_densities(points, self.weights, self.means, self._inverses, freedom, densities)
        return densities

    @cached_property
    def _inverses(self) -> Array:
        return np.linalg.inv(np.linalg.cholesky(self.scales))

    def fitted(self, points: Array) -> "Mixture":
        """Return the mixture fitted to points by one expectation-maximisation step."""
        parts, freedom = self.densities(points), _get_degrees(points.shape[1])
        weights, means = np.empty_like(self.weights), np.empty_like(self.means)
        scales = np.zeros_like(self.scales)
        old = (points, parts, self.means, self._inverses, freedom, _MIN_COMPONENT_MASS)
        number = fit_mixture(*old, weights, means, scales)
        if not number:
            return self
        return Mixture(weights[:number] / weights[:number].sum(), means[:number], scales[:number])


@dataclass(frozen=True)
class Weighted:
    """Points with importance weights, which together represent a density."""

    points: Array  # (n, d)
    weights: Array  # (n,): they sum up to 1

    @property
    def effective(self) -> float:
        """Effective sample size, 1 / sum w^2 (L. Kish, "Survey Sampling", 1965)."""
        return float(1.0 / np.sum(self.weights**2))

    def drawn(self, number: int, rng: np.random.Generator) -> NDArray[np.int64]:
        """Return indices of points drawn by weight, in random order (systematic resampling)."""
        ends = np.cumsum(self.weights)
        places = (np.arange(number) + rng.random()) / number * ends[-1]
        return rng.permutation(np.minimum(np.searchsorted(ends, places), len(ends) - 1))


def sample_adaptively(
    log_density: Callable[[Array], Array],
    first: Mixture,
    rng: np.random.Generator,
    *,
    size: int,
    wanted: float,
    most: int,
) -> Weighted:
    """Draw weighted points from a density until their effective sample size suffices.

    Adaptive multiple importance sampling (J.-M. Cornuet et al., Scand. J. Stat. 39, 2012).
    ``log_density`` returns the logarithm of the density at points, shape (n, d), up to a constant,
    -inf where it is 0. ``first`` is the proposal of the first round. A round has ``size`` points, a
    power of 2; all rounds together have at most ``most``. ``wanted`` is the effective sample size.
    """
    mixtures, mixture = [first], first
    points = np.empty((0, first.means.shape[1]))
    values = np.empty(0)
    while True:
        added = mixtures[-1].draw(size, rng)
        points = np.concatenate([points, added])
        values = np.concatenate([values, log_density(added)])
        proposed = np.sum([each.densities(points).sum(axis=1) for each in mixtures], axis=0)
        with np.errstate(divide="ignore"):
            logarithm = values - np.log(proposed)
        weights = np.exp(logarithm - logarithm.max())
        weighted = Weighted(points, weights / weights.sum())
        if weighted.effective >= wanted or len(points) + size > most:
            return weighted
        learnt = points[weighted.drawn(_LEARNING_POINTS, rng)]
        for _ in range(_EM_STEPS):
            mixture = mixture.fitted(learnt)
        part = _FIRST_MIXTURE_WEIGHT
        weights = np.concatenate([(1.0 - part) * mixture.weights, part * first.weights])
        means = np.concatenate([mixture.means, first.means])
        mixtures.append(Mixture(weights, means, np.concatenate([mixture.scales, first.scales])))


def _get_degrees(dimensions: int) -> int:
    """Return degrees of freedom with an even sum with ``dimensions``: the power has no root."""
    return _MIN_DEGREES + (_MIN_DEGREES + dimensions) % 2


MAX_DRAWS = 8_000  # Default number of draws; a tail of 2.5 % has 200 of them
_DRAWS_PER_POINT = 4  # Draws per independent point
_MAX_ROUNDS = 8
_MAX_SIGMA = 2.0  # standard deviation in log T_B about the best fit
_MIN_BEST_FIT_WEIGHT = 0.3

_WEAK_AMPLITUDE, _WEAK_LOG_SIGMA = 0.7, 0.8
"""Asinh of an amplitude near 0 over its unit, and standard deviation of its logarithm."""

_MIN_WEAK_WEIGHT = 0.03
_RIDGE = 1e-4  # Ridge on the information matrix, against collinear terms
_MIN_START_SIGMAS = 0.3
KEPT_DRAWS = 200  # Number of draws that are kept for an estimate


@dataclass(frozen=True)
class Posterior:
    """Draws from the posterior of a model, equally weighted and in random order."""

    parameters: Array
    """(draws, p): the linear parameters in their order, then B of each process; SI."""
    times: Array  # (draws, g): T_B of each process, rising, s
    ramps: Array  # (draws,): R; zeros where the model has none
    effective: float  # effective sample size


def sample(
    whittle: Whittle, maximum: Maximum, rng: np.random.Generator, draws: int = MAX_DRAWS
) -> Posterior:
    """Draw from the posterior of a model around its best fit, including terms that are 0 in it."""
    target = _Target(whittle, maximum)
    wanted = draws / _DRAWS_PER_POINT
    size = 1 << max(9, math.ceil(math.log2(wanted)))
    points = sample_adaptively(
        target.log_density, target.first(), rng, size=size, wanted=wanted, most=_MAX_ROUNDS * size
    )
    amplitudes = target.amplitudes(points.points[points.drawn(draws, rng)])
    return target.posterior(amplitudes, points.effective, rng)


class _Target:
    """The posterior in log T_B and z, amplitude = unit sinh z, in which it is nearly normal."""

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
        # Error of each squared amplitude: with the other terms fixed, and with them varying.
        parts = whittle.matrix(terms, maximum.times) / density[:, None]
        parts *= np.sqrt(spectrum.ordinates / 2.0)[:, None]
        size = np.linalg.norm(parts, axis=0)
        parts /= size
        inverse = np.linalg.inv(parts.T @ parts + _RIDGE * np.eye(self.terms))
        error = np.sqrt(np.diag(inverse)) / size
        self.log_unit = 0.5 * np.log(0.25 * error)
        self.log_fitted = 0.5 * np.log(np.maximum(maximum.powers, _MIN_START_SIGMAS / size))

    def log_density(self, points: Array) -> Array:
        result = np.full(len(points), -np.inf)
        inside = (points[:, : self.terms] > 0.0).all(axis=1)
        if inside.any():
            values, _, _ = compute_log_posteriors(self.amplitudes(points[inside]), self.problem)
            # d log sinh z = coth z dz
            result[inside] = values - np.log(np.tanh(points[inside, : self.terms])).sum(axis=1)
        return result

    def amplitudes(self, points: Array) -> Array:
        """Return points in the coordinates (log amplitude ..., log T_B ...)."""
        result = points.copy()
        z = points[:, : self.terms]
        # log sinh z without overflow.
        result[:, : self.terms] = self.log_unit + z + np.log(-0.5 * np.expm1(-2.0 * z))
        return result

    def first(self) -> Mixture:
        """Return a mixture about the best fit, with a component for each term that may be 0."""
        places = np.log(self.maximum.times)
        components = [self._approximate_normal(self.log_fitted, places, _MAX_SIGMA, self.problem)]
        if self.terms > 1:
            components += [self._make_weak_component(term) for term in range(self.terms)]
        means, scales = (np.array(part) for part in zip(*components, strict=True))
        values, _, _ = compute_log_posteriors(means, self.problem)
        mass = values + 0.5 * np.linalg.slogdet(scales)[1]
        weights = np.exp(mass - mass.max())
        weights = np.maximum(weights / weights.sum(), _MIN_WEAK_WEIGHT)
        weights[0] = max(weights[0], _MIN_BEST_FIT_WEIGHT)
        # From log amplitudes to z = asinh(amplitude / unit): dz = tanh z d log amplitude.
        slope = np.ones_like(means)
        z = np.arcsinh(np.exp(means[:, : self.terms] - self.log_unit))
        means[:, : self.terms], slope[:, : self.terms] = z, np.tanh(z)
        scales *= slope[:, :, None] * slope[:, None, :]
        return Mixture(weights / weights.sum(), means, scales)

    def _make_weak_component(self, term: int) -> tuple[Array, Array]:
        """Return mean and covariance of a component in which one term is nearly 0."""
        places, problem = np.log(self.maximum.times), self.problem
        new = [term]
        if term < self.linear:
            fixed = np.ascontiguousarray(np.delete(problem.fixed, term, axis=1))
            problem = problem._replace(fixed=fixed)
        else:
            places = np.delete(places, term - self.linear)
            new.append(self.terms + term - self.linear)
        mean, covariance = self._approximate_normal(
            np.delete(self.log_fitted, term), places, _MAX_SIGMA, problem
        )
        old = np.delete(np.arange(self.terms + self.processes), new)
        full_mean, full = np.empty(len(old) + len(new)), np.zeros((len(old) + len(new),) * 2)
        full_mean[old], full[np.ix_(old, old)] = mean, covariance
        full_mean[term] = self.log_unit[term] + math.log(math.sinh(_WEAK_AMPLITUDE))
        full[term, term] = _WEAK_LOG_SIGMA**2
        if term >= self.linear:
            # Its correlation time is arbitrary.
            first, step, logarithms = self.problem.table
            across = step * (len(logarithms) - 1)
            full_mean[new[1]], full[new[1], new[1]] = first + 0.5 * across, (0.3 * across) ** 2
        return full_mean, full

    def _approximate_normal(
        self, start: Array, places: Array, width: float, problem: Problem
    ) -> tuple[Array, Array]:
        """Return mean and covariance of the normal approximation for some of the terms."""
        log_amplitudes, curvature, parts = find_mode(start, places, problem)
        p, g, linear = len(start), len(places), problem.fixed.shape[1]
        information = np.zeros((p + g, p + g))
        information[:p, :p] = curvature
        if g:
            table = self.problem.table
            last = table.first + table.step * (len(table.logarithms) - 1)
            slopes, ends = np.empty((len(parts), g)), np.empty((2, len(parts)))
            for k, place in enumerate(places.tolist()):
                low = max(place - 0.5 * table.step, table.first)
                high = min(place + 0.5 * table.step, last)
                interpolate_shape(low, table, ends[0])
                interpolate_shape(high, table, ends[1])
                slope = np.log(ends[1] / ends[0]) / (high - low)
                slopes[:, k] = 0.5 * parts[:, linear + k] * slope
            half = 0.5 * self.problem.bins.nu[:, None]
            information[p:, :p] = slopes.T @ (half * parts)
            information[:p, p:] = information[p:, :p].T
            information[p:, p:] = slopes.T @ (half * slopes) + np.eye(g) / width**2
        return np.append(log_amplitudes, places), np.asarray(np.linalg.inv(information))

    def posterior(self, amplitudes: Array, effective: float, rng: np.random.Generator) -> Posterior:
        """Return equally weighted points as draws of the parameters."""
        p = self.terms
        ramps = np.zeros(len(amplitudes))
        if self.maximum.terms.ramp:
            # Given the noise, R is normal.
            _, first, again = np.unique(amplitudes[:, 0], return_index=True, return_inverse=True)
            _, best, information = compute_log_posteriors(amplitudes[first], self.problem)
            ramps = best[again] + rng.standard_normal(len(amplitudes)) / np.sqrt(information[again])
        times = np.exp(amplitudes[:, p:])
        order = np.argsort(times, axis=1)
        biases = np.take_along_axis(np.exp(amplitudes[:, self.linear : p]), order, axis=1)
        parameters = np.concatenate([np.exp(amplitudes[:, : self.linear]), biases], axis=1)
        rising = np.take_along_axis(times, order, axis=1)
        return Posterior(parameters, rising, ramps * self.ramp_unit, effective)


def compute_draw_weight(candidate: Candidate, bins: int) -> float:
    """Return the weight of a model among the draws, not normalised: by AIC, but for T_B by BIC.

    Amplitudes start at 0, and AIC keeps a weak term in some draws; BIC would remove it from all. A
    correlation time is searched over decades, of which a fit covers a small part: BIC, with the
    number of fitted bins, has the right penalty. `draw_jointly` applies the penalty for a process
    as slow as a walk.
    """
    terms = candidate.terms
    of_times = terms.gauss_markov * (0.5 * math.log(bins) - 1.0)
    of_rare_terms = 0.5 * BIC_PENALTY_RARE_TERM * (terms.ramp + ("Q" in terms.linear))
    return candidate.akaike_weight * math.exp(-of_times - of_rare_terms)


def draw_jointly(
    parts: Sequence[tuple[Terms, Posterior, float]], longest: float, number: int = KEPT_DRAWS
) -> JointDraws:
    """Return draws from the posteriors of several models, in proportion to their weights.

    They are selected at equal distances of the cumulative weight (systematic resampling without a
    random start). ``parts`` are the models that the log does not exclude, with unnormalised
    weights; ``longest`` is the longest correlation time that the log can determine, s.
    """
    most = max(terms.gauss_markov for terms, _, _ in parts)
    counts = [len(posterior.parameters) for _, posterior, _ in parts]
    firsts, others = [], []
    for (terms, posterior, _), count in zip(parts, counts, strict=True):
        linear = len(terms.linear)
        first = np.zeros((count, len(FAMILY)))
        first[:, FAMILY.index("T_B")] = np.nan
        first[:, FAMILY.index("R")] = posterior.ramps
        for place, letter in enumerate(terms.linear):
            column = FAMILY.index("B" if letter == "F" else letter)
            first[:, column] = posterior.parameters[:, place]
        pairs = np.stack([posterior.parameters[:, linear:], posterior.times], axis=2)
        if terms.gauss_markov and "F" not in terms.linear:
            # By convention the first component is flicker noise, or else the fastest process.
            first[:, FAMILY.index("B")], first[:, FAMILY.index("T_B")] = pairs[:, 0].T
            pairs = pairs[:, 1:]
        processes = np.tile([0.0, np.nan], (count, most, 1))
        processes[:, : pairs.shape[1]] = pairs
        firsts.append(first)
        others.append(processes)
    first, further = np.concatenate(firsts), np.concatenate(others)
    mass = np.repeat([share / n for (_, _, share), n in zip(parts, counts, strict=True)], counts)
    times = np.column_stack((first[:, FAMILY.index("T_B")], further[:, :, 1]))
    slow = (times > WALK_LIKE_TIME_FRACTION * longest).any(axis=1)
    mass = np.cumsum(np.where(slow, math.exp(-0.5 * BIC_PENALTY_UNIT_ROOT), 1.0) * mass)
    rows = np.searchsorted(mass, (np.arange(number) + 0.5) / number * mass[-1])
    return JointDraws(first[rows], further[rows])
