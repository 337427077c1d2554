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

_GRID = 512
"""Frequencies of the integral over G."""


@dataclass(frozen=True)
class Filter:
    """A low-pass filter; frequencies and rates in Hz, results in the shape of the frequencies.

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

    def white(self, frequency: ArrayLike, rate: float) -> Array:
        """Return G, the density of white noise of N = 1 behind the filter, sampled."""
        f = np.asarray(frequency, dtype=np.float64)
        if self.kind == "bilinear":
            return self._bilinear(f, rate)
        if self.kind == "boxcar":
            return self._triangle(f, rate)
        return LowPass(self.cutoff, self.order).folded_power(f, rate)

    def slow(self, frequency: ArrayLike, rate: float) -> Array:
        """Return what the filter leaves of noise that is slow against the rate: no folds."""
        f = np.asarray(frequency, dtype=np.float64)
        if self.kind == "bilinear":
            return self._bilinear(f, rate)
        if self.kind == "boxcar":
            return np.asarray(np.sinc(f * BOXCAR / self.cutoff) ** 2)
        return LowPass(self.cutoff, self.order).power(f)

    def half_power(self, rate: float) -> float:
        """Return the frequency at which white noise behind the filter has lost half its density.

        That is ``cutoff`` but for a boxcar, of which sampling folds the skirts: the running mean of
        three samples has lost it at 0.155 of the rate, and the mean over that time at 0.148.
        """
        if self.kind != "boxcar":
            return self.cutoff
        half = 0.5 * float(self.white(0.0, rate))
        return float(
            brentq(lambda f: float(self.white(f, rate)) - half, 0.5 * self.cutoff, 0.5 * rate)
        )

    def flicker(self, frequency: ArrayLike, rate: float) -> Array:
        """Return what the filter leaves of flicker noise as sampled without it, folds included."""
        f = np.asarray(frequency, dtype=np.float64)
        if self.kind == "bilinear":
            return self._bilinear(f, rate)
        # As sampled, sqrt(2 - 2 cos w) stands for w.
        sampled = 2.0 * rate * np.sin(np.pi * f / rate)
        total = np.zeros(f.shape)
        for k in range(-_SLOW_FOLDS, _SLOW_FOLDS + 1):
            fold = np.abs(f + k * rate)
            total += self.slow(fold, rate) / (2.0 * np.pi * fold)
        return np.asarray(sampled * total)

    def leak(self, frequency: ArrayLike, length: ArrayLike, rate: float) -> Array:
        """Return what the ends of a DCT-II of white noise behind the filter add, as a density.

        A filter leaves less and less towards Nyquist, and what the even continuation of a smooth
        signal has there, (4 V T / n) cos^2(w/2) / (2 - 2 cos w)^2 with V the variance of the
        differences of neighbours, is more in the end. ``length`` is the duration of the transform
        of each frequency, s.
        """
        omega = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64) / rate
        grid = (np.arange(_GRID) + 0.5) / _GRID * 0.5 * rate
        differences = 2.0 - 2.0 * np.cos(2.0 * np.pi * grid / rate)
        variance = float(np.mean(self.white(grid, rate) * differences)) * rate
        gap = 2.0 - 2.0 * np.cos(omega)
        ends = 4.0 * variance / (np.asarray(length) * rate) / rate * np.cos(omega / 2.0) ** 2
        # Where the filter does not bend, the second differences take the ends back.
        bent = 1.0 - np.minimum(self.slow(frequency, rate), 1.0)
        return np.asarray(ends * bent**2 / np.maximum(gap, 1e-12) ** 2)

    def _bilinear(self, f: Array, rate: float) -> Array:
        corner = math.tan(math.pi * min(self.cutoff / rate, 0.4999))
        # The tangent has no value at Nyquist, where nothing is left.
        warped = np.tan(np.minimum(np.pi * f / rate, 0.5 * np.pi - 1e-7)) / corner
        logarithm = np.minimum(2.0 * self.order * np.log(np.maximum(warped, 1e-30)), 600.0)
        return np.asarray(1.0 / (1.0 + np.exp(logarithm)))

    def _triangle(self, f: Array, rate: float) -> Array:
        length = BOXCAR / self.cutoff * rate  # in samples
        whole = math.ceil(length)
        # 1 - k / length is 1 - k / whole in the most part: the kernels of Fejer and of Dirichlet.
        half = np.pi * np.maximum(f, 1e-9 * rate) / rate
        fejer = (np.sin(whole * half) / np.sin(half)) ** 2 / whole
        dirichlet = np.sin((2 * whole - 1) * half) / np.sin(half)
        part = whole / length
        total = part * fejer + (1.0 - part) * dirichlet
        return np.asarray(np.maximum(total, 1e-12) / length)
