"""Alternation of the level of a log from dwell to dwell, for an unknown Earth's rate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.extensions.earth_rate.transients import LevelBlocks, calm_means
from imubench_pipeline.typing import Array

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


def differences(
    blocks: LevelBlocks, stretches: Sequence[tuple[float, float]]
) -> tuple[Array, Array]:
    """Return the A-B-A differences of the dwells, with equal signs.

    They are (-1)^i (2 m_i - m_(i-1) - m_(i+1)) / 4, rad/s, shape (n - 2,), where a drift that is
    linear over three dwells cancels; for two dwells, half their difference. They are positive if
    the sense of the first dwell reads more. Also returned is the variance of the means of the
    dwells from the noise of the blocks alone, (rad/s)^2, shape (n,). ``stretches`` are start and
    stop of the dwells, s, at least two.
    """
    total = np.concatenate(([0.0], np.cumsum(calm_means(blocks))))
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


def alternation(blocks: LevelBlocks, stretches: Sequence[tuple[float, float]]) -> Alternation:
    """Return the mean of the A-B-A differences, with its standard error.

    The error assumes white noise with the observed scatter, and at least the noise of the blocks.
    """
    return _average(*differences(blocks, stretches))


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


def contradiction(blocks: LevelBlocks, stretches: Sequence[tuple[float, float]]) -> int | None:
    """Return the dwell from which the alternation has the opposite sign, or None.

    An extra or a missed turn inverts the sign of all later dwells. The result only raises a doubt.
    """
    difference, white = differences(blocks, stretches)
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


def best_shift(
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
        alternations.append(alternation(blocks, split_at_turns(moved, half_width, duration)))
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
