"""Adaptive importance sampling from a posterior, with mixtures of Student's t distributions.

Each round draws from a mixture, weighs all draws so far by the posterior over the mean of all
mixtures so far, and fits the next mixture to them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, ndtri
from scipy.stats import qmc

from imubench_pipeline.estimators.posterior_kernels import fit_mixture, set_densities
from imubench_pipeline.typing import Array

_MIN_DEGREES = 5
_FIRST_MIXTURE_WEIGHT = 0.15  # Of the first mixture in later ones, which keeps its support covered
_MIN_COMPONENT_MASS = 0.01
_LEARNING_POINTS = 2048  # Number of points to which a mixture is fitted

_CLIPPED_POINTS = 8
"""Highest weights that are clipped before a fit (Koblents and Míguez, Stat. Comput. 25, 2015)."""

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
        """Return weight times density of each component, up to a constant, shape (n, c)."""
        densities = np.empty((len(points), len(self.weights)))
        freedom = _get_degrees(points.shape[1])
        set_densities(points, self.weights, self.means, self._inverses, freedom, densities)
        return densities

    @cached_property
    def _inverses(self) -> Array:
        """Inverses of the roots of the scales."""
        return np.linalg.inv(np.linalg.cholesky(self.scales))

    def fitted(self, points: Array) -> Mixture:
        """Return the mixture after one expectation-maximisation step on points."""
        parts, freedom = self.densities(points), _get_degrees(points.shape[1])
        weights, means = np.empty_like(self.weights), np.empty_like(self.means)
        scales = np.zeros_like(self.scales)
        old = (points, parts, self.means, self._inverses, freedom, _MIN_COMPONENT_MASS)
        number = fit_mixture(*old, weights, means, scales)
        if not number:
            return self
        return Mixture(weights[:number] / weights[:number].sum(), means[:number], scales[:number])

    def beside(self, other: Mixture, part: float) -> Mixture:
        """Combine this mixture with another one, of weight ``part``."""
        return Mixture(
            np.concatenate([(1.0 - part) * self.weights, part * other.weights]),
            np.concatenate([self.means, other.means]),
            np.concatenate([self.scales, other.scales]),
        )


@dataclass(frozen=True)
class Weighted:
    """Points and their weights."""

    points: Array  # (n, d)
    weights: Array  # (n,): they sum up to 1

    @property
    def effective(self) -> float:
        """Effective sample size, 1 / sum w^2 (L. Kish, "Survey Sampling", 1965)."""
        return float(1.0 / np.sum(self.weights**2))

    def clipped(self, number: int) -> Weighted:
        """Return the points with the ``number`` highest weights clipped to the lowest of them."""
        most = np.partition(self.weights, -number)[-number]
        if not most > 0.0:
            return self
        lowered = np.minimum(self.weights, most)
        return Weighted(self.points, lowered / lowered.sum())

    def drawn(self, number: int, rng: np.random.Generator) -> NDArray[np.int64]:
        """Return indices of equally weighted points, in random order (systematic resampling)."""
        ends = np.cumsum(self.weights)
        places = (np.arange(number) + rng.random()) / number * ends[-1]
        which = np.minimum(np.searchsorted(ends, places), len(ends) - 1)
        return rng.permutation(which)


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

    Parameters
    ----------
    log_density : callable
        Logarithm of the density at points, shape (n, d), up to a constant; -inf where it is 0.
    first : Mixture
        Proposal of the first round.
    size, most : int
        Points of a round, a power of 2, and of all rounds.
    wanted : float
        Effective sample size to reach before ``most`` points.

    References
    ----------
    J.-M. Cornuet, J.-M. Marin, A. Mira and C. P. Robert, "Adaptive multiple importance sampling",
    Scandinavian Journal of Statistics 39, 2012.
    """
    mixtures, mixture = [first], first
    points = first.draw(size, rng)
    values = log_density(points)
    proposed = first.densities(points).sum(axis=1)
    while True:
        with np.errstate(divide="ignore"):
            logarithm = values - np.log(proposed)
        weights = np.exp(logarithm - logarithm.max())
        weighted = Weighted(points, weights / weights.sum())
        if weighted.effective >= wanted or len(points) + size > most:
            return weighted
        learnt = points[weighted.clipped(_CLIPPED_POINTS).drawn(_LEARNING_POINTS, rng)]
        for _ in range(_EM_STEPS):
            mixture = mixture.fitted(learnt)
        proposal = mixture.beside(first, _FIRST_MIXTURE_WEIGHT)
        added = proposal.draw(size, rng)
        proposed = proposed + proposal.densities(points).sum(axis=1)
        mixtures.append(proposal)
        everywhere = [earlier.densities(added).sum(axis=1) for earlier in mixtures]
        points = np.concatenate([points, added])
        values = np.concatenate([values, log_density(added)])
        proposed = np.concatenate([proposed, np.sum(everywhere, axis=0)])


def _get_degrees(dimensions: int) -> int:
    """Return degrees of freedom with an even sum with ``dimensions``: the power has no root."""
    return _MIN_DEGREES + (_MIN_DEGREES + dimensions) % 2
