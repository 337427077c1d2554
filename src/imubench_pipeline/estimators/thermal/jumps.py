"""Jumps of a temperature: where the smooth path of its readings begins anew.

A chamber that is set to another temperature, or a sensor that is carried out, changes within a
few samples by far more than in the minutes around. One smooth path through that would have to be
rough everywhere, and would say of the levels between the jumps that they are known all too well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from imubench_pipeline.estimators.thermal.register import Readings
from imubench_pipeline.typing import Array

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


def at_jumps(read: Readings) -> Readings:
    """Return readings with the blocks cut where the temperature jumps, and a piece between jumps.

    The sample of a jump follows from the mean of the block that it falls into. A single sample
    stands on each side, so that a path that is linear between the middles of blocks jumps there.

    Returns
    -------
    Readings
        The same where there is none.
    """
    parts = [_of_part(read, part) for part in read.parts]
    if not any(jumps for jumps in parts):
        return read
    columns: list[Array] = []
    pieces: list[slice] = []
    places: list[slice] = []
    done = 0
    for part, jumps in zip(read.parts, parts, strict=True):
        found, cuts = _cut(read, part, jumps)
        columns.append(found)
        ends = [0, *cuts, found.shape[1]]
        places.append(slice(done, done + found.shape[1]))
        pieces += [slice(done + a, done + b) for a, b in pairwise(ends)]
        done += found.shape[1]
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
