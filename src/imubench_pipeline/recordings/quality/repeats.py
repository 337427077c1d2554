"""Find stretches of a streamed column that repeat bit for bit, in bounded memory.

A window spans a fixed number of changes of value, not of records: a coarse register stays at one
value for long, and only its changes distinguish stretches. Each window has a rolling hash (cyclic
polynomials, Cohen 1997). Only the windows with the lowest hashes are stored. The selection depends
on their content alone, so that a copy at any offset selects the same windows (Broder 1997). A
window that repeats gives the lag of the copy, and successive windows with the same lag form one
stretch.

References
----------
J. D. Cohen, "Recursive hashing functions for n-grams", ACM Trans. Inf. Syst. 15, 1997; A. Z.
Broder, "On the resemblance and containment of documents", Proc. Compression and Complexity of
Sequences, 1997 (sampling by the lowest hashes); G. L. Steele, D. Lea and C. H. Flood, "Fast
splittable pseudorandom number generators", OOPSLA 2014 (SplitMix64, the mixing of bits).
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.typing import Array

Words = NDArray[np.uint64]
Numbers = NDArray[np.int64]
WINDOW = 64  # changes of value: the bits of a word, by which the hash is rotated
_SLOTS = 1 << 16
_MAX_WINDOWS = _SLOTS // 2  # beyond it, the half with the lowest hashes is kept
_MAX_STRETCHES = 64  # largest number of stretches that are listed
_MAX_MISSED_WINDOWS = 12  # in a stretch, in mean distances between stored ones

# Bit patterns of float64, and the constants of SplitMix64

_NAN_BITS = np.uint64(0x7FF8000000000000)
_MINUS_ZERO_BITS = np.uint64(0x8000000000000000)
_GOLDEN_GAMMA = np.uint64(0x9E3779B97F4A7C15)
_MIX_FACTOR_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_FACTOR_2 = np.uint64(0x94D049BB133111EB)

# Indices of the state: words, numbers, and the columns of a stretch
_LAST_BITS, _ROLLING_HASH, _HASH_LIMIT = range(3)
_RECORDS, _RUN_BEGIN, _CHANGE_COUNT, _WINDOW_COUNT, _STRETCH_COUNT, _HASH_SHIFT = range(6)
_LAG, _COPY_BEGIN, _COPY_END, _FIRST_CHANGE, _LAST_CHANGE = range(5)


@dataclass(frozen=True)
class Stretch:
    """A part of a column that repeats an earlier part."""

    first: int
    last: int
    """First and one-past-last record of the copy, to the resolution of the windows: it may begin a
    little earlier and end a little later."""
    lag: int  # records from the original to the copy
    changes: int  # changes of value within it


class Repeats:
    """Finds the stretches of a streamed column that repeat earlier ones (see the module)."""

    def __init__(self) -> None:
        words, numbers = np.zeros(3, dtype=np.uint64), np.zeros(6, dtype=np.int64)
        words[_HASH_LIMIT] = np.uint64(0xFFFFFFFFFFFFFFFF)
        tokens, begins = np.zeros(WINDOW, dtype=np.uint64), np.zeros(WINDOW, dtype=np.int64)
        keys, places = np.zeros(_SLOTS, dtype=np.uint64), np.zeros((_SLOTS, 2), dtype=np.int64)
        stretches = np.zeros((_MAX_STRETCHES, 5), dtype=np.int64)
        self._state = (words, numbers, tokens, begins, keys, places, stretches)

    def add(self, values: Array) -> None:
        """Add the next records of the column; NaN is a missing sample."""
        _add_samples(np.ascontiguousarray(values).view(np.uint64), *self._state)

    def stretches(self) -> list[Stretch]:
        """Return the repeated stretches in the order of the column, at most 64 of them."""
        _, numbers, *_, stretches = self._state
        rows = stretches[: numbers[_STRETCH_COUNT]].tolist()
        return [
            Stretch(begin, end, lag, last - first + WINDOW) for lag, begin, end, first, last in rows
        ]


@njit(cache=True, nogil=True, inline="always")
def _mix_bits(word: np.uint64) -> np.uint64:
    """Return a word whose bits each depend on all bits of the input (finaliser of SplitMix64)."""
    word = (word ^ (word >> np.uint64(30))) * _MIX_FACTOR_1
    word = (word ^ (word >> np.uint64(27))) * _MIX_FACTOR_2
    return word ^ (word >> np.uint64(31))


@njit(cache=True, nogil=True)
def _add_samples(
    values: Words,
    words: Words,
    numbers: Numbers,
    tokens: Words,
    begins: Numbers,
    keys: Words,
    places: Numbers,
    stretches: Numbers,
) -> None:
    """Add samples as bits; each run of one value is a token of the rolling hash."""
    bits, rolled, limit = words[_LAST_BITS], words[_ROLLING_HASH], words[_HASH_LIMIT]
    position, begun, changes = numbers[_RECORDS], numbers[_RUN_BEGIN], numbers[_CHANGE_COUNT]
    for i in range(values.size):
        value = values[i]
        if value == _MINUS_ZERO_BITS:
            value = np.uint64(0)
        elif (value & np.uint64(0x7FFFFFFFFFFFFFFF)) > np.uint64(0x7FF0000000000000):
            value = _NAN_BITS
        if value == bits:
            continue
        here = position + i
        token = _mix_bits(bits ^ np.uint64(here - begun) * _GOLDEN_GAMMA)
        slot = changes & (WINDOW - 1)
        # After `WINDOW` rotations the oldest token is unrotated again, and XOR removes it.
        rolled = (rolled << np.uint64(1) | rolled >> np.uint64(63)) ^ token ^ tokens[slot]
        tokens[slot] = token
        begins[slot] = begun
        begun = here
        bits = value
        changes += 1
        if changes >= WINDOW and rolled <= limit:
            begin = begins[changes & (WINDOW - 1)]
            _match_window(rolled, begin, here, changes, keys, places, stretches, numbers)
            if numbers[_WINDOW_COUNT] > _MAX_WINDOWS:
                limit = limit >> np.uint64(1)
                _drop_windows(limit, keys, places, numbers)
    words[_LAST_BITS], words[_ROLLING_HASH], words[_HASH_LIMIT] = bits, rolled, limit
    numbers[_RECORDS] = position + values.size
    numbers[_RUN_BEGIN], numbers[_CHANGE_COUNT] = begun, changes


@njit(cache=True, nogil=True)
def _match_window(
    key: np.uint64,
    begin: int,
    end: int,
    changes: int,
    keys: Words,
    places: Numbers,
    stretches: Numbers,
    numbers: Numbers,
) -> None:
    """Store a window, or extend the stretch in which a known window repeats."""
    mask = np.uint64(_SLOTS - 1)
    slot = key & mask
    while keys[slot] != np.uint64(0) and keys[slot] != key:
        slot = (slot + np.uint64(1)) & mask
    if keys[slot] == np.uint64(0):
        keys[slot] = key
        places[slot, 0] = end
        places[slot, 1] = end
        numbers[_WINDOW_COUNT] += 1
        return
    if places[slot, 0] < 0:
        return
    if begin < places[slot, 1]:
        # A pattern shorter than the window, such as 0, 1, 0, 1, is not evidence of a copy.
        places[slot, 0] = -1
        return
    places[slot, 1] = end
    lag = end - places[slot, 0]
    count = numbers[_STRETCH_COUNT]
    if count > 0 and stretches[count - 1, _LAG] == lag:
        patience = WINDOW + (_MAX_MISSED_WINDOWS << numbers[_HASH_SHIFT])
        if changes - stretches[count - 1, _LAST_CHANGE] <= patience:
            stretches[count - 1, _COPY_END] = end
            stretches[count - 1, _LAST_CHANGE] = changes
            return
    if count < _MAX_STRETCHES:
        stretches[count, _LAG] = lag
        stretches[count, _COPY_BEGIN] = begin
        stretches[count, _COPY_END] = end
        stretches[count, _FIRST_CHANGE] = changes
        stretches[count, _LAST_CHANGE] = changes
        numbers[_STRETCH_COUNT] = count + 1


@njit(cache=True, nogil=True)
def _drop_windows(limit: np.uint64, keys: Words, places: Numbers, numbers: Numbers) -> None:
    kept_keys, kept_places = np.empty(keys.size, np.uint64), np.empty((keys.size, 2), np.int64)
    number = 0
    for slot in range(keys.size):
        if keys[slot] != np.uint64(0) and keys[slot] <= limit:
            kept_keys[number] = keys[slot]
            kept_places[number, 0], kept_places[number, 1] = places[slot, 0], places[slot, 1]
            number += 1
        keys[slot] = np.uint64(0)
    mask = np.uint64(_SLOTS - 1)
    for k in range(number):
        place = kept_keys[k] & mask
        while keys[place] != np.uint64(0):
            place = (place + np.uint64(1)) & mask
        keys[place] = kept_keys[k]
        places[place, 0], places[place, 1] = kept_places[k, 0], kept_places[k, 1]
    numbers[_WINDOW_COUNT] = number
    numbers[_HASH_SHIFT] += 1
