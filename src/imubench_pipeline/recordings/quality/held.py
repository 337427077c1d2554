"""Samples that repeat the one before at a regular distance: every third, every hundredth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.recordings.quality.summary import PIECE, ColumnSummary, Excerpt
from imubench_pipeline.tables.findings import Finding

_LONGEST = 256
"""Records between two repeats, at most."""

_PIECES = 8
"""Pieces that are looked at: they are looked at for every distance."""

_ALWAYS = 0.98
"""Share of the samples of a phase that repeat; of all others not one phase may reach `_OTHERS`."""
_OTHERS = 0.9

_SURE = -12.0
"""Decimal logarithm of the chance of so many repeats, below which they are none."""


@dataclass(frozen=True)
class Held:
    """Samples that repeat at a regular distance."""

    every: int
    """Records from one to the next."""
    share: float
    """Part of the other samples that repeat."""


def regular_repeats(pieces: list[Excerpt]) -> Held | None:
    """Return at which distance samples repeat the one before; None where by chance alone."""
    whole = [piece.values for piece in pieces if len(piece.values) >= PIECE // 4]
    whole = whole[:: max(1, len(whole) // _PIECES)][:_PIECES]
    regular: list[Held] = []
    for values in whole:
        repeats = np.flatnonzero(values[1:] == values[:-1])
        of_piece = _regular(repeats, len(values) - 1)
        if of_piece is not None:
            regular.append(of_piece)
    if not regular or 2 * len(regular) <= len(whole):
        return None
    every = int(np.median([of_piece.every for of_piece in regular]))
    return Held(every, float(np.median([of_piece.share for of_piece in regular])))


def _regular(repeats: NDArray[np.int64], records: int) -> Held | None:
    counts = np.zeros((_LONGEST + 1, 2), dtype=np.int64)
    _fold(repeats, counts)
    every = np.arange(3, _LONGEST + 1)
    turns = records // every
    most, second = counts[3:].T
    share = (len(repeats) - most) / (records - turns)
    # All phases of all distances could have been the one.
    chance = most * np.log10(share + 1.0 / records) + np.log10(every * _LONGEST)
    regular = (most >= _ALWAYS * turns) & (second <= _OTHERS * turns) & (chance < _SURE)
    if not regular.any():
        return None
    first = int(np.argmax(regular))
    return Held(int(every[first]), float(share[first]))


@njit(cache=True, nogil=True)
def _fold(repeats: NDArray[np.int64], counts: NDArray[np.int64]) -> None:
    """Count the repeats in the fullest phase, and in the next, of each distance."""
    phases = np.zeros(counts.shape[0], dtype=np.int64)
    for every in range(3, counts.shape[0]):
        phases[:every] = 0
        for k in range(repeats.size):
            phases[repeats[k] % every] += 1
        most, second = 0, 0
        for k in range(every):
            if phases[k] > most:
                most, second = phases[k], most
            elif phases[k] > second:
                second = phases[k]
        counts[every, 0], counts[every, 1] = most, second


def held_samples(channel: str, column: ColumnSummary) -> Iterator[Finding]:
    """Yield whether every n-th sample of a channel repeats the one before."""
    if column.repeats < column.present / (2 * _LONGEST):
        return
    regular = regular_repeats(column.excerpts())
    if regular is None:
        return
    detail = (
        f"one sample in {regular.every} of {channel} repeats the one before, in regular turn (of "
        f"the others {100 * regular.share:.2g} % do by chance): the logger asks more often than "
        "the sensor samples, or fills in what it lost; record each sample once"
    )
    yield Finding("held_samples", "warning", detail, regular.every, channel)
