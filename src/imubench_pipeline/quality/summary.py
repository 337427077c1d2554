"""What is counted of one column while it streams past: extremes, repeats, steps, block statistics.

One pass, a few nanoseconds a sample. What it means is decided afterwards, by the other modules of
this package, when the whole column is known.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCK = 256
"""Samples of a block."""

_PRESENT, _MISSING, _INFINITE, _LOW, _HIGH, _AT_LOW, _AT_HIGH = range(7)
_LAST, _RUN, _LONGEST, _LONGEST_END, _REPEATS, _STEP, _TAKEN = range(7, 14)
_FILLED, _COUNT, _SUM, _SQUARES, _LEAST, _MOST, _SHIFT = range(14, 21)
_SIZE = 21


@dataclass(frozen=True)
class Blocks:
    """Statistics of consecutive blocks of `BLOCK` records.

    Attributes
    ----------
    count : ndarray, shape (b,)
        Samples present.
    mean, spread, low, high : ndarray, shape (b,)
        Mean, standard deviation and extremes of the samples present, SI; NaN where there are none.
    """

    count: Array
    mean: Array
    spread: Array
    low: Array
    high: Array


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
    _parts: list[Array] = field(default_factory=list)

    def add(self, values: Array) -> Array:
        """Count a piece of the column and return it with infinities made missing."""
        rows = np.empty((len(values) // BLOCK + 2, 5))
        number, infinite = _take(np.ascontiguousarray(values), self._state, rows)
        if number:
            self._parts.append(rows[:number].copy())
        return np.where(np.isfinite(values), values, np.nan) if infinite else values

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
        """Infinities."""
        return int(self._state[_INFINITE])

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
    def step(self) -> float:
        """Smallest difference between neighbours that differ, SI; infinite if none do."""
        return float(self._state[_STEP])

    @property
    def mean(self) -> float:
        """Mean of the samples present, SI."""
        blocks = self.blocks()
        there = blocks.count > 0
        return float(np.average(blocks.mean[there], weights=blocks.count[there]))

    def blocks(self) -> Blocks:
        """Return the statistics of the blocks, the last one as far as it goes."""
        rows = (
            [*self._parts, _closed(self._state)[None, :]] if self._state[_FILLED] else self._parts
        )
        joined = np.concatenate(rows) if rows else np.empty((0, 5))
        return Blocks(*(np.ascontiguousarray(column) for column in joined.T))


def _closed(state: Array) -> Array:
    row = np.empty(5)
    _close(state.copy(), row)
    return row


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
    # The next block is summed about a value near its mean: no digit is lost to a large bias.
    state[_SHIFT] = row[1]
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
    infinite = False
    last, run, step = state[_LAST], state[_RUN], state[_STEP]
    low, high, at_low, at_high = state[_LOW], state[_HIGH], state[_AT_LOW], state[_AT_HIGH]
    for i in range(values.size):
        x = values[i]
        if np.isfinite(x):
            state[_PRESENT] += 1
            if np.isnan(state[_SHIFT]):
                state[_SHIFT] = x
            state[_COUNT] += 1
            y = x - state[_SHIFT]
            state[_SUM] += y
            state[_SQUARES] += y * y
            if x < state[_LEAST]:
                state[_LEAST] = x
            if x > state[_MOST]:
                state[_MOST] = x
            if x <= low:
                at_low = at_low + 1 if x == low else 1.0
                low = x
            if x >= high:
                at_high = at_high + 1 if x == high else 1.0
                high = x
            if x == last:
                run += 1
                state[_REPEATS] += 1
            else:
                away = abs(x - last)
                if away < step:
                    step = away
                run = 1.0
                last = x
            if run > state[_LONGEST]:
                state[_LONGEST] = run
                state[_LONGEST_END] = state[_TAKEN] + i + 1
        elif np.isnan(x):
            state[_MISSING] += 1
        else:
            state[_INFINITE] += 1
            infinite = True
        state[_FILLED] += 1
        if state[_FILLED] == BLOCK:
            _close(state, rows[number])
            number += 1
    state[_TAKEN] += values.size
    state[_LAST], state[_RUN], state[_STEP] = last, run, step
    state[_LOW], state[_HIGH], state[_AT_LOW], state[_AT_HIGH] = low, high, at_low, at_high
    return number, infinite
