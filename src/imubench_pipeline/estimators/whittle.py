"""The Whittle likelihood of a binned spectrum, and its maximum over the densities of the terms.

-log L = 1/2 sum_i nu_i (log S_i + I_i / S_i) up to a constant, with nu ordinates of mean density
I in bin i. For given correlation times S is linear in the squared parameters, which are at least
0: iteratively reweighted non-negative least squares. A ramp R is a mean, not a variance: it changes
I to I - 2 R cross + R^2 ramp, and is profiled out.
"""

import copy
import math
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from imubench_pipeline.estimators.spectrum import SINGLE, Spectrum
from imubench_pipeline.estimators.whittle_kernels import (
    TOLERANCE,
    Bins,
    Problem,
    ShapeTable,
    fit_powers,
    interpolate_shape,
    profile_cost,
)
from imubench_pipeline.noise import GaussMarkov, NoiseModel, compute_driving_density
from imubench_pipeline.noise.terms.gauss_markov import CORRELATION_TIMES
from imubench_pipeline.typing import Array

_POINTS_PER_BIN = 6  # Frequencies per bin at which a density is evaluated
_MAX_BLOCK_OVER_TIME = 1e-3  # Below this block duration over T_B, a process looks like a walk


class Shapes:
    """Mean densities of unit terms in bins, SI^2/Hz; block means have a folded spectrum."""

    def __init__(self, spectrum: Spectrum) -> None:
        self._interval = 1.0 / spectrum.rate
        self._block = m = spectrum.block.astype(np.float64)
        self._length = spectrum.length
        inside = (np.arange(_POINTS_PER_BIN)[:, None] + 0.5) / _POINTS_PER_BIN
        width = spectrum.upper - spectrum.lower
        # A bin of one ordinate is its frequency, not the surroundings.
        single = width < 0.75 / spectrum.length
        # Shape (6, b), like all results at frequencies.
        frequency = np.where(single, spectrum.frequency, spectrum.lower + width * inside)
        self._omega = 2.0 * np.pi * frequency * m * self._interval
        self._cosine = np.cos(self._omega)
        self._gap = 4.0 * np.sin(self._omega / 2.0) ** 2  # 2 - 2 cos(omega)
        # The mean of m samples of a walk: (2 + cos(omega)) / 3 for large m, 1 for m = 1.
        self._averaged = 1.0 - self._gap / 6.0 * (1.0 - 1.0 / m**2)
        self._single = np.flatnonzero(single & (np.arange(len(width)) < SINGLE))
        self._order = np.rint(
            2.0 * spectrum.frequency[self._single] * spectrum.length[self._single]
        )

    def white(self) -> Array:
        """Return the density of N = 1: 1 in every bin."""
        return np.ones(len(self._length))

    def quantization(self) -> Array:
        """Return the density of Q = 1: (2 - 2 cos(omega)) / (m T)."""
        return np.asarray((self._gap / (self._block * self._interval)).mean(axis=0))

    def random_walk(self) -> Array:
        """Return the density of K = 1, averaged over m samples."""
        step = self._block * self._interval
        return np.asarray((step**2 / self._gap * self._averaged).mean(axis=0))

    def flicker(self) -> Array:
        """Return the density of B = 1 flicker noise, 1 / (2 pi f) well below Nyquist."""
        density = np.empty_like(self._omega)
        for m in np.unique(self._block):
            bins = self._block == m
            folded = (self._omega[:, bins, None] + 2.0 * np.pi * np.arange(m)) / m
            sine = np.abs(np.sin(folded / 2.0))
            # |sin(m w / 2)| is the same in every fold.
            kernel = np.sin(self._omega[:, bins] / 2.0)[..., None] ** 2 / (m * sine) ** 2
            density[:, bins] = (kernel / (2.0 * sine)).mean(axis=-1) * m * self._interval
        shape = density.mean(axis=0)
        shape[self._single] *= [_flicker_edge(order) for order in self._order.tolist()]
        return np.asarray(shape)

    def gauss_markov(self, T_B: float) -> Array:
        """Return the density of a Gauss-Markov process of B = 1.

        The means of m samples are an ARMA(1, 1) process. The lowest ordinates are corrected for the
        ends of the log: c_k^2 is the quadratic form of the covariance in closed form, not the
        spectrum.
        """
        variance = compute_driving_density(1.0, T_B) * T_B / 2.0
        h = self._interval / T_B
        m = self._block
        q, p = -math.expm1(-h), math.exp(-h)
        Q, P = -np.expm1(-m * h), np.exp(-m * h)
        # Covariance 0 and 1 of the block means; for m = 1 they are v and v p.
        sums = m * (1.0 + p) / q - 2.0 * p * -np.expm1(-m * h) / q**2  # variance of m sums over v
        covariance_0 = variance / m**2 * sums
        covariance_1 = variance / m**2 * p * (Q / q) ** 2
        spread = Q**2 + P * self._gap
        shape = covariance_0 + covariance_1 * (2.0 * (self._cosine - P)) / spread
        # That cancels for T_B far longer than a block; then averaging acts as on a random walk.
        slow = -variance * np.expm1(-2.0 * m * h) / spread * self._averaged
        shape = np.where(m * h < _MAX_BLOCK_OVER_TIME, slow, shape)
        shape = (shape * m * self._interval).mean(axis=0)
        i = self._single
        n = np.rint(self._length[i] / (m[i] * self._interval))
        decay, phase = P[i], self._omega[0, i] / 2.0
        sign = np.where(self._order % 2 == 1, 1.0, -1.0)
        ends = 4.0 * variance / n * decay * Q[i] ** 2 * np.cos(phase) ** 2
        ends *= 1.0 + sign * np.exp(-n * m[i] * h)
        shape[i] -= ends / spread[0, i] ** 2 * m[i] * self._interval
        return np.asarray(shape)


