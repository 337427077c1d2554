"""The Whittle likelihood of a binned spectrum, and its maximum over the densities of the terms.

-log L = 1/2 sum_i nu_i (log S_i + I_i / S_i) up to a constant, with nu ordinates of mean density
I in bin i. For given correlation times S is linear in the squared parameters, which are at least
0: iteratively reweighted non-negative least squares. A ramp R is a mean, not a variance: it changes
I to I - 2 R cross + R^2 ramp, and is profiled out.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from imubench_pipeline.estimators.spectral_shapes import Shapes
from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.estimators.whittle_kernels import (
    TOLERANCE,
    Bins,
    Problem,
    ShapeTable,
    fit_powers,
    interpolate_shape,
    profile_cost,
)
from imubench_pipeline.noise import GaussMarkov, NoiseModel
from imubench_pipeline.noise.terms.gauss_markov import CORRELATION_TIMES
from imubench_pipeline.typing import Array

SHAPES = 192  # Correlation times at which the shape of a Gauss-Markov process is tabulated
COARSE = 48  # Correlation times that suffice to detect lines and the band
_SCAN_STEP = 4
_PAIR_STEP = 12
_MIN_TIME_RATIO = 2.5  # Minimum ratio of two correlation times of one model
_SCAN_TOLERANCE = 1e-2  # Tolerance of the cost when correlation times are only compared
_POLISH_TOLERANCE = 1e-6
_LOG_TIME_TOLERANCE = 5e-4  # Tolerance of the logarithm of a correlation time
_MAX_TURNS = 8


@dataclass(frozen=True)
class Terms:
    """Terms of a model: letters of Q, N, F and K, Gauss-Markov processes, and a ramp."""

    linear: str
    gauss_markov: int = 0
    ramp: bool = False

    @property
    def name(self) -> str:
        """The terms, such as ``N+GM+K``."""
        names = [letter for letter in "QNF" if letter in self.linear]
        names += ["GM"] * self.gauss_markov
        names += ["K"] * ("K" in self.linear) + ["R"] * self.ramp
        return "+".join(names)

    @property
    def biases(self) -> tuple[bool, int]:
        """Whether it has flicker noise, and how many Gauss-Markov processes."""
        return "F" in self.linear, self.gauss_markov

    @property
    def parameters(self) -> int:
        """Number of free parameters."""
        return len(self.linear) + 2 * self.gauss_markov + self.ramp


@dataclass(frozen=True)
class Maximum:
    """The best fit of a model."""

    terms: Terms
    powers: Array
    """(p,): squared parameters of the linear terms in their order, then B^2 of each process, SI."""
    times: Array  # (g,): T_B of each process, s, rising
    ramp: float  # R, SI
    cost: float  # -log L, up to a constant that all models of a spectrum share

    def parameter(self, letter: str) -> float:
        """Return Q, N, B of flicker noise (F) or K."""
        return float(np.sqrt(self.powers[self.terms.linear.index(letter)]))

    @property
    def process_powers(self) -> Array:
        """B^2 of each Gauss-Markov process."""
        return self.powers[len(self.terms.linear) :]

    @property
    def biases(self) -> Array:
        """B of each Gauss-Markov process."""
        return np.asarray(np.sqrt(self.process_powers))


@dataclass(frozen=True)
class Behind:
    """Power gains of a low-pass in each bin of a spectrum, each of shape (b,)."""

    white: Array  # of sampled white noise, with white noise after the filter over N^2
    flicker: Array  # of flicker noise, with its aliases
    slow: Array  # of slower noise

    def select(self, chosen: NDArray[np.bool_]) -> Behind:
        """Return the gains in chosen bins."""
        return Behind(self.white[chosen], self.flicker[chosen], self.slow[chosen])


@dataclass
class Whittle:
    """The likelihood of one spectrum."""

    spectrum: Spectrum  # the bins to use
    shortest: float  # correlation time of a Gauss-Markov process that is searched, s
    longest: float
    shapes: int = SHAPES  # correlation times at which its shape is tabulated
    behind: Behind | None = None  # the sensor's low-pass; quantization noise does not pass it
    scale: float = field(init=False)
    columns: dict[str, Array] = field(init=False)
    shape_of: Shapes = field(init=False)
    times: Array = field(init=False)

    def __post_init__(self) -> None:
        self.shape_of = Shapes(self.spectrum)
        self.scale = float(np.median(self.spectrum.density))
        self.columns = {}
        self.times = np.geomspace(self.shortest, self.longest, self.shapes)
        self._nu = self.spectrum.ordinates

    @cached_property
    def table(self) -> Array:
        """Logarithms of the shapes of Gauss-Markov processes at `times`, shape (t, b)."""
        table = np.log(np.array([self.shape_of.gauss_markov(time) for time in self.times]))
        return table if self.behind is None else table + np.log(self.behind.slow)

    def of(self, spectrum: Spectrum) -> Whittle:
        """Return the likelihood of other data in the same bins."""
        _ = self.table  # made once for all
        other = copy.copy(self)
        other.spectrum, other._nu = spectrum, spectrum.ordinates
        other.scale = float(np.median(spectrum.density))
        return other

    def standing(self, behind: Behind) -> Whittle:
        """Return the likelihood of the same data without a low-pass."""
        other = copy.copy(self)
        other.columns, other.behind = {}, behind
        vars(other)["table"] = self.table + np.log(behind.slow)
        return other

    def with_column(self, letter: str, shape: Array) -> Whittle:
        """Return the likelihood with another density, shape (b,), for Q, N, F or K of 1."""
        _ = self.table  # made once for both
        other = copy.copy(self)
        other.columns = self.columns | {letter: shape}
        return other

    def select(self, spectrum: Spectrum, chosen: NDArray[np.bool_]) -> Whittle:
        """Return the likelihood of other data in chosen bins."""
        other = self.of(spectrum.select(chosen))
        if other.behind is not None:
            other.behind = other.behind.select(chosen)
        other.columns = {letter: self.column(letter)[chosen] for letter in "QNFK"}
        other.table = np.ascontiguousarray(self.table[:, chosen])
        return other

    def column(self, letter: str) -> Array:
        """Return the density of a unit linear term (Q, N, F or K) in each bin."""
        if letter not in self.columns:
            shapes, behind = self.shape_of, self.behind
            if letter == "Q":
                shape = shapes.quantization()
            elif letter == "N":
                shape = shapes.white() if behind is None else behind.white
            elif letter == "F":
                shape = shapes.flicker() * (1.0 if behind is None else behind.flicker)
            else:
                shape = shapes.random_walk() * (1.0 if behind is None else behind.slow)
            self.columns[letter] = shape
        return self.columns[letter]

    def gauss_markov(self, time: float) -> Array:
        """Return the density of a Gauss-Markov process of B = 1 in each bin."""
        shape = np.empty(len(self._nu))
        interpolate_shape(np.log(time), self.shape_table(), shape)
        return shape

    def shape_table(self, unit: float = 1.0) -> ShapeTable:
        """Return the table of shapes in units of a density."""
        first = float(np.log(self.times[0]))
        step = (float(np.log(self.times[-1])) - first) / (self.shapes - 1)
        return ShapeTable(first, step, self.table - np.log(unit) if unit != 1.0 else self.table)

    def bins(self, ramp_unit: float = 1.0) -> Bins:
        """Return the bins in units of `scale`, and of a ramp."""
        spectrum = self.spectrum
        return Bins(
            spectrum.ordinates,
            spectrum.density / self.scale,
            spectrum.cross / self.scale * ramp_unit,
            spectrum.ramp / self.scale * ramp_unit**2,
        )

    def matrix(self, terms: Terms, times: Array) -> Array:
        """Return the densities of unit terms, shape (b, p)."""
        columns = [self.column(letter) for letter in terms.linear]
        columns += [self.gauss_markov(float(time)) for time in times]
        return np.column_stack(columns)

    def density(self, maximum: Maximum) -> Array:
        """Return the density of a fitted model in each bin, without its ramp."""
        return np.asarray(self.matrix(maximum.terms, maximum.times) @ maximum.powers)

    def data(self, maximum: Maximum) -> Array:
        """Return the measured density in each bin, less the ramp of a model."""
        spectrum, R = self.spectrum, maximum.ramp
        return np.asarray(spectrum.density - 2.0 * R * spectrum.cross + R**2 * spectrum.ramp)

    def maximum(self, terms: Terms) -> Maximum:
        """Return the best fit of a model."""
        fixed = np.column_stack([self.column(letter) for letter in terms.linear])
        size = fixed.mean(axis=0)
        fixed = np.ascontiguousarray(fixed / size)
        bins = self.bins()
        where = np.empty(0)
        if terms.gauss_markov:
            search = _fit_one_process if terms.gauss_markov == 1 else _fit_two_processes
            where = search(Problem(fixed, bins, terms.ramp, self.shape_table()))
        times = np.sort(np.exp(where))
        processes = [self.gauss_markov(float(time)) for time in times]
        columns = np.ascontiguousarray(np.column_stack([fixed, *processes]))
        norm = columns.mean(axis=0)
        powers, ramp, cost = fit_powers(columns / norm, bins, terms.ramp, TOLERANCE)
        powers = powers / norm * self.scale
        powers[: len(size)] /= size
        return Maximum(terms, powers, times, ramp, cost)

    def sensitivity(self, maximum: Maximum) -> Array:
        """Return S with S S^T the Fisher information of (log parameter ..., log T_B ..., R).

        Shape (m, b), or (m, 2 b) with a ramp, which shares no information with the others; the
        order is `Maximum.powers`, then `times`.
        """
        matrix = self.matrix(maximum.terms, maximum.times)
        total = matrix @ maximum.powers
        rows = [
            2.0 * power * column / total
            for power, column in zip(maximum.powers, matrix.T, strict=True)
        ]
        step = 0.05
        for power, time in zip(maximum.process_powers, maximum.times, strict=True):
            low = max(time / (1 + step), self.times[0])
            high = min(time * (1 + step), self.times[-1])
            change = self.gauss_markov(high) - self.gauss_markov(low)
            rows.append(power * change / np.log(high / low) / total)
        noise = np.array(rows) * np.sqrt(self._nu / 2.0)
        if not maximum.terms.ramp:
            return np.asarray(noise)
        bins = len(total)
        full = np.zeros((len(rows) + 1, 2 * bins))
        full[:-1, :bins] = noise
        full[-1, bins:] = np.sqrt(self._nu * self.spectrum.ramp / total)
        return full


def make_whittle(
    spectrum: Spectrum,
    highest: float,
    shapes: int = SHAPES,
    *,
    shortest: float | None = None,
    behind: Behind | None = None,
) -> Whittle:
    """Return the likelihood of a spectrum, with the correlation times that it can show.

    ``highest`` is the frequency up to which its bins reach, Hz; ``shortest`` the shortest
    correlation time, s, by default twenty sampling intervals; ``shapes`` and ``behind``: from
    `Whittle`.
    """
    longest = CORRELATION_TIMES.of_log * float(spectrum.length.max())
    least = CORRELATION_TIMES.samples / spectrum.rate if shortest is None else shortest
    least = max(least, 1.0 / (np.pi * highest))
    return Whittle(spectrum, min(least, longest / 4.0), longest, shapes, behind)


def make_noise_model(maximum: Maximum) -> NoiseModel:
    """Return the noise model of a fit; flicker noise comes first, then processes by T_B."""
    terms = maximum.terms
    values = {letter: maximum.parameter(letter) for letter in terms.linear}
    processes = [
        GaussMarkov(float(B), float(time))
        for B, time in zip(maximum.biases, maximum.times, strict=True)
    ]
    first = None if "F" in values or not processes else processes.pop(0)
    return NoiseModel(
        Q=values.get("Q", 0.0),
        N=values.get("N", 0.0),
        B=values.get("F", first.B if first else 0.0),
        T_B=first.T_B if first else None,
        K=values.get("K", 0.0),
        R=maximum.ramp,
        further=[process for process in processes if process.B > 0],
    )


def _polish(
    places: Array, which: int, low: float, high: float, problem: Problem
) -> tuple[float, float]:
    """Minimise the cost over one correlation time between limits (Brent's method)."""
    tried = places.copy()

    def cost(place: float) -> float:
        tried[which] = place
        return profile_cost(tried, problem, _POLISH_TOLERANCE)

    best = minimize_scalar(
        cost, bounds=(low, high), method="bounded", options={"xatol": _LOG_TIME_TOLERANCE}
    )
    return float(best.x), float(best.fun)


def _scan(
    places: Array, which: int, low: float, high: float, problem: Problem
) -> tuple[float, float]:
    """Return the best of one correlation time on a grid between limits, and its cost."""
    tried, table = places.copy(), problem.table
    best, lowest = places[which], np.inf
    for i in range(0, table.logarithms.shape[0], _SCAN_STEP):
        tried[which] = table.first + i * table.step
        if low <= tried[which] <= high:
            cost = profile_cost(tried, problem, _SCAN_TOLERANCE)
            if cost < lowest:
                best, lowest = tried[which], cost
    return best, lowest


def _fit_one_process(problem: Problem) -> Array:
    """Scan the correlation time, then polish the best.

    The search is not compiled: numba would inline and compile each of its levels for seconds.
    """
    first, step, logarithms = problem.table
    last = first + step * (logarithms.shape[0] - 1)
    place = np.array([first])
    best, lowest = _scan(place, 0, first, last, problem)
    reach = _SCAN_STEP * step
    place[0] = best
    low, high = max(first, best - reach), min(last, best + reach)
    polished, cost = _polish(place, 0, low, high, problem)
    place[0] = polished if cost < lowest else best
    return place


def _fit_two_processes(problem: Problem) -> Array:
    """Polish the best pair of a coarse grid, and the best process with another one."""
    begun = [_descend(pair, cost, problem, turns=1) for pair, cost in _pairs(problem)]
    pair, cost = min(begun, key=lambda one: one[1])
    return _descend(pair, cost, problem, turns=_MAX_TURNS)[0]


def _pairs(problem: Problem) -> Iterator[tuple[Array, float]]:
    """Yield pairs of correlation times to begin with, and their costs."""
    first, step, logarithms = problem.table
    last = first + step * (logarithms.shape[0] - 1)
    apart = np.log(_MIN_TIME_RATIO)
    lowest = np.inf
    pair = np.array([first, last])
    places = np.empty(2)
    for i in range(0, logarithms.shape[0], _PAIR_STEP):
        for j in range(i + _PAIR_STEP, logarithms.shape[0], _PAIR_STEP):
            places[0], places[1] = first + i * step, first + j * step
            if places[1] - places[0] < apart:
                continue
            cost = profile_cost(places, problem, _SCAN_TOLERANCE)
            if cost < lowest:
                lowest = cost
                pair = places.copy()
    yield pair, lowest
    single = _fit_one_process(problem)[0]
    for which in (1, 0):
        beside = np.array([single, single])
        low, high = (single + apart, last) if which == 1 else (first, single - apart)
        if high <= low:
            continue
        beside[which], cost = _scan(beside, which, low, high, problem)
        if cost < np.inf:
            yield beside, cost


def _descend(pair: Array, lowest: float, problem: Problem, *, turns: int) -> tuple[Array, float]:
    """Polish each of two correlation times in turn."""
    first, step, logarithms = problem.table
    last = first + step * (logarithms.shape[0] - 1)
    apart = np.log(_MIN_TIME_RATIO)
    best = pair.copy()
    reach = _PAIR_STEP * step
    for _ in range(turns):
        before = lowest
        for g in range(2):
            low, high = max(first, best[g] - reach), min(last, best[g] + reach)
            if g == 0:
                high = min(high, best[1] - apart)
            else:
                low = max(low, best[0] + apart)
            if high <= low:
                continue
            polished, cost = _polish(best, g, low, high, problem)
            if cost < lowest:
                lowest = cost
                best[g] = polished
        reach = max(0.7 * reach, 0.1 * step)
        if before - lowest < 1e-4:
            break
    return best, lowest
