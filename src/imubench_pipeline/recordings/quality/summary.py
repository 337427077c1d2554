"""Collect statistics of a streamed column: extremes, repeats, steps, block statistics.

One pass, a few nanoseconds a sample. The other modules of this package evaluate the statistics when
the whole column is known.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np
from numba import njit

from imubench_pipeline.recordings.quality.repeats import Repeats
from imubench_pipeline.typing import Array

T = TypeVar("T")
MIN_BLOCK_SIZE = 256  # records of a block, until there are `2 * _MAX_BLOCKS` blocks
_MAX_BLOCKS = 1 << 15  # pairs of blocks are merged when there are twice this number


@dataclass(frozen=True)
class BlockStatistics:
    """Statistics of consecutive blocks of records."""

    size: int  # records of a block; the last one may have fewer
    count: Array  # number of samples present, shape (b,)
    mean: Array
    spread: Array
    low: Array
    high: Array
    """Mean, standard deviation and extremes of the samples present, SI, shape (b,); NaN where there
    are none."""


@dataclass
class BlockAccumulator:
    """Accumulates blocks: rows of count, mean, standard deviation, lowest and highest sample."""

    _size: int = MIN_BLOCK_SIZE
    _rows: list[Array] = field(default_factory=list)
    _number: int = 0
    _waiting: Array = field(default_factory=lambda: np.empty((0, 5)))

    def add(self, rows: Array) -> None:
        """Add consecutive blocks of `MIN_BLOCK_SIZE` records, shape (n, 5)."""
        fresh = np.concatenate([self._waiting, rows])
        while True:
            together = self._size // MIN_BLOCK_SIZE
            whole = min(len(fresh) // together, 2 * _MAX_BLOCKS - self._number)
            self._rows.append(_merge_blocks(fresh[: whole * together], together))
            self._number += whole
            fresh = fresh[whole * together :]
            if self._number < 2 * _MAX_BLOCKS:
                break
            self._rows = [_merge_blocks(np.concatenate(self._rows), 2)]
            self._number, self._size = _MAX_BLOCKS, 2 * self._size
        self._waiting = fresh.copy()

    def blocks(self, last: Array) -> BlockStatistics:
        """Return all blocks, followed by the blocks ``last``, shape (n, 5), that were not added."""
        fresh = np.concatenate([self._waiting, last])
        rows = np.concatenate([*self._rows, _merge_blocks(fresh, self._size // MIN_BLOCK_SIZE)])
        return BlockStatistics(self._size, *(np.ascontiguousarray(column) for column in rows.T))


def _merge_blocks(rows: Array, together: int) -> Array:
    if together == 1 or len(rows) == 0:
        return rows.copy()
    begins = np.arange(0, len(rows), together)
    count, mean, spread, low, high = rows.T
    present = count > 0
    total = np.add.reduceat(count, begins)
    weight = np.maximum(total, 1.0)
    united = np.add.reduceat(np.where(present, count * mean, 0.0), begins) / weight
    # About the mean of the new block, so that a large bias costs no digits.
    away = mean - np.repeat(united, together)[: len(rows)]
    squares = np.add.reduceat(np.where(present, count * (spread**2 + away**2), 0.0), begins)
    empty = total == 0
    united[empty] = np.nan
    deviation = np.where(empty, np.nan, np.sqrt(squares / weight))
    extremes = np.fmin.reduceat(low, begins), np.fmax.reduceat(high, begins)
    return np.column_stack([total, united, deviation, *extremes])


def compute_finite_median(values: Array) -> float:
    """Return the median of the finite values, shape (n,); NaN if there are none."""
    present = values[np.isfinite(values)]
    return float(np.median(present)) if len(present) else float("nan")


def compute_finite_medians(rows: Array) -> Array:
    """Return the median of the finite values of each row, shape (n,); NaN if there are none."""
    if rows.size and np.isfinite(rows).all():
        return np.asarray(np.median(rows, axis=1))
    return np.array([compute_finite_median(row) for row in rows])


PIECE_SIZE = 4096  # records of a piece
MAX_PIECES = 16  # every second one is dropped then; a shorter log is stored whole


@dataclass(frozen=True)
class Excerpt:
    """Consecutive records of a column."""

    first: int  # number of the first record
    values: Array  # SI, shape (n,); NaN where the sample is missing

    @property
    def present(self) -> Array:
        """Samples that are not missing."""
        return self.values[np.isfinite(self.values)]


@dataclass
class Excerpts:
    """Collects evenly spaced pieces of a column; when too many, it drops every other one."""

    _stride: int = 1
    _reached: int = 0
    _pieces: list[Array] = field(default_factory=list)
    _open: list[Array] = field(default_factory=list)

    def add(self, values: Array) -> None:
        """Add the next records of the column."""
        start = 0
        while start < len(values):
            number, inside = divmod(self._reached, PIECE_SIZE)
            stop = min(len(values), start + PIECE_SIZE - inside)
            if number % self._stride == 0:
                self._open.append(values[start:stop].copy())
            self._reached += stop - start
            start = stop
            if self._reached % PIECE_SIZE == 0 and self._open:
                self._pieces.append(np.concatenate(self._open))
                self._open = []
                if len(self._pieces) == MAX_PIECES:
                    self._pieces = self._pieces[::2]
                    self._stride *= 2

    def pieces(self) -> list[Excerpt]:
        """Return the pieces in order; the last one may be incomplete."""
        pieces = [*self._pieces, np.concatenate(self._open)] if self._open else self._pieces
        return [Excerpt(k * self._stride * PIECE_SIZE, values) for k, values in enumerate(pieces)]


def pair_common_samples(first: list[Excerpt], other: list[Excerpt]) -> list[tuple[Array, Array]]:
    """Return the samples that are present in two columns, in a pair for each common excerpt."""
    places = {piece.first: piece.values for piece in other}
    pairs = []
    for piece in first:
        values = places.get(piece.first)
        if values is not None and len(values) == len(piece.values):
            present = np.isfinite(piece.values) & np.isfinite(values)
            pairs.append((piece.values[present], values[present]))
    return pairs


MAX_MEASUREMENT = 1e30  # largest magnitude of a measurement, SI. Larger values count as infinite.

# Indices of the state of a column

_PRESENT_SAMPLES, _MISSING_SAMPLES, _INFINITE_SAMPLES, _RECORDS = range(4)
_LOWEST_SAMPLE, _HIGHEST_SAMPLE, _COUNT_AT_LOWEST, _COUNT_AT_HIGHEST = range(4, 8)
_LAST_SAMPLE, _RUN_LENGTH, _LONGEST_RUN, _LONGEST_RUN_END = range(8, 12)
_REPEAT_COUNT, _SMALLEST_STEP, _CHANGE_COUNT, _SINGLE_STEPS = range(12, 16)
_PAIR_COUNT, _FAR_PAIRS, _FAR_REPEATS = range(16, 19)
_BLOCK_RECORDS, _BLOCK_COUNT, _BLOCK_SUM, _BLOCK_SQUARES = range(19, 23)
_BLOCK_LOWEST, _BLOCK_HIGHEST, _BLOCK_SHIFT = range(23, 26)
_GAP_LENGTH, _LONGEST_GAP, _GAP_END = range(26, 29)
_STATE_SIZE = 29
FAR_LAG = 64  # lag, samples, at which low-passed noise is uncorrelated for all usual low-passes
_MAX_RATIO_OF_ONE_STEP = 1.5
"""Largest ratio of a change to the smallest step that counts as one step: steps of rounded values
may differ by a digit."""


def _create_state() -> Array:
    state = np.zeros(_STATE_SIZE)
    state[[_LOWEST_SAMPLE, _BLOCK_LOWEST, _SMALLEST_STEP]] = np.inf
    state[[_HIGHEST_SAMPLE, _BLOCK_HIGHEST]] = -np.inf
    state[[_LAST_SAMPLE, _BLOCK_SHIFT]] = np.nan
    return state


class _State(Generic[T]):
    """Descriptor of a number in the state of a column: a count, or a value."""

    def __init__(self, kind: Callable[[float], T], place: int) -> None:
        self._kind, self._place = kind, place

    def __get__(self, column: "ColumnSummary", _: type) -> T:
        return self._kind(column._state[self._place])


@dataclass
class ColumnSummary:
    """Statistics of a streamed column; NaN is a missing sample."""

    _state: Array = field(default_factory=_create_state)
    _blocks: BlockAccumulator = field(default_factory=BlockAccumulator)
    _excerpts: Excerpts = field(default_factory=Excerpts)
    repeated: Repeats = field(default_factory=Repeats)

    present = _State(int, _PRESENT_SAMPLES)  # samples that are finite numbers
    missing = _State(int, _MISSING_SAMPLES)  # records without a number
    not_finite = _State(int, _INFINITE_SAMPLES)  # infinities, and values beyond `MAX_MEASUREMENT`
    repeats = _State(int, _REPEAT_COUNT)  # samples that equal their predecessor
    pairs = _State(int, _PAIR_COUNT)  # of neighbours that were compared
    far_pairs = _State(int, _FAR_PAIRS)  # at the distance `FAR_LAG` in the same pieces
    far_repeats = _State(int, _FAR_REPEATS)  # pairs among them of equal samples
    steps = _State(int, _CHANGE_COUNT)  # unequal neighbours since the smallest step was found
    single_steps = _State(int, _SINGLE_STEPS)  # among them, by the smallest step only

    low = _State(float, _LOWEST_SAMPLE)
    high = _State(float, _HIGHEST_SAMPLE)  # lowest and highest sample, SI
    step = _State(float, _SMALLEST_STEP)  # between neighbours that differ, SI; infinite if none do

    def add(self, values: Array) -> Array:
        """Add a piece of the column; return it with non-finite values replaced by NaN."""
        rows = np.empty((len(values) // MIN_BLOCK_SIZE + 2, 5))
        number, infinite = _count_samples(np.ascontiguousarray(values), self._state, rows)
        if number:
            self._blocks.add(rows[:number])
        finite = np.where(np.abs(values) <= MAX_MEASUREMENT, values, np.nan) if infinite else values
        self._excerpts.add(finite)
        self.repeated.add(finite)
        return finite

    @property
    def longest_gap(self) -> tuple[int, int]:
        """Length of the longest run of records without a finite number, and one past its end."""
        return int(self._state[_LONGEST_GAP]), int(self._state[_GAP_END])

    @property
    def at_extremes(self) -> tuple[int, int]:
        """Numbers of samples at the lowest and at the highest value."""
        return int(self._state[_COUNT_AT_LOWEST]), int(self._state[_COUNT_AT_HIGHEST])

    @property
    def longest_run(self) -> tuple[int, int]:
        """Length of the longest run of one value, and the record one past its end."""
        return int(self._state[_LONGEST_RUN]), int(self._state[_LONGEST_RUN_END])

    def excerpts(self) -> list[Excerpt]:
        """Return pieces of the column, spread evenly over its length."""
        return self._excerpts.pieces()

    def blocks(self) -> BlockStatistics:
        """Return the statistics of the blocks; the last one may be incomplete."""
        incomplete = np.empty((int(self._state[_BLOCK_RECORDS] > 0), 5))
        for row in incomplete:
            _close_block(self._state.copy(), row)
        return self._blocks.blocks(incomplete)


@njit(cache=True, nogil=True)
def _close_block(state: Array, row: Array) -> None:
    count = state[_BLOCK_COUNT]
    row[0] = count
    if count > 0:
        mean = state[_BLOCK_SUM] / count
        row[1] = state[_BLOCK_SHIFT] + mean
        row[2] = np.sqrt(max(state[_BLOCK_SQUARES] / count - mean * mean, 0.0))
        row[3] = state[_BLOCK_LOWEST]
        row[4] = state[_BLOCK_HIGHEST]
    else:
        row[1:] = np.nan
    state[_BLOCK_SHIFT] = np.nan
    state[_BLOCK_RECORDS] = 0
    state[_BLOCK_COUNT] = 0
    state[_BLOCK_SUM] = 0.0
    state[_BLOCK_SQUARES] = 0.0
    state[_BLOCK_LOWEST] = np.inf
    state[_BLOCK_HIGHEST] = -np.inf


@njit(cache=True, nogil=True)
def _count_samples(values: Array, state: Array, rows: Array) -> tuple[int, bool]:
    """Add samples; return the number of completed blocks, and whether a sample is infinite."""
    number = 0
    before = state[_INFINITE_SAMPLES]
    start = 0
    while start < values.size:
        stop = min(values.size, start + MIN_BLOCK_SIZE - int(state[_BLOCK_RECORDS]))
        piece = values[start:stop]
        begun = state[_PRESENT_SAMPLES] > 0.0 and abs(piece[0]) <= MAX_MEASUREMENT
        if begun and np.isnan(state[_BLOCK_SHIFT]):
            # Sums are about the first sample of a block, so that neither a large bias nor an
            # outlier in another block costs digits.
            state[_BLOCK_SHIFT] = piece[0]
        if not (begun and _detect_non_finite(piece) == 0.0 and _count_plain_samples(piece, state)):
            _count_each_sample(piece, state)
        state[_RECORDS] += stop - start
        state[_BLOCK_RECORDS] += stop - start
        if state[_BLOCK_RECORDS] == MIN_BLOCK_SIZE:
            _close_block(state, rows[number])
            number += 1
        start = stop
    return number, state[_INFINITE_SAMPLES] > before


@njit(cache=True, nogil=True)
def _count_plain_samples(piece: Array, state: Array) -> bool:
    """Add finite samples without new extremes or repeats; return False if there are any."""
    least, most, step = _find_extremes(piece, state[_LAST_SAMPLE])
    if step == 0.0 or least <= state[_LOWEST_SAMPLE] or most >= state[_HIGHEST_SAMPLE]:
        return False
    total, squares = _sum_about(piece, state[_BLOCK_SHIFT])
    state[_PRESENT_SAMPLES] += piece.size
    state[_BLOCK_COUNT] += piece.size
    state[_BLOCK_SUM] += total
    state[_BLOCK_SQUARES] += squares
    state[_BLOCK_LOWEST] = min(state[_BLOCK_LOWEST], least)
    state[_BLOCK_HIGHEST] = max(state[_BLOCK_HIGHEST], most)
    state[_SMALLEST_STEP] = min(state[_SMALLEST_STEP], step)
    state[_LAST_SAMPLE], state[_RUN_LENGTH] = piece[-1], 1.0
    state[_GAP_LENGTH] = 0.0
    return True


# `reassoc` allows vector instructions for the sums. `nnan` is safe in `_find_extremes` only, since
# it never receives NaN.


@njit(cache=True, nogil=True, fastmath={"reassoc"})
def _detect_non_finite(piece: Array) -> float:
    """Return 0 if all samples are finite, else NaN."""
    total = 0.0
    for i in range(piece.size):
        total += 0.0 * piece[i]
    return total


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
def _sum_about(piece: Array, shift: float) -> tuple[float, float]:
    """Return the sum and the sum of squares of the deviations from a value."""
    total, squares = 0.0, 0.0
    for i in range(piece.size):
        away = piece[i] - shift
        total += away
        squares += away * away
    return total, squares


@njit(cache=True, nogil=True, fastmath={"reassoc", "nnan", "nsz"})
def _find_extremes(piece: Array, last: float) -> tuple[float, float, float]:
    """Return the lowest and the highest sample, and the smallest step between neighbours."""
    least, most, step = piece[0], piece[0], abs(piece[0] - last)
    for i in range(1, piece.size):
        least = min(least, piece[i])
        most = max(most, piece[i])
        step = min(step, abs(piece[i] - piece[i - 1]))
    return least, most, step


@njit(cache=True, nogil=True)
def _count_each_sample(piece: Array, state: Array) -> None:
    last, run, step = state[_LAST_SAMPLE], state[_RUN_LENGTH], state[_SMALLEST_STEP]
    low, high = state[_LOWEST_SAMPLE], state[_HIGHEST_SAMPLE]
    at_low, at_high = state[_COUNT_AT_LOWEST], state[_COUNT_AT_HIGHEST]
    shift, total, squares = state[_BLOCK_SHIFT], state[_BLOCK_SUM], state[_BLOCK_SQUARES]
    least, most = state[_BLOCK_LOWEST], state[_BLOCK_HIGHEST]
    changes, single = state[_CHANGE_COUNT], state[_SINGLE_STEPS]
    gap = state[_GAP_LENGTH]
    count, repeats = 0, 0
    for i in range(FAR_LAG, piece.size):
        if abs(piece[i]) <= MAX_MEASUREMENT and abs(piece[i - FAR_LAG]) <= MAX_MEASUREMENT:
            state[_FAR_PAIRS] += 1
            state[_FAR_REPEATS] += piece[i] == piece[i - FAR_LAG]
    for i in range(piece.size):
        x = piece[i]
        if not abs(x) <= MAX_MEASUREMENT:
            state[_MISSING_SAMPLES if np.isnan(x) else _INFINITE_SAMPLES] += 1
            gap += 1.0
            if gap > state[_LONGEST_GAP]:
                state[_LONGEST_GAP] = gap
                state[_GAP_END] = state[_RECORDS] + i + 1
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
                if _MAX_RATIO_OF_ONE_STEP * away < step:
                    changes, single = 0.0, 0.0  # earlier changes were several of these steps
                step = away
            changes += 1
            single += away < _MAX_RATIO_OF_ONE_STEP * step
            run = 1.0
            last = x
        if run > state[_LONGEST_RUN]:
            state[_LONGEST_RUN] = run
            state[_LONGEST_RUN_END] = state[_RECORDS] + i + 1
    state[_PRESENT_SAMPLES] += count
    state[_BLOCK_COUNT] += count
    state[_REPEAT_COUNT] += repeats
    state[_PAIR_COUNT] += count
    state[_CHANGE_COUNT], state[_SINGLE_STEPS] = changes, single
    state[_LAST_SAMPLE], state[_RUN_LENGTH], state[_SMALLEST_STEP] = last, run, step
    state[_LOWEST_SAMPLE], state[_HIGHEST_SAMPLE] = low, high
    state[_COUNT_AT_LOWEST], state[_COUNT_AT_HIGHEST] = at_low, at_high
    state[_BLOCK_SHIFT], state[_BLOCK_SUM], state[_BLOCK_SQUARES] = shift, total, squares
    state[_BLOCK_LOWEST], state[_BLOCK_HIGHEST] = least, most
    state[_GAP_LENGTH] = gap
