"""Mean densities of the noise terms in the bins of a spectrum.

Low frequencies come from block means, whose spectrum is the folded spectrum of the samples: closed
forms for white noise, quantization, random walk and Gauss-Markov process, a sum for flicker noise.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from imubench_pipeline.estimators.spectrum import SINGLE, Spectrum
from imubench_pipeline.noise.terms import compute_driving_density
from imubench_pipeline.typing import Array

_POINTS_PER_BIN = 6  # Frequencies per bin at which a density is evaluated
_MAX_BLOCK_OVER_TIME = 1e-3  # Below this block duration over T_B, a process looks like a walk


class Shapes:
    """Mean densities of unit terms in the bins of a spectrum, in SI^2/Hz."""

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
    """Return the mean square of ordinate k of flicker noise over its density, for k << L.

    Flicker noise is a sum of Gauss-Markov processes of all correlation times, and for each the
    mean square of an ordinate is known in closed form.
    """
    times = np.geomspace(1e-4, 1e5, 400)  # T_B over the length of the log
    x = np.pi * order * times  # omega T_B
    sign = 1.0 if order % 2 == 1 else -1.0
    full = 2.0 * times / (1.0 + x**2)  # the spectrum of unit variance, over the length
    ends = 4.0 * times**2 * (1.0 + sign * np.exp(-1.0 / times)) / (1.0 + x**2) ** 2
    return float((full - ends).sum() / full.sum())
