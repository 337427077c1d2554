"""Scale factor, bias and linearity of a gyro from steady rates of a rate table.

    mean of a block = bias + S (table rate + Earth's rate along the axis) + noise

by generalised least squares over all steady rates (`least_squares`). The scale-factor tests of IEEE
Std 952-2020 fit a line. Further terms test it: a quadratic term; the asymmetry, the difference of
the scale factors of positive and negative rates over their mean; and the linearity, the largest
deviation of a rate over the largest rate. An angle a between the axes of gyro and table multiplies
the scale factor by cos(a), and is not separable from it.

The residuals of each steady rate and their covariance (`residuals`):

    r = A (m - X b),   cov(r) = A (C + D - X (X^T (C + D)^-1 X)^-1 X^T) A^T,

m the block means, X and b the regressors and estimates of the line, A the mean over the blocks of a
steady rate, C the covariance of the noise model and D of the true rates about the stated ones.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from imubench_pipeline.extensions.calibration.experiment import (
    Blocks,
    Measured,
    block_mean_covariance,
    block_means,
)
from imubench_pipeline.extensions.calibration.least_squares import (
    Estimated,
    Fit,
    LeastSquares,
    NotObservable,
    NotObservableError,
    choose_block_length,
    compute_half_width,
    make_estimated,
)
from imubench_pipeline.extensions.calibration.pointing import Pointing
from imubench_pipeline.extensions.calibration.schedule import Schedule
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_MAX_UNKNOWN_RATE = 1e-12  # ignored unknown part of the Earth's rate along the axis, rad/s
_RATE_TOLERANCE = 1e-9  # relative difference below which two rates are equal up to rounding


@dataclass(frozen=True)
class Calibration:
    """Bias, scale factor and linearity of a gyro on a rate table, in several runs."""

    line: Fit  # bias, rad/s, at the first sample of the first block, and scale factor
    bias: Estimated  # rad/s, with the uncertainty of the Earth's rate along the axis
    scale_factor: Estimated  # indicated over true rate
    quadratic: Estimated | None  # coefficient of the square of the rate, in addition, s/rad
    asymmetry: Estimated | None  # of the scale factors of both senses, over their mean
    linearity: Estimated | None  # largest deviation of a rate from the line, over the largest rate
    not_observable: tuple[NotObservable, ...]  # reasons for missing values


def fit_rate_table(
    schedule: Schedule,
    blocks: Blocks,
    means: Array,
    model: NoiseModel,
    pointing: Pointing | None = None,
    *,
    setting_sigma: float = 0.0,
) -> Calibration:
    """Estimate bias and scale factor in runs from block means, rad/s, shape (runs, b).

    The blocks are of the schedule's `experiment`. Without a direction (``pointing``) the Earth's
    rate is a part of the bias. ``setting_sigma``, rad/s, is the standard deviation of the true rate
    of each stretch. Raises NotObservableError if there is only one rate; ValueError if the
    deviation is negative, or the heading of an axis that is not vertical is missing.
    """
    if not (math.isfinite(setting_sigma) and setting_sigma >= 0):
        raise ValueError(f"setting_sigma is {setting_sigma}, expected a finite number, 0 or more")
    rate = schedule.of_blocks(blocks) + _find_earth_rate(pointing)
    rates, levels = _group_rates(rate)
    further = setting_sigma**2 * np.equal.outer(blocks.dwell, blocks.dwell)
    ones = np.ones(len(blocks))

    def fit(*columns: Array) -> Fit:
        return LeastSquares(blocks, model, np.column_stack(columns), further=further).fit(means)

    line = fit(ones, rate)
    sigma, scale_sigma = line.sigma.tolist()
    earth_sigma = 0.0 if pointing is None else pointing.rate_sigma
    bias = make_estimated(line.value[:, 0], math.hypot(sigma, earth_sigma), sigma)
    unknown = []
    if pointing is None:
        reason = "the Earth's rate along the axis is a part of the bias"
        unknown.append(NotObservable("bias", reason))
    quadratic = asymmetry = linearity = None
    if len(rates) > 2:
        quadratic = _make_term(fit(ones, rate, rate**2))
        linearity = _compute_linearity(line, fit(*np.eye(len(rates))[levels].T), rates)
    else:
        reason = "two rates always lie on a line"
        unknown += [NotObservable("quadratic", reason), NotObservable("linearity", reason)]
    try:
        bent = fit(ones, rate, np.abs(rate) / 2.0)
    except NotObservableError:
        reason = (
            "three rates with both senses are required: otherwise it cannot be separated from bias "
            "or scale factor"
        )
        unknown.append(NotObservable("asymmetry", reason))
    else:
        scale = bent.value[:, 1]
        if np.any(np.abs(scale) <= compute_half_width() * bent.sigma[1]):
            reason = (
                "the gyro does not follow the table, so there is no scale factor as a reference"
            )
            unknown.append(NotObservable("asymmetry", reason))
        else:
            asymmetry = _make_term(bent, scale)
    scale_factor = make_estimated(line.value[:, 1], scale_sigma)
    return Calibration(line, bias, scale_factor, quadratic, asymmetry, linearity, tuple(unknown))


def _find_earth_rate(pointing: Pointing | None) -> float:
    """Return the Earth's rate along the table's axis, rad/s; 0 without a direction."""
    if pointing is None:
        return 0.0
    if pointing.heading is None and pointing.half_width > _MAX_UNKNOWN_RATE:
        raise ValueError(
            "the heading of the table's axis is not known: state it, or omit the direction; the "
            "Earth's rate is then a part of the bias"
        )
    return pointing.rate


def _group_rates(rate: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the distinct rates up to rounding, shape (k,), and the index of each of n rates."""
    order = np.argsort(rate, kind="stable")
    rising = np.diff(rate[order], prepend=rate[order[0]]) > _RATE_TOLERANCE * np.abs(rate).max()
    levels = np.empty(len(rate), dtype=np.int64)
    levels[order] = np.cumsum(rising)
    first = np.unique(levels, return_index=True)[1]
    if len(first) < 2:
        raise NotObservableError(
            f"the table has one rate only, {rate[0]:g} rad/s: scale factor and bias cannot be "
            "separated; add another rate, best of the opposite sense"
        )
    return rate[first], levels


