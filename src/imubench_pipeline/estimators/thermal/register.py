"""What a temperature register leaves of a temperature: the means of blocks of its readings.

A temperature varies slowly. It is kept in blocks, at most `KNOTS` in a log: blocks of one sample
where the log is no longer, else of ceil(L / KNOTS) samples.

Where a temperature jumps the smooth path of its readings begins anew (`cut_at_jumps`). A chamber
that is set to another temperature, or a sensor that is carried out, changes within a few samples by
far more than in the minutes around. One smooth path through that would have to be rough everywhere,
and would say of the levels between the jumps that they are known all too well.

Long times in one cell of the register leave more open than others (`dwells`). A path that wanders
as it does elsewhere would have left the cell: while it stays there, it moves less, and may as well
be near an edge all the time. What such a path may be off by does not average out, while the
wandering one's error does.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan.phase import Span
from imubench_pipeline.estimators.missing import samples_present
from imubench_pipeline.typing import Array

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

_STEPS = 1.5
"""Least significant bits that a jump is at least."""

_BEYOND = 8.0
"""A jump over the greatest change around it, at least."""

_AROUND = 16
"""Blocks on each side that are around."""

_FEWEST = 5
"""Blocks on each side that a level between jumps has at least."""

_MOST = 64
"""More in a segment are no jumps but how this temperature varies."""

_LONG = 3.0
"""Times that a path takes to cross a cell, from which its stay there is long."""


@dataclass(frozen=True)
class Readings:
    """The readings of a register in blocks."""

    begin: NDArray[np.int64]
    end: NDArray[np.int64]
    """(k,): first and one-past-last sample of each block."""
    count: NDArray[np.int64]  # (k,): readings present
    mean: Array
    low: Array
    high: Array
    """(k,): °C; NaN where none is present."""
    step: float  # least significant bit of the register, °C; 0: none shows
    parts: tuple[slice, ...]  # blocks of each segment
    pieces: tuple[slice, ...]
    """Blocks between which the temperature jumps: the parts, where it does not."""

    @property
    def centre(self) -> Array:
        """Middle of each block, samples."""
        return np.asarray((self.begin + self.end - 1) / 2.0)


def readings(blocks: Iterable[Array], segments: Sequence[Span]) -> Readings:
    """Gather the readings of a temperature in one pass, in bounded memory.

    The blocks are the readings in order on the grid of the log, °C, of any shape (n,), NaN where
    missing; ``segments`` first and one-past-last sample of each part that no time relates to the
    others.

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
    """Return the least significant bit of a register from the different values that it gave, °C.

    The smallest gap between the levels, shape (n,), rising, of which all gaps are multiples, as
    closely as decimals may have rounded them; 0 where there is none, or where only one value was
    read (no step is known then) or hardly any of the readings ``present`` was read twice.
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


def cut_at_jumps(read: Readings) -> Readings:
    """Return readings with the blocks cut where the temperature jumps, and a piece between jumps.

    The sample of a jump follows from the mean of the block that it falls into. A single sample
    stands on each side, so that a path that is linear between the middles of blocks jumps there.
    Readings without a jump stay as they are.
    """
    parts = [_of_part(read, part) for part in read.parts]
    if not any(jumps for jumps in parts):
        return read
    columns: list[Array] = []
    pieces: list[slice] = []
    places: list[slice] = []
    blocks_before = 0
    for part, jumps in zip(read.parts, parts, strict=True):
        blocks, cuts = _cut(read, part, jumps)
        columns.append(blocks)
        ends = [0, *cuts, blocks.shape[1]]
        places.append(slice(blocks_before, blocks_before + blocks.shape[1]))
        pieces += [slice(blocks_before + a, blocks_before + b) for a, b in pairwise(ends)]
        blocks_before += blocks.shape[1]
    begin, end, count, mean, low, high = np.concatenate(columns, axis=1)
    return replace(
        read,
        begin=begin.astype(np.int64),
        end=end.astype(np.int64),
        count=count.astype(np.int64),
        mean=mean,
        low=low,
        high=high,
        parts=tuple(places),
        pieces=tuple(pieces),
    )


def _of_part(read: Readings, part: slice) -> list[tuple[int, int]]:
    """Return block (from the first of the part) and sample of each jump: the first one beyond."""
    mean = read.mean[part]
    n = len(mean)
    if n < 2 * _FEWEST + 1:
        return []
    change = np.zeros(n)
    change[1:-1] = np.abs(mean[2:] - mean[:-2])
    change[~np.isfinite(change)] = 0.0
    padded = np.pad(change, _AROUND)
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * _AROUND + 1).copy()
    around[:, _AROUND - 2 : _AROUND + 3] = 0.0
    least = np.maximum(_BEYOND * around.max(axis=1), _STEPS * read.step)
    jumps: list[tuple[int, int]] = []
    for i in np.flatnonzero((change > least) & (change > 0.0)).tolist():
        if change[i] < change[max(i - 2, 0) : i + 3].max() or not _FEWEST <= i < n - _FEWEST:
            continue  # a block beside the jump, or too near to the end
        if jumps and i - jumps[-1][0] < _FEWEST:
            continue  # on the edge of two blocks
        level = np.median(mean[i + 2 : i + _FEWEST]) - np.median(mean[i - _FEWEST + 1 : i - 1])
        if not abs(level) > least[i]:
            continue  # a reading that stands out, or a gap
        before, here, after = mean[i - 1], mean[i], mean[i + 1]
        share = min(max((after - here) / (after - before), 0.0), 1.0)
        first, last = int(read.begin[part][i]), int(read.end[part][i])
        jumps.append((i, first + round(share * (last - first))))
    return jumps if len(jumps) <= _MOST else []


def _cut(read: Readings, part: slice, jumps: Sequence[tuple[int, int]]) -> tuple[Array, list[int]]:
    """Return the columns of a part's blocks, cut at its jumps, and the first block after each."""
    names = ("begin", "end", "count", "mean", "low", "high")
    blocks = np.array([getattr(read, name)[part] for name in names], dtype=np.float64)
    cuts: list[int] = []
    for i, sample in reversed(jumps):
        before, after = blocks[:, i - 1], blocks[:, i + 1]
        # Three blocks stand around a jump, which may fall on an edge of the middle one.
        edges = sorted({before[0], sample - 1.0, float(sample), sample + 1.0, after[1]})
        made = []
        for first, last in pairwise(edges):
            level = (before if last <= sample else after).copy()
            share = (last - first) / (level[1] - level[0])
            level[:3] = first, last, max(round(level[2] * share), 1)
            made.append(level)
        blocks = np.concatenate([blocks[:, : i - 1], np.array(made).T, blocks[:, i + 2 :]], axis=1)
        inserted = len(made) - 3
        cuts = [i - 1 + edges.index(float(sample)), *(cut + inserted for cut in cuts)]
    return blocks, cuts


