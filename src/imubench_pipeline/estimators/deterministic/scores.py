"""Matched filters for the regressors in given noise, evaluated at all places at once.

The numerator of a step at place t is sum_k w_k r_k s_k(t) with s_k(t) = -sqrt(2 / n)
sin(pi k t / n) / (2 sin(pi k / 2 n)), a sine transform over k; the denominators are cosine
transforms. The columns of other regressors are projected out.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy.fft
from scipy.special import chdtri

from imubench_pipeline.estimators.deterministic.ordinates import Fit, Ordinates
from imubench_pipeline.estimators.deterministic.regressors import Kind, Regressor
from imubench_pipeline.typing import Array

FALSE_ALARM_PROBABILITY: dict[Kind, float] = {
    "step": 0.001,
    "restart": 0.001,
    "exponential": 0.0015,
    "sinusoid": 0.0015,
    "ramp": 0.002,
    "pulse": 0.001,
}
"""False-alarm probability for each kind in a log without deterministic signals."""

_EDGE_BLOCKS = 3  # blocks at the ends of a part in which no step is searched
_TIME_CONSTANTS = 24  # number of time constants that are tried

_MIN_TIME_FRACTION, _MAX_TIME_FRACTION = 1 / 200, 1 / 2
"""Shortest and longest time constant, as fractions of the part of the log."""

_EXPONENTIAL_ORDINATES = 2048  # number of lowest ordinates in which exponentials are searched
_MAX_CYCLES = 64
_CYCLE_STEP = 0.25  # spacing of the frequencies that are tried, cycles in the part
MIN_CYCLES = 0.25  # in the part, e.g. a day in a log of six hours; fewer are a ramp and a bend
_MIN_INDEPENDENT_POWER = 1e-3  # fraction of a regressor's power; less is rounding error


@dataclass(frozen=True)
class Score:
    """The best regressor of a kind, with its gain."""

    regressor: Regressor
    gain: float  # twice the log likelihood that it adds, for given noise
    threshold: float  # what it must reach (`FALSE_ALARM_PROBABILITY`)


def find_best_scores(
    ordinates: Ordinates, fit: Fit, density: Array, *, smooth: bool = False
) -> Iterator[Score]:
    """Yield the best additional regressor of each kind in each part, given a fit.

    ``density``, shape (k,): of the noise, SI²/Hz; ``smooth`` excludes steps and pulses.
    """
    weight = ordinates.weights(density)
    residual = ordinates.coefficient
    if fit.regressors:
        residual = ordinates.solve(fit.regressors, density)[2]
    parts = len(ordinates.sizes)
    for number, n in enumerate(ordinates.sizes):
        of_part = ordinates.part(number)
        w, r = weight[of_part], residual[of_part]
        others = [x for x in fit.regressors if x.part == number]
        basis = _orthonormalise([row for x in others for row in ordinates.columns(x)], w)
        if not smooth:
            yield from _score_steps_and_pulses(number, n, w, r, basis, parts)
        times, columns = _tabulate_exponentials(n)
        low = slice(0, columns.shape[1])
        gains = _compute_gains(columns, w[low], r[low], basis[:, low])
        best = int(np.argmax(gains))
        chance = FALSE_ALARM_PROBABILITY["exponential"] / parts
        threshold = _compute_threshold(chance, float(_TIME_CONSTANTS), _TIME_CONSTANTS)
        exponential = Regressor("exponential", number, float(times[best]))
        yield Score(exponential, float(gains[best]), threshold)
        yield _score_sinusoids(number, n, w, r, basis, parts)
        ramp = Regressor("ramp", number)
        gain = _compute_gains(ordinates.columns(ramp), w, r, basis)[0]
        yield Score(ramp, gain, float(chdtri(1, FALSE_ALARM_PROBABILITY["ramp"] / parts)))


class Gain:
    """Gain of log likelihood by additional regressors of one part, for given noise.

    ``regressors`` are in the fit already; ``density``, shape (k,): of the noise, SI²/Hz.
    """

    def __init__(
        self, ordinates: Ordinates, regressors: Sequence[Regressor], density: Array, part: int
    ) -> None:
        self._ordinates = ordinates
        of_part = ordinates.part(part)
        self._weight = ordinates.weights(density)[of_part]
        others = [row for x in regressors if x.part == part for row in ordinates.columns(x)]
        self._basis = _orthonormalise(others, self._weight)
        coefficient = ordinates.coefficient[of_part]
        self._residual = coefficient - (self._basis @ (self._weight * coefficient)) @ self._basis

    def of(self, regressor: Regressor) -> float:
        """Return twice the log likelihood that a regressor adds."""
        columns = regressor.coefficients(self._ordinates.sizes[regressor.part])
        if len(columns) == 1:
            return float(_compute_gains(columns, self._weight, self._residual, self._basis)[0])
        # Cosine and sine of a few cycles are not orthogonal: fit one after the other.
        independent = columns[0] - (self._basis @ (self._weight * columns[0])) @ self._basis
        first = _orthonormalise([independent], self._weight)
        projection = first @ (self._weight * self._residual)
        both = np.concatenate([self._basis, first])
        left = self._residual - projection @ first
        more = _compute_gains(columns[1:], self._weight, left, both)[0]
        return float(projection @ projection + more)


def _orthonormalise(columns: Sequence[Array], w: Array) -> Array:
    """Return a basis of columns that is orthonormal in the weighted product, shape (q, k)."""
    if not columns:
        return np.empty((0, len(w)))
    X = np.array(columns)
    gram = (X * w) @ X.T
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    independent = values > 1e-10
    return np.asarray(
        (vectors[:, independent] / np.sqrt(values[independent])).T @ (X / scale[:, None])
    )


def _compute_gains(columns: Array, w: Array, r: Array, basis: Array) -> Array:
    """Return the gain of log likelihood by each column, shape (c, k)."""
    weighted = columns * w
    whole = np.einsum("ck,ck->c", weighted, columns)
    left = whole - np.sum((weighted @ basis.T) ** 2, axis=1)
    return _normalise_output(weighted @ r, whole, left)


def _normalise_output(above: Array, whole: Array, left: Array) -> Array:
    """Return the squared filter output over the independent power of each regressor."""
    return np.asarray(
        np.where(left > _MIN_INDEPENDENT_POWER * whole, above**2 / np.maximum(left, 1e-300), 0.0)
    )


def _score_steps_and_pulses(
    number: int, n: int, w: Array, r: Array, basis: Array, parts: int
) -> Iterator[Score]:
    k = np.arange(1, n)
    slope = -math.sqrt(2.0 / n) / (2.0 * np.sin(np.pi * k / (2.0 * n)))
    # The sums of sin(pi k t / n) over k, for t = 1 ... n - 1, are half a DST-I.
    above = 0.5 * scipy.fft.dst(slope * w * r, type=1)
    power = slope**2 * w
    turned = scipy.fft.fft(np.concatenate(([0.0], power))).real
    whole = 0.5 * (turned[0] - turned[1:])
    left = whole.copy()
    for row in basis:
        left -= (0.5 * scipy.fft.dst(slope * w * row, type=1)) ** 2
    gains = _normalise_output(above, whole, left)
    gains[: _EDGE_BLOCKS - 1] = 0.0
    gains[n - _EDGE_BLOCKS :] = 0.0
    place = int(np.argmax(gains))
    # Scores at neighbouring places are correlated: the number of independent places follows from
    # the correlation (Rice's formula), and cannot exceed the number of places.
    alike = float(np.sum(power * np.cos(np.pi * k / n)) / np.sum(power))
    apart = (n - 1) * math.sqrt(2.0 * max(1.0 - alike, 0.0))
    yield Score(
        Regressor("step", number, float(place + 1)),
        float(gains[place]),
        _compute_threshold(FALSE_ALARM_PROBABILITY["step"] / parts, apart, n),
    )
    above = scipy.fft.idct(np.concatenate(([0.0], w * r)), type=2, norm="ortho")
    whole = np.full(n, float(w.sum()) / n)
    left = whole.copy()
    for row in basis:
        left -= scipy.fft.idct(np.concatenate(([0.0], w * row)), type=2, norm="ortho") ** 2
    gains = _normalise_output(above, whole, left)
    place = int(np.argmax(gains))
    yield Score(
        Regressor("pulse", number, float(place)),
        float(gains[place]),
        _compute_threshold(FALSE_ALARM_PROBABILITY["pulse"] / parts, math.inf, n),
    )


def _compute_threshold(chance: float, apart: float, places: int) -> float:
    """Return the threshold for the largest of many gains: Rice's formula, or Bonferroni's.

    S. O. Rice, Bell Syst. Tech. J. 24, 1945: the rate of upcrossings of a Gaussian process.
    """
    low, high = 4.0, 200.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        single = math.erfc(math.sqrt(0.5 * middle))
        crossed = single + apart / math.pi * math.exp(-0.5 * middle)
        if min(crossed, places * single) > chance:
            low = middle
        else:
            high = middle
    return high


@lru_cache(maxsize=8)
def _tabulate_exponentials(n: int) -> tuple[Array, Array]:
    """Return time constants in blocks and their coefficients, shape (t, n - 1)."""
    times = np.geomspace(max(_MIN_TIME_FRACTION * n, 2.0), _MAX_TIME_FRACTION * n, _TIME_CONSTANTS)
    rows = [
        Regressor("exponential", 0, t).coefficients(n)[:, :_EXPONENTIAL_ORDINATES] for t in times
    ]
    return times, np.concatenate(rows)


@lru_cache(maxsize=8)
def _tabulate_sinusoids(n: int) -> tuple[Array, Array, int]:
    """Return cycles in the part, coefficients of cosine and sine (2, c, k), and the number k."""
    most = min(_MAX_CYCLES, n // 8)
    cycles = np.arange(MIN_CYCLES, most + 1e-9, _CYCLE_STEP)
    count = min(n - 1, 4 * most)
    columns = np.empty((2, len(cycles), count))
    # The low ordinates of a slow signal are the same for fewer, longer blocks.
    few = min(n, 8 * most)
    scale = math.sqrt(n / few)
    for i, c in enumerate(cycles):
        columns[:, i] = scale * Regressor("sinusoid", 0, c / few).coefficients(few)[:, :count]
    return cycles, columns, count


def _score_sinusoids(number: int, n: int, w: Array, r: Array, basis: Array, parts: int) -> Score:
    cycles, columns, count = _tabulate_sinusoids(n)
    w, r, basis = w[:count], r[:count], basis[:, :count]
    weighted = columns * w
    above = weighted @ r
    a, b = np.einsum("xck,xck->xc", weighted, columns)
    c = np.einsum("ck,ck->c", weighted[0], columns[1])
    projected = weighted @ basis.T
    whole = a * b - c**2
    a = a - np.sum(projected[0] ** 2, axis=1)
    b = b - np.sum(projected[1] ** 2, axis=1)
    c = c - np.sum(projected[0] * projected[1], axis=1)
    left = a * b - c**2
    good = left > 10.0 * _MIN_INDEPENDENT_POWER * whole
    form = b * above[0] ** 2 - 2.0 * c * above[0] * above[1] + a * above[1] ** 2
    gains = np.where(good, form / np.where(good, left, 1.0), 0.0)
    best = int(np.argmax(gains))
    # Each has two amplitudes; there are two independent frequencies per cycle.
    chance = FALSE_ALARM_PROBABILITY["sinusoid"] / parts / (2.0 * len(cycles) * _CYCLE_STEP)
    return Score(
        Regressor("sinusoid", number, float(cycles[best]) / n),
        float(gains[best]),
        float(chdtri(2, chance)),
    )
