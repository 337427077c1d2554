"""Generalised least squares on the means of blocks of a log, with the noise model's covariance.

    y = X b + e,   cov(e) = C,   b^ = (X^T C^-1 X)^-1 X^T C^-1 y,   cov(b^) = (X^T C^-1 X)^-1

(A. C. Aitken 1935), with C from `block_mean_covariance`. The standard errors follow from the noise
model, not from the scatter, which contains little of the slow noise. The scatter is a check:
(y - X b^)^T C^-1 (y - X b^) is chi-squared of b - p degrees of freedom if C and X are right.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cholesky, solve_triangular
from scipy.stats import chi2, norm

from imubench_pipeline.extensions.calibration.experiment import (
    Blocks,
    Experiment,
    block_mean_covariance,
)
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array
from imubench_pipeline.words.numbers import counted

_MAX_SIGMA_INCREASE = 1e-3  # largest relative increase of a standard error by longer blocks
_MAX_BLOCKS = 1024  # largest number of blocks in the test of a block length
_MIN_SINGULAR_VALUE = 1e-8  # of independent whitened regressors of unit length
_CONFIDENCE_LEVEL = 0.95

Quantity = Literal[
    "earth_rate", "bias", "heading", "scale_factor", "asymmetry", "quadratic", "linearity"
]


@dataclass(frozen=True)
class NotObservable:
    """A quantity that the recording does not determine."""

    quantity: Quantity
    reason: str  # in words
    half_width: float | None = None  # half of the range of the bias, rad/s; None: unbounded


class NotObservableError(ValueError):
    """Raised if the data would not determine a requested quantity even without noise."""


@dataclass(frozen=True)
class Estimated:
    """Estimates of a quantity in several runs, SI, with standard error and limits."""

    value: Array  # shape (runs,)
    sigma: float  # its standard error
    noise_sigma: float  # the part by the noise model
    lower: Array  # shape (runs,); 95 % limits
    upper: Array
    p_value: Array | None = None  # shape (runs,); of a value at least as large, by noise alone


def make_estimated(
    value: Array, sigma: float, noise_sigma: float | None = None, p_value: Array | None = None
) -> Estimated:
    """Return estimates, shape (runs,), with 95 % limits for normal errors."""
    noise_sigma = sigma if noise_sigma is None else noise_sigma
    half = compute_half_width() * sigma
    return Estimated(value, sigma, noise_sigma, value - half, value + half, p_value)


@dataclass(frozen=True)
class Fit:
    """Result of generalised least squares for runs with equal regressors."""

    value: Array  # shape (runs, p); estimates, SI
    covariance: Array  # shape (p, p); of their errors, by the noise model
    chi_squared: Array  # shape (runs,); squared residuals in units of the noise model
    freedom: int  # their degrees of freedom, b - p

    @property
    def sigma(self) -> Array:
        """Standard errors, shape (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def p_value(self) -> Array:
        """Probability of residuals at least as large if the model is right, shape (runs,)."""
        return np.asarray(chi2.sf(self.chi_squared, self.freedom))


def compute_half_width(quantities: int = 1) -> float:
    """Return half of a two-sided 95 % interval, in standard deviations.

    For several quantities, 95 % is the probability that all intervals are right (Bonferroni).
    """
    level = 1.0 - (1.0 - _CONFIDENCE_LEVEL) / quantities
    return float(norm.ppf(0.5 + level / 2.0))


class LeastSquares:
    """Generalised least squares for runs with equal blocks and regressors, shape (b, p).

    The model has some noise in every sample. ``further``, shape (b, b), is added to the covariance
    of the noise, (rad/s)^2. Raises NotObservableError if there are fewer blocks than regressors, or
    the regressors are collinear.
    """

    def __init__(
        self,
        blocks: Blocks,
        model: NoiseModel,
        regressors: Array,
        *,
        further: Array | None = None,
    ) -> None:
        if len(blocks) < regressors.shape[1]:
            raise NotObservableError(
                f"{counted(regressors.shape[1], 'parameter')} cannot be determined from "
                f"{counted(len(blocks), 'block mean')}; expected at least one for each parameter"
            )
        self._blocks = blocks
        covariance = block_mean_covariance(model, blocks)
        if further is not None:
            covariance = covariance + further
        self._root = cholesky(covariance, lower=True)
        white = solve_triangular(self._root, regressors, lower=True)
        length = np.linalg.norm(white, axis=0)
        if np.any(length == 0.0):
            raise NotObservableError("a regressor is 0 in all blocks; its parameter has no effect")
        basis, values, turn = np.linalg.svd(white / length, full_matrices=False)
        if values[-1] < _MIN_SINGULAR_VALUE:
            raise NotObservableError("the data cannot separate the parameters")
        self._basis = basis
        self._back = (turn.T / values) / length[:, None]
        self.covariance = self._back @ self._back.T

    @property
    def sigma(self) -> Array:
        """Standard errors of the parameters, shape (p,), which do not depend on the data."""
        return np.sqrt(np.diag(self.covariance))

    def fit(self, means: Array) -> Fit:
        """Estimate the parameters of each run from finite block means of shape (runs, b)."""
        self._blocks.check_means(means)
        white = solve_triangular(self._root, means.T, lower=True).T
        along = white @ self._basis
        residual = white - along @ self._basis.T
        return Fit(
            along @ self._back.T,
            self.covariance,
            np.sum(residual**2, axis=1),
            means.shape[1] - self._basis.shape[1],
        )


def choose_block_length(
    experiment: Experiment, model: NoiseModel, regressors: Callable[[Blocks], Array]
) -> int:
    """Return the longest block, in samples, whose means keep the information of the samples.

    There are 1,024 blocks at most (see `halve_block_length`), none longer than the longest dwell.
    ``regressors`` gives the regressors of blocks, shape (b, p). Raises NotObservableError if they
    are collinear.
    """
    length = max(dwell.stop - dwell.start for dwell in experiment.dwells)

    def sigma(blocks: Blocks) -> Array:
        return LeastSquares(blocks, model, regressors(blocks)).sigma

    return halve_block_length(length, experiment, sigma, _MAX_BLOCKS)


def halve_block_length(
    length: int, experiment: Experiment, sigma: Callable[[Blocks], ArrayLike], max_blocks: int
) -> int:
    """Halve a block length, in samples, until shorter blocks give no more information.

    With a fourth of the returned length, no standard error would be 0.1 % lower, or there would be
    more than ``max_blocks`` blocks. ``sigma`` returns the standard errors for given blocks.
    """

    @cache
    def of_length(longest: int) -> Array:
        return np.asarray(sigma(experiment.blocks(longest)))

    while length > 1:
        shorter = max(length // 4, 1)
        if len(experiment.blocks(shorter)) > max_blocks:
            break
        if np.all(of_length(shorter) > (1.0 - _MAX_SIGMA_INCREASE) * of_length(length)):
            break
        length //= 2
    return length