@cache
def _flicker_edge(order: float) -> float:
    """Return the mean square of ordinate k of flicker noise over its density, for k << L."""
    # The sum over Gauss-Markov processes of all correlation times, each in closed form.
    times = np.geomspace(1e-4, 1e5, 400)  # T_B over the length of the log
    x = np.pi * order * times  # omega T_B
    sign = 1.0 if order % 2 == 1 else -1.0
    full = 2.0 * times / (1.0 + x**2)  # the spectrum of unit variance, over the length
    ends = 4.0 * times**2 * (1.0 + sign * np.exp(-1.0 / times)) / (1.0 + x**2) ** 2
    return float((full - ends).sum() / full.sum())


SHAPES = 192  # Correlation times at which the shape of a Gauss-Markov process is tabulated
COARSE = 48  # Correlation times that suffice to detect lines and the band
_GRID_STEPS = {1: 4, 2: 8}  # Steps of the table between starts, by number of processes
_MIN_TIME_RATIO = 2.5  # Minimum ratio of two correlation times of one model
_SCAN_TOLERANCE = 1e-2  # Tolerance of the cost when correlation times are only compared
_POLISH_TOLERANCE = 1e-6
_LOG_TIME_TOLERANCE = 5e-4  # Tolerance of the logarithm of a correlation time
_MAX_TURNS = 8
_MIN_TURN_GAIN = 1e-4  # Gain of log likelihood by a turn over both correlation times


@dataclass(frozen=True)
class Terms:
    """Terms of a model: letters out of QNFK, number of Gauss-Markov processes, and a ramp."""

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
        """Whether the model has flicker noise, and how many Gauss-Markov processes."""
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
        """Return the value of a term by its letter: Q, N, K, or F for the B of flicker noise."""
        return float(np.sqrt(self.powers[self.terms.linear.index(letter)]))

    @property
    def process_powers(self) -> Array:
        """B^2 of each Gauss-Markov process."""
        return self.powers[len(self.terms.linear) :]

    @property
    def biases(self) -> Array:
        """B of each Gauss-Markov process."""
        return np.asarray(np.sqrt(self.process_powers))


