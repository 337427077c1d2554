"""Low-pass filters between a sensor's noise and its log, in a sampled spectrum.

White noise of density N behind a filter has the density N^2 G(f) in the samples:

- analogue, Butterworth of order n: G = sum_k |H(f + k f_s)|^2, aliased by the sampling;
- bilinear, the same filter after the bilinear transform: G = 1 / (1 + (tan(pi f / f_s) /
  tan(pi f_c / f_s))^(2 n)), 0 at Nyquist;
- boxcar, the mean over a time d: the autocovariance is a triangle, so that G = T/d (1 +
  2 sum_(k T < d) (1 - k T/d) cos(2 pi f k T)); d = m T is the moving average of m samples.

f_c is where the power is halved; for the boxcar 0.443 / d, before the sampling.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.typing import Array

Kind = Literal["analogue", "bilinear", "boxcar"]

BOXCAR_CUTOFF_LENGTH = 0.442946  # Cut-off of a boxcar times its length, where sinc^2 is one half
_ALIASES = 3  # Aliases of flicker noise on each side; the filter leaves little of the others
_GRID_SIZE = 512  # Frequencies of the numerical integral over G


@dataclass(frozen=True)
class Filter:
    """A low-pass filter; results have the shape of the frequencies (Hz, 0 to half the rate)."""

    kind: Kind
    order: int  # n of the Butterworth filter; 1 for the boxcar
    cutoff: float  # f_c, Hz

    def white(self, frequency: ArrayLike, rate: float) -> Array:
        """Return G, the density of white noise of N = 1 behind the filter, sampled at a rate, Hz.

        For the analogue filter of order n, the sum over all aliases is exact: 1 / (1 + x^(2 n)) has
        the poles p_j with p_j^(2 n) = -1, and sum_k 1 / (x + k / r - p_j) = pi r cot(pi r (x -
        p_j)) with x = f / f_c and r = f_c / ``rate``.
        """
        f = np.asarray(frequency, dtype=np.float64)
        if self.kind == "bilinear":
            return self.slow(f, rate)
        if self.kind == "boxcar":
            length = BOXCAR_CUTOFF_LENGTH / self.cutoff * rate  # in samples
            whole = math.ceil(length)
            # Split 1 - k / length into 1 - k / whole and a constant: Fejer and Dirichlet kernels.
            half = np.pi * np.maximum(f, 1e-9 * rate) / rate
            fejer = (np.sin(whole * half) / np.sin(half)) ** 2 / whole
            dirichlet = np.sin((2 * whole - 1) * half) / np.sin(half)
            part = whole / length
            total = part * fejer + (1.0 - part) * dirichlet
            return np.asarray(np.maximum(total, 1e-12) / length)
        ratio, total = self.cutoff / rate, np.zeros(f.shape)
        for j in range(self.order):
            pole = np.exp(0.5j * np.pi * (2 * j + 1) / self.order)
            total -= (pole / np.tan(np.pi * (f / rate - pole * ratio))).real
        return np.asarray(np.maximum(np.pi * ratio / self.order * total, 1e-12))

    def slow(self, frequency: ArrayLike, rate: float) -> Array:
        """Return the power gain for noise that is slow compared with the rate, without aliases."""
        f = np.asarray(frequency, dtype=np.float64)
        if self.kind == "boxcar":
            return np.asarray(np.sinc(f * BOXCAR_CUTOFF_LENGTH / self.cutoff) ** 2)
        if self.kind == "analogue":
            return LowPass(self.cutoff, self.order).power(f)
        tangent = np.tan(np.minimum(np.pi * f / rate, 0.5 * np.pi - 1e-7))
        warped = tangent / math.tan(math.pi * min(self.cutoff / rate, 0.4999))
        logarithm = np.minimum(2.0 * self.order * np.log(np.maximum(warped, 1e-30)), 600.0)
        return np.asarray(1.0 / (1.0 + np.exp(logarithm)))

    def flicker(self, frequency: Array, rate: float) -> Array:
        """Return the power gain for flicker noise and its nearest aliases; not for 0 Hz."""
        if self.kind == "bilinear":
            return self.slow(frequency, rate)
        distance = np.abs(frequency + rate * np.arange(-_ALIASES, _ALIASES + 1)[:, None])
        # The density of sampled flicker noise is B^2 / (2 rate sin(pi f / rate)).
        sampled = 2.0 * rate * np.sin(np.pi * frequency / rate)
        total = (self.slow(distance, rate) / (2.0 * np.pi * distance)).sum(axis=0)
        return np.asarray(sampled * total)

    def half_power(self, rate: float) -> float:
        """Return the cut-off, Hz; of a boxcar, where G with aliases is half of G(0)."""
        if self.kind != "boxcar":
            return self.cutoff
        half = 0.5 * float(self.white(0.0, rate))
        ends = 0.5 * self.cutoff, 0.5 * rate
        return float(brentq(lambda f: float(self.white(f, rate)) - half, *ends))

    def leakage(self, frequency: ArrayLike, rate: float, length: ArrayLike) -> Array:
        """Return the spectral leakage of the DCT-II of filtered white noise, as a density.

        The even continuation of a smooth signal has discontinuous slopes at its ends. They add the
        density (4 V T / n) cos^2(w/2) / (2 - 2 cos w)^2, with V the variance of first differences,
        w = 2 pi f T, T = 1 / ``rate``, and ``length`` = n T the duration of the transform, s.
        """
        grid = (np.arange(_GRID_SIZE) + 0.5) / _GRID_SIZE * 0.5 * rate
        variance = float(np.mean(self.white(grid, rate) * _difference_gain(grid, rate))) * rate
        f = np.asarray(frequency, dtype=np.float64)
        ends = 4.0 * variance / (np.asarray(length) * rate) / rate * np.cos(np.pi * f / rate) ** 2
        # Where the filter passes, the second differences cancel the terms of the ends.
        bent = 1.0 - np.minimum(self.slow(f, rate), 1.0)
        return np.asarray(ends * bent**2 / np.maximum(_difference_gain(f, rate), 1e-12) ** 2)


def _difference_gain(frequency: Array, rate: float) -> Array:
    """Return 2 - 2 cos(w), w = 2 pi f / rate, the power gain of first differences."""
    return np.asarray(2.0 - 2.0 * np.cos(2.0 * np.pi * frequency / rate))