@dataclass(frozen=True)
class CellStay:
    """A long time in one cell."""

    blocks: slice  # of a segment
    taper: Array
    """(b,): from 0 at the moments when the path crosses an edge of the cell, which say where it is,
    to 1 a crossing time away from them."""


def dwells(inside: NDArray[np.bool_], level: Array, half: float, q: float) -> Iterator[CellStay]:
    """Find the long times in one cell.

    Parameters
    ----------
    inside : ndarray of bool, shape (k,)
        All readings of a block are of one cell.
    level : ndarray, shape (k,)
        The mean reading of a block, K.
    half : float
        Half the width of a cell, K.
    q : float
        Density of the second derivative of the path (an integrated random walk), K² per block³.
    """
    if not inside.any():
        return
    # q t^3 / 3 is the variance of an integrated random walk.
    crossing = (3.0 * (2.0 * half) ** 2 / q) ** (1.0 / 3.0)
    other = (inside[1:] != inside[:-1]) | (np.abs(np.diff(level)) > half)
    edges = np.concatenate(([0], np.flatnonzero(other) + 1, [len(inside)]))
    for begin, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        if not inside[begin] or end - begin < _LONG * crossing:
            continue
        place = np.arange(end - begin) + 0.5
        before = place if begin > 0 else math.inf
        after = end - begin - place if end < len(inside) else math.inf
        away = np.minimum(np.minimum(before, after), crossing) / crossing
        yield CellStay(slice(begin, end), np.asarray(away) * np.ones(end - begin))
