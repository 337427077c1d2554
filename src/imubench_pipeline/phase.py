"""Cumulative sums of a log: what every Allan variance is taken from."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray


@dataclass(frozen=True)
class Phase:
    """Cumulative sums of a log on its uniform grid.

    Attributes
    ----------
    theta : ndarray of float64, shape (L + 1,)
        Cumulative sum of the samples less a constant; missing samples add nothing.
    present : ndarray of int32, shape (L + 1,), or None
        Cumulative number of samples present; None: all are.
    segments : tuple of (int, int)
        Grid points that begin and end each segment.
    """

    theta: NDArray[np.float64]
    present: NDArray[np.int32] | None
    segments: tuple[tuple[int, int], ...]

    @property
    def samples(self) -> int:
        """L, the points of the grid."""
        return len(self.theta) - 1


def integrate(
    blocks: Iterable[NDArray[np.float64]],
    samples: int,
    *,
    holes: bool,
    segments: Sequence[tuple[int, int]] | None = None,
) -> Phase:
    """Sum consecutive blocks of samples up, in bounded memory beyond the result.

    Parameters
    ----------
    blocks : iterable of ndarray
        The log in order; NaN where a sample is missing.
    samples : int
        L, the length of all blocks together.
    holes : bool
        Samples may be missing; False saves the memory of their counts.
    segments : sequence of (int, int), optional
        Grid points that begin and end each segment; one segment by default.

    Raises
    ------
    ValueError
        If the blocks are not ``samples`` long, a sample is infinite, or one is missing although
        ``holes`` is False.
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
            raise ValueError(f"the blocks hold more than the {samples} samples stated")
        finite = values[np.isfinite(values)] if level is None else values
        if level is None and len(finite):
            # A constant drops out of the variance, but 9.81 would eat the digits of the sum.
            level = float(finite.mean())
        if present is None:
            _accumulate(values, level or 0.0, theta[reached : stop + 1])
        else:
            reach = slice(reached, stop + 1)
            accumulate_present(values, level or 0.0, theta[reach], present[reach])
        reached = stop
    if reached != samples:
        raise ValueError(f"the blocks hold {reached} samples, {samples} were stated")
    if not np.isfinite(theta[-1]):
        raise ValueError(
            "a sample is infinite" if holes else "a sample is missing or infinite, but holes=False"
        )
    return Phase(theta, present, tuple(segments) if segments else ((0, samples),))


@njit(cache=True, nogil=True)
def _accumulate(values: NDArray[np.float64], level: float, theta: NDArray[np.float64]) -> None:
    total = theta[0]
    for i in range(values.size):
        total += values[i] - level
        theta[i + 1] = total


@njit(cache=True, nogil=True)
def accumulate_present(
    values: NDArray[np.float64],
    level: float,
    theta: NDArray[np.float64],
    present: NDArray[Any],
) -> None:
    """Sum samples less a level and count them, from the first entries on; NaN adds nothing."""
    total, number = theta[0], present[0]
    for i in range(values.size):
        if not np.isnan(values[i]):
            total += values[i] - level
            number += 1
        theta[i + 1] = total
        present[i + 1] = number


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract", "nsz"})
def sum_squares(
    first: NDArray[np.float64], middle: NDArray[np.float64], last: NDArray[np.float64]
) -> float:
    """Return the sum of (last - 2 middle + first)^2 over arrays of one length."""
    total = 0.0
    for i in range(first.size):
        difference = last[i] - 2.0 * middle[i] + first[i]
        total += difference * difference
    return total


@njit(cache=True, nogil=True)
def sum_present(
    theta: NDArray[np.float64],
    present: NDArray[Any],
    m: int,
    enough: int,
    start: int,
    stop: int,
) -> tuple[float, float, int]:
    """Sum squared differences of adjacent means over the samples present.

    Parameters
    ----------
    theta, present : ndarray
        Cumulative sums, and numbers of samples present, at one stride.
    m : int
        Steps of that stride in a cluster.
    enough : int
        Samples that a cluster must have.
    start, stop : int
        First and one-past-last point at which the first cluster of a pair begins.

    Returns
    -------
    (float, float, int)
        Sum of squares, sum of the mean inverse numbers of samples, and number of pairs.
    """
    total = 0.0
    thinned = 0.0
    number = 0
    for i in range(start, stop):
        first = present[i + m] - present[i]
        second = present[i + 2 * m] - present[i + m]
        if first >= enough and second >= enough:
            difference = (theta[i + 2 * m] - theta[i + m]) / second - (
                theta[i + m] - theta[i]
            ) / first
            total += difference * difference
            thinned += 0.5 / first + 0.5 / second
            number += 1
    return total, thinned, number
