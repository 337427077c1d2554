"""Means of the blocks of a log, of several lengths in one pass and bounded memory."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan.phase import finite_mean
from imubench_pipeline.typing import Array

Span = tuple[int, int]

PRESENT = 0.9
"""Part of the samples of a block that must be there, as of a cluster of the Allan variance."""


def block_means(
    parts: Iterable[NDArray[np.floating[Any]]],
    segments: Sequence[Span],
    rate: float,
    lengths: Iterable[float],
) -> dict[float, list[Array]]:
    """Return the means of consecutive blocks of each segment, NaN where samples are missing.

    A block has a sample more or less than others where the samples do not divide evenly.

    Parameters
    ----------
    parts : iterable of ndarray
        The log in order, NaN where a sample is missing.
    segments : sequence of (int, int)
        First and one-past-last sample of each.
    rate : float
        Hz.
    lengths : iterable of float
        Of the blocks, s; a sample or more.

    Returns
    -------
    dict of float to list of ndarray
        By length, of each segment: rad/s or m/s^2, less one constant of the log.
    """
    edges = {
        length: [_edges(start, stop, length * rate) for start, stop in segments]
        for length in lengths
    }
    if not edges:
        return {}
    sums = _sums(parts, np.unique(np.concatenate([one for many in edges.values() for one in many])))
    return {length: [sums.means(one) for one in many] for length, many in edges.items()}


def _edges(start: int, stop: int, samples: float) -> NDArray[np.int64]:
    """Return the first sample of each block of a segment, and the one after the last block."""
    blocks = math.floor((stop - start) / samples + 1e-9)
    return start + np.rint(np.arange(blocks + 1) * samples).astype(np.int64)


@dataclass(frozen=True)
class _Sums:
    """Sums of the samples before each edge, and how many they are."""

    edges: NDArray[np.int64]
    sums: Array
    present: NDArray[np.int64]

    def means(self, edges: NDArray[np.int64]) -> Array:
        places = np.searchsorted(self.edges, edges)
        there, size = np.diff(self.present[places]), np.diff(edges)
        means = np.full(len(size), np.nan)
        enough = (there >= PRESENT * size) & (there > 0)
        np.divide(np.diff(self.sums[places]), there, out=means, where=enough)
        return means


def _sums(parts: Iterable[NDArray[np.floating[Any]]], edges: NDArray[np.int64]) -> _Sums:
    sums, present = np.zeros(len(edges)), np.zeros(len(edges), dtype=np.int64)
    reached, total, count = 0, 0.0, 0
    level: float | None = None
    for part in parts:
        if level is None and not np.isnan(part).all():
            # Gravity would eat the digits of the sum.
            level = finite_mean(part)
        values = part - (level or 0.0)
        gaps = np.isnan(values)
        holes = bool(gaps.any())
        running = np.cumsum(np.where(gaps, 0.0, values) if holes else values)
        first, last = np.searchsorted(edges, [reached + 1, reached + len(part) + 1])
        places = edges[first:last] - reached - 1
        sums[first:last] = total + running[places]
        if holes:
            counted = np.cumsum(~gaps)
            present[first:last] = count + counted[places]
            count += int(counted[-1])
        else:
            present[first:last] = count + places + 1
            count += len(part)
        reached, total = reached + len(part), total + float(running[-1])
    return _Sums(edges, sums, present)
