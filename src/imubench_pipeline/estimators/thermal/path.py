"""The smooth path of a temperature from the readings of a register, with its error.

The temperature is a random walk of its slope, which makes the most likely path a smoothing spline
(G. Wahba, J. R. Stat. Soc. B 40, 1978). The spline is computed by its second differences (C.
Reinsch, Numer. Math. 10, 1967), and the density of the walk maximises their likelihood.

A reading in whole steps says little of the temperature within its cell. All readings of a stay in a
cell are one measurement, of its centre; a change between two cells measures their edge.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.optimize import minimize_scalar

from imubench_pipeline.allan.phase import Span
from imubench_pipeline.estimators.thermal.register import Readings, gather_readings
from imubench_pipeline.typing import Array

DRAWN_PATHS = 24  # paths drawn around the most likely one
_LOG_DENSITIES = (-16.0, 4.0)  # of the walk, over the squared range of the readings
_MIN_CELL_FRACTION = 0.5
"""Fraction of blocks with readings of one level; if fewer, noise averages the steps."""

_CROSSING_ERROR = 0.5
"""Error of a crossing, in typical changes over the time between its blocks: 2 / sqrt(12)."""

_UNKNOWN_VARIANCE = 1e4  # of a block without a measurement, over the squared range of the readings
_SIGMA_OVER_MAD = 1.4826  # standard deviation over median absolute deviation of normal noise


@dataclass(frozen=True)
class TemperaturePath:
    """A temperature on a coarse grid, linear between the knots of a segment."""

    sample: Array  # (k,): place of the knots on the grid of the log
    value: Array  # (k,): temperature, °C
    draws: Array  # (d, k): paths drawn from their distribution, given the readings, °C
    parts: tuple[slice, ...]  # knots of each segment
    segments: tuple[Span, ...]  # first and one-past-last sample of each segment

    @property
    def deviation(self) -> Array:
        """Standard deviation of the temperature at the knots, shape (k,), °C."""
        return np.asarray(np.sqrt(np.mean((self.draws - self.value) ** 2, axis=0)))

    @property
    def mean(self) -> float:
        """Mean over the log, °C: T_0 by convention."""
        return float(np.mean(self.value))

    @property
    def range(self) -> float:
        """Highest less lowest, °C."""
        return float(np.ptp(self.value))

    def at(self, points: NDArray[Any], values: Array) -> Array:
        """Interpolate values at the knots, shape (k,), within each segment.

        ``points``, shape (n,), are ascending places on the grid of the log; between two segments
        the value at the last knot is returned.
        """
        cuts = np.searchsorted(points, [start for start, _ in self.segments[1:]])
        pieces = zip(np.split(points, cuts), self.parts, strict=True)
        pieces_at = [np.interp(piece, self.sample[part], values[part]) for piece, part in pieces]
        return np.concatenate(pieces_at)

    def means(self, first: int, block: int, count: int, values: Array) -> Array:
        """Return means over blocks, shape (count,), of values at the knots, shape (k,).

        ``first`` is the first sample of ``count`` adjacent blocks of ``block`` samples in a
        segment.
        """
        part = self.parts[sum(start <= first for start, _ in self.segments) - 1]
        edges = first - 0.5 + block * np.arange(count + 1)
        # The integral from the first edge; flat beyond the first and the last knot.
        points = np.union1d(edges, np.clip(self.sample[part], edges[0], edges[-1]))
        at = np.interp(points, self.sample[part], values[part])
        integral = np.cumsum(np.diff(points) * 0.5 * (at[1:] + at[:-1]))
        integral = np.concatenate(([0.0], integral))
        return np.asarray(np.diff(integral[np.searchsorted(points, edges)]) / block)

    def apply_lag(self, values: Array, rate: float, lag: float) -> Array:
        """Return temperatures at the knots, shape (k,), behind a lag in s (see `apply_lag`).

        Each segment begins in equilibrium. ``rate``: of the log, Hz.
        """
        parts = [apply_lag(self.sample[part] / rate, values[part], lag) for part in self.parts]
        return np.concatenate(parts)


def estimate_temperature_path(
    blocks: Iterable[Array], segments: Sequence[Span], rng: np.random.Generator
) -> TemperaturePath:
    """Return the path of a temperature from the readings of its register.

    The readings, °C, are on the grid of the log, NaN where missing; the time between segments is
    unknown. Raises ValueError if no reading is present.
    """
    read = gather_readings(blocks, segments)
    spread = max(float(np.nanmax(read.high) - np.nanmin(read.low)), read.step, 1e-6)
    measured, variance, stay = _measure(read, spread)
    splines = [_Spline(read.centre[part], measured[part], variance[part]) for part in read.parts]

    def cost(logarithm: float) -> float:
        return sum(spline.cost(spread**2 * 10.0**logarithm) for spline in splines)

    best = minimize_scalar(cost, bounds=_LOG_DENSITIES, method="bounded", options={"xatol": 0.05})
    density = spread**2 * 10.0 ** float(best.x)
    value = np.concatenate([spline.smooth(density) for spline in splines])
    # The error of a reading in a stay is the same in all of the stay.
    within = read.step * (rng.random((DRAWN_PATHS, stay.max() + 1))[:, stay] - 0.5)
    noise = np.sqrt(variance) * rng.standard_normal((DRAWN_PATHS, len(value)))
    errors = np.where(stay > 0, within, noise)
    drawn = [
        spline.draw_errors(density, errors[:, part], rng)
        for spline, part in zip(splines, read.parts, strict=True)
    ]
    spans = tuple((int(start), int(stop)) for start, stop in segments)
    return TemperaturePath(
        read.centre, value, value + np.concatenate(drawn, axis=1), read.parts, spans
    )


def _measure(read: Readings, spread: float) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return the temperature of each block by its readings, its variance, and its stay (0: none).

    All shapes are (k,).
    """
    n = len(read.mean)
    # The noise of block means, by their second differences: the temperature changes slowly.
    bends = np.abs(np.diff(read.mean, 2))
    white = _SIGMA_OVER_MAD * float(np.median(bends)) / math.sqrt(6.0) if len(bends) else 0.0
    measured = read.mean.copy()
    variance = np.full(n, white**2 + (1e-6 * spread) ** 2)
    stay = np.zeros(n, dtype=np.int64)
    inside = np.flatnonzero(read.high == read.low)
    if read.step == 0.0 or len(inside) < _MIN_CELL_FRACTION * n:
        return measured, variance, stay
    steps = np.abs(np.diff(read.mean[inside])) / read.step
    segment = np.searchsorted([part.start for part in read.parts], inside, side="right")
    same = np.diff(segment) == 0
    stay[inside] = 1 + np.cumsum(np.concatenate(([False], (steps > 0.5) | ~same)))
    crosses = (steps > 0.5) & (steps < 1.5) & same  # a larger step is a jump
    length = np.bincount(stay)
    variance = np.where(stay > 0, length[stay] * read.step**2 / 12.0, _UNKNOWN_VARIANCE * spread**2)
    before, after = inside[:-1][crosses], inside[1:][crosses]
    place = (before + after + 1) // 2
    measured[place] = 0.5 * (read.mean[before] + read.mean[after])
    variance[place] = (_CROSSING_ERROR * spread / n * (after - before)) ** 2
    stay[place] = 0
    return measured, variance, stay


