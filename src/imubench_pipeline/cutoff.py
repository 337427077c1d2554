"""The cut-off of a sensor's own low-pass, from the spectrum of its noise at rest.

White noise of density N behind a Butterworth filter of order n (n = 1: first order) has the
density N^2 |H(f)|^2 with |H|^2 = 1 / (1 + (f / f_c)^(2 n)), in continuous time; sampling at the
rate f_s folds it to N^2 sum_k |H(f + k f_s)|^2. That holds for a cut-off above Nyquist too, where
the folds leave little of the bend, but a long log shows it. N is the density before the filter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq, minimize_scalar

from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.whittle import COARSE, Whittle, whittle_of
from imubench_pipeline.estimators.whittle_kernels import best_powers
from imubench_pipeline.spectrum import Spectrum

Array = NDArray[np.float64]

_POINTS = 6
_FOLDS = 64
_SCAN = 32
_LOWEST, _HIGHEST = 1 / 500, 4.0
"""Cut-offs that are looked for, parts of the rate."""

_CORRELATIONS = (1e3, 1e4, 1e5)
"""Correlation times of slow noise beside flicker and random walk, sampling intervals."""

_HALF_CHI_SQUARED = 1.9207
"""Log likelihood below its maximum at the ends of a 95 % interval."""

_BEYOND_BIC = 6.0
_WIDEST = 1.2
"""Ratio of the limits of a cut-off beyond which it is not called known."""

_FEWEST_BINS = 24


@dataclass(frozen=True)
class Cutoff:
    """The low-pass that a spectrum shows.

    Attributes
    ----------
    frequency : Parameter
        f_c (-3 dB), Hz.
    order : int or None
        n; None where no filter shows.
    N : Parameter
        Density of white noise before the filter, SI.
    floor : float
        Density of white noise after it, as of rounding, SI.
    gained : float
        BIC of the noise without a filter, less that with it.
    """

    frequency: Parameter
    order: int | None
    N: Parameter
    floor: float
    gained: float


def low_pass(frequency: ArrayLike, cutoff: float, order: int = 1) -> Array:
    """Return the power gain of a Butterworth low-pass in continuous time.

    Parameters
    ----------
    frequency : array_like
        Hz.
    cutoff : float
        f_c, Hz.
    order : int
        n.
    """
    f = np.asarray(frequency, dtype=np.float64)
    return np.asarray(1.0 / (1.0 + (f / cutoff) ** (2 * order)))


def folded_low_pass(frequency: ArrayLike, cutoff: float, rate: float, order: int = 1) -> Array:
    """Return the power gain of white noise behind a low-pass, sampled.

    For n = 1 the sum over the folds is (pi f_c / f_s) sinh(2 pi f_c / f_s) / (cosh(2 pi f_c / f_s)
    - cos(2 pi f / f_s)), the spectrum of a sampled Gauss-Markov process.

    Parameters
    ----------
    frequency : array_like
        Hz, up to Nyquist.
    cutoff : float
        f_c, Hz.
    rate : float
        f_s, Hz.
    order : int
        n.
    """
    f = np.asarray(frequency, dtype=np.float64)
    if order == 1:
        h = 2.0 * np.pi * cutoff / rate
        # Both over e^h, which may be great.
        decay = math.exp(-h)
        sine, cosine = 0.5 * -math.expm1(-2.0 * h), 0.5 * (1.0 + decay**2)
        return np.asarray(0.5 * h * sine / (cosine - decay * np.cos(2.0 * np.pi * f / rate)))
    folds = int(_FOLDS + math.ceil(4.0 * cutoff / rate))
    k = np.arange(-folds, folds + 1) * rate
    total = low_pass(f[..., None] + k, cutoff, order).sum(axis=-1)
    # Folds beyond: the integral of (f / f_c)^(-2 n) on both sides.
    rest = (folds + 0.5) * rate / cutoff
    return np.asarray(total + 2.0 * cutoff / rate * rest ** (1 - 2 * order) / (2 * order - 1))


def find_cutoff(
    spectrum: Spectrum,
    clear: NDArray[np.bool_] | None = None,
    *,
    orders: Sequence[int] = (1, 2, 3, 4),
) -> Cutoff:
    """Find the low-pass of a sensor from its spectrum.

    Slow noise (flicker noise, a random walk, Gauss-Markov processes) stands beside the white;
    the order and a floor behind the filter are chosen by BIC.

    Parameters
    ----------
    spectrum : Spectrum
        Of a log, up to Nyquist.
    clear : ndarray of bool, shape (b,), optional
        Bins that no line touches.
    orders : sequence of int
        Orders to try.

    Returns
    -------
    Cutoff
        With status ``not_identified`` where the interval of the cut-off is wider than a fifth,
        ``absent`` where no filter shows.
    """
    used = np.ones(len(spectrum.frequency), dtype=np.bool_) if clear is None else clear
    if used.sum() < _FEWEST_BINS:
        unknown = Parameter(None, "not_shown", f"the spectrum has {used.sum()} bins only")
        return Cutoff(unknown, None, unknown, 0.0, 0.0)
    fits = _Fits(spectrum.taken(used))
    penalty = 0.5 * math.log(used.sum())
    powers, without = fits.unfiltered()
    best: tuple[float, int, bool, float] | None = None
    for order in orders:
        for floor in (False, True):
            cutoff, cost = fits.best(order, floor)
            score = cost + penalty * (1 + floor)
            if best is None or score < best[0] - (1.0 if floor else 0.0):
                best = (score, order, floor, cutoff)
    assert best is not None
    score, order, floor, cutoff = best
    gained = 2.0 * (without - score)
    if gained < _BEYOND_BIC:
        absent = Parameter(None, "absent", "the spectrum shows no low-pass below Nyquist")
        return Cutoff(absent, None, Parameter(math.sqrt(powers[0])), 0.0, gained)
    lower, upper = fits.limits(cutoff, order, floor)
    N, after = fits.density(cutoff, order, floor)
    ends = sorted(fits.density(end, order, floor)[0] for end in (lower, upper))
    error = 1.96 * N / math.sqrt(2.0 * float(spectrum.ordinates[used].sum()))
    density = Parameter(N, lower=min(ends[0], N) - error, upper=max(ends[1], N) + error)
    if upper > _WIDEST * lower or upper >= 0.999 * fits.highest:
        reason = f"the log allows cut-offs from {lower:.4g} to {upper:.4g} Hz"
        found = Parameter(None, "not_identified", reason, lower, upper, fitted=cutoff)
        density = replace(
            density, value=None, status="not_identified", reason=reason, fitted=density.value
        )
    else:
        found = Parameter(cutoff, lower=lower, upper=upper)
    return Cutoff(found, order, density, after, gained)


class _Fits:
    """Whittle fits of a spectrum for given filters."""

    def __init__(self, spectrum: Spectrum) -> None:
        self.rate = spectrum.rate
        self.lowest, self.highest = _LOWEST * spectrum.rate, _HIGHEST * spectrum.rate
        self.whittle: Whittle = whittle_of(spectrum, 0.5 * spectrum.rate, COARSE)
        whittle = self.whittle
        within = (np.arange(_POINTS) + 0.5) / _POINTS
        width = (spectrum.upper - spectrum.lower)[:, None]
        self.frequency = spectrum.lower[:, None] + width * within
        times = np.array(_CORRELATIONS) / spectrum.rate
        times = times[(times > whittle.shortest) & (times < whittle.longest)]
        slow = [whittle.column("F"), whittle.column("K")]
        slow += [whittle.gauss_markov(float(time)) for time in times]
        self.slow = np.column_stack(slow)

    def unfiltered(self) -> tuple[Array, float]:
        """Return the squared densities without a filter, that of white noise first, and -log L."""
        return self._powers(np.column_stack([self.whittle.column("N"), self.slow]))

    def cost(self, cutoff: float, order: int, floor: bool) -> float:
        """Return -log L at a cut-off."""
        return self._powers(self._columns(cutoff, order, floor))[1]

    def density(self, cutoff: float, order: int, floor: bool) -> tuple[float, float]:
        """Return N before the filter, and the density after it."""
        powers = self._powers(self._columns(cutoff, order, floor))[0]
        return math.sqrt(powers[0]), math.sqrt(powers[-1]) if floor else 0.0

    def best(self, order: int, floor: bool) -> tuple[float, float]:
        """Return the cut-off of the least cost, and the cost."""
        scan = np.linspace(math.log(self.lowest), math.log(self.highest), _SCAN)
        costs = [self.cost(math.exp(x), order, floor) for x in scan]
        place = int(np.argmin(costs))
        found = minimize_scalar(
            lambda x: self.cost(math.exp(x), order, floor),
            bounds=(scan[max(place - 1, 0)], scan[min(place + 1, _SCAN - 1)]),
            method="bounded",
            options={"xatol": 1e-5},
        )
        return math.exp(found.x), float(found.fun)

    def limits(self, cutoff: float, order: int, floor: bool) -> tuple[float, float]:
        """Return the ends of the 95 % interval, by the profile of the likelihood."""
        most = self.cost(cutoff, order, floor) + _HALF_CHI_SQUARED

        def beyond(x: float) -> float:
            return self.cost(math.exp(x), order, floor) - most

        ends = []
        for sign, end in ((-1.0, self.lowest), (1.0, self.highest)):
            inside = math.log(cutoff)
            step, outside = 1e-3, inside
            while True:
                outside = inside + sign * step
                if sign * (outside - math.log(end)) >= 0.0:
                    ends.append(end)
                    break
                if beyond(outside) > 0.0:
                    ends.append(math.exp(brentq(beyond, inside, outside, xtol=1e-6)))
                    break
                inside, step = outside, 2.0 * step
        return ends[0], ends[1]

    def _columns(self, cutoff: float, order: int, floor: bool) -> Array:
        white = folded_low_pass(self.frequency, cutoff, self.rate, order).mean(axis=1)
        slow = self.slow * low_pass(self.frequency, cutoff, order).mean(axis=1)[:, None]
        columns = [white, *slow.T]
        return np.column_stack([*columns, np.ones(len(white))] if floor else columns)

    def _powers(self, columns: Array) -> tuple[Array, float]:
        norm = columns.mean(axis=0)
        powers, _, cost = best_powers(
            np.ascontiguousarray(columns / norm), self.whittle.bins(), False
        )
        return powers / norm * self.whittle.scale, cost
