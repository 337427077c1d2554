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
    Estimated,
    LeastSquares,
    NotObservable,
    choose_block_length,
    compute_half_width,
    make_estimated,
)
from imubench_pipeline.extensions.calibration.pointing import Pointing
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_MIN_HEADING_SENSITIVITY = 1e-9  # least share of the rate that may depend on the heading


@dataclass(frozen=True)
class StillBias:
    """The bias of a gyro from runs at rest; the limits include an unknown heading."""

    fixed: Estimated  # bias at the first sample of the first block, rad/s
    present: Estimated  # mean of bias and slow noise over the last block, rad/s
    bound: float | None  # largest error of the subtracted rate for an unknown heading, rad/s
    p_value: Array  # shape (runs,); of a scatter at least as large; NaN for one block
    not_observable: tuple[NotObservable, ...]


def fit_bias_at_rest(
    blocks: Blocks, means: Array, model: NoiseModel, pointing: Pointing
) -> StillBias:
    """Estimate the bias in runs in one position from finite block means, rad/s, (runs, b)."""
    error = means - pointing.rate
    fit = LeastSquares(blocks, model, np.ones((len(blocks), 1))).fit(error)
    filtered = RateFilter(blocks, model, rate_sigma=0.0).run(error)
    bound = pointing.half_width if pointing.heading is None else None

    def estimate(value: Array, noise: float) -> Estimated:
        sigma = math.hypot(noise, pointing.rate_sigma)
        if bound is None:
            return make_estimated(value, sigma, noise)
        half = compute_half_width() * math.hypot(noise, pointing.tilt_sigma) + bound
        return Estimated(value, sigma, noise, value - half, value + half)

    return StillBias(
        estimate(fit.value[:, 0], float(fit.sigma[0])),
        estimate(filtered.drift[:, -1], float(filtered.drift_sigma[-1])),
        bound,
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


def bias_at_rest(log: Array, rate: float, model: NoiseModel, pointing: Pointing) -> StillBias:
    """Return the bias of a gyro from a log at rest, rad/s, shape (n,), NaN where missing.

    The rate is in Hz. Raises ValueError if the log has too few samples.
    """
    run = Experiment((Dwell(0, len(log), 1),), rate, 0.0)
    longest = choose_block_length(run, model, lambda blocks: np.ones((len(blocks), 1)))
    measured = block_means([log], run, longest)
    return fit_bias_at_rest(measured.blocks, measured.means, model, pointing)
