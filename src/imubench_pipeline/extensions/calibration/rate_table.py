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
    CONFIDENCE_LEVEL,
    Fit,
    LeastSquares,
    Limits,
    NotObservable,
    NotObservableError,
    choose_block_length,
    compute_half_width,
    compute_limits,
)
from imubench_pipeline.extensions.calibration.pointing import Pointing
from imubench_pipeline.extensions.calibration.schedule import Schedule
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_MAX_UNKNOWN_RATE = 1e-12  # ignored unknown part of the Earth's rate along the axis, rad/s
_RATE_TOLERANCE = 1e-9  # relative difference below which two rates are equal up to rounding


@dataclass(frozen=True)
class Term:
    """A further term of the line, in runs of one design."""

    value: Array  # shape (runs,); quadratic term, s/rad, or asymmetry, over scale factor
    sigma: float  # its standard error by the noise model

    @property
    def p_value(self) -> Array:
        """Probability of a value at least as far from 0 if the line is right, shape (runs,)."""
        return np.asarray(chi2.sf((self.value / self.sigma) ** 2, 1))

    def interval(self) -> Limits:
        """Return confidence limits, shapes (runs,)."""
        return compute_limits(self.value, self.sigma)


@dataclass(frozen=True)
class Linearity:
    """The largest deviation of a rate from the line, over full scale, in runs of one design."""

    deviation: Array  # shape (runs, levels); deviation of each rate from the line, over full scale
    sigma: Array  # shape (levels,); its standard error by the noise model
    full_scale: float  # the largest rate of the test, rad/s
    p_value: Array  # shape (runs,); of deviations at least as large in total

    @property
    def value(self) -> Array:
        """The largest deviation, a fraction of full scale without sign, shape (runs,)."""
        return np.abs(self.deviation).max(axis=1)

    def interval(self) -> Limits:
        """Return limits of the largest true deviation, shapes (runs,), by Bonferroni."""
        half = compute_half_width(1.0 - (1.0 - CONFIDENCE_LEVEL) / self.sigma.size) * self.sigma
        size = np.abs(self.deviation)
        return np.maximum(size - half, 0.0).max(axis=1), (size + half).max(axis=1)


@dataclass(frozen=True)
class Calibration:
    """Bias and scale factor in runs of one design."""

    line: Fit  # bias, rad/s, at the first sample of the first block, and scale factor
    bias_sigma: float  # of the bias, with the Earth's rate along the axis, rad/s
    quadratic: Term | None  # coefficient of the square of the rate, in addition to the line, s/rad
    asymmetry: Term | None  # of the scale factors of both senses, over their mean
    linearity: Linearity | None
    not_observable: tuple[NotObservable, ...]  # reasons for missing values

    @property
    def bias(self) -> Array:
        """Bias, rad/s, shape (runs,)."""
        return self.line.value[:, 0]

    @property
    def scale_factor(self) -> Array:
        """Indicated over true rate, shape (runs,): 1 and the scale factor's error."""
        return self.line.value[:, 1]

    @property
    def scale_factor_sigma(self) -> float:
        """Its standard error."""
        return float(self.line.sigma[1])

    def bias_interval(self) -> Limits:
        """Return confidence limits of the bias, rad/s, shapes (runs,)."""
        return compute_limits(self.bias, self.bias_sigma)

    def scale_factor_interval(self) -> Limits:
        """Return confidence limits of the scale factor, shapes (runs,)."""
        return compute_limits(self.scale_factor, self.scale_factor_sigma)


