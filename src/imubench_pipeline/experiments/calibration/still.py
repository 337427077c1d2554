"""The bias of a gyro that stands still at a known place, and what a single position cannot tell.

    bias = mean reading - w,    w the Earth's rate along the axis (`pointing`).

This is the run without turning that Silva et al. leave for later (003 section 9). Given the rate,
it tells the bias; it does not tell the rate, whatever filter it is fed to: bias and rate enter as
a sum. The fixed bias is what the gyro has at the first sample, by generalised least squares; the
present one is what it has drifted to in the last block, by the filter of the two-position
experiment with a rate that is known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.experiments.calibration.least_squares import (
    LeastSquares,
    Limits,
    NotObservable,
    block_length,
    half_width,
    limits,
)
from imubench_pipeline.experiments.earth_rate.experiment import (
    Blocks,
    Dwell,
    Experiment,
    block_means,
)
from imubench_pipeline.experiments.earth_rate.kalman import RateFilter
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.settings.pointing import Pointing
from imubench_pipeline.typing import Array

_LEVEL = 1e-9
"""Part of the Earth's rate below which an axis sees nothing of the heading."""


@dataclass(frozen=True)
class StillBias:
    """The bias of a gyro from runs at rest of one design."""

    fixed: Array  # shape (runs,); bias at the first sample of the first block, rad/s
    fixed_noise_sigma: float  # its standard error by the noise model, rad/s
    present: Array  # shape (runs,); mean of bias and slow noise over the last block, rad/s
    present_noise_sigma: float  # its standard error by the noise model, rad/s
    # the Earth's rate along the axis that was taken off, rad/s; with an unknown heading the middle
    # of what it may be
    rate: float
    # standard deviation of that, which both biases have beside their noise, rad/s
    rate_sigma: float
    # where the heading is not known: how far the true rate is from that at most at the stated
    # elevation, rad/s
    bound: float | None
    # what the spread of the elevation adds to that, at the heading where it is most, rad/s
    tilt_sigma: float
    # shape (runs,); chance of a scatter of the block means at least as large, where the noise model
    # is right; NaN for one block
    p_value: Array
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
        """Return confidence limits of the fixed bias, rad/s, shapes (runs,).

        Where the heading is not known they are those of the noise, widened to either side by all
        that the Earth's rate may be: they hold for every heading.
        """
        return self._interval(self.fixed, self.fixed_noise_sigma)

    def present_interval(self) -> Limits:
        """Return confidence limits of the present bias, as `fixed_interval` does."""
        return self._interval(self.present, self.present_noise_sigma)

    def _interval(self, value: Array, noise: float) -> Limits:
        if self.bound is None:
            return limits(value, math.hypot(noise, self.rate_sigma))
        half = half_width() * math.hypot(noise, self.tilt_sigma) + self.bound
        return value - half, value + half


class StillRun:
    """A run at rest in one position: blocks, noise model, and where the axis points.

    Parameters
    ----------
    blocks : Blocks
        Neither their sense nor their latitude is used.
    model : NoiseModel
        Of the gyro, with some noise in every sample.
    pointing : Pointing
    """

    def __init__(self, blocks: Blocks, model: NoiseModel, pointing: Pointing) -> None:
        self.blocks, self.pointing = blocks, pointing
        self._fixed = LeastSquares(blocks, model, np.ones((len(blocks), 1)), names=["bias"])
        self._filter = RateFilter(blocks, model, rate_sigma=0.0)

    @property
    def fixed_noise_sigma(self) -> float:
        """Standard error of the fixed bias by the noise model, rad/s; needs no data."""
        return float(self._fixed.sigma[0])

    def fit(self, means: Array) -> StillBias:
        """Estimate the bias in runs of this design from block means, rad/s, shape (runs, b).

        Raises
        ------
        ValueError
            If there is not one finite mean a block.
        """
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
    """Return what one position does not tell of a gyro."""
    quantities = [
        NotObservable(
            "earth_rate",
            "in one position the Earth's rate and the bias enter every reading as the same sum: "
            "the rate has to be known for the bias, and the bias for the rate",
        ),
        NotObservable(
            "scale_factor",
            "one rate is sensed throughout: an error of the scale factor is a part of the bias, "
            "of that rate times the error",
        ),
    ]
    if pointing.heading is None and pointing.half_width > _LEVEL * abs(pointing.rate):
        quantities.append(
            NotObservable(
                "heading",
                "the heading is not known: the bias is told only to plus or minus w_ie "
                "cos(latitude) cos(elevation), beside its noise",
                pointing.half_width,
            )
        )
    return tuple(quantities)


def bias_at_rest(
    log: Array, rate: float, model: NoiseModel, pointing: Pointing, longest: int | None = None
) -> StillBias:
    """Return the bias of a gyro from a log at rest.

    The log is in rad/s, shape (n,); NaN where a sample is missing; the rate in Hz. A block has
    ``longest`` samples at most; by default so many that nothing is lost.

    Raises
    ------
    ValueError
        If the log is empty, or has too few samples present.
    """
    run = Experiment((Dwell(0, len(log), 1),), rate, 0.0)
    if longest is None:
        longest = block_length(run, model, lambda blocks: np.ones((len(blocks), 1)))
    measured = block_means([log], run, longest)
    return StillRun(measured.blocks, model, pointing).fit(measured.means)
