"""The smooth path of a temperature from the readings of a register, with its error.

The temperature is a random walk of its slope, which makes the most likely path a smoothing spline
(G. Wahba, J. R. Stat. Soc. B 40, 1978). The spline is computed by its second differences (C.
Reinsch, Numer. Math. 10, 1967), and the density of the walk maximises their likelihood.

A reading in whole steps says little of the temperature within its cell. All readings of a stay in a
cell are one measurement, of its centre; a change between two cells measures their edge.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.optimize import minimize_scalar

from imubench_pipeline.allan.phase import Span
from imubench_pipeline.estimators.missing import yield_present_samples
from imubench_pipeline.typing import Array

MAX_BLOCKS = 8192  # maximum number of blocks of a log (plus one per segment)
_MAX_LEVELS = 1 << 16  # maximum number of distinct readings from which the resolution is estimated
_MIN_READINGS_PER_LEVEL = 8.0  # minimum readings per level; fewer repetitions may be chance
_MAX_DIVISOR = 256  # maximum number of steps in the smallest gap, where few levels were read
_MAX_CHANCE = 1e-3  # maximum probability that levels are multiples of a step by chance
_MAX_ROUNDING = 0.2  # maximum deviation of decimal readings from multiples of a step, in steps


@dataclass(frozen=True)
class Readings:
    """The readings of a register, summarised in blocks; blocks without a reading are left out."""

    centre: Array  # (k,): middle of each block, samples
    count: NDArray[np.int64]  # (k,): readings present
    mean: Array
    low: Array
    high: Array
    """(k,): °C."""
    step: float  # least significant bit of the register, °C; 0: unknown
    parts: tuple[slice, ...]  # blocks of each segment


def gather_readings(blocks: Iterable[Array], segments: Sequence[Span]) -> Readings:
    """Return readings, °C, NaN where missing, averaged in blocks; ValueError if none is present."""
    width = max(1, -(-sum(stop - start for start, stop in segments) // MAX_BLOCKS))
    begins = [np.arange(start, stop, width) for start, stop in segments]
    begin = np.concatenate(begins)
    end = np.concatenate(
        [np.minimum(b + width, stop) for b, (_, stop) in zip(begins, segments, strict=True)]
    )
    total, count = np.zeros(len(begin)), np.zeros(len(begin), dtype=np.int64)
    low, high = np.full(len(begin), np.inf), np.full(len(begin), -np.inf)
    levels: Array = np.empty(0)
    for place, chosen in yield_present_samples(blocks, begin, end):
        edges = np.flatnonzero(np.diff(place, prepend=-1))
        block = place[edges]
        total[block] += np.add.reduceat(chosen, edges)
        count[block] += np.diff(np.append(edges, len(chosen)))
        low[block] = np.minimum(low[block], np.minimum.reduceat(chosen, edges))
        high[block] = np.maximum(high[block], np.maximum.reduceat(chosen, edges))
        if len(levels) <= _MAX_LEVELS:
            levels = np.union1d(levels, chosen)
    present = int(count.sum())
    if present == 0:
        raise ValueError("the log has no reading of the temperature, expected one or more")
    for first, last in pairwise(np.cumsum([0, *(len(part) for part in begins)])):
        if not count[first:last].any():  # a segment without readings has no effect
            total[first], count[first] = total.sum() / present, 1
            low[first], high[first] = low.min(), high.max()
    there = count > 0
    stops = np.cumsum([0, *(len(part) for part in begins)])
    kept = np.concatenate(([0], np.cumsum(there)))[stops]
    parts = tuple(slice(int(a), int(b)) for a, b in pairwise(kept))
    return Readings(
        centre=((begin + end - 1) / 2.0)[there],
        count=count[there],
        mean=total[there] / count[there],
        low=low[there],
        high=high[there],
        step=estimate_resolution(levels, present),
        parts=parts,
    )


def estimate_resolution(levels: Array, present: int) -> float:
    """Return the least significant bit of a register from its distinct readings, °C; 0: unknown.

    It is the smallest gap between the levels, shape (n,), ascending, if all gaps are multiples of
    it within decimal rounding, and the ``present`` readings repeat each level often enough.
    """
    if len(levels) < 2 or present < _MIN_READINGS_PER_LEVEL * len(levels):
        return 0.0
    gaps = np.diff(levels)
    smallest = float(gaps.min())
    # Decimal rounding makes gaps of one step differ; their mean is unaffected.
    step, first = float(np.mean(gaps[gaps < 1.75 * smallest])), float(levels[0])
    for _ in range(2):
        multiples = np.rint((levels - first) / step)
        if multiples[-1] > multiples[0]:
            step, first = (float(value) for value in np.polyfit(multiples, levels, 1))
    if not math.isfinite(step):
        return 0.0
    missed = np.abs((levels - first) / step - multiples)
    regular = float(np.quantile(missed, 0.99)) <= _MAX_ROUNDING
    if regular and _compute_chance(gaps, step) < _MAX_CHANCE:
        return step
    if len(gaps) < 2:
        return 0.0
    # Few levels: the greatest step that divides all gaps, unless it may do so by chance.
    for step in smallest / np.arange(2, _MAX_DIVISOR + 1):
        if smallest / step * _compute_chance(gaps, float(step)) < _MAX_CHANCE:
            return float(step)
    return 0.0


def _compute_chance(gaps: Array, step: float) -> float:
    """Return the probability that the other gaps are as near to multiples of a step by chance."""
    others = np.delete(gaps, int(gaps.argmin())) / step
    if not len(others):
        return 0.0
    missed = float(np.quantile(np.abs(others - np.rint(others)), 0.99))
    return min(2.0 * missed, 1.0) ** len(others)


DRAWN_PATHS = 24  # paths drawn around the most likely one
_LOG_DENSITIES = (-16.0, 4.0)  # log10 of the walk's density over the squared range of the readings
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
        """Highest minus lowest temperature, °C."""
        return float(np.ptp(self.value))

    def at(self, points: NDArray[Any], values: Array) -> Array:
        """Interpolate values given at the knots, (k,), to ascending points of the log's grid."""
        cuts = np.searchsorted(points, [start for start, _ in self.segments[1:]])
        pieces = zip(np.split(points, cuts), self.parts, strict=True)
        pieces_at = [np.interp(piece, self.sample[part], values[part]) for piece, part in pieces]
        return np.concatenate(pieces_at)

    def means(self, first: int, block: int, count: int, values: Array) -> Array:
        """Return the means of ``count`` blocks from sample ``first``; ``values`` at knots, (k,)."""
        part = self.parts[sum(start <= first for start, _ in self.segments) - 1]
        edges = first - 0.5 + block * np.arange(count + 1)
        # The integral from the first edge; flat beyond the first and the last knot.
        points = np.union1d(edges, np.clip(self.sample[part], edges[0], edges[-1]))
        at = np.interp(points, self.sample[part], values[part])
        integral = np.cumsum(np.diff(points) * 0.5 * (at[1:] + at[:-1]))
        integral = np.concatenate(([0.0], integral))
        return np.asarray(np.diff(integral[np.searchsorted(points, edges)]) / block)

    def apply_lag(self, values: Array, rate: float, lag: float) -> Array:
        """Return temperatures at the knots, (k,), behind a lag, s, with equilibrium at a start."""
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
    draws = value + np.concatenate(drawn, axis=1)
    spans = tuple((int(start), int(stop)) for start, stop in segments)
    return TemperaturePath(read.centre, value, draws, read.parts, spans)