class RateTable:
    """A recording on a rate table: its blocks, the gyro's noise, and the known rates.

    The blocks are of the schedule's `experiment`. Without a direction (``pointing``) the Earth's
    rate is a part of the bias. ``setting_sigma``, rad/s, is the standard deviation of the true rate
    of each stretch. Raises NotObservableError for one rate; ValueError if the deviation is
    negative, or the heading of an axis that is not vertical is missing.
    """

    def __init__(
        self,
        schedule: Schedule,
        blocks: Blocks,
        model: NoiseModel,
        pointing: Pointing | None = None,
        *,
        setting_sigma: float = 0.0,
    ) -> None:
        if not (math.isfinite(setting_sigma) and setting_sigma >= 0):
            raise ValueError(f"setting_sigma is {setting_sigma}, expected a number from 0")
        open_heading = pointing is not None and pointing.heading is None
        if pointing and open_heading and pointing.half_width > _MAX_UNKNOWN_RATE:
            raise ValueError(
                "the heading of the table's axis is not known: state it, or omit the direction; "
                "the Earth's rate is then a part of the bias"
            )
        earth = 0.0 if pointing is None else pointing.rate
        self._earth_sigma = 0.0 if pointing is None else pointing.rate_sigma
        rate = schedule.of_blocks(blocks) + earth
        # The index of each rate among the distinct ones, equal up to rounding.
        order = np.argsort(rate, kind="stable")
        risen = np.diff(rate[order], prepend=rate[order[0]]) > _RATE_TOLERANCE * np.abs(rate).max()
        self._levels = np.empty(len(rate), dtype=np.int64)
        self._levels[order] = np.cumsum(risen)
        number = int(self._levels.max()) + 1
        self._rates = np.array([rate[self._levels == level][0] for level in range(number)])
        if number < 2:
            raise NotObservableError(
                f"the table has one rate only, {rate[0]:g} rad/s: scale factor and bias cannot be "
                "separated; add another rate, best of the opposite sense"
            )
        further = setting_sigma**2 * np.equal.outer(blocks.dwell, blocks.dwell)
        ones = np.ones(len(blocks))

        def squares(*columns: Array) -> LeastSquares:
            return LeastSquares(blocks, model, np.column_stack(columns), further=further)

        self._line = squares(ones, rate)
        self._open: list[NotObservable] = []
        if pointing is None:
            self._open.append(
                NotObservable("bias", "the Earth's rate along the axis is a part of the bias")
            )
        self._quadratic = self._asymmetry = self._each = None
        if number > 2:
            self._quadratic = squares(ones, rate, rate**2)
            self._each = squares(*np.eye(number)[self._levels].T)
        else:
            for name in ("quadratic", "linearity"):
                self._open.append(NotObservable(name, "two rates always lie on a line"))
        try:
            self._asymmetry = squares(ones, rate, np.abs(rate) / 2.0)
        except NotObservableError:
            self._open.append(
                NotObservable(
                    "asymmetry",
                    "three rates with both senses are required: otherwise it cannot be separated "
                    "from bias or scale factor",
                )
            )

    @property
    def sigma(self) -> tuple[float, float]:
        """Standard errors of bias, rad/s, and scale factor; they need no data."""
        bias, scale = self._line.sigma
        return math.hypot(bias, self._earth_sigma), float(scale)

    def fit(self, means: Array) -> Calibration:
        """Estimate bias and scale factor in runs from block means, rad/s, shape (runs, b)."""
        line, quadratic, asymmetry, linearity = self._line.fit(means), None, None, None
        if (squares := self._quadratic) is not None:
            quadratic = Term(squares.fit(means).value[:, -1], float(squares.sigma[-1]))
        not_observable = list(self._open)
        if (squares := self._asymmetry) is not None:
            fit = squares.fit(means)
            scale = fit.value[:, 1]
            if np.any(np.abs(scale) <= compute_half_width() * fit.sigma[1]):
                reason = (
                    "the gyro does not follow the table, so there is no scale factor as a reference"
                )
                not_observable.append(NotObservable("asymmetry", reason))
            else:  # the error of the scale factor is of second order
                sigma = float(squares.sigma[-1] / np.abs(scale).mean())
                asymmetry = Term(fit.value[:, -1] / scale, sigma)
        if self._each is not None:
            each = self._each.fit(means)
            explained = np.maximum(line.chi_squared - each.chi_squared, 0.0)
            at_rates = np.column_stack([np.ones(len(self._rates)), self._rates])
            # The line is fitted to the same means, which reduces the covariance of the residuals.
            variance = np.diag(each.covariance - at_rates @ line.covariance @ at_rates.T)
            full_scale = float(np.abs(self._rates).max())
            linearity = Linearity(
                (each.value - line.value @ at_rates.T) / full_scale,
                np.sqrt(np.maximum(variance, 0.0)) / full_scale,
                full_scale,
                np.asarray(chi2.sf(explained, line.freedom - each.freedom)),
            )
        return Calibration(
            line, self.sigma[0], quadratic, asymmetry, linearity, tuple(not_observable)
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
    `RateTable`; ValueError also if the log ends too early, or too few samples are present.
    """
    run = schedule.experiment
    whole = max(stretch.stop - stretch.start for stretch in schedule.stretches)
    _ = RateTable(schedule, run.blocks(whole), model, pointing)
    longest = choose_block_length(
        run,
        model,
        lambda blocks: np.column_stack([np.ones(len(blocks)), schedule.of_blocks(blocks)]),
    )
    measured = block_means([log], run, longest)
    table = RateTable(schedule, measured.blocks, model, pointing, setting_sigma=setting_sigma)
    return table.fit(measured.means), measured


@dataclass(frozen=True)
class Residuals:
    """Residuals of steady rates from the line."""

    dwell: NDArray[np.int64]  # shape (k,); index in the schedule, from 0
    mean: Array  # shape (k,); mean reading, rad/s
    line: Array  # shape (k,); value of the line, rad/s
    sigma: Array  # shape (k,); standard deviation of mean less line, rad/s

    @property
    def value(self) -> Array:
        """Mean less line, rad/s, shape (k,)."""
        return self.mean - self.line


def residuals(
    calibration: Calibration,
    measured: Measured,
    rates: Array,
    model: NoiseModel,
    setting_sigma: float = 0.0,
) -> Residuals:
    """Return the residuals of each steady rate, for a calibration of one run.

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
