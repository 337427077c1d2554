"""What is counted of one column while it streams past: extremes, repeats, steps, block statistics.

One pass, a few nanoseconds a sample. What it means is decided afterwards, by the other modules of
this package, when the whole column is known.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit

from imubench_pipeline.recordings.quality.repeats import Repeats
from imubench_pipeline.typing import Array

FIRST_SIZE = 256
"""Records of a block, until there are many blocks."""

_MANY = 1 << 15
"""Two blocks are made one where there are twice as many as this."""


@dataclass(frozen=True)
class BlockStatistics:
    """Statistics of consecutive blocks of records."""

    size: int
    """Records of a block; the last one may have fewer."""
    count: Array
    """Samples present, shape (b,)."""
    mean: Array
    spread: Array
    low: Array
    high: Array
    """Mean, standard deviation and extremes of the samples present, SI, shape (b,); NaN where there
    are none."""


def _no_rows() -> Array:
    return np.empty((0, 5))


@dataclass
class Gathering:
    """Blocks as they come; each a row of count, mean, spread, lowest and highest sample."""

    _size: int = FIRST_SIZE
    _rows: list[Array] = field(default_factory=list)
    _number: int = 0
    _waiting: Array = field(default_factory=_no_rows)

    def add(self, rows: Array) -> None:
        """Take consecutive blocks of `FIRST_SIZE` records, shape (n, 5)."""
        fresh = np.concatenate([self._waiting, rows])
        while True:
            together = self._size // FIRST_SIZE
            whole = min(len(fresh) // together, 2 * _MANY - self._number)
            self._rows.append(_united(fresh[: whole * together], together))
            self._number += whole
            fresh = fresh[whole * together :]
            if self._number < 2 * _MANY:
                break
            self._rows = [_united(np.concatenate(self._rows), 2)]
            self._number, self._size = _MANY, 2 * self._size
        self._waiting = fresh.copy()

    def blocks(self, last: Array) -> BlockStatistics:
        """Return all blocks; ``last``, shape (n, 5), are those that were not added yet."""
        fresh = np.concatenate([self._waiting, last])
        rows = np.concatenate([*self._rows, _united(fresh, self._size // FIRST_SIZE)])
        return BlockStatistics(self._size, *(np.ascontiguousarray(column) for column in rows.T))


def _united(rows: Array, together: int) -> Array:
    """Make one block of so many; the last one may be of fewer."""
    if together == 1 or len(rows) == 0:
        return rows.copy()
    begins = np.arange(0, len(rows), together)
    count, mean, spread, low, high = rows.T
    present = count > 0
    total = np.add.reduceat(count, begins)
    weight = np.maximum(total, 1.0)
    united = np.add.reduceat(np.where(present, count * mean, 0.0), begins) / weight
    # About the mean of the new block: no digit is lost to a large bias.
    away = mean - np.repeat(united, together)[: len(rows)]
    squares = np.add.reduceat(np.where(present, count * (spread**2 + away**2), 0.0), begins)
    empty = total == 0
    return np.column_stack(
        [
            total,
            np.where(empty, np.nan, united),
            np.where(empty, np.nan, np.sqrt(squares / weight)),
            np.fmin.reduceat(low, begins),
            np.fmax.reduceat(high, begins),
        ]
    )


def present_median(values: Array) -> float:
    """Return the median of the values that are there, shape (n,); NaN where none is."""
    present = values[np.isfinite(values)]
    return float(np.median(present)) if len(present) else float("nan")


PIECE = 4096
"""Records of a piece."""

MOST = 16
"""Every second piece is forgotten when there are so many; a shorter log is kept whole."""


@dataclass(frozen=True)
class Excerpt:
    """Consecutive records of a column."""

    first: int
    """Number of the first record."""
    values: Array
    """SI, shape (n,); NaN where the sample is missing."""

    @property
    def present(self) -> Array:
        """The samples that are there."""
        return self.values[np.isfinite(self.values)]


@dataclass
class Excerpts:
    """Pieces as the column streams past: every one, every second, every fourth and so on.

    Block statistics do not tell which samples are multiples of what, or which repeat every third
    one. Some ten thousand samples do, however long the log is.
    """

    _stride: int = 1
    _reached: int = 0
    _pieces: list[Array] = field(default_factory=list)
    _open: list[Array] = field(default_factory=list)

    def add(self, values: Array) -> None:
        """Take the next records of the column."""
        start = 0
        while start < len(values):
            number, inside = divmod(self._reached, PIECE)
            stop = min(len(values), start + PIECE - inside)
            if number % self._stride == 0:
                self._open.append(values[start:stop].copy())
            self._reached += stop - start
            start = stop
            if self._reached % PIECE == 0 and self._open:
                self._pieces.append(np.concatenate(self._open))
                self._open = []
                if len(self._pieces) == MOST:
                    self._pieces = self._pieces[::2]
                    self._stride *= 2

    def pieces(self) -> list[Excerpt]:
        """Return the pieces in order; the last one as far as it goes."""
        pieces = [*self._pieces, np.concatenate(self._open)] if self._open else self._pieces
        return [Excerpt(k * self._stride * PIECE, values) for k, values in enumerate(pieces)]


def together(first: list[Excerpt], other: list[Excerpt]) -> list[tuple[Array, Array]]:
    """Return the samples of two columns at the same records, those present in both.

    Parameters
    ----------
    first, other : list of Excerpt
        Of columns that advance together.

    Returns
    -------
    list of (ndarray, ndarray)
        A pair for each piece that both have, of equal shapes.
    """
    places = {piece.first: piece.values for piece in other}
    pairs = []
    for piece in first:
        values = places.get(piece.first)
        if values is not None and len(values) == len(piece.values):
            present = np.isfinite(piece.values) & np.isfinite(values)
            pairs.append((piece.values[present], values[present]))
    return pairs


LARGEST = 1e30
"""Largest figure, SI, that is taken for a measurement. Larger ones count as infinite."""

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


class _Count:
    """A count in the state of a column."""

    def __init__(self, place: int) -> None:
        self._place = place

    def __get__(self, column: ColumnSummary, _: type) -> int:
        return int(column._state[self._place])


@dataclass
class ColumnSummary:
    """A column as it streams past; NaN is a missing sample."""

    _state: Array = field(default_factory=_start)
    _blocks: Gathering = field(default_factory=Gathering)
    _excerpts: Excerpts = field(default_factory=Excerpts)
    repeated: Repeats = field(default_factory=Repeats)

    present = _Count(_PRESENT)
    """Samples that are finite numbers."""
    missing = _Count(_MISSING)
    """Records without a number."""
    not_finite = _Count(_INFINITE)
    """Infinities, and figures beyond `LARGEST`."""
    repeats = _Count(_REPEATS)
    """Samples that equal the one before."""
    pairs = _Count(_PAIRS)
    """Neighbours that were compared: in all pieces in which any are equal."""
    far_pairs = _Count(_FAR_PAIRS)
    """Samples that were compared with that `FAR` before, where neighbours were."""
    far_repeats = _Count(_FAR_REPEATS)
    """Samples among them that equal that."""
    steps = _Count(_CHANGES)
    """Neighbours that differ, as far as they were compared since the smallest step."""
    single_steps = _Count(_SINGLE)
    """Neighbours among them that differ by the smallest step."""

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
