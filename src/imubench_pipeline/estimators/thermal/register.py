"""Block means of a temperature register, its resolution, and jumps of the temperature.

The smooth path of a temperature is restarted where the temperature jumps (`split_at_jumps`), since
one path through a jump would be too rough everywhere. Errors during long stays in one cell of the
register do not average out (`find_cell_stays`).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
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
_MIN_JUMP_BITS = 1.5  # minimum size of a jump in least significant bits
_MIN_JUMP_RATIO = 8.0  # minimum ratio of a jump and the greatest change around it
_NEIGHBOUR_BLOCKS = 16  # blocks on each side of a jump that are compared with it
_MIN_LEVEL_BLOCKS = 5  # minimum number of blocks of a level between jumps
_MAX_JUMPS = 64  # per segment; more are the normal variation of the temperature
_MIN_STAY_CROSSINGS = 3.0  # duration of a long stay in a cell over the time to cross it


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
    step: float  # least significant bit of the register, °C; 0: unknown
    parts: tuple[slice, ...]  # blocks of each segment
    pieces: tuple[slice, ...]
    """Blocks between jumps of the temperature; equal to ``parts`` without jumps."""

    @property
    def centre(self) -> Array:
        """Middle of each block, samples."""
        return np.asarray((self.begin + self.end - 1) / 2.0)


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
    stops = np.cumsum([len(part) for part in begins])
    empty = count == 0
    parts = tuple(slice(int(b - len(p)), int(b)) for p, b in zip(begins, stops, strict=True))
    columns = [total / np.maximum(count, 1), low, high]
    mean, low, high = (np.where(empty, np.nan, column) for column in columns)
    step = estimate_resolution(levels, present)
    return Readings(begin, end, count, mean, low, high, step, parts, parts)


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


def split_at_jumps(read: Readings) -> Readings:
    """Return readings with blocks split at jumps of the temperature, and the pieces between jumps.

    The sample of a jump follows from the mean of its block. A block of a single sample is made on
    each side, so that a path that is linear between the centres of blocks jumps there. Readings
    without jumps are returned unchanged.
    """
    parts = [_find_jumps(read, part) for part in read.parts]
    if not any(parts):
        return read
    names = ("begin", "end", "count", "mean", "low", "high")
    columns: list[Array] = []
    pieces: list[slice] = []
    places: list[slice] = []
    begun = 0
    for part, jumps in zip(read.parts, parts, strict=True):
        blocks = np.array([getattr(read, name)[part] for name in names], dtype=np.float64)
        cuts: list[int] = []
        for i, sample in reversed(jumps):
            before, after = blocks[:, i - 1], blocks[:, i + 1]
            # Replace three blocks around a jump, which may be at an edge of the middle one.
            edges = sorted({before[0], sample - 1.0, float(sample), sample + 1.0, after[1]})
            made = []
            for first, last in pairwise(edges):
                level = (before if last <= sample else after).copy()
                share = (last - first) / (level[1] - level[0])
                level[:3] = first, last, max(round(level[2] * share), 1)
                made.append(level)
            around = blocks[:, : i - 1], np.array(made).T, blocks[:, i + 2 :]
            blocks = np.concatenate(around, axis=1)
            cuts = [i - 1 + edges.index(float(sample)), *(cut + len(made) - 3 for cut in cuts)]
        columns.append(blocks)
        ends = [begun, *(begun + cut for cut in cuts), begun + blocks.shape[1]]
        places.append(slice(begun, ends[-1]))
        pieces += [slice(a, b) for a, b in pairwise(ends)]
        begun = ends[-1]
    joined = np.concatenate(columns, axis=1)
    begin, end, count = joined[:3].astype(np.int64)
    mean, low, high = joined[3:]
    return Readings(begin, end, count, mean, low, high, read.step, tuple(places), tuple(pieces))


def _find_jumps(read: Readings, part: slice) -> list[tuple[int, int]]:
    """Return block (from the first of the part) and sample of each jump: the first one beyond."""
    mean = read.mean[part]
    n = len(mean)
    if n < 2 * _MIN_LEVEL_BLOCKS + 1:
        return []
    change = np.zeros(n)
    change[1:-1] = np.abs(mean[2:] - mean[:-2])
    change[~np.isfinite(change)] = 0.0
    padded = np.pad(change, _NEIGHBOUR_BLOCKS)
    around = np.lib.stride_tricks.sliding_window_view(padded, 2 * _NEIGHBOUR_BLOCKS + 1).copy()
    around[:, _NEIGHBOUR_BLOCKS - 2 : _NEIGHBOUR_BLOCKS + 3] = 0.0
    least = np.maximum(_MIN_JUMP_RATIO * around.max(axis=1), _MIN_JUMP_BITS * read.step)
    jumps: list[tuple[int, int]] = []
    for i in np.flatnonzero((change > least) & (change > 0.0)).tolist():
        if (
            change[i] < change[max(i - 2, 0) : i + 3].max()
            or not _MIN_LEVEL_BLOCKS <= i < n - _MIN_LEVEL_BLOCKS
        ):
            continue  # a block beside the jump, or too near to the end
        if jumps and i - jumps[-1][0] < _MIN_LEVEL_BLOCKS:
            continue  # on the edge of two blocks
        level = np.median(mean[i + 2 : i + _MIN_LEVEL_BLOCKS]) - np.median(
            mean[i - _MIN_LEVEL_BLOCKS + 1 : i - 1]
        )
        if not abs(level) > least[i]:
            continue  # a reading that stands out, or a gap
        before, here, after = mean[i - 1], mean[i], mean[i + 1]
        share = min(max((after - here) / (after - before), 0.0), 1.0)
        first, last = int(read.begin[part][i]), int(read.end[part][i])
        jumps.append((i, first + round(share * (last - first))))
    return jumps if len(jumps) <= _MAX_JUMPS else []


def find_cell_stays(
    inside: NDArray[np.bool_], level: Array, half: float, q: float
) -> Iterator[tuple[slice, Array]]:
    """Yield the blocks of a segment in long stays in one cell of the register, and their taper.

    The taper, shape (b,), rises from 0 where the path crosses an edge of the cell, and is therefore
    known, to 1 at a distance of one crossing time. ``inside``, shape (k,): all readings of a block
    are of one cell; ``level``, shape (k,): mean reading of a block, K; ``half``: half the width of
    a cell, K; ``q``: density of the second derivative of the path, K² per block³.
    """
    if not inside.any():
        return
    # q t^3 / 3 is the variance of an integrated random walk.
    crossing = (3.0 * (2.0 * half) ** 2 / q) ** (1.0 / 3.0)
    other = (inside[1:] != inside[:-1]) | (np.abs(np.diff(level)) > half)
    edges = np.concatenate(([0], np.flatnonzero(other) + 1, [len(inside)]))
    for begin, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        if not inside[begin] or end - begin < _MIN_STAY_CROSSINGS * crossing:
            continue
        place = np.arange(end - begin) + 0.5
        before = place if begin > 0 else math.inf
        after = end - begin - place if end < len(inside) else math.inf
        away = np.minimum(np.minimum(before, after), crossing) / crossing
        yield slice(begin, end), np.asarray(away) * np.ones(end - begin)
