"""Dwells and turns in the log of a turned gyro, and the alternation of its level."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.extensions.calibration.experiment import Dwell
from imubench_pipeline.extensions.earth_rate.transients import LevelBlocks, clip_block_means
from imubench_pipeline.typing import Array

FoundBy = Literal["transient", "step", "schedule", "column"]

DETECTION_ORDER: tuple[FoundBy, ...] = ("column", "transient", "step", "schedule")
"""Ways to find a turn, the most reliable first."""

# Least size, in standard errors, of the alternations before and after an extra turn
_MIN_CONTRADICTION_SIGMAS = 3.5
# Variance of the mean of a dwell over the variance of an A-B-A difference / 4, in white noise
_WHITE_VARIANCE_RATIO = 16.0 / 6.0


@dataclass(frozen=True)
class Alternation:
    """Mean of the dwells of the first sense less the mean of both senses."""

    # value, sigma: rad/s; the difference, and its standard error
    value: float
    sigma: float

    @property
    def z(self) -> float:
        """The value in standard errors."""
        return self.value / self.sigma


@dataclass(frozen=True)
class Turn:
    """A turn of the sensor."""

    # start, stop: s from the first sample; the time left out, with the margin
    start: float
    stop: float
    time: float  # its middle as found, s
    found_by: FoundBy
    peak: float | None = None  # largest rate during it, or height of the step, rad/s
    doubts: tuple[str, ...] = ()  # in words


@dataclass(frozen=True)
class FoundDwell:
    """A dwell between two turns, or between a turn and an end of the log."""

    # start, stop: s from the first sample, without turning
    start: float
    stop: float
    sense: int  # +1 or -1
    found_by: FoundBy = "schedule"  # of the two adjacent turns, the less reliable way
    # doubts about its length and sense, in words
    doubts: tuple[str, ...] = ()

    def in_samples(self, rate: float) -> Dwell:
        """Return the dwell in samples at a rate, Hz; raise ValueError if it has none."""
        first, last = (_find_first_sample(time, rate) for time in (self.start, self.stop))
        return Dwell(first, last, self.sense)


@dataclass(frozen=True)
class Turning:
    """The dwells and turns of a log."""

    dwells: tuple[FoundDwell, ...]  # in order; the sense alternates
    turns: tuple[Turn, ...]  # in order
    # start and stop of disturbances other than turns, s; to be left out, too
    knocks: tuple[tuple[float, float], ...]
    # whether the sense of the first dwell was assumed: all senses may be inverted
    ambiguous: bool
    # level of sense +1 less the mean of both, from A-B-A differences: the Earth's rate along the
    # axis, for information only
    alternation: Alternation
    doubts: tuple[str, ...] = ()  # about the log as a whole, in words

    @property
    def by_schedule(self) -> int:
        """Number of turns that only the schedule gives."""
        return sum(turn.found_by == "schedule" for turn in self.turns)

    def senses(self, samples: int, rate: float) -> NDArray[np.int8]:
        """Return the sense of each sample, 1 or -1, and 0 where it is not to be used.

        The shape is (samples,), the rate in Hz. Missing samples count like others.
        """
        sense = np.zeros(samples, dtype=np.int8)
        for dwell in self.dwells:
            first, last = (_find_first_sample(time, rate) for time in (dwell.start, dwell.stop))
            sense[first:last] = dwell.sense
        for knock in self.knocks:
            first, last = (max(0, _find_first_sample(time, rate)) for time in knock)
            sense[first:last] = 0
        return sense


def _find_first_sample(time: float, rate: float) -> int:
    """Return the first sample not before a time, with a tolerance for rounding."""
    return int(np.ceil(time * rate - 1e-6))


def compute_differences(
    blocks: LevelBlocks, stretches: Sequence[tuple[float, float]]
) -> tuple[Array, Array]:
    """Return the A-B-A differences of the dwells, with equal signs.

    They are (-1)^i (2 m_i - m_(i-1) - m_(i+1)) / 4, rad/s, shape (n - 2,), where a drift that is
    linear over three dwells cancels; for two dwells, half their difference. They are positive if
    the sense of the first dwell reads more. Also returned is the variance of the means of the
    dwells from the noise of the blocks alone, (rad/s)^2, shape (n,). ``stretches`` are start and
    stop of the dwells, s, at least two.
    """
    total = np.concatenate(([0.0], np.cumsum(clip_block_means(blocks))))
    present = np.concatenate(([0], np.cumsum(blocks.present)))
    edges = np.clip(np.rint(np.asarray(stretches) / blocks.length), 0, len(blocks.z)).astype(int)
    count = present[edges[:, 1]] - present[edges[:, 0]]
    has = count > 0
    mean = (total[edges[:, 1]] - total[edges[:, 0]]) / np.maximum(count, 1)
    mean[~has] = np.nan
    white = np.where(has, blocks.sigma**2 / np.maximum(count, 1), np.nan)
    if len(mean) == 2:
        return np.array([0.5 * (mean[0] - mean[1])]), white
    sign = (-1.0) ** np.arange(1, len(mean) - 1)
    return sign * (2.0 * mean[1:-1] - mean[:-2] - mean[2:]) / 4.0, white


def estimate_alternation(
    blocks: LevelBlocks, stretches: Sequence[tuple[float, float]]
) -> Alternation:
    """Return the mean of the A-B-A differences, with its standard error.

    The error assumes white noise with the observed scatter, and at least the noise of the blocks.
    """
    return _average(*compute_differences(blocks, stretches))


def _average(difference: Array, white: Array) -> Alternation:
    finite = np.isfinite(difference)
    if not finite.any():
        return Alternation(0.0, math.inf)
    n = int(finite.sum())
    # If dwells have no samples, few of the others belong to a difference.
    variance = float(np.nanmean(white)) / min(len(white), n + 2)
    if n > 2:
        variance = max(
            variance, _WHITE_VARIANCE_RATIO * float(np.var(difference[finite], ddof=1)) / (n + 2)
        )
    return Alternation(float(difference[finite].mean()), math.sqrt(variance))


def find_contradiction(blocks: LevelBlocks, stretches: Sequence[tuple[float, float]]) -> int | None:
    """Return the dwell from which the alternation has the opposite sign, or None.

    An extra or a missed turn inverts the sign of all later dwells. The result only raises a doubt.
    """
    difference, white = compute_differences(blocks, stretches)
    if len(difference) < 6:
        return None
    worst, place = _MIN_CONTRADICTION_SIGMAS, None
    for k in range(3, len(difference) - 2):
        before = _average(difference[:k], white[: k + 2]).z
        after = _average(difference[k:], white[k:]).z
        size = min(abs(before), abs(after))
        if before * after < 0.0 and size > worst:
            worst, place = size, k + 1
    return place


def find_best_shift(
    blocks: LevelBlocks, turns: Array, half_width: float, longest: float, duration: float
) -> tuple[float, float, float]:
    """Return the delay of the turns that maximises the alternation.

    Only the constancy of the alternation is used, not its size or sign. All shifts share one
    standard error, so that z^2 is twice the log-likelihood. Returned are the shift, s, and the
    alternation in standard errors with and without it. The largest shift to either side is
    ``longest``, s; the turns are those of the schedule (see `split_at_turns`).
    """
    shifts = np.arange(-math.floor(longest / 0.5), math.floor(longest / 0.5) + 1) * 0.5
    alternations = []
    for shift in shifts:
        moved = turns + shift
        moved = moved[(moved > half_width) & (moved < duration - half_width)]
        alternations.append(
            estimate_alternation(blocks, split_at_turns(moved, half_width, duration))
        )
    z = np.array([shifted.value for shifted in alternations]) / np.median(
        [shifted.sigma for shifted in alternations]
    )
    best = int(np.argmax(np.abs(z)))
    return float(shifts[best]), float(z[best]), float(z[shifts == 0.0][0])


def split_at_turns(turns: Array, half_width: float, duration: float) -> list[tuple[float, float]]:
    """Return the n + 1 stretches, start and stop in s, between turns.

    ``turns`` are their middles, shape (n,); ``half_width`` is half of the time that is left out
    about each, ``duration`` the length of the log, all in s.
    """
    starts = np.concatenate(([0.0], turns + half_width))
    stops = np.concatenate((turns - half_width, [duration]))
    return list(zip(starts.tolist(), np.maximum(stops, starts).tolist(), strict=True))
