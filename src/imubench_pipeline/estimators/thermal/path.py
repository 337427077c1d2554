"""The smooth path of a temperature from the readings of a register, with its error.

The temperature is an integrated random walk (G. Wahba, J. R. Stat. Soc. B 40, 1978). A block of
equal readings gives the cell of the register, and a block with two readings the time at the edge
between their cells (expectation propagation: T. Minka, UAI 2001). The rate of the walk and the
noise of the register maximise the evidence.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import ndtri

from imubench_pipeline.allan.phase import Span
from imubench_pipeline.estimators.thermal.path_kernels import draw_paths, propagate
from imubench_pipeline.estimators.thermal.register import (
    Readings,
    find_cell_stays,
    gather_readings,
    split_at_jumps,
)
from imubench_pipeline.typing import Array

DRAWN_PATHS = 24  # paths drawn from the posterior of the temperature
_LOG_DENSITY_GRID = range(-14, 5, 2)
_NOISE_GRID = (0.01, 0.1, 0.4)
_MIN_NOISE = 1e-4
_MAX_ITERATIONS = 40
_IMPOSSIBLE_COST = 1e300
_FLOOR = 1e-3
_MAX_BOUNDING_NOISE = 0.25  # ratio of noise and step below which a reading bounds the temperature


@dataclass(frozen=True)
class TemperaturePath:
    """A temperature on a coarse grid, linear between the knots of a segment."""

    sample: Array  # (k,): place of the knots on the grid of the log
    value: Array
    deviation: Array
    """(k,): temperature, and its standard deviation, °C."""
    draws: Array  # (d, k): paths drawn from their distribution, given the readings, °C
    parts: tuple[slice, ...]  # knots of each segment
    segments: tuple[Span, ...]  # first and one-past-last sample of each segment
    step: float  # least significant bit of the register, °C; 0: unknown
    noise: float  # standard deviation of the noise of a reading, °C

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
        """Return means over blocks, shape (..., count), of values at the knots, shape (..., k).

        ``first`` is the first sample of ``count`` adjacent blocks of ``block`` samples in a
        segment.
        """
        part = self.parts[sum(start <= first for start, _ in self.segments) - 1]
        edges = first - 0.5 + block * np.arange(count + 1)
        knots, at_knots = self.sample[part], values[..., part]
        # Flat beyond the first and the last knot.
        x = np.concatenate(
            ([min(edges[0], knots[0]) - 1.0], knots, [max(edges[-1], knots[-1]) + 1])
        )
        y = np.concatenate((at_knots[..., :1], at_knots, at_knots[..., -1:]), axis=-1)
        width = np.diff(x)
        below = np.cumsum(width * 0.5 * (y[..., 1:] + y[..., :-1]), axis=-1)
        below = np.concatenate((np.zeros_like(y[..., :1]), below), axis=-1)
        at = np.clip(np.searchsorted(x, edges, side="right") - 1, 0, len(x) - 2)
        inside = edges - x[at]
        slope = (y[..., at + 1] - y[..., at]) / width[at]
        integral = below[..., at] + inside * (y[..., at] + 0.5 * slope * inside)
        return np.asarray(np.diff(integral, axis=-1) / block)


def estimate_temperature_path(
    blocks: Iterable[Array], segments: Sequence[Span], rng: np.random.Generator
) -> TemperaturePath:
    """Return the path of a temperature from the readings of its register.

    The readings, °C, are on the grid of the log, NaN where missing; the time between segments is
    unknown. Raises ValueError if no reading is present.
    """
    read = gather_readings(blocks, segments)
    level = float(np.nanmedian(read.mean))
    spread = max(float(np.nanmax(read.high) - np.nanmin(read.low)), read.step, 1e-6)
    evidence = _Evidence(read, level, spread)
    q, noise, height = evidence.best()
    cut = split_at_jumps(read)
    if cut is not read:
        jumping = _Evidence(cut, level, spread)
        *best, higher = jumping.best()
        if higher > height:
            read, evidence, (q, noise) = cut, jumping, best
    value, variance = np.empty(len(read.begin)), np.empty(len(read.begin))
    draws = np.empty((DRAWN_PATHS, len(read.begin)))
    for part in read.pieces:
        if evidence.stays_in_a_cell(part):
            # Anywhere in the cell, all the time: the largest error that the level can have.
            value[part], variance[part] = read.mean[part] - level, read.step**2 / 12.0
            draws[:, part] = value[part] + read.step * (rng.random((DRAWN_PATHS, 1)) - 0.5)
            continue
        value[part], variance[part], _, precision, shift = evidence.part(part, q, noise)
        normals = rng.standard_normal((DRAWN_PATHS, part.stop - part.start, 2))
        draws[:, part] = draw_paths(evidence.steps(part), q, spread, precision, shift, normals)
        draws[:, part] += evidence.draw_stays(part, q, noise, variance[part], rng)
    value, draws = value + level, draws + level
    if noise < _MAX_BOUNDING_NOISE * read.step:
        inside = read.high == read.low
        half = 0.5 * read.step
        value[inside] = np.clip(value, read.mean - half, read.mean + half)[inside]
    spans = tuple((int(start), int(stop)) for start, stop in segments)
    deviation = np.sqrt(variance)
    return TemperaturePath(
        read.centre, value, deviation, draws, read.parts, spans, read.step, noise
    )


class _Evidence:
    """The readings as the kernels take them, and their likelihood."""

    def __init__(self, read: Readings, level: float, spread: float) -> None:
        self._read, self._level, self._spread = read, level, spread
        self._width = float(np.median(read.end - read.begin))
        present = read.count > 0
        stepped = present & (read.step > 0.0)
        self._cell = stepped & (read.high == read.low)
        self._two = stepped & ~self._cell & (read.high - read.low < 1.5 * read.step)
        self._mean = present & ~self._cell & ~self._two
        count = np.maximum(read.count, 1)
        # All of n readings are in one cell: x is away from its edges by about the largest of n
        # normal variates, with this median and (nearly) this standard deviation.
        self._clear = ndtri(0.5 ** (1.0 / count))
        self._soft = 1.0 / np.sqrt(1.0 + 0.9 * np.log(count))
        # Readings on both sides of an edge: x follows from the share of each.
        share = (read.mean - read.low) / max(read.step, 1e-300)
        share = np.clip((share * count + 0.5) / (count + 1.0), 0.01, 0.99)
        self._beyond = ndtri(share)
        density = np.exp(-0.5 * self._beyond**2) / math.sqrt(2.0 * math.pi)
        self._share_variance = share * (1.0 - share) / count / density**2
        # x changes within a block.
        self._floor = max(_FLOOR * read.step, 2.0 * spread / len(count))

    def stays_in_a_cell(self, part: slice) -> bool:
        """Return whether a piece between jumps stays in one cell of the register."""
        read = self._read
        in_one_cell = bool(self._cell[part].all() and np.ptp(read.mean[part]) < 0.5 * read.step)
        return in_one_cell and part not in read.parts

    def steps(self, part: slice) -> Array:
        """Return the time from the block before, in blocks; 1 for the first."""
        centre = self._read.centre[part] / self._width
        return np.asarray(np.diff(centre, prepend=centre[0] - 1.0))

    def part(self, part: slice, q: float, noise: float) -> tuple[Array, Array, float, Array, Array]:
        """Return mean, variance and log evidence of a segment, and its Gaussian equivalents."""
        read, least = self._read, (1e-6 * self._spread) ** 2
        mean = read.mean[part] - self._level
        cell, two, many = self._cell[part], self._two[part], self._mean[part]
        edge = 0.5 * (read.low[part] + read.high[part]) - self._level
        at = np.where(two, edge + noise * self._beyond[part], mean)
        variance = noise**2 * np.where(
            two, self._share_variance[part], 1.0 / np.maximum(read.count[part], 1)
        )
        variance += np.where(two, self._floor**2, 0.0) + least
        precision = np.where(two | many, 1.0 / variance, 0.0)
        shift = np.where(two | many, at / variance, 0.0)
        height = -0.5 * np.log(variance[many]).sum()
        # The share of a block is given, not the x that follows from it: dx = noise dz.
        height += (
            0.5 * np.log((noise**2 * self._share_variance[part] + least) / variance)[two].sum()
        )
        height += float((-0.5 * at**2 / variance)[two | many].sum())
        half = self._compute_half_width(part, noise)
        low, high = (np.where(cell, mean + side * half, 0.0) for side in (-1.0, 1.0))
        softened = (noise * self._soft[part]) ** 2 + least
        prior = self.steps(part), q, self._spread
        path, spread, evidence = propagate(*prior, cell, low, high, softened, precision, shift)
        return path, spread, evidence + float(height), precision, shift

    def _compute_half_width(self, part: slice, noise: float) -> Array:
        """Return half the width of the range of the path in the cell of each block."""
        step = self._read.step
        return np.maximum(0.5 * step - noise * self._clear[part], 0.05 * step)

    def draw_stays(
        self, part: slice, q: float, noise: float, variance: Array, rng: np.random.Generator
    ) -> Array:
        """Draw errors of a path that are constant during a stay in a cell, shape (d, k).

        They increase its variance to the variance of a level anywhere in the cell.
        """
        inside, mean = self._cell[part], self._read.mean[part]
        half = self._compute_half_width(part, noise)
        off = np.zeros((DRAWN_PATHS, len(inside)))
        if not inside.any():
            return off
        for blocks, taper in find_cell_stays(inside, mean, float(np.median(half[inside])), q):
            missing = np.maximum(half**2 / 3.0 - variance, 0.0)[blocks]
            level = math.sqrt(3.0) * (2.0 * rng.random((DRAWN_PATHS, 1)) - 1.0)
            off[:, blocks] = level * taper * np.sqrt(missing)
        return off

    def best(self) -> tuple[float, float, float]:
        """Return q and the noise with the maximum evidence, and its logarithm."""
        read = self._read
        present = read.mean[read.count > 0]
        rough = float(np.median(np.abs(np.diff(present)))) if len(present) > 1 else 0.0
        least = _MIN_NOISE * self._spread
        noises = {max(part * read.step, least) for part in _NOISE_GRID} | {max(rough, least)}
        moving = [part for part in read.pieces if not self.stays_in_a_cell(part)]
        # A level has a uniform prior over the spread of all levels.
        level_pieces = len(read.pieces) - len(moving)
        constant = level_pieces * math.log(read.step / self._spread) if level_pieces else 0.0

        def cost(at: Array) -> float:
            q, noise = self._spread**2 * 10.0 ** float(at[0]), 10.0 ** float(at[1])
            if not (-16.0 < at[0] < 6.0 and 0.99 * least < noise < 10.0 * self._spread):
                return _IMPOSSIBLE_COST
            evidence = sum(self.part(part, q, noise)[2] for part in moving)
            return min(-(evidence + constant), _IMPOSSIBLE_COST)

        starts = [
            np.array([k, math.log10(noise)]) for k in _LOG_DENSITY_GRID for noise in sorted(noises)
        ]
        first = min(starts, key=cost)
        simplex = first + np.array([[0.0, 0.0], [0.7, 0.0], [0.0, 0.3]])
        minimum = minimize(
            cost,
            first,
            method="Nelder-Mead",
            options={
                "maxfev": _MAX_ITERATIONS,
                "initial_simplex": simplex,
                "xatol": 0.05,
                "fatol": 0.05,
            },
        )
        best = float(minimum.x[0]), float(minimum.x[1])
        return self._spread**2 * 10.0 ** best[0], 10.0 ** best[1], -float(minimum.fun)


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


def apply_lag_to_path(path: TemperaturePath, values: Array, rate: float, lag: float) -> Array:
    """Return temperatures at the knots, shape (k,), behind a lag in s (see `apply_lag`).

    Each segment begins in equilibrium.
    """
    return np.concatenate(
        [apply_lag(path.sample[part] / rate, values[part], lag) for part in path.parts]
    )
