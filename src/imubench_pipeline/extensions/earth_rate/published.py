"""Compare published Earth-rate estimates with the scatter that the published noise allows.

A run is modelled as its source describes it: the schedule of turns, and the noise of the printed
figures. An estimate from pairs of dwells then scatters about the true rate with the standard
deviation of `extensions.earth_rate.pairs`. A published estimate many standard deviations away has
other errors: warm-up of the sensor, a misaligned axis, turns within the mean, or a wrong sense.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.experiment import Experiment
from imubench_pipeline.extensions.calibration.kalman import RateFilter
from imubench_pipeline.extensions.earth_rate.bound import block_length
from imubench_pipeline.extensions.earth_rate.courses import white_sigma
from imubench_pipeline.extensions.earth_rate.pairs import by_pairs
from imubench_pipeline.noise import NoiseModel

Row = dict[str, Any]

_Z_95 = 1.96
"""Half width, in standard deviations, of the interval with 95 % of the estimates."""


@dataclass(frozen=True)
class RunDesign:
    """A run as its source describes it."""

    dwell: float  # from turn to turn, s
    turning: float  # turning time within it, s
    rate: float  # sampling rate, Hz
    latitude: float  # rad

    def experiment(self, duration: float) -> Experiment:
        """Return the design of a run of this duration, s."""
        return Experiment.regular(
            dwell=self.dwell - self.turning,
            turning=self.turning,
            dwells=round(duration / self.dwell),
            rate=self.rate,
            latitude=self.latitude,
        )


def allowed_sigmas(run: RunDesign, duration: float, model: NoiseModel) -> Row:
    """Return the standard deviations by noise of the estimates of a run, rad/s; duration in s.

    ``white``: by white noise alone; ``sigma``: of the mean over pairs; ``sigma_filter``: of the
    filter.
    """
    design = run.experiment(duration)
    blocks = design.blocks(block_length(design, model))
    zero_means = np.zeros((1, len(blocks)))
    return {
        "white": white_sigma(model, blocks),
        "sigma": float(by_pairs(zero_means, blocks, model).sigma[-1]),
        "sigma_filter": float(RateFilter(blocks, model).rate_sigma[-1]),
    }


def published_row(value: float, run: RunDesign, duration: float, model: NoiseModel) -> Row:
    """Return the columns of ``earth_rate_published`` for a published estimate.

    The value is in rad/s; the duration of the run, or of a part of it, in s; the noise model as
    published.
    """
    noise = allowed_sigmas(run, duration, model)
    off = (value - EARTH_RATE) / noise["sigma"]
    verdict = "within the noise" if abs(off) <= _Z_95 else "beyond the noise"
    return noise | {
        "duration": duration,
        "published": value,
        "truth": EARTH_RATE,
        "off_sigma": off,
        "verdict": verdict,
    }
