"""Stretches of a column that occur again, bit for bit, while it streams past in bounded memory.

A window reaches over a number of changes, and not of records: a coarse register stays at one value
for long, and its changes are what tells one stretch from another. Each window has a hash that rolls
along (cyclic polynomials, Cohen 1997). Of all windows those with the lowest hashes are remembered,
as many as the memory holds: which ones depends on their content alone, so that a copy at any offset
meets the same ones. A window that comes again tells the distance of the copy; windows that come one
after the other at the same distance are one stretch.

References
----------
J. D. Cohen, "Recursive hashing functions for n-grams", ACM Trans. Inf. Syst. 15, 1997; A. Z.
Broder, "On the resemblance and containment of documents", Proc. Compression and Complexity of
Sequences, 1997 (the lowest hashes as a sample).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.typing import Array

Words = NDArray[np.uint64]
Numbers = NDArray[np.int64]

WINDOW = 64
"""Changes of value in a window: the bits of a word, by which the hash turns."""

_SLOTS = 1 << 16
_MOST = _SLOTS // 2
"""Windows that are remembered: all up to there, then the half of them with the lowest hashes."""

_STRETCHES = 64
"""Stretches that are listed, at most."""

_PATIENCE = 12
"""Mean distances between remembered windows after which a stretch is over."""

_NAN = np.uint64(0x7FF8000000000000)
_MINUS_ZERO = np.uint64(0x8000000000000000)
_BASE = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)

_BITS, _HASH, _LIMIT = range(3)
_TAKEN, _BEGUN, _CHANGES, _HELD, _FOUND, _SHIFT = range(6)
_LAG, _COPY, _END, _FROM, _TO = range(5)


@dataclass(frozen=True)
class Stretch:
    """A part of a column that occurred before."""

    first: int
    last: int
    """First and one-past-last record of the second occurrence, as far as windows tell: it may begin
    a little before and end a little after."""
    lag: int
    """Records from the first occurrence to the second."""
    changes: int
    """Changes of value within it."""


def _words() -> Words:
    state = np.zeros(3, dtype=np.uint64)
    state[_LIMIT] = np.uint64(0xFFFFFFFFFFFFFFFF)
    return state


@dataclass
class Repeats:
    """Windows of a column that were seen, and the stretches that occurred again."""

    _words: Words = field(default_factory=_words)
    _numbers: Numbers = field(default_factory=lambda: np.zeros(6, dtype=np.int64))
    _tokens: Words = field(default_factory=lambda: np.zeros(WINDOW, dtype=np.uint64))
    _begins: Numbers = field(default_factory=lambda: np.zeros(WINDOW, dtype=np.int64))
    _keys: Words = field(default_factory=lambda: np.zeros(_SLOTS, dtype=np.uint64))
    _places: Numbers = field(default_factory=lambda: np.zeros((_SLOTS, 2), dtype=np.int64))
    _stretches: Numbers = field(default_factory=lambda: np.zeros((_STRETCHES, 5), dtype=np.int64))

    def add(self, values: Array) -> None:
        """Take the next records of the column; NaN is a missing sample."""
        _take(
            np.ascontiguousarray(values).view(np.uint64),
            self._words,
            self._numbers,
            self._tokens,
            self._begins,
            self._keys,
            self._places,
            self._stretches,
        )

    def stretches(self) -> list[Stretch]:
        """Return what occurred before, in the order of the column, at most 64 of them."""
        rows = self._stretches[: self._numbers[_FOUND]]
        return [
            Stretch(
                int(row[_COPY]), int(row[_END]), int(row[_LAG]), int(row[_TO] - row[_FROM]) + WINDOW
            )
            for row in rows
        ]


@njit(cache=True, nogil=True, inline="always")
def _mixed(word: np.uint64) -> np.uint64:
    """Return a word whose every bit depends on every bit of another (the finish of splitmix64)."""
    word = (word ^ (word >> np.uint64(30))) * _FIRST
    word = (word ^ (word >> np.uint64(27))) * _SECOND
    return word ^ (word >> np.uint64(31))


@njit(cache=True, nogil=True)
def _take(
    values: Words,
    words: Words,
    numbers: Numbers,
    tokens: Words,
    begins: Numbers,
    keys: Words,
    places: Numbers,
    stretches: Numbers,
) -> None:
    """Take the bits of samples: each run of one value is a token of the rolling hash."""
    bits, rolled, limit = words[_BITS], words[_HASH], words[_LIMIT]
    position, begun, changes = numbers[_TAKEN], numbers[_BEGUN], numbers[_CHANGES]
    for i in range(values.size):
        value = values[i]
        if value == _MINUS_ZERO:
            value = np.uint64(0)
        elif (value & np.uint64(0x7FFFFFFFFFFFFFFF)) > np.uint64(0x7FF0000000000000):
            value = _NAN
        if value == bits:
            continue
        here = position + i
        token = _mixed(bits ^ np.uint64(here - begun) * _BASE)
        slot = changes & (WINDOW - 1)
        # After as many turns as a word has bits, the token that leaves is as it was.
        rolled = (rolled << np.uint64(1) | rolled >> np.uint64(63)) ^ token ^ tokens[slot]
        tokens[slot] = token
        begins[slot] = begun
        begun = here
        bits = value
        changes += 1
        if changes >= WINDOW and rolled <= limit:
            begin = begins[changes & (WINDOW - 1)]
            _meet(rolled, begin, here, changes, keys, places, stretches, numbers)
            if numbers[_HELD] > _MOST:
                limit = limit >> np.uint64(1)
                _thin(limit, keys, places, numbers)
    words[_BITS], words[_HASH], words[_LIMIT] = bits, rolled, limit
    numbers[_TAKEN], numbers[_BEGUN], numbers[_CHANGES] = position + values.size, begun, changes


@njit(cache=True, nogil=True)
def _meet(
    key: np.uint64,
    begin: int,
    end: int,
    changes: int,
    keys: Words,
    places: Numbers,
    stretches: Numbers,
    numbers: Numbers,
) -> None:
    """Remember a window, or tell where it was before."""
    mask = np.uint64(_SLOTS - 1)
    slot = key & mask
    while keys[slot] != np.uint64(0) and keys[slot] != key:
        slot = (slot + np.uint64(1)) & mask
    if keys[slot] == np.uint64(0):
        keys[slot] = key
        places[slot, 0] = end
        places[slot, 1] = end
        numbers[_HELD] += 1
        return
    if places[slot, 0] < 0:
        return
    if begin < places[slot, 1]:
        # A pattern shorter than the window, such as 0, 1, 0, 1: that it repeats tells nothing.
        places[slot, 0] = -1
        return
    places[slot, 1] = end
    lag = end - places[slot, 0]
    count = numbers[_FOUND]
    if count > 0 and stretches[count - 1, _LAG] == lag:
        patience = WINDOW + (_PATIENCE << numbers[_SHIFT])
        if changes - stretches[count - 1, _TO] <= patience:
            stretches[count - 1, _END] = end
            stretches[count - 1, _TO] = changes
            return
    if count < _STRETCHES:
        stretches[count, _LAG] = lag
        stretches[count, _COPY] = begin
        stretches[count, _END] = end
        stretches[count, _FROM] = changes
        stretches[count, _TO] = changes
        numbers[_FOUND] = count + 1


@njit(cache=True, nogil=True)
def _thin(limit: np.uint64, keys: Words, places: Numbers, numbers: Numbers) -> None:
    """Forget the windows with a hash above the limit."""
    kept_keys, kept_places = np.empty_like(keys), np.empty_like(places)
    number = 0
    for slot in range(keys.size):
        if keys[slot] != np.uint64(0) and keys[slot] <= limit:
            kept_keys[number] = keys[slot]
            kept_places[number, 0], kept_places[number, 1] = places[slot, 0], places[slot, 1]
            number += 1
    keys[:] = np.uint64(0)
    mask = np.uint64(_SLOTS - 1)
    for k in range(number):
        place = kept_keys[k] & mask
        while keys[place] != np.uint64(0):
            place = (place + np.uint64(1)) & mask
        keys[place] = kept_keys[k]
        places[place, 0], places[place, 1] = kept_places[k, 0], kept_places[k, 1]
    numbers[_HELD] = number
    numbers[_SHIFT] += 1