class Whittle:
    """The likelihood of one spectrum, for T_B from ``shortest`` to ``longest``, s."""

    def __init__(
        self, spectrum: Spectrum, shortest: float, longest: float, shapes: int = SHAPES
    ) -> None:
        self.spectrum, self.shortest, self.longest = spectrum, shortest, longest
        self.shape_of, self._nu = Shapes(spectrum), spectrum.ordinates
        self.scale = float(np.median(spectrum.density))
        self.columns: dict[str, Array] = {}
        self.times = np.geomspace(shortest, longest, shapes)

    @cached_property
    def table(self) -> Array:
        """Logarithms of the shapes of Gauss-Markov processes at `times`, shape (t, b)."""
        return np.log(np.array([self.shape_of.gauss_markov(time) for time in self.times]))

    def of(self, spectrum: Spectrum) -> "Whittle":
        """Return the likelihood of other data in the same bins."""
        _ = self.table  # made once for all
        other = copy.copy(self)
        other.spectrum, other._nu = spectrum, spectrum.ordinates
        other.scale = float(np.median(spectrum.density))
        return other

    def select(self, spectrum: Spectrum, chosen: NDArray[np.bool_]) -> "Whittle":
        """Return the likelihood of other data in chosen bins."""
        other = self.of(spectrum.select(chosen))
        other.columns = {letter: self.column(letter)[chosen] for letter in "QNFK"}
        other.table = np.ascontiguousarray(self.table[:, chosen])
        return other

    def column(self, letter: str) -> Array:
        """Return the density of a unit linear term (Q, N, F or K) in each bin."""
        if letter not in self.columns:
            shapes = self.shape_of
            shape = {
                "Q": shapes.quantization,
                "N": shapes.white,
                "F": shapes.flicker,
                "K": shapes.random_walk,
            }
            self.columns[letter] = shape[letter]()
        return self.columns[letter]

    def gauss_markov(self, time: float) -> Array:
        """Return the density of a Gauss-Markov process of B = 1 in each bin."""
        shape = np.empty(len(self._nu))
        interpolate_shape(np.log(time), self.shape_table(), shape)
        return shape

    def shape_table(self, unit: float = 1.0) -> ShapeTable:
        """Return the table of shapes of Gauss-Markov processes, divided by a density ``unit``."""
        first = float(np.log(self.times[0]))
        step = (float(np.log(self.times[-1])) - first) / (len(self.times) - 1)
        return ShapeTable(first, step, self.table - np.log(unit) if unit != 1.0 else self.table)

    def bins(self, ramp_unit: float = 1.0) -> Bins:
        """Return the bins with densities in units of `scale`, and ramps in ``ramp_unit``."""
        spectrum = self.spectrum
        return Bins(
            spectrum.ordinates,
            spectrum.density / self.scale,
            spectrum.cross / self.scale * ramp_unit,
            spectrum.ramp / self.scale * ramp_unit**2,
        )

    def matrix(self, terms: Terms, times: Array) -> Array:
        """Return the densities of unit terms in the bins, shape (b, p), processes last."""
        columns = [self.column(letter) for letter in terms.linear]
        columns += [self.gauss_markov(float(time)) for time in times]
        return np.column_stack(columns)

    def density(self, maximum: Maximum) -> Array:
        """Return the density of a fitted model in each bin, without its ramp."""
        return np.asarray(self.matrix(maximum.terms, maximum.times) @ maximum.powers)

    def data(self, maximum: Maximum) -> Array:
        """Return the measured density in each bin, with the ramp of a model removed."""
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
            problem = Problem(fixed, bins, terms.ramp, self.shape_table())
            where = _fit_times(problem, terms.gauss_markov)
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

        Shape (m, b), or (m, 2 b) with a ramp, which has no information in common with the other
        parameters; the order is `Maximum.powers`, then `times`.
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
    spectrum: Spectrum, highest: float, shapes: int = SHAPES, *, shortest: float | None = None
) -> Whittle:
    """Return the likelihood of bins up to ``highest``, Hz, and of T_B from ``shortest``, s."""
    longest = CORRELATION_TIMES.of_log * float(spectrum.length.max())
    least = CORRELATION_TIMES.samples / spectrum.rate if shortest is None else shortest
    least = max(least, 1.0 / (np.pi * highest))
    return Whittle(spectrum, min(least, longest / 4.0), longest, shapes)


def make_noise_model(maximum: Maximum) -> NoiseModel:
    """Return the noise model of a fit; flicker noise comes first, then processes by T_B."""
    values = {letter: maximum.parameter(letter) for letter in maximum.terms.linear}
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


def _fit_times(problem: Problem, number: int) -> Array:
    """Return the logarithms of one or two correlation times at the lowest cost, rising.

    The best place of a grid is polished for each time in turn. The search is not compiled: numba
    would inline and compile each of its levels for seconds.
    """
    first, step, logarithms = problem.table
    last = first + step * (len(logarithms) - 1)
    apart = math.log(_MIN_TIME_RATIO)
    spacing = _GRID_STEPS[number] * step
    grid = np.arange(first, last + 0.5 * step, spacing).tolist()
    places = [np.array(place) for place in combinations(grid, number)]
    places = [place for place in places if (np.diff(place) >= apart).all()]
    costs = [profile_cost(place, problem, _SCAN_TOLERANCE) for place in places]
    best, lowest = places[int(np.argmin(costs))], min(costs)
    for _ in range(_MAX_TURNS if number > 1 else 1):
        before = lowest
        for g in range(number):
            low = max(best[g] - spacing, first if g == 0 else best[g - 1] + apart)
            high = min(best[g] + spacing, last if g == number - 1 else best[g + 1] - apart)
            if high <= low:
                continue
            tried = best.copy()

            def cost(place: float, tried: Array = tried, g: int = g) -> float:
                tried[g] = place
                return profile_cost(tried, problem, _POLISH_TOLERANCE)

            polished = minimize_scalar(
                cost, bounds=(low, high), method="bounded", options={"xatol": _LOG_TIME_TOLERANCE}
            )
            if polished.fun < lowest:
                best[g], lowest = polished.x, polished.fun
        if before - lowest < _MIN_TURN_GAIN:
            break
    return best
