"""Low-pass filters between a sensor's noise and its log, in a sampled spectrum.

White noise of density N behind a filter has the density N^2 G(f) in the samples:

- analogue, Butterworth of order n: G = sum_k |H(f + k f_s)|^2, aliased by the sampling;
- bilinear, the same filter after the bilinear transform: G = 1 / (1 + (tan(pi f / f_s) /
  tan(pi f_c / f_s))^(2 n)), 0 at Nyquist;
- boxcar, the mean over a time d: the autocovariance is a triangle, so that G = T/d (1 +
  2 sum_(k T < d) (1 - k T/d) cos(2 pi f k T)); d = m T is the moving average of m samples.

f_c is where the power is halved; for the boxcar 0.443 / d, before the sampling.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.typing import Array

Kind = Literal["analogue", "bilinear", "boxcar"]

BOXCAR_CUTOFF_LENGTH = 0.442946  # Cut-off of a boxcar times its length, where sinc^2 is one half
_FLICKER_ALIASES = 3  # On each side; the filter leaves little of the others
_MIN_ALIASES = 2  # On each side, in addition to those up to four times the cut-off
_GRID_SIZE = 512  # Frequencies of the numerical integral over G


class Frequencies:
    """Frequencies f up to Nyquist (Hz) of samples at a rate (Hz), and cached functions of them."""

    def __init__(self, frequency: ArrayLike, rate: float) -> None:
        self.f = np.asarray(frequency, dtype=np.float64)
        self.rate = rate
        self._folds: dict[int, Array] = {}

    @cached_property
    def cosine(self) -> Array:
        """cos(w), w = 2 pi f / rate."""
        return np.asarray(np.cos(2.0 * np.pi * self.f / self.rate))

    @cached_property
    def difference_gain(self) -> Array:
        """2 - 2 cos(w), the power gain of first differences."""
        return np.asarray(2.0 - 2.0 * self.cosine)

    @cached_property
    def end_gain(self) -> Array:
        """cos^2(w / 2), the gain of the ends of a DCT-II."""
        return np.asarray(np.cos(2.0 * np.pi * self.f / self.rate / 2.0) ** 2)

    @cached_property
    def tangent(self) -> Array:
        """tan(w / 2), clipped below Nyquist, where a bilinear filter passes nothing."""
        return np.asarray(np.tan(np.minimum(np.pi * self.f / self.rate, 0.5 * np.pi - 1e-7)))

    @cached_property
    def half_angle(self) -> tuple[Array, Array]:
        """Half of w, above 0, and its sine."""
        half = np.pi * np.maximum(self.f, 1e-9 * self.rate) / self.rate
        return half, np.sin(half)

    @cached_property
    def nearest_aliases(self) -> tuple[Array, Array, Array]:
        """Absolute frequencies of the nearest aliases, shape (7, ...), Hz and rad/s; sampled w.

        The sampled frequency is sqrt(2 - 2 cos w) times the rate, the counterpart of 2 pi f.
        """
        distance = np.abs(self.aliases(_FLICKER_ALIASES))
        sampled = 2.0 * self.rate * np.sin(np.pi * self.f / self.rate)
        return distance, 2.0 * np.pi * distance, sampled

    def aliases(self, number: int) -> Array:
        """Return the frequencies that alias onto these, ``number`` on each side, shape (k, ...)."""
        if number not in self._folds:
            k = np.arange(-number, number + 1).reshape(-1, *[1] * self.f.ndim)
            self._folds[number] = self.f + k * self.rate
        return self._folds[number]


@lru_cache(maxsize=4)
def _make_integration_grid(rate: float) -> Frequencies:
    return Frequencies((np.arange(_GRID_SIZE) + 0.5) / _GRID_SIZE * 0.5 * rate, rate)


@dataclass(frozen=True)
class Filter:
    """A low-pass filter; results have the shape of the frequencies."""

    kind: Kind
    order: int  # n of the Butterworth filter; 1 for the boxcar
    cutoff: float  # f_c, Hz

    def white(self, at: Frequencies) -> Array:
        """Return G, the density of white noise of N = 1 behind the filter, sampled."""
        if self.kind == "bilinear":
            return self._evaluate_bilinear(at)
        if self.kind == "boxcar":
            length = BOXCAR_CUTOFF_LENGTH / self.cutoff * at.rate  # in samples
            whole = math.ceil(length)
            # Split 1 - k / length into 1 - k / whole and a constant: Fejer and Dirichlet kernels.
            half, sine = at.half_angle
            fejer = (np.sin(whole * half) / sine) ** 2 / whole
            dirichlet = np.sin((2 * whole - 1) * half) / sine
            part = whole / length
            total = part * fejer + (1.0 - part) * dirichlet
            return np.asarray(np.maximum(total, 1e-12) / length)
        if self.order > 1:
            return self._sum_aliases(at, self._evaluate_aliases(at))
        # The spectrum of a sampled Gauss-Markov process, the sum over the aliases for n = 1:
        # (h / 2) sinh(h) / (cosh(h) - cos w). Both are divided by e^h, which may overflow.
        h = 2.0 * np.pi * self.cutoff / at.rate
        decay = math.exp(-h)
        sinh, cosh = 0.5 * -math.expm1(-2.0 * h), 0.5 * (1.0 + decay**2)
        return np.asarray(0.5 * h * sinh / (cosh - decay * at.cosine))

    def slow(self, at: Frequencies) -> Array:
        """Return the power gain for noise that is slow against the rate, without aliases."""
        if self.kind == "bilinear":
            return self._evaluate_bilinear(at)
        return self._evaluate_power(at.f)

    def gains(self, at: Frequencies) -> tuple[Array, Array, Array]:
        """Return the gains for white noise, G, flicker noise with aliases, and slow noise."""
        if self.kind == "bilinear":
            same = self._evaluate_bilinear(at)
            return same, same, same
        distance, turned, sampled = at.nearest_aliases
        if self.kind == "analogue" and self.order > 1:
            powers = self._evaluate_aliases(at)
            further = len(powers) // 2 - _FLICKER_ALIASES
            white, nearest = self._sum_aliases(at, powers), powers[further : len(powers) - further]
        else:
            white, nearest = self.white(at), self._evaluate_power(distance)
        flicker = np.asarray(sampled * (nearest / turned).sum(axis=0))
        return white, flicker, nearest[_FLICKER_ALIASES]

    def half_power(self, rate: float) -> float:
        """Return the frequency at which the density of filtered white noise is halved.

        It equals ``cutoff`` except for a boxcar, whose side lobes alias: it is 0.155 of the rate
        for the running mean of three samples, and 0.148 for the mean over that time.
        """
        if self.kind != "boxcar":
            return self.cutoff

        def white(f: float) -> float:
            return float(self.white(Frequencies(f, rate)))

        half = 0.5 * white(0.0)
        return float(brentq(lambda f: white(f) - half, 0.5 * self.cutoff, 0.5 * rate))

    def leakage(self, at: Frequencies, length: ArrayLike) -> Array:
        """Return the spectral leakage of the DCT-II of filtered white noise, as a density.

        The even continuation of a smooth signal has discontinuous slopes at its ends. They add the
        density (4 V T / n) cos^2(w/2) / (2 - 2 cos w)^2, V the variance of first differences.
        ``length`` is the duration of the transform at each frequency, s.
        """
        rate, grid = at.rate, _make_integration_grid(at.rate)
        variance = float(np.mean(self.white(grid) * grid.difference_gain)) * rate
        ends = 4.0 * variance / (np.asarray(length) * rate) / rate * at.end_gain
        # Where the filter passes, the second differences cancel the terms of the ends.
        bent = 1.0 - np.minimum(self.slow(at), 1.0)
        return np.asarray(ends * bent**2 / np.maximum(at.difference_gain, 1e-12) ** 2)

    def _evaluate_power(self, f: Array) -> Array:
        """Return the power gain at frequencies, before the sampling."""
        if self.kind == "boxcar":
            return np.asarray(np.sinc(f * BOXCAR_CUTOFF_LENGTH / self.cutoff) ** 2)
        return LowPass(self.cutoff, self.order).power(f)

    def _evaluate_aliases(self, at: Frequencies) -> Array:
        further = math.ceil(4.0 * self.cutoff / at.rate)
        return self._evaluate_power(at.aliases(_MIN_ALIASES + further))

    def _sum_aliases(self, at: Frequencies, powers: Array) -> Array:
        """Return the sum over all aliases, from the powers of the nearest, shape (k, ...)."""
        total = powers.sum(axis=0)
        # Further aliases: the integral of (f / f_c)^(-2 n) on each side, with the next term of the
        # Euler-Maclaurin formula.
        steep = 2 * self.order
        for side in (at.f, -at.f):
            end = 0.5 * len(powers) + side / at.rate
            power = math.prod([end] * (steep - 2), start=end)
            rest = (self.cutoff / at.rate) ** steep / power / (steep - 1)
            total += rest * (1.0 - steep * (steep - 1) / 24.0 / end**2)
        return np.asarray(total)

    def _evaluate_bilinear(self, at: Frequencies) -> Array:
        warped = at.tangent / math.tan(math.pi * min(self.cutoff / at.rate, 0.4999))
        logarithm = np.minimum(2.0 * self.order * np.log(np.maximum(warped, 1e-30)), 600.0)
        return np.asarray(1.0 / (1.0 + np.exp(logarithm)))
