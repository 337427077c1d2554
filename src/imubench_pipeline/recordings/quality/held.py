"""Find samples that repeat their predecessor periodically: every third, every hundredth."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.recordings.quality.summary import PIECE_SIZE, ColumnSummary, Excerpt
from imubench_pipeline.tables.findings import Finding, find
from imubench_pipeline.words.findings.samples import HeldSamples

_MAX_PERIOD = 256  # longest period of repeats that is tested, records
_MAX_PIECES = 8  # pieces that are tested; each is tested for every period
_MIN_REPEATS_OF_PHASE = 0.98  # least share of repeats in the fullest phase of a period
_MAX_REPEATS_OF_OTHERS = 0.9  # largest share of repeats in any other phase
_MAX_LOG10_CHANCE = -12.0  # of the probability that the repeats are random


@dataclass(frozen=True)
class Held:
    """Samples that repeat periodically."""

    every: int  # period, records
    share: float  # share of repeats among the other samples


def find_regular_repeats(pieces: list[Excerpt]) -> Held | None:
    """Return the period at which samples repeat their predecessor; None if there is none."""
    whole = [piece.values for piece in pieces if len(piece.values) >= PIECE_SIZE // 4]
    whole = whole[:: max(1, len(whole) // _MAX_PIECES)][:_MAX_PIECES]
    periods = np.arange(3, _MAX_PERIOD + 1)
    regular: list[Held] = []
    for values in whole:
        repeats, records = np.flatnonzero(values[1:] == values[:-1]), len(values) - 1
        counts = np.zeros((_MAX_PERIOD + 1, 2), dtype=np.int64)
        _count_phases(repeats, counts)
        most, second = counts[3:].T
        turns = records // periods
        share = (len(repeats) - most) / (records - turns)
        # Corrected for the number of phases and periods that are tested.
        chance = most * np.log10(share + 1.0 / records) + np.log10(periods * _MAX_PERIOD)
        is_regular = (
            (most >= _MIN_REPEATS_OF_PHASE * turns)
            & (second <= _MAX_REPEATS_OF_OTHERS * turns)
            & (chance < _MAX_LOG10_CHANCE)
        )
        if is_regular.any():
            first = int(np.argmax(is_regular))
            regular.append(Held(int(periods[first]), float(share[first])))
    if not regular or 2 * len(regular) <= len(whole):
        return None
    every = int(np.median([of_piece.every for of_piece in regular]))
    return Held(every, float(np.median([of_piece.share for of_piece in regular])))


@njit(cache=True, nogil=True)
def _count_phases(repeats: NDArray[np.int64], counts: NDArray[np.int64]) -> None:
    """Count the repeats in the fullest and the second fullest phase of each period."""
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


def find_held_samples(channel: str, column: ColumnSummary) -> Iterator[Finding]:
    """Yield a finding if every n-th sample of a channel repeats its predecessor."""
    if column.repeats < column.present / (2 * _MAX_PERIOD):
        return
    regular = find_regular_repeats(column.excerpts())
    if regular is None:
        return
    data = HeldSamples(regular.every, regular.share)
    yield find(data, "warning", regular.every, channel)
