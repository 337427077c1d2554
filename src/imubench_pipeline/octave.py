"""The multi-octave Allan variance: one pass over the log for every tau, in bounded memory.

Clusters of n samples need not start at every sample: starts n/48 apart, or closer, cost no
measurable efficiency. So the phase is decimated as n grows, and the work is O(L). Inside a
section of the log that fits the cache the phase is decimated up to `DECIMATION`; longer clusters
are taken from the phase of the whole log at that stride.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.phase import Phase, accumulate_present, integrate, sum_present, sum_squares
from imubench_pipeline.threads import in_threads

Array = NDArray[np.float64]

STEPS = 48
"""Starts of clusters within a cluster's length, at least."""

DECIMATION = 64
"""Stride of the phase that is kept of the whole log."""

SECTION = 1 << 17
"""Samples that are summed together: their phase fits the cache."""

INNER = 1 << 11
"""Starts whose clusters of all sizes are summed while their phase is in the L1 cache."""

SHORTEST = 1 << 16
"""Samples of a log that is worth a decimation; the clusters of a shorter one overlap fully."""

_LEVELS = 6  # strides 1, 2 ... 32 inside a section
_AHEAD = 2 * STEPS * DECIMATION  # two of the longest clusters of a section
_FIRST = 1 << 18


def octave_sizes(sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Round cluster sizes to multiples of the stride of their octave (by 1 % at most)."""
    stride = np.left_shift(1, _level(sizes))
    return np.unique(np.rint(sizes / stride).astype(np.int64) * stride)


def _level(sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.maximum(0, np.floor(np.log2(sizes / STEPS) + 1e-12)).astype(np.int64)


class OctaveSums:
    """Sums of squared differences of cluster means of one segment of a log.

    Parameters
    ----------
    sizes : ndarray of int, shape (m,)
        n of each tau, as `octave_sizes` gives them.
    share : float
        Part of a cluster's samples that must be there for its mean to count.
    holes : bool
        Samples may be missing (NaN).
    threads : int
        The sums have the same bits for any number.
    """

    def __init__(
        self, sizes: NDArray[np.int64], *, share: float, holes: bool, threads: int = 1
    ) -> None:
        self._sizes, self._holes, self._threads = sizes, holes, threads
        self._enough = np.ceil(share * sizes - 1e-9).astype(np.int64)
        self._short = _level(sizes) < _LEVELS
        self._sums = np.zeros((3, len(sizes)))
        self._possible = np.zeros(len(sizes), dtype=np.int64)
        self._edges: list[Array] = []
        self._counts: list[NDArray[np.int64]] = []
        self._at, self._present_at = 0.0, 0
        self._rest = np.empty(0)
        self._bias: float | None = None
        self._first: list[Array] = []
        self.samples = 0

    def push(self, block: Array) -> None:
        """Take the next samples, in SI; NaN where one is missing."""
        if self.samples < _FIRST:
            self._first.append(block[: _FIRST - self.samples].copy())
        self.samples += len(block)
        joined = np.concatenate((self._rest, block)) if len(self._rest) else block
        ready = max(0, (len(joined) - _AHEAD) // SECTION)
        self._sum(joined, ready)
        self._rest = joined[ready * SECTION :].copy()

    def finish(self) -> None:
        """Sum up what is left, and the long clusters."""
        sections = -(-len(self._rest) // SECTION)
        self._sum(self._rest, sections)
        self._rest = np.empty(0)
        theta = np.concatenate([*self._edges, [self._at]]) if self._edges else np.zeros(1)
        # The edge after the last section is a point of the grid only if the log ends on it.
        points = self.samples // DECIMATION + 1
        self.theta = theta[:points]
        self.present: NDArray[np.int64] | None = None
        if self._holes:
            self.present = np.concatenate([*self._counts, [self._present_at]])[:points]
        for j in np.flatnonzero(~self._short):
            self._add_long(int(j))

    @property
    def first(self) -> Phase:
        """Cumulative sums of the first samples."""
        begin = np.concatenate(self._first)
        return integrate([begin], len(begin), holes=self._holes)

    @property
    def results(self) -> tuple[Array, Array, NDArray[np.int64], NDArray[np.int64]]:
        """Sum of squares, sum of mean inverse counts, differences, and the most there could be."""
        squares, thinned, terms = self._sums
        return squares, thinned, np.rint(terms).astype(np.int64), self._possible

    def _add_long(self, j: int) -> None:
        theta, present = self.theta, self.present
        m = int(self._sizes[j]) // DECIMATION
        most = max(0, len(theta) - 2 * m)
        if most == 0:
            return
        if present is None:
            square = sum_squares(theta[: -2 * m], theta[m:-m], theta[2 * m :])
            n = float(self._sizes[j])
            self._sums[:, j] += np.array([square / n**2, most / n, most])
        else:
            counts = present[m:] - present[:-m]
            good = counts >= self._enough[j]
            means = (theta[m:] - theta[:-m]) / np.maximum(counts, 1)
            both = good[m:] & good[:-m]
            difference = (means[m:] - means[:-m])[both]
            thinned = 0.5 / counts[m:][both] + 0.5 / counts[:-m][both]
            self._sums[:, j] += np.array([difference @ difference, thinned.sum(), len(difference)])
        self._possible[j] += most

    def _sum(self, samples: Array, sections: int) -> None:
        """Sum the short clusters that begin in complete sections, and keep the decimated phase."""
        if sections == 0:
            return
        if self._bias is None:
            begin = samples[: min(SECTION, len(samples))]
            finite = begin[np.isfinite(begin)]
            self._bias = float(finite.mean()) if len(finite) else 0.0
        sizes = self._sizes[self._short]
        kernel = _sections_with_holes if self._holes else _sections
        arguments = (self._bias, sizes, _level(sizes), self._enough[self._short])
        sums, possible, edges, present = in_threads(
            lambda low, high: kernel(samples, low, high, *arguments), sections, self._threads
        )
        for section in range(sections):
            self._sums[:, self._short] += sums[section]
            self._possible[self._short] += possible[section]
            start = section * SECTION
            kept = min(SECTION, len(samples) - start)
            points = -(-kept // DECIMATION)
            self._edges.append(self._at + edges[section, :points])
            self._at += edges[section, -1]
            if self._holes:
                self._counts.append(self._present_at + present[section, :points])
                self._present_at += int(present[section, -1])


def split(
    blocks: Iterable[Array], segments: Sequence[tuple[int, int]]
) -> Iterator[tuple[int, Array]]:
    """Yield blocks cut at the ends of segments, each with the number of its segment."""
    reached, number = 0, 0
    for block in blocks:
        begin = 0
        while begin < len(block) and number < len(segments):
            start, stop = segments[number]
            low = max(start - reached, begin)
            high = min(stop - reached, len(block))
            if high > low:
                yield number, block[low:high]
            if stop - reached <= len(block):
                number += 1
                begin = max(begin, high)
            else:
                break
        reached += len(block)


@njit(cache=True, nogil=True)
def _local_phase(samples: Array, bias: float, theta: Array) -> None:
    """Sum samples up in four chains at once: one chain waits for each addition."""
    quarter = samples.size // 4
    a = b = c = d = 0.0
    theta[0] = 0.0
    for i in range(quarter):
        a += samples[i] - bias
        b += samples[quarter + i] - bias
        c += samples[2 * quarter + i] - bias
        d += samples[3 * quarter + i] - bias
        theta[i + 1] = a
        theta[quarter + i + 1] = b
        theta[2 * quarter + i + 1] = c
        theta[3 * quarter + i + 1] = d
    for i in range(quarter):
        theta[quarter + i + 1] += a
    b += a
    for i in range(quarter):
        theta[2 * quarter + i + 1] += b
    c += b
    for i in range(quarter):
        theta[3 * quarter + i + 1] += c
    d += c
    for i in range(4 * quarter, samples.size):
        d += samples[i] - bias
        theta[i + 1] = d


@njit(cache=True, nogil=True)
def _sections(
    samples: Array,
    low: int,
    high: int,
    bias: float,
    sizes: NDArray[np.int64],
    levels: NDArray[np.int64],
    enough: NDArray[np.int64],
) -> tuple[Array, NDArray[np.int64], Array, NDArray[np.int64]]:
    """Sum the clusters that begin in sections ``low`` to ``high``; return them, and the phase."""
    sections = high - low
    sums = np.zeros((sections, 3, sizes.size))
    possible = np.zeros((sections, sizes.size), dtype=np.int64)
    edges = np.zeros((sections, SECTION // DECIMATION + 1))
    counts = np.zeros((sections, 1), dtype=np.int64)
    for section in range(sections):
        begin = (low + section) * SECTION
        stop = min(begin + SECTION + _AHEAD, samples.size)
        own = min(SECTION, samples.size - begin)
        theta = np.empty(stop - begin + 1)
        _local_phase(samples[begin:stop], bias, theta)
        edges[section, -1] = theta[own]
        points = theta.size
        for level in range(_LEVELS):
            starts = (own + (1 << level) - 1) >> level
            for block in range(0, starts, INNER):
                for j in range(sizes.size):
                    if levels[j] == level:
                        m = sizes[j] >> level
                        stop_at = min(block + INNER, starts, points - 2 * m)
                        if stop_at > block:
                            square = sum_squares(
                                theta[block:stop_at],
                                theta[block + m : stop_at + m],
                                theta[block + 2 * m : stop_at + 2 * m],
                            )
                            sums[section, 0, j] += square / (sizes[j] * sizes[j])
                            sums[section, 1, j] += (stop_at - block) / sizes[j]
                            sums[section, 2, j] += stop_at - block
                            possible[section, j] += stop_at - block
            points = (points + 1) // 2
            for i in range(points):
                theta[i] = theta[2 * i]
        for i in range((own + DECIMATION - 1) // DECIMATION):
            edges[section, i] = theta[i]
    return sums, possible, edges, counts


@njit(cache=True, nogil=True)
def _sections_with_holes(
    samples: Array,
    low: int,
    high: int,
    bias: float,
    sizes: NDArray[np.int64],
    levels: NDArray[np.int64],
    enough: NDArray[np.int64],
) -> tuple[Array, NDArray[np.int64], Array, NDArray[np.int64]]:
    """Sum the clusters that begin in sections ``low`` to ``high``; return them, and the phase."""
    sections = high - low
    sums = np.zeros((sections, 3, sizes.size))
    possible = np.zeros((sections, sizes.size), dtype=np.int64)
    edges = np.zeros((sections, SECTION // DECIMATION + 1))
    counts = np.zeros((sections, SECTION // DECIMATION + 1), dtype=np.int64)
    for section in range(sections):
        begin = (low + section) * SECTION
        stop = min(begin + SECTION + _AHEAD, samples.size)
        own = min(SECTION, samples.size - begin)
        theta = np.empty(stop - begin + 1)
        present = np.empty(stop - begin + 1, dtype=np.int64)
        theta[0] = 0.0
        present[0] = 0
        accumulate_present(samples[begin:stop], bias, theta, present)
        edges[section, -1] = theta[own]
        counts[section, -1] = present[own]
        points = theta.size
        for level in range(_LEVELS):
            starts = (own + (1 << level) - 1) >> level
            for j in range(sizes.size):
                if levels[j] == level:
                    m = sizes[j] >> level
                    most = min(starts, points - 2 * m)
                    total, thinned, number = sum_present(theta, present, m, enough[j], 0, most)
                    sums[section, 0, j] = total
                    sums[section, 1, j] = thinned
                    sums[section, 2, j] = number
                    possible[section, j] = max(most, 0)
            points = (points + 1) // 2
            for i in range(points):
                theta[i] = theta[2 * i]
                present[i] = present[2 * i]
        for i in range((own + DECIMATION - 1) // DECIMATION):
            edges[section, i] = theta[i]
            counts[section, i] = present[i]
    return sums, possible, edges, counts