def _make_term(fit: Fit, scale: Array | float = 1.0) -> Estimated:
    """Return the last term of a fit over the scale factor, with its p-value if the line is right.

    The error of the scale factor is of second order.
    """
    value, sigma = fit.value[:, -1] / scale, float(fit.sigma[-1] / np.abs(scale).mean())
    return make_estimated(value, sigma, p_value=chi2.sf((value / sigma) ** 2, 1))


def _compute_linearity(line: Fit, each: Fit, rates: Array) -> Estimated:
    at_rates = np.column_stack([np.ones(len(rates)), rates])
    largest = float(np.abs(rates).max())
    size = np.abs(each.value - line.value @ at_rates.T) / largest
    # The line is fitted to the same means, which reduces the covariance of the residuals.
    variance = np.diag(each.covariance - at_rates @ line.covariance @ at_rates.T)
    sigma = np.sqrt(np.maximum(variance, 0.0)) / largest
    half = compute_half_width(len(rates)) * sigma
    explained = np.maximum(line.chi_squared - each.chi_squared, 0.0)
    of_largest = float(sigma[size[0].argmax()])
    return Estimated(
        size.max(axis=1),
        of_largest,
        of_largest,
        np.maximum(size - half, 0.0).max(axis=1),
        (size + half).max(axis=1),
        np.asarray(chi2.sf(explained, line.freedom - each.freedom)),
    )


def calibrate(
    log: Array,
    schedule: Schedule,
    model: NoiseModel,
    pointing: Pointing | None = None,
    *,
    setting_sigma: float = 0.0,
) -> tuple[Calibration, Measured]:
    """Return bias and scale factor of a gyro from a log on a rate table, and its block means.

    The log is in rad/s, shape (n,); NaN where a sample is missing. Parameters and errors are as in
    `fit_rate_table`; ValueError also if the log ends too early, or too few samples are present.
    """
    run = schedule.experiment
    _group_rates(schedule.table_rates + _find_earth_rate(pointing))
    longest = choose_block_length(
        run,
        model,
        lambda blocks: np.column_stack([np.ones(len(blocks)), schedule.of_blocks(blocks)]),
    )
    measured = block_means([log], run, longest)
    blocks, means = measured.blocks, measured.means
    fit = fit_rate_table(schedule, blocks, means, model, pointing, setting_sigma=setting_sigma)
    return fit, measured


@dataclass(frozen=True)
class Residuals:
    """Residuals of the mean reading at each steady rate from the fitted line."""

    dwell: NDArray[np.int64]  # shape (k,); index in the schedule, from 0
    mean: Array  # shape (k,); mean reading, rad/s
    line: Array  # shape (k,); value of the line, rad/s
    sigma: Array  # shape (k,); standard deviation of mean less line, rad/s

    @property
    def value(self) -> Array:
        """The residuals: mean reading minus value of the line, rad/s, shape (k,)."""
        return self.mean - self.line


def residuals(
    calibration: Calibration,
    measured: Measured,
    rates: Array,
    model: NoiseModel,
    setting_sigma: float = 0.0,
) -> Residuals:
    """Return the residual of each steady rate from the line of a calibration of one run.

    ``rates`` is the rate of table and Earth in each block, shape (b,), rad/s; ``setting_sigma`` is
    the standard deviation of the true rate about the stated one, rad/s.
    """
    blocks = measured.blocks
    dwell, place = np.unique(blocks.dwell, return_inverse=True)
    mean_of = np.zeros((len(dwell), len(blocks)))
    mean_of[place, np.arange(len(blocks))] = blocks.count
    mean_of /= mean_of.sum(axis=1, keepdims=True)
    regressors = np.column_stack([np.ones(len(blocks)), rates])
    covariance = block_mean_covariance(model, blocks)
    covariance = covariance + setting_sigma**2 * np.equal.outer(blocks.dwell, blocks.dwell)
    covariance -= regressors @ calibration.line.covariance @ regressors.T
    variance = np.einsum("ki,ij,kj->k", mean_of, covariance, mean_of)
    return Residuals(
        dwell.astype(np.int64),
        mean_of @ measured.means[0],
        mean_of @ (regressors @ calibration.line.value[0]),
        np.sqrt(np.maximum(variance, 0.0)),
    )
