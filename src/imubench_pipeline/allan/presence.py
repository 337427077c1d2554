"""Record the missing samples of a log at two resolutions, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan.phase import GapCount, Gaps, Span, spans_of

Counts = NDArray[np.int64]

_MAX_COARSE_POINTS = 1 << 15
_MIN_CLUSTERS = 16
_STARTS_PER_CLUSTER = 32


@dataclass(frozen=True)
class Presence:
    """Cumulative numbers of samples present."""

    samples: int  # L, the points of the grid
    segments: tuple[Span, ...]  # grid points that begin and end each segment
    first: Counts  # samples present before each of the first points
    stride: int
    coarse: Counts  # samples present before every ``stride``-th point of the log
    gaps: Gaps

    def differences(self, n: int) -> tuple[NDArray[np.bool_], int] | None:
        """Return a mask of the valid differences of adjacent cluster means, and their stride.

        ``n``: samples in a cluster. The mask is for differences that begin a stride apart, in the
        whole log, or in its beginning if that has enough clusters. None: no resolution is enough.
        """
        if n >= _STARTS_PER_CLUSTER // 2 * self.stride:
            counts, base = self.coarse, self.stride
        elif len(self.first) - 1 >= min(2 * _MIN_CLUSTERS * n, self.samples):
            counts, base = self.first, 1
        else:
            return None
        size = round(n / base)
        begin = np.arange(0, len(counts) - 2 * size, max(1, size // _STARTS_PER_CLUSTER))
        if not len(begin):
            return np.zeros(0, dtype=np.bool_), base
        enough = self.gaps.enough(np.array([size * base]))[0]
        complete = np.ones(len(begin), dtype=np.bool_)
        for cluster in (begin, begin + size):
            complete &= counts[cluster + size] - counts[cluster] >= enough
        if len(self.segments) > 1:
            ends = np.array([stop for _, stop in self.segments])
            starts = np.array([start for start, _ in self.segments])
            points = begin * base
            which = np.minimum(np.searchsorted(ends, points, side="right"), len(ends) - 1)
            complete &= (points >= starts[which]) & (points + 2 * size * base <= ends[which])
        return complete, base * max(1, size // _STARTS_PER_CLUSTER)


def presence(
    blocks: Iterable[NDArray[np.floating[Any]]],
    samples: int,
    segments: Sequence[Span] | None = None,
) -> Presence:
    """Count the samples that are present in a log; NaN where one is missing.

    ``segments``: first and last grid point of each segment; one segment by default.
    """
    stride = 1
    while samples // stride > _MAX_COARSE_POINTS:
        stride *= 2
    first = np.zeros(min(samples, 2 * _MAX_COARSE_POINTS) + 1, dtype=np.int64)
    coarse = np.zeros(samples // stride + 1, dtype=np.int64)
    gaps = GapCount()
    reached = total = 0
    for block in blocks:
        counts = total + np.cumsum(np.isfinite(block), dtype=np.int64)
        stop = reached + len(block)
        gaps.add(block)
        points = np.arange(reached // stride + 1, min(stop // stride, len(coarse) - 1) + 1)
        coarse[points] = counts[points * stride - reached - 1]
        if reached + 1 < len(first):
            part = counts[: len(first) - 1 - reached]
            first[reached + 1 : reached + 1 + len(part)] = part
        reached, total = stop, int(counts[-1]) if len(counts) else total
    return Presence(samples, spans_of(segments, samples), first, stride, coarse, gaps.gaps())
