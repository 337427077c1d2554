"""Accuracy of the self-alignment of a triad over the time at rest, in one position and in two.

The triad is level, its nose to the north. Two positions are opposite about the vertical, with equal
amounts of data. As a check, triads are simulated from the exact distribution of their block means,
and aligned coarsely, then by the filter. If the error of the heading is too large for that, small
angles about the true attitude are compared.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.extensions.calibration.alignment.attitude import euler_angles
from imubench_pipeline.extensions.calibration.alignment.coarse import (
    coarse_alignment,
    coarse_sigma,
    mean_vectors,
)
from imubench_pipeline.extensions.calibration.alignment.fine import (
    UNIFORM_HEADING_SIGMA,
    FineAlignment,
)
from imubench_pipeline.extensions.calibration.alignment.triad import Positions, Site, Triad
from imubench_pipeline.extensions.earth_rate.simulation import simulate_runs
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class TriadRuns:
    """Simulated block means of triads at rest, with the true errors of each axis."""

    means: Array  # shape (runs, b, 6); block means of gyros and accelerometers, SI
    drift: Array  # shape (runs, b, 6); their slow errors, biases included


def true_means(positions: Positions, site: Site, attitude: Array) -> Array:
    """Return error-free readings in each block, shape (b, 6), for an attitude, shape (3, 3)."""
    to_body = np.swapaxes(attitude @ positions.of_blocks, 1, 2)
    return np.concatenate([to_body @ site.earth_rate, to_body @ site.specific_force], axis=1)


def simulate_triad(
    triad: Triad,
    positions: Positions,
    site: Site,
    attitude: Array,
    *,
    runs: int,
    rng: np.random.Generator,
) -> TriadRuns:
    """Draw the block means of many runs; ``attitude``, shape (3, 3): in the first position."""
    drawn = [
        simulate_runs(
            model, positions.blocks, earth_rate=0.0, turn_on_bias=bias, runs=runs, rng=stream
        )
        for (model, bias), stream in zip(triad.axes, rng.spawn(6), strict=True)
    ]
    errors = np.stack([runs_of_axis.means for runs_of_axis in drawn], axis=2)
    drift = np.stack([runs_of_axis.drift for runs_of_axis in drawn], axis=2)
    return TriadRuns(errors + true_means(positions, site, attitude), drift)


TURN_TIME = 2.0  # between two positions, s
# Blocks of a run, by the number of its positions; twice as many lower a sigma by 5 % at most
_BLOCKS_BY_POSITIONS = {1: 16, 2: 64}

_MAX_LINEAR_HEADING_SIGMA = 0.2  # rad, for a start from coarse alignment
_LEVEL_ATTITUDE = np.eye(3)


@dataclass(frozen=True)
class Accuracy:
    """Accuracy of the alignment of a triad after a time at rest."""

    positions: int  # 1 or 2
    method: str  # ``coarse`` or ``fine``
    time: float  # s
    sigma: Array  # shape (3,); of roll, pitch and heading, rad
    errors: Array | None = None  # shape (3,); rms of simulated errors over ``sigma``

    @property
    def reason(self) -> str | None:
        """Reason for a missing angle; None if there is none."""
        if not np.all(np.isfinite(self.sigma)):
            return (
                "the noise is so small that rounding errors hide the angles: no sensor is so "
                "quiet; check the findings about it"
            )
        if self.sigma[2] < UNIFORM_HEADING_SIGMA:
            return None
        if self.positions == 1:
            return (
                "the uncertainty of the gyro biases exceeds the horizontal part of the Earth's "
                "rate: turn the triad about the vertical, or use better gyros"
            )
        return (
            "the noise of the gyros in this time exceeds the horizontal part of the Earth's rate: "
            "record for longer, or use better gyros"
        )


def accuracies(
    triad: Triad,
    site: Site,
    rate: float,
    times: Sequence[float],
    *,
    runs: int = 0,
    rng: np.random.Generator | None = None,
) -> Iterator[Accuracy]:
    """Yield the accuracy after times, s; a simulation of ``runs`` triads checks the last time."""
    for number in (1, 2):
        for time in times:
            block = time / _BLOCKS_BY_POSITIONS[number]
            if number == 1:
                positions = Positions.at_rest(time, block, rate)
            else:
                dwell, turning = (time - TURN_TIME) / 2.0, TURN_TIME
                positions = Positions.turned_about_z(
                    [0.0, math.pi], dwell=dwell, turning=turning, block=block, rate=rate
                )
            coarse = coarse_sigma(triad, positions, site, _LEVEL_ATTITUDE)
            yield Accuracy(number, "coarse", time, coarse)
            fine = FineAlignment(triad, positions, site, _LEVEL_ATTITUDE)
            errors = None
            if runs and rng is not None and time == times[-1]:
                # Rms errors of simulated triads over the sigma of the filter.
                level, sigma = _LEVEL_ATTITUDE, fine.sigma[-1]
                drawn = simulate_triad(triad, positions, site, level, runs=runs, rng=rng).means
                if sigma[2] < _MAX_LINEAR_HEADING_SIGMA:
                    start = coarse_alignment(*mean_vectors(drawn, positions), site)
                    angles = euler_angles(fine.run(drawn, start).attitude)
                    errors = np.asarray(np.sqrt(np.mean(angles**2, axis=0)) / sigma)
                else:
                    # The angles about north, east, down are errors of roll, pitch, heading.
                    errors = np.sqrt(np.mean(fine.run(drawn).psi[:, -1] ** 2, axis=0)) / sigma
                    known = [True, True, sigma[2] < UNIFORM_HEADING_SIGMA]
                    errors = np.where(known, errors, math.nan)
            yield Accuracy(number, "fine", time, fine.sigma[-1], errors)
