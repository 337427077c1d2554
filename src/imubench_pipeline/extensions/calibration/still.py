"""The bias of a gyro at rest at a known place, and the quantities that are not observable.

    bias = mean reading - w,    w the Earth's rate along the axis (`pointing`).

This is the run without turning that Silva et al. leave for later (section 9). No filter can
determine the rate from it, since bias and rate enter as a sum. The fixed bias is the bias at the
first sample, by generalised least squares; the present bias is the mean of bias and drift over the
last block, by the filter of the two-position experiment with a known rate.
"""

import math
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.extensions.calibration.experiment import (
    Blocks,
    Dwell,
    Experiment,
    block_means,
)
from imubench_pipeline.extensions.calibration.kalman import RateFilter
from imubench_pipeline.extensions.calibration.least_squares import (
    LeastSquares,
    Limits,
    NotObservable,
    choose_block_length,
    compute_half_width,
    compute_limits,
)
from imubench_pipeline.extensions.calibration.pointing import Pointing
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_MIN_HEADING_SENSITIVITY = 1e-9  # least share of the rate that may depend on the heading


@dataclass(frozen=True)
class StillBias:
    """The bias of a gyro from runs at rest of one design."""

    fixed: Array  # shape (runs,); bias at the first sample of the first block, rad/s
    fixed_noise_sigma: float  # its standard error by the noise model, rad/s
    present: Array  # shape (runs,); mean of bias and slow noise over the last block, rad/s
    present_noise_sigma: float  # its standard error by the noise model, rad/s
    rate: float  # the subtracted Earth's rate along the axis, rad/s; the middle of its range
    rate_sigma: float  # its standard deviation, which adds to the noise of both biases, rad/s
    bound: float | None  # largest error of ``rate`` for an unknown heading, rad/s
    tilt_sigma: float  # standard deviation by the elevation, at the worst heading, rad/s
    p_value: Array  # shape (runs,); of a scatter at least as large; NaN for one block
    not_observable: tuple[NotObservable, ...]

    @property
    def fixed_sigma(self) -> float:
        """Standard error of the fixed bias, noise and direction together, rad/s."""
        return math.hypot(self.fixed_noise_sigma, self.rate_sigma)

    @property
    def present_sigma(self) -> float:
        """Standard error of the present bias, noise and direction together, rad/s."""
        return math.hypot(self.present_noise_sigma, self.rate_sigma)

    def fixed_interval(self) -> Limits:
        """Return limits of the fixed bias, rad/s, shapes (runs,), wider for an unknown heading."""
        return self._interval(self.fixed, self.fixed_noise_sigma)

    def present_interval(self) -> Limits:
        """Return confidence limits of the present bias, as `fixed_interval` does."""
        return self._interval(self.present, self.present_noise_sigma)

    def _interval(self, value: Array, noise: float) -> Limits:
        if self.bound is None:
            return compute_limits(value, math.hypot(noise, self.rate_sigma))
        half = compute_half_width() * math.hypot(noise, self.tilt_sigma) + self.bound
        return value - half, value + half


class StillRun:
    """A run at rest in one position: blocks (of any sense), noise model, direction of the axis."""

    def __init__(self, blocks: Blocks, model: NoiseModel, pointing: Pointing) -> None:
        self.blocks, self.pointing = blocks, pointing
        self._fixed = LeastSquares(blocks, model, np.ones((len(blocks), 1)), names=["bias"])
        self._filter = RateFilter(blocks, model, rate_sigma=0.0)

    @property
    def fixed_noise_sigma(self) -> float:
        """Standard error of the fixed bias by the noise model, rad/s; needs no data."""
        return float(self._fixed.sigma[0])

    def fit(self, means: Array) -> StillBias:
        """Estimate the bias in runs from finite block means, rad/s, shape (runs, b)."""
        pointing = self.pointing
        error = means - pointing.rate
        fit, filtered = self._fixed.fit(error), self._filter.run(error)
        open_heading = pointing.heading is None
        return StillBias(
            fit.value[:, 0],
            self.fixed_noise_sigma,
            filtered.drift[:, -1],
            float(filtered.drift_sigma[-1]),
            pointing.rate,
            pointing.rate_sigma,
            pointing.half_width if open_heading else None,
            pointing.tilt_sigma,
            fit.p_value if fit.freedom else np.full(len(means), np.nan),
            not_observable(pointing),
        )


def not_observable(pointing: Pointing) -> tuple[NotObservable, ...]:
    """Return the quantities of a gyro that are not observable in one position."""
    quantities = [
        NotObservable(
            "earth_rate",
            "in one position, only the sum of Earth's rate and bias is observable: each can be "
            "found only if the other is known",
        ),
        NotObservable(
            "scale_factor",
            "only one rate is present, so a scale factor error cannot be separated from the bias",
        ),
    ]
    if pointing.heading is None and pointing.half_width > _MIN_HEADING_SENSITIVITY * abs(
        pointing.rate
    ):
        quantities.append(
            NotObservable(
                "heading",
                "the heading is not known: besides the noise, the bias is uncertain by ± w_ie "
                "cos(latitude) cos(elevation)",
                pointing.half_width,
            )
        )
    return tuple(quantities)


def bias_at_rest(
    log: Array, rate: float, model: NoiseModel, pointing: Pointing, longest: int | None = None
) -> StillBias:
    """Return the bias of a gyro from a log at rest, rad/s, shape (n,), NaN where missing.

    The rate is in Hz. A block has ``longest`` samples at most, by default the longest without loss
    of information. Raises ValueError if the log has too few samples.
    """
    run = Experiment((Dwell(0, len(log), 1),), rate, 0.0)
    if longest is None:
        longest = choose_block_length(run, model, lambda blocks: np.ones((len(blocks), 1)))
    measured = block_means([log], run, longest)
    return StillRun(measured.blocks, model, pointing).fit(measured.means)
