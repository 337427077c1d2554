"""The multi-octave Allan variance: one pass over the log for all tau, in bounded memory.

Clusters of n samples that start n/48 apart, or closer, cost no measurable efficiency. The phase
(cumulative sum) is therefore decimated as n grows: up to `DECIMATION` within a section of the log
that fits the cache. Longer clusters use the phase of the whole log at that stride. It takes O(L).
"""

from queue import SimpleQueue
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.allan.phase import (
    NO_GAPS,
    Gaps,
    Phase,
    accumulate,
    accumulate_present,
    average_finite,
    integrate,
    sum_all_sizes,
    sum_present,
    sum_sizes,
)
from imubench_pipeline.allan.threads import run_in_threads
from imubench_pipeline.typing import Array

Integers = NDArray[np.int64]
Samples = NDArray[np.floating[Any]]

Grid = tuple[Integers, Integers, Integers, Integers]
"""Ascending sizes of short clusters in samples, in strides of their level, and in strides of all
lanes; and the index of the first size of each level."""

Buffers = tuple[Array, Array, Integers]
"""Arrays that a thread reuses: the phase of a section, of the samples after it, and counts."""

MIN_STARTS_PER_CLUSTER = 48  # least number of starts of clusters per cluster length
DECIMATION = 64  # stride of the stored phase of the whole log
SECTION_SAMPLES = 1 << 16  # samples that are summed together, so that their phase fits the L2 cache
FULL_PHASE_SAMPLES = 1 << 17  # with fully stored phase, for the noise type of short clusters
MIN_DECIMATED_SAMPLES = 1 << 16  # shorter logs use fully overlapping clusters
_LEVELS_IN_SECTION = 6  # strides 1, 2 ... 32 inside a section
_POINTS_OF_LONGEST_PAIR = 4 * MIN_STARTS_PER_CLUSTER  # at any stride, of a pair of clusters
_OVERLAP_SAMPLES = _POINTS_OF_LONGEST_PAIR * DECIMATION // 2
_NUMBER_OF_LANES = 4  # parts of a section whose phases are interleaved
_STARTS_PER_BLOCK = 1 << 11  # starts that are summed for all sizes while they are in the L1 cache


def round_octave_sizes(sizes: Integers) -> Integers:
    """Round cluster sizes to multiples of the stride of their octave (by 1 % at most)."""
    stride = np.left_shift(1, _find_level(sizes))
    return np.unique(np.rint(sizes / stride).astype(np.int64) * stride)


def _find_level(sizes: Integers) -> Integers:
    return np.maximum(0, np.floor(np.log2(sizes / MIN_STARTS_PER_CLUSTER) + 1e-12)).astype(np.int64)


