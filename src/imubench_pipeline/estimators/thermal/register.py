"""Block means of the readings of a temperature register, and its resolution."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan.phase import Span
from imubench_pipeline.estimators.missing import yield_present_samples
from imubench_pipeline.typing import Array

MAX_BLOCKS = 8192  # maximum number of blocks of a log (plus one per segment)
_MAX_LEVELS = 1 << 16  # maximum number of distinct readings from which the resolution is estimated
_MIN_READINGS_PER_LEVEL = 8.0  # minimum readings per level; fewer repetitions may be chance
_MAX_DIVISOR = 256  # maximum number of steps in the smallest gap, where few levels were read
_MAX_CHANCE = 1e-3  # maximum probability that levels are multiples of a step by chance
_MAX_ROUNDING = 0.2  # maximum deviation of decimal readings from multiples of a step, in steps


@dataclass(frozen=True)
class Readings:
    """The readings of a register in blocks that have at least one."""

    centre: Array  # (k,): middle of each block, samples
    count: NDArray[np.int64]  # (k,): readings present
    mean: Array
    low: Array
    high: Array
    """(k,): °C."""
    step: float  # least significant bit of the register, °C; 0: unknown
    parts: tuple[slice, ...]  # blocks of each segment


def gather_readings(blocks: Iterable[Array], segments: Sequence[Span]) -> Readings:
    """Return the block means of temperature readings, °C, NaN where missing, in one pass.

    Raises ValueError if no reading is present.
    """
    width = max(1, -(-sum(stop - start for start, stop in segments) // MAX_BLOCKS))
    begins = [np.arange(start, stop, width) for start, stop in segments]
    begin = np.concatenate(begins)
    end = np.concatenate(
        [np.minimum(b + width, stop) for b, (_, stop) in zip(begins, segments, strict=True)]
    )
    total, count = np.zeros(len(begin)), np.zeros(len(begin), dtype=np.int64)
    low, high = np.full(len(begin), np.inf), np.full(len(begin), -np.inf)
    levels: Array = np.empty(0)
    for place, chosen in yield_present_samples(blocks, begin, end):
        edges = np.flatnonzero(np.diff(place, prepend=-1))
        block = place[edges]
        total[block] += np.add.reduceat(chosen, edges)
        count[block] += np.diff(np.append(edges, len(chosen)))
        low[block] = np.minimum(low[block], np.minimum.reduceat(chosen, edges))
        high[block] = np.maximum(high[block], np.maximum.reduceat(chosen, edges))
        if len(levels) <= _MAX_LEVELS:
            levels = np.union1d(levels, chosen)
    present = int(count.sum())
    if present == 0:
        raise ValueError("no temperature is present")
    for first, last in pairwise(np.cumsum([0, *(len(part) for part in begins)])):
        if not count[first:last].any():  # a segment without readings has no effect
            total[first], count[first] = total.sum() / present, 1
            low[first], high[first] = low.min(), high.max()
    there = count > 0
    stops = np.cumsum([0, *(len(part) for part in begins)])
    kept = np.concatenate(([0], np.cumsum(there)))[stops]
    parts = tuple(slice(int(a), int(b)) for a, b in pairwise(kept))
    return Readings(
        centre=((begin + end - 1) / 2.0)[there],
        count=count[there],
        mean=total[there] / count[there],
        low=low[there],
        high=high[there],
        step=estimate_resolution(levels, present),
        parts=parts,
    )


def estimate_resolution(levels: Array, present: int) -> float:
    """Return the least significant bit of a register from its distinct readings, °C; 0: unknown.

    It is the smallest gap between the levels, shape (n,), ascending, if all gaps are multiples of
    it within decimal rounding, and enough of the readings ``present`` are repeated.
    """
    if len(levels) < 2 or present < _MIN_READINGS_PER_LEVEL * len(levels):
        return 0.0
    gaps = np.diff(levels)
    smallest = float(gaps.min())
    # Decimal rounding makes gaps of one step differ; their mean is unaffected.
    step, first = float(np.mean(gaps[gaps < 1.75 * smallest])), float(levels[0])
    for _ in range(2):
        multiples = np.rint((levels - first) / step)
        if multiples[-1] > multiples[0]:
            step, first = (float(value) for value in np.polyfit(multiples, levels, 1))
    if not math.isfinite(step):
        return 0.0
    missed = np.abs((levels - first) / step - multiples)
    regular = float(np.quantile(missed, 0.99)) <= _MAX_ROUNDING
    if regular and _compute_chance(gaps, step) < _MAX_CHANCE:
        return step
    if len(gaps) < 2:
        return 0.0
    # Few levels: the greatest step that divides all gaps, unless it may do so by chance.
    for step in smallest / np.arange(2, _MAX_DIVISOR + 1):
        if smallest / step * _compute_chance(gaps, float(step)) < _MAX_CHANCE:
            return float(step)
    return 0.0


def _compute_chance(gaps: Array, step: float) -> float:
    """Return the probability that the other gaps are as near to multiples of a step by chance."""
    others = np.delete(gaps, int(gaps.argmin())) / step
    if not len(others):
        return 0.0
    missed = float(np.quantile(np.abs(others - np.rint(others)), 0.99))
    return min(2.0 * missed, 1.0) ** len(others)
