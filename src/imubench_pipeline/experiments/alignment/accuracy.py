"""How well a triad aligns itself as the time at rest grows, in one position and in two.

The triad is level, its nose to the north: the accuracy of the heading is that of the east gyro. Two
positions are opposite about the vertical, with as much data each. Coarse alignment is that of means
(`coarse`), fine that of the filter (`fine`). As a check triads are simulated from the exact
distribution of their block means, aligned coarsely and then by the filter; the root mean square of
their errors over the standard deviation that the filter states is 1 where that is right. Where the
heading is not small enough for that, small angles about the true attitude are compared.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.experiments.alignment.attitude import euler_angles
from imubench_pipeline.experiments.alignment.coarse import (
    coarse_accuracy,
    coarse_alignment,
    mean_vectors,
)
from imubench_pipeline.experiments.alignment.fine import OPEN, FineAlignment
from imubench_pipeline.experiments.alignment.triad import Positions, Site, Triad
from imubench_pipeline.experiments.earth_rate.simulation import simulate_runs
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class TriadRuns:
    """Simulated runs of one design, and their truth."""

    # shape (runs, b, 6); block means of gyros and accelerometers x, y, z, rad/s and m/s^2
    means: Array
    # shape (runs, b, 6); mean of each axis' slow error over each block, its bias included
    drift: Array


def true_means(positions: Positions, site: Site, attitude: Array) -> Array:
    """Return what a triad without error shows, rad/s and m/s^2, shape (b, 6).

    Gyros and accelerometers x, y, z, at an attitude in the first position, shape (3, 3).
    """
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
    """Draw the block means of many runs; the fixed biases are drawn for each.

    The attitude is that in the first position, shape (3, 3).
    """
    drawn = [
        simulate_runs(
            model, positions.blocks, earth_rate=0.0, turn_on_bias=bias, runs=runs, rng=stream
        )
        for (model, bias), stream in zip(triad.axes, rng.spawn(6), strict=True)
    ]
    errors = np.stack([runs_of_axis.means for runs_of_axis in drawn], axis=2)
    drift = np.stack([runs_of_axis.drift for runs_of_axis in drawn], axis=2)
    return TriadRuns(errors + true_means(positions, site, attitude), drift)


TURNING = 2.0
"""Time between two positions, s."""

_BLOCKS = {1: 16, 2: 64}
"""Blocks of a run, by the number of its positions: twice as many lower a sigma by 5 % at most, and
that after an hour in two positions."""

_LINEAR = 0.2
"""Standard deviation of a heading up to which the filter corrects that of means, rad."""

_LEVEL = np.eye(3)


@dataclass(frozen=True)
class Accuracy:
    """How well attitude is known after a time."""

    positions: int  # 1 or 2
    method: str  # ``coarse`` or ``fine``
    time: float  # s
    sigma: Array  # shape (3,); of roll, pitch and heading, rad
    # shape (3,); rms of simulated errors over these; NaN where there is no heading
    errors: Array | None = None
    simulated: int = 0  # triads of that check

    @property
    def reason(self) -> str | None:
        """Why an angle is missing; None where all are there."""
        if not np.all(np.isfinite(self.sigma)):
            return (
                "the noise is so small that rounding errors hide the angles: no sensor is that "
                "quiet, look at the findings about it"
            )
        if self.sigma[2] < OPEN:
            return None
        if self.positions == 1:
            return (
                "what is not known of the gyros' biases is more than the horizontal part of the "
                "Earth's rate: it takes turns about the vertical, or better gyros"
            )
        return (
            "the noise of the gyros in this time is more than the horizontal part of the Earth's "
            "rate: it takes longer, or better gyros"
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
    """Yield how well a triad aligns itself in these times, in one position and in two.

    The rate is that of sampling, Hz; the times rise, each longer than the turn between two
    positions, s. So many ``runs`` are simulated by ``rng`` at the last time, for fine alignment; 0:
    none.
    """
    for number in (1, 2):
        for time in times:
            positions = _positions(number, time, rate)
            coarse = coarse_accuracy(triad, positions, site, _LEVEL)
            yield Accuracy(number, "coarse", time, coarse.sigma)
            fine = FineAlignment(triad, positions, site, _LEVEL)
            errors = None
            if runs and rng is not None and time == times[-1]:
                errors = _errors(triad, site, fine, runs, rng)
            yield Accuracy(
                number, "fine", time, fine.sigma[-1], errors, 0 if errors is None else runs
            )


def _positions(number: int, time: float, rate: float) -> Positions:
    block = time / _BLOCKS[number]
    if number == 1:
        return Positions.at_rest(time, block, rate)
    dwell = (time - TURNING) / 2.0
    return Positions.turned_about_z(
        [0.0, math.pi], dwell=dwell, turning=TURNING, block=block, rate=rate
    )


def _errors(
    triad: Triad, site: Site, fine: FineAlignment, runs: int, rng: np.random.Generator
) -> Array:
    """Return the rms of the errors of simulated triads over the sigma that the filter states."""
    drawn = simulate_triad(triad, fine.positions, site, _LEVEL, runs=runs, rng=rng)
    sigma = fine.sigma[-1]
    if sigma[2] < _LINEAR:
        start = coarse_alignment(*mean_vectors(drawn.means, fine.positions), site)
        aligned = fine.run(drawn.means, start)
        return np.asarray(np.sqrt(np.mean(euler_angles(aligned.attitude) ** 2, axis=0)) / sigma)
    # Level and to the north: attitude is off by the angles about north, east and down.
    ratios = np.sqrt(np.mean(fine.run(drawn.means).psi[:, -1] ** 2, axis=0)) / sigma
    return np.where([True, True, sigma[2] < OPEN], ratios, math.nan)
