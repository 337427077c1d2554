"""The low-pass filters that stand between a sensor's noise and its log, in a sampled spectrum.

White noise of density N behind a filter has the density N^2 G(f) in the samples:

- analogue, Butterworth of order n: G = sum_k |H(f + k f_s)|^2, folded by the sampling;
- bilinear, the same filter carried over to samples: G = 1 / (1 + (tan(pi f / f_s) /
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

BOXCAR = 0.442946
"""Cut-off of a boxcar times its length: sinc^2 is one half there."""

_SLOW_FOLDS = 3
"""Folds on each side of flicker noise, of which little is left there."""

_FOLDS = 2
"""Folds on each side that are added one by one, besides those up to four times the cut-off."""

_GRID = 512
"""Frequencies of the integral over G."""


class Frequencies:
    """Frequencies f up to Nyquist (Hz) of samples at a rate (Hz).

    What of them is the same for all filters is made once.
    """

    def __init__(self, frequency: ArrayLike, rate: float) -> None:
        self.f = np.asarray(frequency, dtype=np.float64)
        self.rate = rate
        self._folds: dict[int, Array] = {}

    @cached_property
    def cosine(self) -> Array:
        """cos(w), w = 2 pi f / rate."""
        return np.asarray(np.cos(2.0 * np.pi * self.f / self.rate))

    @cached_property
    def gap(self) -> Array:
        """2 - 2 cos(w), the gain of differences of neighbours."""
        return np.asarray(2.0 - 2.0 * self.cosine)

    @cached_property
    def ends(self) -> Array:
        """cos^2(w / 2), as at the ends of a transform."""
        return np.asarray(np.cos(2.0 * np.pi * self.f / self.rate / 2.0) ** 2)

    @cached_property
    def tangent(self) -> Array:
        """tan(w / 2); it has no value at Nyquist, where a bilinear filter leaves nothing."""
        return np.asarray(np.tan(np.minimum(np.pi * self.f / self.rate, 0.5 * np.pi - 1e-7)))

    @cached_property
    def half(self) -> tuple[Array, Array]:
        """Half of w, above 0, and its sine."""
        half = np.pi * np.maximum(self.f, 1e-9 * self.rate) / self.rate
        return half, np.sin(half)

    @cached_property
    def nearest(self) -> tuple[Array, Array, Array]:
        """Distances from 0 of the nearest folds, shape (7, ...), Hz, in rad/s, and of samples.

        That of samples is sqrt(2 - 2 cos w) times the rate, which stands for 2 pi f in them.
        """
        distance = np.abs(self.folds(_SLOW_FOLDS))
        sampled = 2.0 * self.rate * np.sin(np.pi * self.f / self.rate)
        return distance, 2.0 * np.pi * distance, sampled

    def folds(self, number: int) -> Array:
        """Return the frequencies that fold onto these, so many on each side, shape (k, ...)."""
        if number not in self._folds:
            k = np.arange(-number, number + 1).reshape(-1, *[1] * self.f.ndim)
            self._folds[number] = self.f + k * self.rate
        return self._folds[number]


@lru_cache(maxsize=4)
def _grid(rate: float) -> Frequencies:
    return Frequencies((np.arange(_GRID) + 0.5) / _GRID * 0.5 * rate, rate)


@dataclass(frozen=True)
class Filter:
    """A low-pass filter; results are in the shape of the frequencies.

    Parameters
    ----------
    kind : {"analogue", "bilinear", "boxcar"}
    order : int
        n of the Butterworth filter; 1 for the boxcar.
    cutoff : float
        f_c, Hz.
    """

    kind: Kind
    order: int
    cutoff: float

    @property
    def name(self) -> str:
        """In words."""
        if self.kind == "boxcar":
            return "mean over a time (boxcar)"
        return f"{self.kind} low-pass of order {self.order}"

    def white(self, at: Frequencies) -> Array:
        """Return G, the density of white noise of N = 1 behind the filter, sampled."""
        if self.kind == "bilinear":
            return self._bilinear(at)
        if self.kind == "boxcar":
            return self._triangle(at)
        if self.order == 1:
            return self._sampled_process(at)
        return self._folded(at, self._powers_of_folds(at))

    def slow(self, at: Frequencies) -> Array:
        """Return what the filter leaves of noise that is slow against the rate: no folds."""
        return self._bilinear(at) if self.kind == "bilinear" else self._power(at.f)

    def gains(self, at: Frequencies) -> tuple[Array, Array, Array]:
        """Return what the filter leaves of white noise, G, of flicker noise, and of slow noise.

        Of flicker noise it is relative to that as sampled without the filter, folds included.
        """
        if self.kind == "bilinear":
            same = self._bilinear(at)
            return same, same, same
        distance, turned, sampled = at.nearest
        if self.kind == "analogue" and self.order > 1:
            powers = self._powers_of_folds(at)
            further = len(powers) // 2 - _SLOW_FOLDS
            white, nearest = self._folded(at, powers), powers[further : len(powers) - further]
        else:
            white, nearest = self.white(at), self._power(distance)
        flicker = np.asarray(sampled * (nearest / turned).sum(axis=0))
        return white, flicker, nearest[_SLOW_FOLDS]

    def half_power(self, rate: float) -> float:
        """Return the frequency at which white noise behind the filter has lost half its density.

        That is ``cutoff`` but for a boxcar, of which sampling folds the skirts: the running mean of
        three samples has lost it at 0.155 of the rate, and the mean over that time at 0.148.
        """
        if self.kind != "boxcar":
            return self.cutoff

        def white(f: float) -> float:
            return float(self.white(Frequencies(f, rate)))

        half = 0.5 * white(0.0)
        return float(brentq(lambda f: white(f) - half, 0.5 * self.cutoff, 0.5 * rate))

    def leak(self, at: Frequencies, length: ArrayLike) -> Array:
        """Return what the ends of a DCT-II of white noise behind the filter add, as a density.

        A filter leaves less and less towards Nyquist, and what the even continuation of a smooth
        signal has there, (4 V T / n) cos^2(w/2) / (2 - 2 cos w)^2 with V the variance of the
        differences of neighbours, is more in the end. ``length`` is the duration of the transform
        of each frequency, s.
        """
        rate, grid = at.rate, _grid(at.rate)
        variance = float(np.mean(self.white(grid) * grid.gap)) * rate
        ends = 4.0 * variance / (np.asarray(length) * rate) / rate * at.ends
        # Where the filter does not bend, the second differences take the ends back.
        bent = 1.0 - np.minimum(self.slow(at), 1.0)
        return np.asarray(ends * bent**2 / np.maximum(at.gap, 1e-12) ** 2)

    def _power(self, f: Array) -> Array:
        """Return the power that is left at frequencies, before the sampling."""
        if self.kind == "boxcar":
            return np.asarray(np.sinc(f * BOXCAR / self.cutoff) ** 2)
        return LowPass(self.cutoff, self.order).power(f)

    def _powers_of_folds(self, at: Frequencies) -> Array:
        return self._power(at.folds(_FOLDS + math.ceil(4.0 * self.cutoff / at.rate)))

    def _folded(self, at: Frequencies, powers: Array) -> Array:
        """Return the sum over all folds, from the powers of the nearest, shape (k, ...)."""
        total = powers.sum(axis=0)
        # Folds beyond: the integral of (f / f_c)^(-2 n) on each side, with the next term of the
        # sum formula of Euler and Maclaurin.
        steep = 2 * self.order
        for side in (at.f, -at.f):
            end = 0.5 * len(powers) + side / at.rate
            power = math.prod([end] * (steep - 2), start=end)
            rest = (self.cutoff / at.rate) ** steep / power / (steep - 1)
            total += rest * (1.0 - steep * (steep - 1) / 24.0 / end**2)
        return np.asarray(total)

    def _sampled_process(self, at: Frequencies) -> Array:
        """Return (pi f_c / f_s) sinh(2 pi f_c / f_s) / (cosh(2 pi f_c / f_s) - cos w).

        The sum over the folds for n = 1: the spectrum of a sampled Gauss-Markov process.
        """
        h = 2.0 * np.pi * self.cutoff / at.rate
        # Both over e^h, which may be great.
        decay = math.exp(-h)
        sine, cosine = 0.5 * -math.expm1(-2.0 * h), 0.5 * (1.0 + decay**2)
        return np.asarray(0.5 * h * sine / (cosine - decay * at.cosine))

    def _bilinear(self, at: Frequencies) -> Array:
        warped = at.tangent / math.tan(math.pi * min(self.cutoff / at.rate, 0.4999))
        logarithm = np.minimum(2.0 * self.order * np.log(np.maximum(warped, 1e-30)), 600.0)
        return np.asarray(1.0 / (1.0 + np.exp(logarithm)))

    def _triangle(self, at: Frequencies) -> Array:
        length = BOXCAR / self.cutoff * at.rate  # in samples
        whole = math.ceil(length)
        # 1 - k / length is 1 - k / whole in the most part: the kernels of Fejer and of Dirichlet.
        half, sine = at.half
        fejer = (np.sin(whole * half) / sine) ** 2 / whole
        dirichlet = np.sin((2 * whole - 1) * half) / sine
        part = whole / length
        total = part * fejer + (1.0 - part) * dirichlet
        return np.asarray(np.maximum(total, 1e-12) / length)
