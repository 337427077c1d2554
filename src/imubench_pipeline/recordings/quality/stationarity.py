"""Is the noise the same from beginning to end? Moved sensors, warm-up, changing variance.

All of it is told from block means and spreads. A static sensor's bias walks and flickers, which
is what the benchmark measures; a finding is only what is far out of that: a step that no other
step of the log comes near, a beginning that drifts as no later part does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imubench_pipeline.recordings.quality.summary import BlockStatistics, present_median
from imubench_pipeline.typing import Array

_PARTS = 20
_FEWEST_BLOCKS = 8
"""Blocks in a part: a shorter recording says nothing about its parts."""

_SPIKY = 6.0
"""Standard deviations of a block that a knock in it reaches, and motion does not."""

_MAD = 1.4826
"""Standard deviation over the median absolute deviation, of normal noise."""


@dataclass(frozen=True)
class Step:
    """A sudden change of the mean."""

    sample: int
    """Record at which it happens, to half a window."""
    size: float
    """SI."""
    sigmas: float
    """Its size over the spread of the other steps."""
    window: int
    """Records of a window."""


@dataclass(frozen=True)
class WarmUp:
    """A beginning that drifts."""

    end: int
    """Record at which the drift is like that of the rest."""
    drift: float
    """Change of the mean over it, SI."""
    usual: float
    """Median change over a part of the rest, SI."""


def steps(blocks: BlockStatistics, sigmas: float) -> list[Step]:
    """Find sudden changes of the mean.

    ``sigmas``: how far a step lies out of the others, in their robust standard deviations.
    """
    size = max(1, len(blocks.mean) // 400)
    means = _means(blocks, size)
    if len(means) < 16:
        return []
    # Over two windows, so that a step inside a window shows whole.
    away = means[2:] - means[:-2]
    scale = _MAD * present_median(np.abs(away - present_median(away)))
    if not scale > 0.0:
        return []
    far = np.flatnonzero(np.abs(away) > sigmas * scale)
    if len(far) == 0:
        return []
    moves = []
    for group in np.split(far, np.flatnonzero(np.diff(far) > 3) + 1):
        peak = group[np.argmax(np.abs(away[group]))]
        # A step stays; what comes back at once is a knock.
        before = present_median(means[max(0, group[0] - 4) : group[0] + 1])
        after = present_median(means[group[-1] + 2 : group[-1] + 7])
        change = after - before
        if abs(change) > 0.5 * abs(float(away[peak])):
            sample = (int(peak) + 1) * size * blocks.size + size * blocks.size // 2
            moves.append(Step(sample, change, abs(float(away[peak])) / scale, size * blocks.size))
    return moves


def warm_up(blocks: BlockStatistics, times: float) -> WarmUp | None:
    """Find a beginning that drifts more than the rest.

    ``times``: how many times the median drift of a part counts.
    """
    size = len(blocks.mean) // _PARTS
    if size < _FEWEST_BLOCKS:
        return None
    drifts = np.empty(_PARTS)
    for k in range(_PARTS):
        part = blocks.mean[k * size : (k + 1) * size]
        third = size // 3
        drifts[k] = present_median(part[-third:]) - present_median(part[:third])
    rest = np.abs(drifts[_PARTS // 2 :])
    usual, first = present_median(rest), float(drifts[0])
    most = float(np.max(rest[np.isfinite(rest)], initial=0.0))
    # Parts that do not drift at all are those of a coarse register: nothing to compare with.
    if not (usual > 0.0 and abs(first) > times * usual and abs(first) > 2.0 * most):
        return None
    calm = np.flatnonzero(np.abs(drifts) < 3.0 * usual)
    end = int(calm[0]) if len(calm) else _PARTS
    drift = float(np.nansum(drifts[:end]))
    return WarmUp(end * size * blocks.size, drift, usual)


def variance_change(blocks: BlockStatistics) -> tuple[float, int, int] | None:
    """Return how many times the spread of the noisiest part is that of the calmest, and where.

    Returns
    -------
    (ratio, first, last) or None
        ``first`` and ``last`` record of the noisiest part; None for a short recording.
    """
    size = len(blocks.spread) // _PARTS
    if size < _FEWEST_BLOCKS:
        return None
    spreads = np.array(
        [present_median(part) for part in blocks.spread[: size * _PARTS].reshape(_PARTS, size)]
    )
    calm = float(np.min(spreads[spreads > 0.0], initial=np.inf))
    noisy = int(np.argmax(np.nan_to_num(spreads)))
    if not np.isfinite(calm):
        return None
    return (
        float(spreads[noisy]) / calm,
        noisy * size * blocks.size,
        (noisy + 1) * size * blocks.size,
    )


def motions(blocks: BlockStatistics, times: float, least: float = 0.0) -> list[tuple[int, int]]:
    """Return where the spread is many times the usual, and not for a knock.

    Parameters
    ----------
    times : float
        Times the median spread that count as motion.
    least : float
        Spread below which nothing does, SI.

    Returns
    -------
    list of (int, int)
        First and one-past-last record of each.
    """
    usual = present_median(blocks.spread)
    if not usual > 0.0:
        return []
    reach = np.maximum(blocks.high - blocks.mean, blocks.mean - blocks.low)
    shaken = np.flatnonzero(
        (blocks.spread > max(times * usual, least)) & (reach < _SPIKY * blocks.spread)
    )
    if len(shaken) == 0:
        return []
    groups = np.split(shaken, np.flatnonzero(np.diff(shaken) > 2) + 1)
    return [(int(group[0]) * blocks.size, (int(group[-1]) + 1) * blocks.size) for group in groups]


def _means(blocks: BlockStatistics, size: int) -> Array:
    """Return medians of the means of ``size`` blocks: one knock does not move them.

    The mean of a block of a few samples, such as the last one, is far off without any step.
    """
    whole = len(blocks.mean) // size
    mean = np.where(2 * blocks.count >= blocks.size, blocks.mean, np.nan)
    grouped = mean[: whole * size].reshape(whole, size)
    if np.isfinite(grouped).all():
        return np.median(grouped, axis=1)
    return np.array([present_median(group) for group in grouped])
