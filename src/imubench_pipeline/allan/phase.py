"""Cumulative sums of a log and sums of their squared differences, for the Allan variance.

The missing samples of a log are recorded at two resolutions, in bounded memory (`Presence`).
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.allan.threads import run_in_threads
from imubench_pipeline.typing import Array

BLOCK_DIFFERENCES = 1 << 14  # summed together, so that three float64 blocks stay in the L2 cache
MIN_PRESENT_SHARE = 0.9
"""Least share of the samples of a cluster for a valid mean; in a log with many short gaps, relative
to the usual share."""

_MIN_CLUSTER_OVER_SHORT_GAP = 4  # least ratio of a cluster to a gap that counts as short in it

_MAX_COARSE_POINTS = 1 << 15
_MIN_CLUSTERS = 16
_STARTS_PER_CLUSTER = 32

Span = tuple[int, int]
"""First and one-past-last sample of a segment."""


def list_spans(segments: Sequence[Span] | None, samples: int) -> tuple[Span, ...]:
    """Return the segments of a log; without any, the whole log is one segment."""
    return tuple(segments) if segments else ((0, samples),)


@dataclass(frozen=True)
class Gaps:
    """Numbers of missing samples of a log, by the length of their gap.

    The mean of a cluster is valid if the missing samples are spread evenly over the cluster, but
    not if they are in one long gap. The share of samples present in a cluster is therefore compared
    with the share between long gaps (see `enough`).
    """

    samples: int  # points of the grid
    missing: NDArray[np.int64]  # (64,): samples in gaps of length 1, 2 to 3, 4 to 7 and so on

    def enough(self, sizes: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the least number of samples that a cluster of each size needs for a valid mean."""
        longest = (1 << np.arange(1, 33)) - 1  # in each octave
        octaves = np.searchsorted(longest, sizes // _MIN_CLUSTER_OVER_SHORT_GAP, side="right")
        short = np.concatenate(([0], np.cumsum(self.missing)))[octaves]
        between = self.samples - (self.missing.sum() - short)
        usual = 1.0 - short / np.maximum(between, 1)
        return np.maximum(np.ceil(MIN_PRESENT_SHARE * usual * sizes - 1e-9), 1).astype(np.int64)


NO_GAPS = Gaps(0, np.zeros(64, dtype=np.int64))  # no gaps, or long ones only


@dataclass
class GapCount:
    """Counts the gaps of a log that is given in blocks."""

    _samples: int = 0
    _open: int = 0
    _missing: NDArray[np.int64] = field(default_factory=lambda: np.zeros(64, dtype=np.int64))

    def add(self, block: NDArray[np.floating[Any]]) -> None:
        """Add the next samples; NaN where one is missing."""
        self._samples += len(block)
        there = np.flatnonzero(np.isfinite(block))
        if not len(there):
            self._open += len(block)
            return
        inside = np.diff(there) - 1
        self._missing += _count_by_octave(np.concatenate(([self._open + there[0]], inside)))
        self._open = len(block) - 1 - int(there[-1])

    def gaps(self) -> Gaps:
        """Return the gaps so far."""
        return Gaps(self._samples, self._missing + _count_by_octave(np.array([self._open])))


def count_gaps(blocks: Iterable[NDArray[np.floating[Any]]]) -> Gaps:
    """Return the gaps of a log in consecutive blocks; NaN where a sample is missing."""
    count = GapCount()
    for block in blocks:
        count.add(block)
    return count.gaps()


def _count_by_octave(lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    lengths = lengths[lengths > 0]
    octaves = np.frexp(lengths.astype(np.float64))[1] - 1
    return np.bincount(octaves, weights=lengths, minlength=64).astype(np.int64)


@dataclass(frozen=True)
class Phase:
    """Cumulative sums of a log on its uniform grid."""

    theta: Array
    """Cumulative sum of the samples less a constant, shape (L + 1,); missing samples add 0."""
    present: NDArray[np.integer[Any]] | None
    """Cumulative number of samples present, shape (L + 1,); None: no sample is missing."""
    segments: tuple[Span, ...]  # grid points that begin and end each segment

    @property
    def samples(self) -> int:
        """L, the number of grid points."""
        return len(self.theta) - 1

    def every(
        self, n: int, start: int = 0, stop: int | None = None
    ) -> tuple[Array, NDArray[np.integer[Any]] | None]:
        """Return sums and counts at every n-th point from ``start`` to ``stop`` inclusive."""
        points = slice(start, None if stop is None else stop + 1, n)
        return self.theta[points], None if self.present is None else self.present[points]


def integrate(
    blocks: Iterable[NDArray[np.floating[Any]]],
    samples: int,
    *,
    holes: bool,
    segments: Sequence[Span] | None = None,
) -> Phase:
    """Return the cumulative sums of consecutive blocks; memory beyond the result is bounded.

    Without ``holes`` no sample may be missing (NaN), and no counts are stored. Raises ValueError if
    the blocks are not ``samples`` long, or a sample is infinite, or missing without ``holes``.
    """
    theta = np.empty(samples + 1)
    theta[0] = 0.0
    present = np.zeros(samples + 1, dtype=np.int32) if holes else None
    reached = 0
    level: float | None = None
    for block in blocks:
        values = np.asarray(block, dtype=np.float64)
        stop = reached + len(values)
        if stop > samples:
            raise ValueError(f"the blocks have more samples than expected, {samples}")
        if level is None and not np.isnan(values).all():
            # A constant cancels in the variance, but 9.81 would cost digits of the sum.
            level = average_finite(values)
        if present is None:
            accumulate(values, level or 0.0, theta[reached : stop + 1])
        else:
            reach = slice(reached, stop + 1)
            accumulate_present(values, level or 0.0, theta[reach], present[reach])
        reached = stop
    if reached != samples:
        raise ValueError(f"the blocks have {reached} samples, expected {samples}")
    if not np.isfinite(theta[-1]):
        raise ValueError(
            "a sample is infinite; expected a finite number, or NaN where it is missing"
            if holes
            else "a sample is missing or infinite, but holes=False; expected finite numbers"
        )
    return Phase(theta, present, list_spans(segments, samples))


def split(
    blocks: Iterable[NDArray[Any]], segments: Sequence[Span]
) -> Iterator[tuple[int, NDArray[Any]]]:
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


def average_finite(samples: NDArray[np.floating[Any]]) -> float:
    """Return the mean of the finite samples; 0 if there are none."""
    with np.errstate(invalid="ignore"):
        mean = float(samples.mean(dtype=np.float64))
    if not np.isfinite(mean):
        finite = samples[np.isfinite(samples)]
        mean = float(finite.mean(dtype=np.float64)) if len(finite) else 0.0
    return mean


@njit(cache=True, nogil=True)
def accumulate(values: NDArray[np.floating[Any]], level: float, theta: Array) -> None:
    """Set ``theta[1:]`` to ``theta[0]`` plus the cumulative sums of ``values`` minus ``level``."""
    total = theta[0]
    for i in range(values.size):
        total += values[i] - level
        theta[i + 1] = total


@njit(cache=True, nogil=True)
def accumulate_present(
    values: NDArray[np.floating[Any]], level: float, theta: Array, present: NDArray[Any]
) -> None:
    """Set cumulative sums (see `accumulate`) and counts of samples; NaN adds to neither."""
    total, number = theta[0], present[0]
    for i in range(values.size):
        if not np.isnan(values[i]):
            total += values[i] - level
            number += 1
        theta[i + 1] = total
        present[i + 1] = number


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _sum_squares(first: Array, middle: Array, last: Array) -> float:
    """Return the sum of (last - 2 middle + first)^2 over arrays of one length."""
    total = 0.0
    for i in range(first.size):
        difference = last[i] - 2.0 * middle[i] + first[i]
        total += difference * difference
    return total


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _sum_squares_twice(
    first: Array, middle: Array, last: Array, longer_middle: Array, longer_last: Array
) -> tuple[float, float]:
    """Return the result of `_sum_squares` for two sizes at once, which saves loads."""
    total = longer_total = 0.0
    for i in range(first.size):
        begin = first[i]
        difference = last[i] - 2.0 * middle[i] + begin
        total += difference * difference
        longer = longer_last[i] - 2.0 * longer_middle[i] + begin
        longer_total += longer * longer
    return total, longer_total


@njit(cache=True, nogil=True)
def sum_sizes(theta: Array, start: int, stop: int, sizes: NDArray[np.int64], sums: Array) -> None:
    """Add to ``sums``, by size, squared second differences that begin at ``start`` to ``stop``."""
    j = 0
    while j < sizes.size:
        n = sizes[j]
        end = max(start, min(stop, theta.size - 2 * n))
        # Slices first: an index i + 2 n inside the loop would prevent vectorisation.
        first, middle = theta[start:end], theta[start + n : end + n]
        last = theta[start + 2 * n : end + 2 * n]
        next_n = sizes[min(j + 1, sizes.size - 1)]
        if j + 1 < sizes.size and end == min(stop, theta.size - 2 * next_n):
            next_middle = theta[start + next_n : end + next_n]
            next_last = theta[start + 2 * next_n : end + 2 * next_n]
            both = _sum_squares_twice(first, middle, last, next_middle, next_last)
            sums[j] += both[0]
            sums[j + 1] += both[1]
            j += 2
        else:
            sums[j] += _sum_squares(first, middle, last)
            j += 1


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def sum_present(
    theta: Array, present: NDArray[Any], m: int, enough: int, start: int, stop: int
) -> tuple[float, float, int]:
    """Sum squared differences of adjacent means over the samples present.

    ``theta`` and ``present`` are cumulative sums and counts at one stride. A cluster has ``m``
    strides, and at least ``enough`` samples; the first of a pair begins at points ``start`` to
    ``stop``. Returns the sum, the sum of the mean inverse counts, and the number of pairs.
    """
    total = thinned = 0.0
    number = 0
    length = max(0, stop - start)
    # Slices first and no branches, so that the loop is vectorised.
    theta_0, present_0 = theta[start:][:length], present[start:][:length]
    theta_1, present_1 = theta[start + m :][:length], present[start + m :][:length]
    theta_2, present_2 = theta[start + 2 * m :][:length], present[start + 2 * m :][:length]
    for i in range(length):
        first = present_1[i] - present_0[i]
        second = present_2[i] - present_1[i]
        good = (first >= enough) & (second >= enough)
        inverse_first = 1.0 / max(first, 1)
        inverse_second = 1.0 / max(second, 1)
        mean = (theta_1[i] - theta_0[i]) * inverse_first
        difference = (theta_2[i] - theta_1[i]) * inverse_second - mean
        weight = 1.0 if good else 0.0
        total += weight * difference * difference
        thinned += weight * 0.5 * (inverse_first + inverse_second)
        number += good
    return total, thinned, number


def sum_all_sizes(
    phase: Phase, sizes: NDArray[np.int64], threads: int, *, stride: int = 1, gaps: Gaps = NO_GAPS
) -> tuple[Array, Array, NDArray[np.int64], NDArray[np.int64]]:
    """Return sums over the differences of cluster means, by size in points of the phase.

    They are the sum of the squared differences, the sum of the mean inverse numbers of samples of
    both clusters, the number of differences, and their number without missing samples. They have
    the same bits for any number of threads. ``stride``: samples from one point to the next.
    """
    total, thinned = np.zeros(len(sizes)), np.zeros(len(sizes))
    terms, possible = np.zeros((2, len(sizes)), dtype=np.int64)
    samples = sizes * stride
    sizes = sizes.copy()  # writable, since the kernels are compiled for writable arrays
    for start, stop in phase.segments:
        theta = phase.theta[start : stop + 1]
        blocks = -(-len(theta) // BLOCK_DIFFERENCES)
        most = np.maximum(stop - start - 2 * sizes + 1, 0)
        possible += most
        if phase.present is None:
            (sums,) = run_in_threads(partial(_sum_blocks, theta, sizes), blocks, threads)
            total += sums.sum(axis=0) / samples.astype(np.float64) ** 2
            thinned += most / samples
            terms += most
        else:
            counts = phase.present[start : stop + 1]
            work = partial(_sum_blocks_present, theta, counts, sizes, gaps.enough(samples))
            sums, inverse, numbers = run_in_threads(work, blocks, threads)
            total += sums.sum(axis=0)
            thinned += inverse.sum(axis=0)
            terms += numbers.sum(axis=0)
    return total, thinned, terms, possible


@njit(cache=True, nogil=True)
def _sum_blocks(theta: Array, sizes: NDArray[np.int64], low: int, high: int) -> tuple[Array]:
    """Return the sum of squared second differences of blocks ``low`` to ``high``, by size."""
    sums = np.zeros((high - low, sizes.size))
    for block in range(sums.shape[0]):
        start = (low + block) * BLOCK_DIFFERENCES
        sum_sizes(theta, start, start + BLOCK_DIFFERENCES, sizes, sums[block])
    return (sums,)


@njit(cache=True, nogil=True)
def _sum_blocks_present(
    theta: Array,
    present: NDArray[np.integer[Any]],
    sizes: NDArray[np.int64],
    enough: NDArray[np.int64],
    low: int,
    high: int,
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return the terms of `sum_all_sizes` over the samples present, by block and size."""
    sums, inverse = np.zeros((high - low, sizes.size)), np.zeros((high - low, sizes.size))
    numbers = np.zeros((high - low, sizes.size), dtype=np.int64)
    for block in range(sums.shape[0]):
        start = (low + block) * BLOCK_DIFFERENCES
        for j in range(sizes.size):
            n = sizes[j]
            stop = min(start + BLOCK_DIFFERENCES, theta.size - 2 * n)
            of_size = sum_present(theta, present, n, enough[j], start, stop)
            sums[block, j], inverse[block, j], numbers[block, j] = of_size
    return sums, inverse, numbers


@dataclass(frozen=True)
class Presence:
    """Cumulative numbers of the samples present in a log, at two resolutions."""

    samples: int  # L, the points of the grid
    segments: tuple[Span, ...]  # grid points that begin and end each segment
    first: NDArray[np.int64]  # samples present before each of the first points
    stride: int
    coarse: NDArray[np.int64]  # samples present before every ``stride``-th point of the log
    gaps: Gaps

    def differences(self, n: int) -> tuple[NDArray[np.bool_], int] | None:
        """Return which differences of n-sample means are valid, and their stride; None: unknown."""
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
            starts, ends = np.array(self.segments).T
            points = begin * base
            which = np.minimum(np.searchsorted(ends, points, side="right"), len(ends) - 1)
            complete &= (points >= starts[which]) & (points + 2 * size * base <= ends[which])
        return complete, base * max(1, size // _STARTS_PER_CLUSTER)


def count_presence(
    blocks: Iterable[NDArray[np.floating[Any]]],
    samples: int,
    segments: Sequence[Span] | None = None,
) -> Presence:
    """Count the samples that are present in a log; NaN where one is missing."""
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
    return Presence(samples, list_spans(segments, samples), first, stride, coarse, gaps.gaps())
