"""What a source prints of its runs, beside what the noise that it prints allows.

A run is taken as its source describes it: a turn at each time of the run, and the noise of
the printed figures. An estimate from pairs of dwells then scatters about the true rate with the
standard deviation of `experiments.earth_rate.pairs`; a published one that is many of these
away has other errors in it: a sensor that is warming up, an axis that is off, turns that are taken
into the mean, or a sense that is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.experiments.earth_rate.bound import block_length
from imubench_pipeline.experiments.earth_rate.courses import white_sigma
from imubench_pipeline.experiments.earth_rate.experiment import Experiment
from imubench_pipeline.experiments.earth_rate.kalman import RateFilter
from imubench_pipeline.experiments.earth_rate.pairs import by_pairs
from imubench_pipeline.noise import NoiseModel

Row = dict[str, Any]

_WITHIN = 1.96
"""Standard deviations, of either sign, within which 95 % of the estimates lie."""


@dataclass(frozen=True)
class RunDesign:
    """A run as its source describes it."""

    dwell: float  # from turn to turn, s
    turning: float  # of it that turning takes, s
    rate: float  # sampling rate, Hz
    latitude: float  # rad

    def experiment(self, duration: float) -> Experiment:
        """Return the design of a run of so many s."""
        return Experiment.regular(
            dwell=self.dwell - self.turning,
            turning=self.turning,
            dwells=round(duration / self.dwell),
            rate=self.rate,
            latitude=self.latitude,
        )


def allowed_sigmas(run: RunDesign, duration: float, model: NoiseModel) -> Row:
    """Return the standard deviations that noise gives the estimates of a run of so many s, rad/s.

    ``white``, by white noise alone; ``sigma``, of the mean over pairs; ``sigma_filter``.
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
    """Return what noise says of a published estimate: columns of ``earth_rate_published``.

    The value is in rad/s; the duration, s, that of the run or of the part of it; the noise model as
    published.
    """
    noise = allowed_sigmas(run, duration, model)
    off = (value - EARTH_RATE) / noise["sigma"]
    verdict = "within the noise" if abs(off) <= _WITHIN else "beyond the noise"
    return noise | {
        "duration": duration,
        "published": value,
        "truth": EARTH_RATE,
        "off_sigma": off,
        "verdict": verdict,
    }