class OctaveSums:
    """Accumulates the squared differences of cluster means of one segment of a log.

    `push` takes the ``samples`` of the segment in blocks; after `finish`, `results` has the sums.
    The sizes, shape (m,), are from `round_octave_sizes`; the sums have the same bits for any number
    of threads. With ``holes`` samples may be missing (NaN). ``theta`` and ``present`` are the phase
    at every `DECIMATION`-th sample, ``first`` is the phase of the first samples.
    """

    def __init__(
        self, sizes: Integers, samples: int, *, holes: bool, gaps: Gaps = NO_GAPS, threads: int = 1
    ) -> None:
        self._sizes, self._holes, self._threads = sizes, holes, max(1, threads)
        self._short = _find_level(sizes) < _LEVELS_IN_SECTION
        short = sizes[self._short]
        level = _find_level(short)
        steps = short >> level
        self._grid = (
            short,
            steps,
            _NUMBER_OF_LANES * steps,
            np.searchsorted(level, np.arange(_LEVELS_IN_SECTION + 1)),
        )
        self._gaps, self._enough = gaps, gaps.enough(short)
        self._sums = np.zeros((4, len(short)))
        # The end of the log is a point of the grid only if it falls on it.
        points = samples // DECIMATION + 1
        self.theta = np.zeros(points)
        self.present = np.zeros(points, dtype=np.int64) if holes else None
        self._filled = 0
        self._at, self._present_at = 0.0, 0
        self._begin: list[Samples] = []
        self._bias = 0.0
        self._rest: Samples = np.empty(0, dtype=np.float32)
        self._rooms: SimpleQueue[Buffers] = SimpleQueue()
        points = SECTION_SAMPLES + _OVERLAP_SAMPLES + 1
        for _ in range(self._threads):
            phase = np.empty(points + 8)
            # Aligned to a cache line: a load across two lines takes twice the time.
            start = -phase.ctypes.data % 64 // 8
            tail, present = np.empty(_OVERLAP_SAMPLES + 1), np.empty(points * holes, dtype=np.int64)
            self._rooms.put((phase[start : start + points], tail, present))
        self.received = 0

    def push(self, block: Samples) -> None:
        """Add the next samples, in SI; NaN where one is missing."""
        block = np.ascontiguousarray(block)
        if self.received < FULL_PHASE_SAMPLES:
            self._begin.append(block[: FULL_PHASE_SAMPLES - self.received].copy())
        self.received += len(block)
        rest = self._rest
        ready = max(0, (len(rest) + len(block) - _OVERLAP_SAMPLES) // SECTION_SAMPLES)
        used = ready * SECTION_SAMPLES - len(rest)
        if ready:
            # Only sections that begin in the remainder are copied, with the samples they need.
            heads = min(ready, -(-len(rest) // SECTION_SAMPLES))
            end = heads * SECTION_SAMPLES + _OVERLAP_SAMPLES - len(rest)
            head = np.concatenate((rest, block[:end]))
            body = block[heads * SECTION_SAMPLES - len(rest) :] if ready > heads else block[:0]
            self._sum(head, heads, body, ready)
        self._rest = block[used:].copy() if used >= 0 else np.concatenate((rest[used:], block))

    def finish(self) -> None:
        """Add the last samples; ValueError if any is infinite, or missing without ``holes``."""
        sections = -(-len(self._rest) // SECTION_SAMPLES)
        if sections:
            self._sum(self._rest, sections, self._rest[:0], sections)
        self._rest = self._rest[:0]
        if self._filled < len(self.theta):
            self.theta[self._filled] = self._at
            if self.present is not None:
                self.present[self._filled] = self._present_at
        if not np.isfinite(self._at):
            raise ValueError(
                "a sample is infinite; expected a finite number, or NaN where it is missing"
                if self._holes
                else "a sample is missing or infinite, but holes=False; expected finite numbers"
            )
        self.first = integrate(self._begin, sum(map(len, self._begin)), holes=self._holes)

    @property
    def phase(self) -> Phase:
        """Cumulative sums at every `DECIMATION`-th sample."""
        return Phase(self.theta, self.present, ((0, len(self.theta) - 1),))

    @property
    def results(self) -> list[NDArray[Any]]:
        """Four arrays of shape (m,): the sums by size that `sum_all_sizes` returns."""
        steps = self._sizes[~self._short] // DECIMATION
        long = sum_all_sizes(self.phase, steps, self._threads, stride=DECIMATION, gaps=self._gaps)
        return [
            np.concatenate((of_short.astype(of_long.dtype), of_long))
            for of_short, of_long in zip(self._sums, long, strict=True)
        ]

    def _sum(self, head: Samples, heads: int, body: Samples, sections: int) -> None:
        """Sum the short clusters that begin in sections of head, then body; store their phase."""
        if not self._filled:
            self._bias = average_finite((head if heads else body)[:SECTION_SAMPLES])
        # Converted to one type, so that the kernel is compiled only once.
        head, body = head.view(), body.astype(head.dtype, copy=False).view()
        head.flags.writeable = body.flags.writeable = False

        def work(low: int, high: int) -> tuple[NDArray[Any], ...]:
            room = self._rooms.get()
            try:
                return self._sections(low, high, head, heads, body, room)
            finally:
                self._rooms.put(room)

        sums, totals, edges, counts = run_in_threads(work, sections, self._threads)
        for row in sums:
            self._sums += row  # one by one, so that the order does not depend on the blocks
        # At the end of the log the last section may be shorter.
        samples = len(head) if heads == sections else sections * SECTION_SAMPLES
        points = -(-min(sections * SECTION_SAMPLES, samples) // DECIMATION)
        filled = slice(self._filled, self._filled + points)
        before = np.cumsum(np.concatenate(([self._at], totals)))
        edges += before[:-1, None]
        self.theta[filled] = edges.reshape(-1)[:points]
        self._at = float(before[-1])
        if self.present is not None:
            present = np.cumsum(np.concatenate(([self._present_at], counts[:, -1])))
            counts += present[:-1, None]
            self.present[filled] = counts[:, :-1].reshape(-1)[:points]
            self._present_at = int(present[-1])
        self._filled += points

    def _sections(
        self, low: int, high: int, head: Samples, heads: int, body: Samples, room: Buffers
    ) -> tuple[Array, Array, Array, Integers]:
        """Sum the clusters that begin in sections ``low`` to ``high``.

        Returns by section: sums, shape (4, sizes), as `results`; the total of the samples less the
        bias; edges, cumulative sums at every `DECIMATION`-th sample; and counts, numbers of samples
        present at the edges and in all (empty: all are).
        """
        theta, tail, present = room
        number, points = high - low, SECTION_SAMPLES // DECIMATION
        sums, totals = np.zeros((number, 4, len(self._grid[0]))), np.zeros(number)
        edges = np.zeros((number, points))
        counts = np.zeros((number, points + 1 if self._holes else 0), dtype=np.int64)
        whole = np.zeros(number, dtype=np.bool_)
        common = (self._bias, self._grid, theta)
        _sum_sections(low, head, heads, body, *common, tail, sums, totals, edges, whole)
        for section in range(number):
            in_head = low + section < heads
            begin = (low + section - (0 if in_head else heads)) * SECTION_SAMPLES
            end = begin + SECTION_SAMPLES + _OVERLAP_SAMPLES
            samples = (head if in_head else body)[begin:end]
            of_section = (*common, sums[section], edges[section])
            if len(samples) < SECTION_SAMPLES + _OVERLAP_SAMPLES:
                totals[section], whole[section] = _sum_end(samples, *of_section)
            if self._holes and whole[section]:
                counts[section] = np.minimum(np.arange(points + 1) * DECIMATION, len(samples))
            elif self._holes:
                totals[section] = _sum_present(
                    samples, *of_section, self._enough, present, counts[section]
                )
        return sums, totals, edges, counts


@njit(cache=True, nogil=True)
def _sum_sections(
    low: int,
    head: Samples,
    heads: int,
    body: Samples,
    bias: float,
    grid: Grid,
    theta: Array,
    tail: Array,
    sums: Array,
    totals: Array,
    edges: Array,
    whole: NDArray[np.bool_],
) -> None:
    """Sum sections without missing samples as `OctaveSums._sections`; set ``whole`` for them."""
    offsets = np.empty(_NUMBER_OF_LANES + 1)
    for section in range(totals.size):
        begin = (low + section) * SECTION_SAMPLES
        source = head
        if low + section >= heads:
            begin -= heads * SECTION_SAMPLES
            source = body
        samples = source[begin : min(begin + SECTION_SAMPLES + _OVERLAP_SAMPLES, source.size)]
        if samples.size == SECTION_SAMPLES + _OVERLAP_SAMPLES:
            _integrate_lanes(samples, bias, theta, tail, offsets)
            totals[section] = offsets[_NUMBER_OF_LANES]
            whole[section] = np.isfinite(offsets[_NUMBER_OF_LANES] + tail[_OVERLAP_SAMPLES])
            if whole[section]:
                _sum_lanes(offsets, theta, tail, grid, sums[section], edges[section])


@njit(cache=True, nogil=True)
def _integrate_lanes(
    samples: Samples, bias: float, theta: Array, tail: Array, offsets: Array
) -> None:
    """Integrate a section in four interleaved lanes, and the samples after it; set the offsets.

    A single sum would wait for each addition. With interleaved lanes, the loads for the differences
    are aligned for any size.
    """
    rows = SECTION_SAMPLES // _NUMBER_OF_LANES
    # Slices of equal length first, so that the loop needs no bounds checks.
    first, second = samples[:rows], samples[rows : 2 * rows]
    third, fourth = samples[2 * rows : 3 * rows], samples[3 * rows : 4 * rows]
    a = b = c = d = 0.0
    for i in range(rows):
        theta[_NUMBER_OF_LANES * i] = a
        theta[_NUMBER_OF_LANES * i + 1] = b
        theta[_NUMBER_OF_LANES * i + 2] = c
        theta[_NUMBER_OF_LANES * i + 3] = d
        a += first[i] - bias
        b += second[i] - bias
        c += third[i] - bias
        d += fourth[i] - bias
    tail[0] = 0.0
    accumulate(samples[SECTION_SAMPLES:], bias, tail)
    offsets[0], offsets[1] = 0.0, a
    offsets[2], offsets[3], offsets[4] = a + b, a + b + c, a + b + c + d


@njit(cache=True, nogil=True)
def _sum_lanes(
    offsets: Array, theta: Array, tail: Array, grid: Grid, sums: Array, edges: Array
) -> None:
    """Sum the clusters that begin in a section in lanes, and decimate its phase."""
    sizes, _, steps, begins = grid
    rows = SECTION_SAMPLES // _NUMBER_OF_LANES
    lengths = np.empty(_NUMBER_OF_LANES)
    for lane in range(_NUMBER_OF_LANES):
        lengths[lane] = offsets[lane + 1] - offsets[lane]
    for level in range(_LEVELS_IN_SECTION):
        # Each lane is continued with the beginning of the next one.
        for i in range(_POINTS_OF_LONGEST_PAIR):
            for lane in range(_NUMBER_OF_LANES - 1):
                theta[(rows + i) * _NUMBER_OF_LANES + lane] = (
                    lengths[lane] + theta[i * _NUMBER_OF_LANES + lane + 1]
                )
            theta[(rows + i) * _NUMBER_OF_LANES + _NUMBER_OF_LANES - 1] = (
                lengths[_NUMBER_OF_LANES - 1] + tail[i]
            )
        starts = _NUMBER_OF_LANES * rows
        points = starts + _NUMBER_OF_LANES * _POINTS_OF_LONGEST_PAIR
        _sum_level(theta, starts, points, sizes, steps, begins[level], begins[level + 1], sums)
        rows //= 2
        for i in range(rows):
            for lane in range(_NUMBER_OF_LANES):
                theta[i * _NUMBER_OF_LANES + lane] = theta[2 * i * _NUMBER_OF_LANES + lane]
        for i in range((_POINTS_OF_LONGEST_PAIR << (_LEVELS_IN_SECTION - 1 - level)) // 2):
            tail[i] = tail[2 * i]
    for lane in range(_NUMBER_OF_LANES):
        for i in range(rows):
            edges[lane * rows + i] = offsets[lane] + theta[i * _NUMBER_OF_LANES + lane]


@njit(cache=True, nogil=True)
def _sum_end(
    samples: Samples, bias: float, grid: Grid, theta: Array, sums: Array, edges: Array
) -> tuple[float, bool]:
    """Sum as `_sum_lanes` at the end of the log; return total and whether no sample is missing."""
    sizes, steps, _, begins = grid
    own, points = min(SECTION_SAMPLES, samples.size), samples.size + 1
    theta[0] = 0.0
    accumulate(samples, bias, theta)
    total = theta[own]
    if not np.isfinite(theta[samples.size]):
        return total, False
    for level in range(_LEVELS_IN_SECTION):
        starts = (own + (1 << level) - 1) >> level
        _sum_level(theta, starts, points, sizes, steps, begins[level], begins[level + 1], sums)
        points = (points + 1) // 2
        for i in range(points):
            theta[i] = theta[2 * i]
    for i in range((own + DECIMATION - 1) // DECIMATION):
        edges[i] = theta[i]
    return total, True


@njit(cache=True, nogil=True)
def _sum_level(
    theta: Array,
    starts: int,
    points: int,
    sizes: Integers,
    steps: Integers,
    low: int,
    high: int,
    sums: Array,
) -> None:
    """Sum the differences of the clusters of sizes ``low`` to ``high``, of one level."""
    for block in range(0, starts, _STARTS_PER_BLOCK):
        stop = min(block + _STARTS_PER_BLOCK, starts)
        sum_sizes(theta[:points], block, stop, steps[low:high], sums[0, low:high])
    for j in range(low, high):
        most = max(0, min(starts, points - 2 * steps[j]))
        sums[0, j] /= sizes[j] * sizes[j]
        sums[1, j] = most / sizes[j]
        sums[2, j] = most
        sums[3, j] = most


@njit(cache=True, nogil=True)
def _sum_present(
    samples: Samples,
    bias: float,
    grid: Grid,
    theta: Array,
    sums: Array,
    edges: Array,
    enough: Integers,
    present: Integers,
    counts: Integers,
) -> float:
    """Sum as `_sum_end` where samples are missing; return the sum of samples less the bias."""
    _, steps, _, begins = grid
    own, points = min(SECTION_SAMPLES, samples.size), samples.size + 1
    theta[0] = 0.0
    present[0] = 0
    accumulate_present(samples, bias, theta, present)
    total, counts[counts.size - 1] = theta[own], present[own]
    for level in range(_LEVELS_IN_SECTION):
        starts = (own + (1 << level) - 1) >> level
        for j in range(begins[level], begins[level + 1]):
            most = max(0, min(starts, points - 2 * steps[j]))
            of_size = sum_present(theta, present, steps[j], enough[j], 0, most)
            sums[0, j], sums[1, j], sums[2, j] = of_size[0], of_size[1], float(of_size[2])
            sums[3, j] = most
        points = (points + 1) // 2
        for i in range(points):
            theta[i] = theta[2 * i]
            present[i] = present[2 * i]
    for i in range((own + DECIMATION - 1) // DECIMATION):
        edges[i] = theta[i]
        counts[i] = present[i]
    return total
