"""Test the stationarity of a column: steps of the mean, warm-up, changing variance, motion.

All tests use block means and standard deviations. Random walk and flicker noise are no findings:
only a step far larger than the others, or a first drift far above any later drift, is reported.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imubench_pipeline.recordings.quality.summary import BlockStatistics, compute_finite_median

_NUMBER_OF_PARTS = 20
_MIN_BLOCKS_PER_PART = 8  # least number of blocks in a part; a shorter recording is not tested
_MAX_MOTION_CREST_FACTOR = 6.0  # of extremes over deviation; a knock exceeds it
_SD_OVER_MAD = 1.4826  # standard deviation over the median absolute deviation, of normal noise


@dataclass(frozen=True)
class Step:
    """A sudden change of the mean."""

    sample: int  # record of the step, to half a window
    size: float  # SI
    sigmas: float  # size over the robust standard deviation of all steps
    window: int  # records of a window


@dataclass(frozen=True)
class WarmUp:
    """A beginning that drifts."""

    end: int  # record from which the drift is as small as in the rest
    drift: float  # change of the mean during the warm-up, SI
    usual: float  # median change over a part of the rest, SI


def find_steps(blocks: BlockStatistics, sigmas: float) -> list[Step]:
    """Find sudden changes of the mean by ``sigmas`` robust standard deviations of all steps."""
    size = max(1, len(blocks.mean) // 400)
    # Medians are robust to knocks. The means of blocks with few samples scatter too much.
    mean = np.where(2 * blocks.count >= blocks.size, blocks.mean, np.nan)
    grouped = mean[: len(mean) // size * size].reshape(-1, size)
    means = np.array([compute_finite_median(group) for group in grouped])
    if len(means) < 16:
        return []
    # Difference over two windows, so that a step inside a window counts in full.
    away = means[2:] - means[:-2]
    scale = _SD_OVER_MAD * compute_finite_median(np.abs(away - compute_finite_median(away)))
    if not scale > 0.0:
        return []
    far = np.flatnonzero(np.abs(away) > sigmas * scale)
    if len(far) == 0:
        return []
    moves = []
    for group in np.split(far, np.flatnonzero(np.diff(far) > 3) + 1):
        peak = group[np.argmax(np.abs(away[group]))]
        # A step lasts; a change that reverses at once is a knock.
        before = compute_finite_median(means[max(0, group[0] - 4) : group[0] + 1])
        after = compute_finite_median(means[group[-1] + 2 : group[-1] + 7])
        change = after - before
        if abs(change) > 0.5 * abs(float(away[peak])):
            sample = (int(peak) + 1) * size * blocks.size + size * blocks.size // 2
            moves.append(Step(sample, change, abs(float(away[peak])) / scale, size * blocks.size))
    return moves


def find_warm_up(blocks: BlockStatistics, times: float) -> WarmUp | None:
    """Find a beginning that drifts more than `times` the median drift of the later parts."""
    size = len(blocks.mean) // _NUMBER_OF_PARTS
    if size < _MIN_BLOCKS_PER_PART:
        return None
    drifts = np.empty(_NUMBER_OF_PARTS)
    for k in range(_NUMBER_OF_PARTS):
        part = blocks.mean[k * size : (k + 1) * size]
        third = size // 3
        drifts[k] = compute_finite_median(part[-third:]) - compute_finite_median(part[:third])
    rest = np.abs(drifts[_NUMBER_OF_PARTS // 2 :])
    usual, first = compute_finite_median(rest), float(drifts[0])
    most = float(np.max(rest[np.isfinite(rest)], initial=0.0))
    # Later parts of a coarse register may not drift at all; then there is no reference.
    if not (usual > 0.0 and abs(first) > times * usual and abs(first) > 2.0 * most):
        return None
    calm = np.flatnonzero(np.abs(drifts) < 3.0 * usual)
    end = int(calm[0]) if len(calm) else _NUMBER_OF_PARTS
    drift = float(np.nansum(drifts[:end]))
    return WarmUp(end * size * blocks.size, drift, usual)


def find_variance_change(blocks: BlockStatistics) -> tuple[float, int, int] | None:
    """Return the ratio of largest to smallest noise of a part, and the noisiest records."""
    size = len(blocks.spread) // _NUMBER_OF_PARTS
    if size < _MIN_BLOCKS_PER_PART:
        return None
    parts = blocks.spread[: size * _NUMBER_OF_PARTS].reshape(_NUMBER_OF_PARTS, size)
    spreads = np.array([compute_finite_median(part) for part in parts])
    calm = float(np.min(spreads[spreads > 0.0], initial=np.inf))
    noisy = int(np.argmax(np.nan_to_num(spreads)))
    if not np.isfinite(calm):
        return None
    records = size * blocks.size
    return float(spreads[noisy]) / calm, noisy * records, (noisy + 1) * records


def find_motion(blocks: BlockStatistics, times: float, least: float = 0.0) -> list[tuple[int, int]]:
    """Return the parts (first, one past last record) with a large deviation that no knock explains.

    ``times``, ``least``: lower limits of the standard deviation, over its median and in SI.
    """
    usual = compute_finite_median(blocks.spread)
    if not usual > 0.0:
        return []
    reach = np.maximum(blocks.high - blocks.mean, blocks.mean - blocks.low)
    shaken = np.flatnonzero(
        (blocks.spread > max(times * usual, least))
        & (reach < _MAX_MOTION_CREST_FACTOR * blocks.spread)
    )
    if len(shaken) == 0:
        return []
    groups = np.split(shaken, np.flatnonzero(np.diff(shaken) > 2) + 1)
    return [(int(group[0]) * blocks.size, (int(group[-1]) + 1) * blocks.size) for group in groups]
