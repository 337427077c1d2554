"""Find samples to leave out: knocks (isolated outliers) with their surroundings, straight lines."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.recordings.quality.summary import BlockStatistics, Excerpt
from imubench_pipeline.typing import Array

_BLOCKS_ON_EACH_SIDE = 16  # their median is the reference of a block without a knock
_MIN_BLOCKS_AROUND = 2  # least number of blocks with samples for the comparison
_SETTLED_SIGMAS = 4.0  # distance from the level at which a sensor has settled
_SETTLED_SAMPLES = 5  # consecutive settled samples that end a knock
_MIN_OUTLIER_STEPS = 2.0
"""Least distance of an outlier from the level, in steps of the register. Clean samples can be one
step away, and a drifting level lies between two steps. With 1.5, one knock was found in 60 clean
logs with steps of up to 6 sigma."""

_MARGIN_SAMPLES = 5  # samples on either side that are left out with a knock


@dataclass(frozen=True)
class Knock:
    """An isolated outlier with its surroundings, to be left out."""

    first: int
    last: int  # first and one-past-last record to leave out
    size: float  # largest distance from the level, over the noise of `find_outlier_blocks`


def find_outlier_blocks(
    blocks: BlockStatistics, sigmas: float, step: float | None = None
) -> tuple[NDArray[np.int64], Array, Array]:
    """Return the indices of blocks with an outlier, level and noise around them, SI, shape (n,).

    The level is the median of the means of the 4 nearest blocks. The noise is the median standard
    deviation of 16 blocks on either side, at least 2 ``step`` / ``sigmas``. ``sigmas``: least
    distance of an outlier, standard deviations. ``step``: least significant bit, SI; None: none.
    """
    least = _MIN_OUTLIER_STEPS * (step or 0.0) / sigmas
    filled = np.isfinite(blocks.spread)
    usual = np.median(blocks.spread[filled]) if filled.any() else np.inf
    reach = np.maximum(blocks.high - blocks.mean, blocks.mean - blocks.low)
    quick = np.flatnonzero(reach > 0.5 * sigmas * usual)
    number, levels, noises = [], [], []
    for k in quick:
        around = np.r_[max(0, k - _BLOCKS_ON_EACH_SIDE) : k, k + 1 : k + _BLOCKS_ON_EACH_SIDE + 1]
        around = around[(around < len(blocks.mean))]
        around = around[np.isfinite(blocks.mean[around])]
        if len(around) < _MIN_BLOCKS_AROUND:
            continue
        near = around[np.argsort(np.abs(around - k))[:4]]
        level = float(np.median(blocks.mean[near]))
        noise = float(np.median(blocks.spread[around]))
        noise = max(noise, least) if noise > 0.0 else 0.0
        if max(blocks.high[k] - level, level - blocks.low[k]) > sigmas * noise > 0.0:
            number.append(int(k))
            levels.append(level)
            noises.append(noise)
    return np.array(number, dtype=np.int64), np.array(levels), np.array(noises)


def find_knocks(
    pieces: Iterable[Array],
    blocks: BlockStatistics,
    sigmas: float,
    longest: int,
    step: float | None = None,
) -> Iterator[Knock]:
    """Yield the knocks of a column; for the other parameters see `find_outlier_blocks`.

    ``pieces``: the column in order, SI. ``longest``: longest knock, records; a longer one is
    motion.
    """
    number, level, noise = find_outlier_blocks(blocks, sigmas, step)
    if len(number) == 0:
        return
    wanted = {int(k): i for i, k in enumerate(number)}
    reached = 0
    for k, values in enumerate(_split_into_blocks(pieces, blocks.size)):
        if k in wanted:
            i = wanted[k]
            away = np.abs(values - level[i]) / noise[i]
            for first, last in _find_events(away, sigmas):
                if last - first <= longest:
                    begin, end = reached + first - _MARGIN_SAMPLES, reached + last + _MARGIN_SAMPLES
                    yield Knock(begin, end, float(np.nanmax(away[first:last])))
        reached += len(values)


def _split_into_blocks(pieces: Iterable[Array], size: int) -> Iterator[Array]:
    rest = np.empty(0)
    for piece in pieces:
        joined = np.concatenate((rest, piece)) if len(rest) else piece
        whole = len(joined) // size * size
        yield from joined[:whole].reshape(-1, size)
        rest = joined[whole:]
    if len(rest):
        yield rest


def _find_events(away: Array, sigmas: float) -> Iterator[tuple[int, int]]:
    """Yield first and one-past-last sample of each event around an outlier."""
    out = np.flatnonzero(away > sigmas)
    calm = ~(away > _SETTLED_SIGMAS)
    reached = 0
    for peak in out:
        if peak < reached:
            continue
        first, last = int(peak), int(peak) + 1
        while first > reached and not calm[max(reached, first - _SETTLED_SAMPLES) : first].all():
            first -= 1
        while last < len(away) and not calm[last : last + _SETTLED_SAMPLES].all():
            last += 1
        reached = last
        yield first, last


_ROUNDING = 16.0 * np.finfo(np.float64).eps  # of a second difference, over the largest sample
_CALM = 0.02  # Second differences below it, over their standard deviation, are not noise
_MEDIAN_OF_NORMAL = 0.6745  # Median of the absolute value of a standard normal variate
_DENSITY_OF_NORMAL = 0.8  # Probability of absolute values below x is nearly 0.8 x
_MAX_CHANCE = 1e-3  # Of one such run anywhere in a log without interpolated samples
_MIN_RUN = 3  # samples
_MIN_SAMPLES = 1000
_MAX_SHARE = 0.2  # Beyond it the log was interpolated to a higher rate, and not at gaps


@dataclass(frozen=True)
class StraightLines:
    """Rule for interpolated samples: consecutive second differences up to a tolerance."""

    tolerance: float  # SI
    least: int  # consecutive samples


def detect_interpolation(pieces: Iterable[Excerpt], records: int) -> list[StraightLines]:
    """Return the rules that find interpolated samples; none in a log without any.

    Samples on a straight line have a second difference of 0, to the rounding of float64, or of the
    digits of a file. If noise has such a difference with probability p, then n of them follow each
    other with probability p^n. ``records`` is the number of records of the column.
    """
    parts = [piece.values for piece in pieces if len(piece.values) > 2]
    second = np.concatenate([np.abs(np.diff(part, 2)) for part in parts]) if parts else np.empty(0)
    second = second[np.isfinite(second)]
    if len(second) < _MIN_SAMPLES:
        return []
    deviation = float(np.median(second)) / _MEDIAN_OF_NORMAL
    if not deviation > 0.0:
        return []
    largest = float(np.nanmax([np.nanmax(np.abs(part), initial=0.0) for part in parts]))
    rules = []
    for tolerance in (_ROUNDING * largest, _CALM * deviation):
        number = 0
        for part in parts:
            calm = np.abs(np.diff(part, 2)) <= tolerance
            number += int((calm[1:-1] & ~calm[:-2] & ~calm[2:]).sum())
        single = number / len(second)
        chance = min(max(_DENSITY_OF_NORMAL * tolerance / deviation, single, 1e-6), 0.9)
        needed = math.ceil(math.log(_MAX_CHANCE / records) / math.log(chance))
        rule = StraightLines(tolerance, max(_MIN_RUN, needed))
        found = sum(int(mark_straight_lines(part, [rule]).sum()) for part in parts)
        if 0 < found <= _MAX_SHARE * len(second):
            rules.append(rule)
    return rules


def mark_straight_lines(values: Array, rules: Iterable[StraightLines]) -> NDArray[np.bool_]:
    """Return which samples lie on straight lines between their neighbours, bool, shape (n,)."""
    marked = np.zeros(len(values), dtype=np.bool_)
    if len(values) < 3:
        return marked
    second = np.abs(np.diff(values, 2))
    for rule in rules:
        for first, last in _list_runs(second <= rule.tolerance):
            constant = values[last + 1] == values[first]  # repeats, and no line
            if last - first >= rule.least and not constant:
                marked[first + 1 : last + 1] = True
    return marked


def _list_runs(calm: NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], calm.astype(np.int8), [0]))))
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]
