"""What is counted of one column while it streams past: extremes, repeats, steps, block statistics.

One pass, a few nanoseconds a sample. What it means is decided afterwards, by the other modules of
this package, when the whole column is known.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit

from imubench_pipeline.recordings.quality.blocks import FIRST_SIZE, BlockStatistics, Gathering
from imubench_pipeline.recordings.quality.excerpts import Excerpt, Excerpts
from imubench_pipeline.recordings.quality.repeats import Repeats
from imubench_pipeline.typing import Array

LARGEST = 1e75
"""SI. What is larger was never measured; its fourth power would overflow. It counts as infinite."""

_PRESENT, _MISSING, _INFINITE, _LOW, _HIGH, _AT_LOW, _AT_HIGH = range(7)
_LAST, _RUN, _LONGEST, _LONGEST_END, _REPEATS, _STEP, _TAKEN = range(7, 14)
_FILLED, _COUNT, _SUM, _SQUARES, _LEAST, _MOST, _SHIFT = range(14, 21)
_PAIRS, _FAR_PAIRS, _FAR_REPEATS, _CHANGES, _SINGLE = range(21, 26)
_GAP, _LONGEST_GAP, _GAP_END = range(26, 29)
_SIZE = 29

FAR = 64
"""Samples between two that no usual low-pass makes alike."""

_ONE_STEP = 1.5
"""Least steps that are not one: the steps of printed figures may differ by a digit."""


def _start() -> Array:
    state = np.zeros(_SIZE)
    state[[_LOW, _LEAST, _STEP]] = np.inf
    state[[_HIGH, _MOST]] = -np.inf
    state[[_LAST, _SHIFT]] = np.nan
    return state


@dataclass
class ColumnSummary:
    """A column as it streams past; NaN is a missing sample."""

    _state: Array = field(default_factory=_start)
    _blocks: Gathering = field(default_factory=Gathering)
    _excerpts: Excerpts = field(default_factory=Excerpts)
    repeated: Repeats = field(default_factory=Repeats)

    def add(self, values: Array) -> Array:
        """Count a piece of the column and return it with what is not finite made missing."""
        rows = np.empty((len(values) // FIRST_SIZE + 2, 5))
        number, infinite = _take(np.ascontiguousarray(values), self._state, rows)
        if number:
            self._blocks.add(rows[:number])
        finite = np.where(np.abs(values) <= LARGEST, values, np.nan) if infinite else values
        self._excerpts.add(finite)
        self.repeated.add(finite)
        return finite

    @property
    def present(self) -> int:
        """Samples that are finite numbers."""
        return int(self._state[_PRESENT])

    @property
    def missing(self) -> int:
        """Records without a number."""
        return int(self._state[_MISSING])

    @property
    def not_finite(self) -> int:
        """Infinities, and figures beyond `LARGEST`."""
        return int(self._state[_INFINITE])

    @property
    def longest_gap(self) -> tuple[int, int]:
        """Length of the longest run of records without a finite number, and one past its end."""
        return int(self._state[_LONGEST_GAP]), int(self._state[_GAP_END])

    @property
    def low(self) -> float:
        """Lowest sample, SI."""
        return float(self._state[_LOW])

    @property
    def high(self) -> float:
        """Highest sample, SI."""
        return float(self._state[_HIGH])

    @property
    def at_extremes(self) -> tuple[int, int]:
        """Samples at the lowest and at the highest value."""
        return int(self._state[_AT_LOW]), int(self._state[_AT_HIGH])

    @property
    def longest_run(self) -> tuple[int, int]:
        """Length of the longest run of one value, and the record one past its end."""
        return int(self._state[_LONGEST]), int(self._state[_LONGEST_END])

    @property
    def repeats(self) -> int:
        """Samples that equal the one before."""
        return int(self._state[_REPEATS])

    @property
    def pairs(self) -> int:
        """Neighbours that were compared: in all pieces in which any are equal."""
        return int(self._state[_PAIRS])

    @property
    def far_pairs(self) -> int:
        """Samples that were compared with that `FAR` before, where neighbours were."""
        return int(self._state[_FAR_PAIRS])

    @property
    def far_repeats(self) -> int:
        """Samples among them that equal that."""
        return int(self._state[_FAR_REPEATS])

    @property
    def steps(self) -> int:
        """Neighbours that differ, as far as they were compared since the smallest step."""
        return int(self._state[_CHANGES])

    @property
    def single_steps(self) -> int:
        """Neighbours among them that differ by the smallest step."""
        return int(self._state[_SINGLE])

    @property
    def step(self) -> float:
        """Smallest difference between neighbours that differ, SI; infinite if none do."""
        return float(self._state[_STEP])

    def excerpts(self) -> list[Excerpt]:
        """Return pieces of the column, evenly over all of it."""
        return self._excerpts.pieces()

    def blocks(self) -> BlockStatistics:
        """Return the statistics of the blocks, the last one as far as it goes."""
        return self._blocks.blocks(_closed(self._state))


def _closed(state: Array) -> Array:
    """Return the block that is being filled as a row, or no row, shape (n, 5)."""
    rows = np.empty((int(state[_FILLED] > 0), 5))
    for row in rows:
        _close(state.copy(), row)
    return rows


@njit(cache=True, nogil=True)
def _close(state: Array, row: Array) -> None:
    """Write the statistics of a block and begin the next."""
    count = state[_COUNT]
    row[0] = count
    if count > 0:
        mean = state[_SUM] / count
        row[1] = state[_SHIFT] + mean
        row[2] = np.sqrt(max(state[_SQUARES] / count - mean * mean, 0.0))
        row[3] = state[_LEAST]
        row[4] = state[_MOST]
    else:
        row[1:] = np.nan
    state[_SHIFT] = np.nan
    state[_FILLED] = 0
    state[_COUNT] = 0
    state[_SUM] = 0.0
    state[_SQUARES] = 0.0
    state[_LEAST] = np.inf
    state[_MOST] = -np.inf


@njit(cache=True, nogil=True)
def _take(values: Array, state: Array, rows: Array) -> tuple[int, bool]:
    """Count samples; return the number of blocks that were completed, and if one is infinite."""
    number = 0
    before = state[_INFINITE]
    start = 0
    while start < values.size:
        stop = min(values.size, start + FIRST_SIZE - int(state[_FILLED]))
        piece = values[start:stop]
        begun = state[_PRESENT] > 0.0 and abs(piece[0]) <= LARGEST
        if begun and np.isnan(state[_SHIFT]):
            # A block is summed about its first sample: no digit is lost to a large bias, nor to
            # an outlier in another block.
            state[_SHIFT] = piece[0]
        if not (begun and _nothing(piece) == 0.0 and _take_plain(piece, state)):
            _take_each(piece, state)
        state[_TAKEN] += stop - start
        state[_FILLED] += stop - start
        if state[_FILLED] == FIRST_SIZE:
            _close(state, rows[number])
            number += 1
        start = stop
    return number, state[_INFINITE] > before


@njit(cache=True, nogil=True)
def _take_plain(piece: Array, state: Array) -> bool:
    """Count finite samples that are no new extremes and repeat nothing; else tell so."""
    least, most, step = _extremes(piece, state[_LAST])
    if step == 0.0 or least <= state[_LOW] or most >= state[_HIGH]:
        return False
    total, squares = _sums(piece, state[_SHIFT])
    state[_PRESENT] += piece.size
    state[_COUNT] += piece.size
    state[_SUM] += total
    state[_SQUARES] += squares
    state[_LEAST] = min(state[_LEAST], least)
    state[_MOST] = max(state[_MOST], most)
    state[_STEP] = min(state[_STEP], step)
    state[_LAST], state[_RUN] = piece[-1], 1.0
    state[_GAP] = 0.0
    return True


# The order of sums is free here, which makes wide instructions of them; comparisons need no care
# for NaN in `_extremes` alone, where there is none.


@njit(cache=True, nogil=True, fastmath={"reassoc"})
def _nothing(piece: Array) -> float:
    """Return 0, or NaN where a sample is not finite."""
    total = 0.0
    for i in range(piece.size):
        total += 0.0 * piece[i]
    return total


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _sums(piece: Array, shift: float) -> tuple[float, float]:
    """Return the sum, and that of the squares, about a value."""
    total, squares = 0.0, 0.0
    for i in range(piece.size):
        away = piece[i] - shift
        total += away
        squares += away * away
    return total, squares


@njit(cache=True, nogil=True, fastmath={"reassoc", "nnan", "nsz"})
def _extremes(piece: Array, last: float) -> tuple[float, float, float]:
    """Return the lowest and the highest sample, and the smallest step between neighbours."""
    least, most, step = piece[0], piece[0], abs(piece[0] - last)
    for i in range(1, piece.size):
        least = min(least, piece[i])
        most = max(most, piece[i])
        step = min(step, abs(piece[i] - piece[i - 1]))
    return least, most, step


@njit(cache=True, nogil=True)
def _take_each(piece: Array, state: Array) -> None:
    """Count samples one by one."""
    last, run, step = state[_LAST], state[_RUN], state[_STEP]
    low, high, at_low, at_high = state[_LOW], state[_HIGH], state[_AT_LOW], state[_AT_HIGH]
    shift, total, squares = state[_SHIFT], state[_SUM], state[_SQUARES]
    least, most = state[_LEAST], state[_MOST]
    changes, single = state[_CHANGES], state[_SINGLE]
    gap = state[_GAP]
    count, repeats = 0, 0
    for i in range(FAR, piece.size):
        if abs(piece[i]) <= LARGEST and abs(piece[i - FAR]) <= LARGEST:
            state[_FAR_PAIRS] += 1
            state[_FAR_REPEATS] += piece[i] == piece[i - FAR]
    for i in range(piece.size):
        x = piece[i]
        if not abs(x) <= LARGEST:
            state[_MISSING if np.isnan(x) else _INFINITE] += 1
            gap += 1.0
            if gap > state[_LONGEST_GAP]:
                state[_LONGEST_GAP] = gap
                state[_GAP_END] = state[_TAKEN] + i + 1
            continue
        gap = 0.0
        count += 1
        if np.isnan(shift):
            shift = x
        y = x - shift
        total += y
        squares += y * y
        if x < least:
            least = x
        if x > most:
            most = x
        if x <= low:
            at_low = at_low + 1 if x == low else 1.0
            low = x
        if x >= high:
            at_high = at_high + 1 if x == high else 1.0
            high = x
        if x == last:
            run += 1
            repeats += 1
        else:
            away = abs(x - last)
            if away < step:
                if _ONE_STEP * away < step:
                    changes, single = 0.0, 0.0  # what was counted were several of these steps
                step = away
            changes += 1
            single += away < _ONE_STEP * step
            run = 1.0
            last = x
        if run > state[_LONGEST]:
            state[_LONGEST] = run
            state[_LONGEST_END] = state[_TAKEN] + i + 1
    state[_PRESENT] += count
    state[_COUNT] += count
    state[_REPEATS] += repeats
    state[_PAIRS] += count
    state[_CHANGES], state[_SINGLE] = changes, single
    state[_LAST], state[_RUN], state[_STEP] = last, run, step
    state[_LOW], state[_HIGH], state[_AT_LOW], state[_AT_HIGH] = low, high, at_low, at_high
    state[_SHIFT], state[_SUM], state[_SQUARES] = shift, total, squares
    state[_LEAST], state[_MOST] = least, most
    state[_GAP] = gap
