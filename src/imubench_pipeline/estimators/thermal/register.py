"""What a temperature register leaves of a temperature: the means of blocks of its readings.

A temperature varies slowly. It is kept in blocks, at most `KNOTS` in a log: blocks of one sample
where the log is no longer, else of ceil(L / KNOTS) samples.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.missing import samples_present
from imubench_pipeline.typing import Array

Span = tuple[int, int]

KNOTS = 8192
"""Blocks that a log is divided into, at most (and one more a segment)."""

_LEVELS = 1 << 16
"""Different readings that are looked at for the steps of a register."""

_FEWEST_REPEATS = 8.0
"""Readings a level: rarer repeats may be by chance."""

_MOST_PARTS = 256
"""Steps in the smallest gap, at most, where few levels were read."""

_BY_CHANCE = 1e-3
"""Chance above which levels that are multiples of a step say nothing of it."""

_ROUNDED = 0.2
"""Part of a step by which readings in decimals may miss its multiples."""


@dataclass(frozen=True)
class Readings:
    """The readings of a register in blocks.

    Attributes
    ----------
    begin, end : ndarray of int, shape (k,)
        First and one-past-last sample of each block.
    count : ndarray of int, shape (k,)
        Readings present.
    mean, low, high : ndarray, shape (k,)
        °C; NaN where none is present.
    step : float
        Least significant bit of the register, °C; 0: none shows.
    parts : tuple of slice
        Blocks of each segment.
    pieces : tuple of slice
        Blocks between which the temperature jumps: the parts, where it does not.
    """

    begin: NDArray[np.int64]
    end: NDArray[np.int64]
    count: NDArray[np.int64]
    mean: Array
    low: Array
    high: Array
    step: float
    parts: tuple[slice, ...]
    pieces: tuple[slice, ...]

    @property
    def centre(self) -> Array:
        """Middle of each block, samples."""
        return np.asarray((self.begin + self.end - 1) / 2.0)


def readings(blocks: Iterable[Array], segments: Sequence[Span]) -> Readings:
    """Gather the readings of a temperature in one pass, in bounded memory.

    Parameters
    ----------
    blocks : iterable of ndarray
        Temperature in order on the grid of the log, °C; NaN where missing.
    segments : sequence of (int, int)
        First and one-past-last sample of each part that no time relates to the others.

    Raises
    ------
    ValueError
        If no reading is present.
    """
    width = max(1, -(-sum(stop - start for start, stop in segments) // KNOTS))
    begins = [np.arange(start, stop, width) for start, stop in segments]
    begin = np.concatenate(begins)
    end = np.concatenate(
        [np.minimum(b + width, stop) for b, (_, stop) in zip(begins, segments, strict=True)]
    )
    total, count = np.zeros(len(begin)), np.zeros(len(begin), dtype=np.int64)
    low, high = np.full(len(begin), np.inf), np.full(len(begin), -np.inf)
    levels: Array = np.empty(0)
    present = 0
    for place, chosen in samples_present(blocks, begin, end):
        edges = np.flatnonzero(np.diff(place, prepend=-1))
        block = place[edges]
        total[block] += np.add.reduceat(chosen, edges)
        count[block] += np.diff(np.append(edges, len(chosen)))
        low[block] = np.minimum(low[block], np.minimum.reduceat(chosen, edges))
        high[block] = np.maximum(high[block], np.maximum.reduceat(chosen, edges))
        present += len(chosen)
        if len(levels) <= _LEVELS:
            levels = np.union1d(levels, chosen)
    if present == 0:
        raise ValueError("no temperature is present")
    stops = np.cumsum([len(part) for part in begins])
    empty = count == 0
    parts = tuple(slice(int(b - len(p)), int(b)) for p, b in zip(begins, stops, strict=True))
    return Readings(
        begin,
        end,
        count,
        np.where(empty, np.nan, total / np.maximum(count, 1)),
        np.where(empty, np.nan, low),
        np.where(empty, np.nan, high),
        step_of(levels, present),
        parts,
        parts,
    )


def step_of(levels: Array, present: int) -> float:
    """Return the least significant bit of a register from the different values that it gave.

    Parameters
    ----------
    levels : ndarray, shape (n,)
        The values, rising, °C.
    present : int
        Readings that were made.

    Returns
    -------
    float
        °C. The smallest gap between values, of which all gaps are multiples, as closely as
        decimals may have rounded them; 0 where there is none, or where only one value was read
        (no step is known then) or hardly any was read twice.
    """
    if len(levels) < 2 or present < _FEWEST_REPEATS * len(levels):
        return 0.0
    gaps = np.diff(levels)
    smallest = float(gaps.min())
    # Readings printed in few decimals make gaps of one step differ; their mean does not.
    step = float(np.mean(gaps[gaps < 1.75 * smallest]))
    first = float(levels[0])
    for _ in range(2):
        multiples = np.rint((levels - first) / step)
        if multiples[-1] > multiples[0]:
            step, first = (float(value) for value in np.polyfit(multiples, levels, 1))
    if not math.isfinite(step):
        return 0.0
    missed = np.abs((levels - first) / step - multiples)
    if float(np.quantile(missed, 0.99)) <= _ROUNDED and _chance(gaps, step) < _BY_CHANCE:
        return step
    return _common_divisor(gaps)


def _chance(gaps: Array, step: float) -> float:
    """Return how likely gaps beside the smallest would be as near to multiples by chance."""
    others = np.delete(gaps, int(gaps.argmin())) / step
    if not len(others):
        return 0.0
    missed = float(np.quantile(np.abs(others - np.rint(others)), 0.99))
    return min(2.0 * missed, 1.0) ** len(others)


def _common_divisor(gaps: Array) -> float:
    """Return the greatest step of which a few gaps are multiples; 0 where chance would find one."""
    smallest = float(gaps.min())
    steps = smallest / np.arange(2, _MOST_PARTS + 1)
    return next(
        (
            float(step)
            for step in steps
            if len(gaps) > 1 and smallest / step * _chance(gaps, float(step)) < _BY_CHANCE
        ),
        0.0,
    )