def _measure(read: Readings, spread: float) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return temperature, variance and stay (0: none) of each block, shapes (k,)."""
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
        scale = float(np.median(np.diff(centre))) if len(centre) > 1 else 1.0
        step = np.diff(centre / scale)
        first, last = 1.0 / step[:-1], 1.0 / step[1:]
        # (k - 2,) each: the difference of two slopes; empty for one or two blocks.
        self._rows = first, -(first + last), last
        self._walk = 0.5 * (step[:-1] + step[1:])
        self._bent = self._bend(measured)

    def _bend(self, values: Array) -> Array:
        """Return the second differences, shape (..., k - 2), of values, shape (..., k)."""
        a, b, c = self._rows
        return np.asarray(a * values[..., :-2] + b * values[..., 1:-1] + c * values[..., 2:])

    def _factor(self, density: float) -> Array:
        """Return the banded Cholesky factor of the covariance of the second differences."""
        (a, b, c), v = self._rows, self._variance
        bands = np.zeros((3, len(a)))
        bands[0] = a**2 * v[:-2] + b**2 * v[1:-1] + c**2 * v[2:] + density * self._walk
        bands[1, :-1] = b[:-1] * a[1:] * v[1:-2] + c[:-1] * b[1:] * v[2:-1]
        bands[2, :-2] = c[:-2] * a[2:] * v[2:-2]
        return np.asarray(cholesky_banded(bands, lower=True, check_finite=False))

    def cost(self, density: float) -> float:
        """Return -log of the likelihood of the second differences, up to a constant."""
        if not len(self._walk):
            return 0.0
        try:
            factor = self._factor(density)
        except LinAlgError:  # a walk far too smooth
            return math.inf
        solved = cho_solve_banded((factor, True), self._bent)
        return float(np.log(factor[0]).sum() + 0.5 * self._bent @ solved)

    def _corrected(self, values: Array, bent: Array, density: float) -> Array:
        """Return values less the errors that second differences ``bent`` show."""
        if not len(self._walk):
            return values
        solved = cho_solve_banded((self._factor(density), True), bent.T).T
        spread = np.zeros(values.shape)
        for i, row in enumerate(self._rows):  # the transpose of `_bend`
            spread[..., i : i + len(row)] += row * solved
        return np.asarray(values - self._variance * spread)

    def smooth(self, density: float) -> Array:
        """Return the most likely path, shape (k,)."""
        return self._corrected(self._measured, self._bent, density)

    def draw_errors(self, density: float, errors: Array, rng: np.random.Generator) -> Array:
        """Return draws of the error of the smoothed path, shape (d, k).

        ``errors``, (d, k): drawn errors of the readings; the walk, with ``density``, is drawn here.
        """
        normal = rng.standard_normal((len(errors), len(self._walk)))
        bent = np.sqrt(density * self._walk) * normal + self._bend(errors)
        return self._corrected(errors, bent, density)


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
    equilibrium at the first. The lag is in s, from 0.
    """
    values = np.asarray(values, dtype=np.float64)
    if lag == 0.0:
        return values.copy()
    return np.asarray(_lagged(np.asarray(times, dtype=np.float64), values, lag))
