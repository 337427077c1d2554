"""The Allan variance: grid of cluster sizes, kernels over holes and segments.

With theta the cumulative sum of the samples (L + 1 points, starting at 0) the fully
overlapping Allan variance at n samples a cluster is

    sigma^2(n T) = sum_{i=0}^{L-2n} (theta_{i+2n} - 2 theta_{i+n} + theta_i)^2 / (2 n^2 (L-2n+1))

(IEEE Std 952; L - 2n + 1 terms, as in allantools' ``oadev``.)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numba import get_num_threads, njit, prange, set_num_threads
from numpy.typing import ArrayLike, NDArray

from imubench_pipeline.confidence import deviation_limits, equivalent_degrees, noise_exponent
from imubench_pipeline.phase import Phase, integrate

BLOCK = 1 << 14
"""Differences summed together: three blocks of float64 stay in the L2 cache."""

PRESENT = 0.9
"""Part of a cluster's samples that must be there for its mean to count."""


_MANY_CLUSTERS = 100


@dataclass(frozen=True)
class AllanCurve:
    """An Allan variance over tau.

    Attributes
    ----------
    tau : ndarray, shape (m,)
        Cluster length in s: ``cluster_size / rate`` of the cluster size really used.
    cluster_size : ndarray of int, shape (m,)
        n, samples in a cluster.
    variance : ndarray, shape (m,)
        Allan variance in the squared unit of the samples.
    edf : ndarray, shape (m,)
        Equivalent degrees of freedom of each variance.
    exponent : ndarray of int, shape (m,)
        Noise type at each tau: the power of frequency, 2 to -2, in the spectrum of fractional
        frequency (0: white noise of the samples, -1: flicker, -2: random walk).
    samples : int
        L, samples in the log.
    averaged : ndarray, shape (m,)
        Samples that a cluster really averages: n, or fewer (their harmonic mean) where samples
        are missing. The variance of white noise goes with 1 / averaged.
    """

    tau: NDArray[np.float64]
    cluster_size: NDArray[np.int64]
    variance: NDArray[np.float64]
    edf: NDArray[np.float64]
    exponent: NDArray[np.int64]
    samples: int
    averaged: NDArray[np.float64]

    @property
    def deviation(self) -> NDArray[np.float64]:
        """Allan deviation in the unit of the samples, shape (m,)."""
        return np.sqrt(self.variance)

    def limits(self, confidence: float = 0.95) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the lower and upper confidence limits of the deviation, shapes (m,)."""
        return deviation_limits(self.deviation, self.edf, confidence)


def cluster_sizes(samples: int, *, per_decade: int = 10, longest: float = 0.5) -> NDArray[np.int64]:
    """Return log-spaced cluster sizes, whole and distinct.

    Parameters
    ----------
    samples : int
        L.
    per_decade : int
        Sizes per decade, where whole numbers allow.
    longest : float
        The largest size as a part of the log, at most 1/2.
    """
    largest = int(samples * min(longest, 0.5) * (1 + 1e-12))
    if largest < 1:
        return np.empty(0, dtype=np.int64)
    exponents = np.arange(int(np.log10(largest) * per_decade + 1e-9) + 1) / per_decade
    sizes = np.rint(10.0**exponents).astype(np.int64)
    return np.unique(sizes[sizes <= largest])


def allan_variance(
    samples: ArrayLike,
    rate: float,
    *,
    cluster_sizes: ArrayLike | None = None,
    overlap: Literal["full"] = "full",
    valid: ArrayLike | None = None,
    segments: Sequence[tuple[int, int]] | None = None,
) -> AllanCurve:
    """Return the fully overlapping Allan variance of a log.

    Parameters
    ----------
    samples : array_like, shape (L,)
        The log on its uniform grid, in rad/s or m/s². NaN marks a missing sample.
    rate : float
        Sampling rate, Hz.
    cluster_sizes : array_like of int, optional
        n of each tau; by default `cluster_sizes` of the length.
    overlap : {"full"}
        Every cluster of every size is used.
    valid : array_like of bool, shape (L,), optional
        False where the sample is missing.
    segments : sequence of (int, int), optional
        First and one-past-last sample of each segment; no difference spans two.

    Returns
    -------
    AllanCurve
        At the sizes for which the log has at least one difference.

    Raises
    ------
    ValueError
        If the log is not one-dimensional, the rate not positive, a size not positive, or the
        segments do not lie in the log one after the other.

    References
    ----------
    IEEE Std 952-1997, annex C; limits: C. Greenhall and W. Riley, "Uncertainty of stability
    variances based on finite differences", PTTI 2003.
    """
    values = np.asarray(samples, dtype=np.float64)
    if values.ndim != 1 or len(values) < 2:
        raise ValueError(f"samples have shape {values.shape}, expected one dimension of 2 or more")
    if overlap != "full":
        raise ValueError(f"overlap {overlap!r} is not known, expected 'full'")
    if valid is not None:
        mask = np.asarray(valid, dtype=bool)
        if mask.shape != values.shape:
            raise ValueError(f"valid has shape {mask.shape}, expected {values.shape}")
        values = np.where(mask, values, np.nan)
    holes = not bool(np.isfinite(values).all())
    return of_phase(
        integrate([values], len(values), holes=holes, segments=segments), rate, cluster_sizes
    )


def of_phase(
    phase: Phase, rate: float, sizes: ArrayLike | None = None, *, threads: int = 1
) -> AllanCurve:
    """Return the fully overlapping Allan variance of cumulative sums (see `allan_variance`).

    The result has the same bits for any number of threads.
    """
    if not rate > 0:
        raise ValueError(f"the rate is {rate}, expected a frequency above zero")
    _check_segments(phase)
    wanted = cluster_sizes(phase.samples) if sizes is None else np.asarray(sizes, dtype=np.int64)
    if wanted.ndim != 1 or (wanted < 1).any():
        raise ValueError("cluster sizes must be whole numbers from 1 in one dimension")
    total, thinned, terms, possible = _sums(phase, wanted, threads)
    shown = terms > 0
    wanted, total, thinned = wanted[shown], total[shown], thinned[shown]
    terms, possible = terms[shown], possible[shown]
    variance = total / (2.0 * terms)
    exponent = np.array(_exponents(phase, wanted), dtype=np.int64)
    edf = np.array(
        [
            _degrees(phase, int(alpha), int(n)) * done / most
            for alpha, n, done, most in zip(exponent, wanted, terms, possible, strict=True)
        ]
    )
    return AllanCurve(
        tau=wanted / rate,
        cluster_size=wanted,
        variance=variance,
        edf=np.maximum(edf, 1.0),
        exponent=exponent,
        samples=phase.samples,
        averaged=terms / thinned,
    )


def _check_segments(phase: Phase) -> None:
    reached = 0
    for start, stop in phase.segments:
        if not reached <= start < stop <= phase.samples:
            raise ValueError(
                f"segment ({start}, {stop}) does not lie in the {phase.samples} samples, after "
                "the one before it"
            )
        reached = stop


def _sums(
    phase: Phase, sizes: NDArray[np.int64], threads: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Sum over the differences of means, by size.

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
    before = get_num_threads()
    set_num_threads(max(1, min(threads, before)))
    try:
        for start, stop in phase.segments:
            theta = phase.theta[start : stop + 1]
            most = np.maximum(stop - start - 2 * sizes + 1, 0)
            possible += most
            if phase.present is None:
                total += _full(theta, sizes).sum(axis=0) / sizes.astype(np.float64) ** 2
                thinned += most / sizes
                terms += most
            else:
                counts = phase.present[start : stop + 1]
                enough = np.ceil(PRESENT * sizes - 1e-9).astype(np.int64)
                sums, inverse, numbers = _full_with_holes(theta, counts, sizes, enough)
                total += sums.sum(axis=0)
                thinned += inverse.sum(axis=0)
                terms += numbers.sum(axis=0)
    finally:
        set_num_threads(before)
    return total, thinned, terms, possible


def _exponents(phase: Phase, sizes: NDArray[np.int64]) -> list[int]:
    """Return the noise type at each size; where too few clusters are left, the last one told.

    With few clusters white noise often looks blue: then no bluer type than before is believed.
    """
    start, stop = max(phase.segments, key=lambda segment: segment[1] - segment[0])
    exponents: list[int] = []
    for n in sizes:
        edges = phase.theta[start : stop + 1 : n]
        held = None if phase.present is None else phase.present[start : stop + 1 : n]
        found = noise_exponent(edges, held, int(n))
        before = exponents[-1] if exponents else 0
        if found is None:
            found = before
        elif len(edges) <= _MANY_CLUSTERS:
            found = min(found, max(before, 0))
        exponents.append(found)
    return exponents


def _degrees(phase: Phase, exponent: int, n: int) -> float:
    terms = [stop - start - 2 * n + 1 for start, stop in phase.segments]
    return sum(equivalent_degrees(exponent, n, term) for term in terms if term > 0)


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def _sum_squares(first, middle, last):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    total = 0.0
    for i in range(first.size):
        difference = last[i] - 2.0 * middle[i] + first[i]
        total += difference * difference
    return total


@njit(cache=True, nogil=True, parallel=True)
def _full(theta, sizes):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    """Return the sum of squared second differences of each block and size."""
    points = theta.size
    blocks = (points + BLOCK - 1) // BLOCK
    sums = np.zeros((blocks, sizes.size))
    for block in prange(blocks):
        start = block * BLOCK
        for j in range(sizes.size):
            n = sizes[j]
            stop = min(start + BLOCK, points - 2 * n)
            if stop > start:
                # Slices first: an index i + 2 n inside the loop would keep it scalar.
                sums[block, j] = _sum_squares(
                    theta[start:stop],
                    theta[start + n : stop + n],
                    theta[start + 2 * n : stop + 2 * n],
                )
    return sums


@njit(cache=True, nogil=True, parallel=True)
def _full_with_holes(theta, present, sizes, enough):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    """Return, by block and size, what `_sums` adds up, over the samples present."""
    points = theta.size
    blocks = (points + BLOCK - 1) // BLOCK
    sums = np.zeros((blocks, sizes.size))
    inverse = np.zeros((blocks, sizes.size))
    numbers = np.zeros((blocks, sizes.size), dtype=np.int64)
    for block in prange(blocks):
        start = block * BLOCK
        for j in range(sizes.size):
            n = sizes[j]
            total = 0.0
            thinned = 0.0
            number = 0
            for i in range(start, min(start + BLOCK, points - 2 * n)):
                first = present[i + n] - present[i]
                second = present[i + 2 * n] - present[i + n]
                if first >= enough[j] and second >= enough[j]:
                    difference = (theta[i + 2 * n] - theta[i + n]) / second - (
                        theta[i + n] - theta[i]
                    ) / first
                    total += difference * difference
                    thinned += 0.5 / first + 0.5 / second
                    number += 1
            sums[block, j] = total
            inverse[block, j] = thinned
            numbers[block, j] = number
    return sums, inverse, numbers