class _Spline:
    """The smoothing spline of a segment, in the second differences of its blocks."""

    def __init__(self, centre: Array, measured: Array, variance: Array) -> None:
        self._measured, self._variance = measured, variance
        step = np.diff(centre / float(np.median(np.diff(centre)))) if len(centre) > 1 else centre
        first, last = 1.0 / step[:-1], 1.0 / step[1:]
        # (3, k - 2): the difference of two slopes.
        self._rows = np.array([first, -(first + last), last]) if len(centre) > 2 else None
        if self._rows is not None:
            self._walk = 0.5 * (step[:-1] + step[1:])
            self._bent = self._bend(measured)

    def _bend(self, values: Array) -> Array:
        """Return the second differences, shape (..., k - 2), of values, shape (..., k)."""
        a, b, c = self._rows  # type: ignore[misc]  # only called where there are rows
        return np.asarray(a * values[..., :-2] + b * values[..., 1:-1] + c * values[..., 2:])

    def _spread(self, values: Array) -> Array:
        """Return the transpose of `_bend`, from shape (..., k - 2) to (..., k)."""
        a, b, c = self._rows  # type: ignore[misc]  # only called where there are rows
        result = np.zeros((*values.shape[:-1], values.shape[-1] + 2))
        result[..., :-2] += a * values
        result[..., 1:-1] += b * values
        result[..., 2:] += c * values
        return result

    def _factor(self, density: float) -> Array:
        """Return the banded Cholesky factor of the covariance of the second differences."""
        a, b, c = self._rows  # type: ignore[misc]  # only called where there are rows
        v = self._variance
        bands = np.zeros((3, len(a)))
        bands[0] = a**2 * v[:-2] + b**2 * v[1:-1] + c**2 * v[2:] + density * self._walk
        bands[1, :-1] = b[:-1] * a[1:] * v[1:-2] + c[:-1] * b[1:] * v[2:-1]
        bands[2, :-2] = c[:-2] * a[2:] * v[2:-2]
        return np.asarray(cholesky_banded(bands, lower=True, check_finite=False))

    def cost(self, density: float) -> float:
        """Return -log of the likelihood of the second differences, up to a constant."""
        if self._rows is None:
            return 0.0
        try:
            factor = self._factor(density)
        except LinAlgError:  # a walk far too smooth
            return math.inf
        solved = cho_solve_banded((factor, True), self._bent)
        return float(np.log(factor[0]).sum() + 0.5 * self._bent @ solved)

    def smooth(self, density: float) -> Array:
        """Return the most likely path, shape (k,)."""
        if self._rows is None:
            return self._measured
        solved = cho_solve_banded((self._factor(density), True), self._bent)
        return np.asarray(self._measured - self._variance * self._spread(solved))

    def draw_errors(self, density: float, errors: Array, rng: np.random.Generator) -> Array:
        """Return errors of the path, shape (d, k), by ``errors`` of the readings and the walk."""
        if self._rows is None:
            return errors
        walk = np.sqrt(density * self._walk) * rng.standard_normal(
            (len(errors), errors.shape[1] - 2)
        )
        bent = walk + self._bend(errors)
        solved = cho_solve_banded((self._factor(density), True), bent.T).T
        return np.asarray(errors - self._variance * self._spread(solved))


@njit(cache=True)
def _lagged(times: Array, values: Array, lag: float) -> Array:
    result = np.empty_like(values)
    if values.size == 0:
        return result
    result[0] = values[0]
    # T_lag - T decays, and a ramp of the temperature adds to it. Weights of T_lag itself would be
    # differences of nearly equal numbers over short steps.
    behind = 0.0
    for i in range(1, values.size):
        h = (times[i] - times[i - 1]) / lag
        behind = math.exp(-h) * behind + math.expm1(-h) / h * (values[i] - values[i - 1])
        result[i] = values[i] + behind
    return result


def apply_lag(times: Array, values: Array, lag: float) -> Array:
    """Return a temperature, shape (k,), behind a first-order lag: L dT_lag/dt = T - T_lag.

    Exact at the ascending knots ``times``, s, for a temperature that is linear between them and in
    equilibrium at the first. Raises ValueError if the lag, s, is below 0 or not finite.
    """
    if not (lag >= 0.0 and math.isfinite(lag)):
        raise ValueError(f"the lag is {lag} s, expected a time from 0")
    values = np.asarray(values, dtype=np.float64)
    if lag == 0.0:
        return values.copy()
    return np.asarray(_lagged(np.asarray(times, dtype=np.float64), values, lag))
