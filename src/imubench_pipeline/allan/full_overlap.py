"""Sums over every pair of adjacent clusters: the fully overlapping Allan variance."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.allan.phase import Phase, sum_present, sum_sizes
from imubench_pipeline.allan.threads import in_threads
from imubench_pipeline.typing import Array

BLOCK = 1 << 14
"""Differences summed together: three blocks of float64 stay in the L2 cache."""

PRESENT = 0.9
"""Part of a cluster's samples that must be there for its mean to count."""


def enough_present(sizes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return how many samples a cluster must have for its mean to count, by size."""
    return np.ceil(PRESENT * sizes - 1e-9).astype(np.int64)


def full_sums(
    phase: Phase, sizes: NDArray[np.int64], threads: int, *, stride: int = 1
) -> tuple[Array, Array, NDArray[np.int64], NDArray[np.int64]]:
    """Sum over the differences of means, by size.

    Parameters
    ----------
    phase : Phase
    sizes : ndarray of int
        Points of the phase in a cluster.
    threads : int
        The sums have the same bits for any number.
    stride : int
        Samples from one point of the phase to the next.

    Returns
    -------
    total : ndarray
        Sum of the squared differences.
    thinned : ndarray
        Sum of the mean inverse numbers of samples that the two clusters average.
    terms, possible : ndarray of int
        Number of differences, and what it would be without holes.
    """
    total = np.zeros(len(sizes))
    thinned = np.zeros(len(sizes))
    terms = np.zeros(len(sizes), dtype=np.int64)
    possible = np.zeros(len(sizes), dtype=np.int64)
    samples = sizes * stride
    for start, stop in phase.segments:
        theta = phase.theta[start : stop + 1]
        blocks = -(-len(theta) // BLOCK)
        most = np.maximum(stop - start - 2 * sizes + 1, 0)
        possible += most
        if phase.present is None:
            (sums,) = in_threads(partial(_full, theta, sizes), blocks, threads)
            total += sums.sum(axis=0) / samples.astype(np.float64) ** 2
            thinned += most / samples
            terms += most
        else:
            counts = phase.present[start : stop + 1]
            work = partial(_full_with_holes, theta, counts, sizes, enough_present(samples))
            sums, inverse, numbers = in_threads(work, blocks, threads)
            total += sums.sum(axis=0)
            thinned += inverse.sum(axis=0)
            terms += numbers.sum(axis=0)
    return total, thinned, terms, possible


@njit(cache=True, nogil=True)
def _full(theta: Array, sizes: NDArray[np.int64], low: int, high: int) -> tuple[Array]:
    """Return the sum of squared second differences of each block and size."""
    sums = np.zeros((high - low, sizes.size))
    for block in range(high - low):
        start = (low + block) * BLOCK
        sum_sizes(theta, start, start + BLOCK, sizes, sums[block])
    return (sums,)


@njit(cache=True, nogil=True)
def _full_with_holes(
    theta: Array,
    present: NDArray[np.integer[Any]],
    sizes: NDArray[np.int64],
    enough: NDArray[np.int64],
    low: int,
    high: int,
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return, by block and size, what `full_sums` adds up, over the samples present."""
    points = theta.size
    sums = np.zeros((high - low, sizes.size))
    inverse = np.zeros((high - low, sizes.size))
    numbers = np.zeros((high - low, sizes.size), dtype=np.int64)
    for block in range(high - low):
        start = (low + block) * BLOCK
        for j in range(sizes.size):
            n = sizes[j]
            stop = min(start + BLOCK, points - 2 * n)
            total, thinned, number = sum_present(theta, present, n, enough[j], start, stop)
            sums[block, j] = total
            inverse[block, j] = thinned
            numbers[block, j] = number
    return sums, inverse, numbers
