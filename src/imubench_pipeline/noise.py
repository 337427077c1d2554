"""The noise terms of an inertial sensor, each with all that follows from it.

A term knows its two-sided power spectral density, its Allan variance in continuous time and as
sampled, and its discrete state space. A model is the sum of its terms; curve fits, simulation
and scores take everything from here.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

PEAK = 0.4365
"""Peak of the Allan deviation of a Gauss-Markov process over sqrt(S_B T_B)."""

PEAK_TAU = 1.8926
"""Tau of that peak over T_B."""

FLOOR = math.sqrt(2.0 * math.log(2.0) / math.pi)
"""Bias instability plateau over B: 0.664."""

_SERIES_BELOW = 0.5
_SERIES = [(-1) ** (k + 1) * (2.0**k - 4.0) / (2.0 * math.factorial(k)) for k in range(3, 24)]
"""The bracket of 000 eq. 26 cancels for tau << T_B; its power series over tau/T_B does not."""

Array = NDArray[np.float64]


class Term(Protocol):
    """One noise process of a model."""

    symbol: str

    def psd(self, frequency: Array) -> Array:
        """Two-sided power spectral density in continuous time, SI^2/Hz."""

    def allan_variance(self, tau: Array) -> Array:
        """Allan variance of the process averaged continuously over tau, SI^2."""

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """Allan variance of the sampled process at n samples a cluster, SI^2."""

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """Spectrum of the samples, SI^2; its mean over -pi..pi is their variance."""


@dataclass(frozen=True)
class StateSpace:
    """A discrete model x' = transition x + w, z = output x + v (000 eq. 18-23, exact).

    Attributes
    ----------
    transition : ndarray, shape (m,)
        Diagonal of Phi.
    process_noise : ndarray, shape (m,)
        Diagonal of Q_d, variance of w.
    output : ndarray, shape (m,)
        H.
    measurement_noise : float
        R_d, variance of v.
    initial_variance : ndarray, shape (m,)
        Variance of the first x: the stationary one, 0 for a random walk.
    """

    transition: Array
    process_noise: Array
    output: Array
    measurement_noise: float
    initial_variance: Array


@dataclass(frozen=True)
class WhiteNoise:
    """White noise of density N: angle or velocity random walk (IEEE Std 952)."""

    N: float
    symbol = "N"

    def psd(self, frequency: Array) -> Array:
        """N^2."""
        return np.full_like(frequency, self.N**2)

    def allan_variance(self, tau: Array) -> Array:
        """N^2 / tau."""
        return self.N**2 / tau

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """N^2 / tau: sampled white noise of variance N^2 / T is white."""
        return self.N**2 / (n * interval)

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """N^2 / T."""
        return np.full_like(omega, self.N**2 / interval)


@dataclass(frozen=True)
class GaussMarkov:
    """First-order Gauss-Markov process that stands for the bias instability B (000 eq. 4-8)."""

    B: float
    T_B: float
    symbol = "GM"

    @property
    def density(self) -> float:
        """S_B = 2 B^2 ln 2 / (pi 0.4365^2 T_B), density of the driving white noise."""
        return driving_density(self.B, self.T_B)

    def psd(self, frequency: Array) -> Array:
        """S_B T_B^2 / (1 + (2 pi f T_B)^2)."""
        return self.density * self.T_B**2 / (1.0 + (2.0 * np.pi * frequency * self.T_B) ** 2)

    def allan_variance(self, tau: Array) -> Array:
        """000 eq. 26 with the sign mended: e^(-tau/T_B)."""
        return self.density * gauss_markov_shape(tau, self.T_B)

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """Exact for samples of the process: sum of its covariances."""
        return self.density * sampled_gauss_markov_shape(n, interval, self.T_B)

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """(S_B T_B / 2) (1 - p^2) / (1 - 2 p cos(omega) + p^2) with p = e^(-T/T_B)."""
        p = math.exp(-interval / self.T_B)
        variance = self.density * self.T_B / 2.0
        gap = math.expm1(-interval / self.T_B) ** 2 + p * 4.0 * np.sin(omega / 2.0) ** 2
        return -variance * math.expm1(-2.0 * interval / self.T_B) / gap


@dataclass(frozen=True)
class RandomWalk:
    """Rate or acceleration random walk K (IEEE Std 952)."""

    K: float
    symbol = "K"

    def psd(self, frequency: Array) -> Array:
        """K^2 / (2 pi f)^2."""
        return self.K**2 / (2.0 * np.pi * frequency) ** 2

    def allan_variance(self, tau: Array) -> Array:
        """K^2 tau / 3."""
        return self.K**2 * tau / 3.0

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """K^2 tau / 3 (1 + 1 / (2 n^2))."""
        return self.K**2 * n * interval / 3.0 * (1.0 + 0.5 / n**2)

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """K^2 T / (2 - 2 cos(omega))."""
        return self.K**2 * interval / (4.0 * np.sin(omega / 2.0) ** 2)


def driving_density(B: float, T_B: float) -> float:
    """Return S_B of a bias instability B with correlation time T_B (000 eq. 8)."""
    return 2.0 * B**2 * math.log(2.0) / (math.pi * PEAK**2 * T_B)


def bias_instability(density: float, T_B: float) -> float:
    """Return B of a Gauss-Markov process with driving density S_B (000 eq. 8 solved for B)."""
    return math.sqrt(density * T_B * math.pi * PEAK**2 / (2.0 * math.log(2.0)))


def gauss_markov_shape(tau: Array, T_B: float) -> Array:
    """Return the Allan variance of a Gauss-Markov process over S_B, s (000 eq. 26, Farrell 63).

    (T_B^2/tau) (1 - (T_B/(2 tau)) (3 - 4 e^(-tau/T_B) + e^(-2 tau/T_B)))
    """
    ratio = np.asarray(tau, dtype=np.float64) / T_B
    small = ratio < _SERIES_BELOW
    r = np.where(small, ratio, 0.0)
    x = np.where(small, 1.0, ratio)
    series = r * np.polynomial.polynomial.polyval(r, _SERIES)
    closed = (1.0 - (3.0 - 4.0 * np.exp(-x) + np.exp(-2.0 * x)) / (2.0 * x)) / x
    return T_B * np.where(small, series, closed)


def sampled_gauss_markov_shape(n: ArrayLike, interval: float, T_B: float) -> Array:
    """Return the Allan variance of a sampled Gauss-Markov process over S_B, s.

    (T_B / (2 n^2)) (n (1+p)/(1-p) - p (3 - 4 p^n + p^(2n)) / (1-p)^2) with p = e^(-T/T_B);
    from the sum of the covariances of the samples.
    """
    n = np.asarray(n, dtype=np.float64)
    p = math.exp(-interval / T_B)
    q = -math.expm1(-interval / T_B)
    x = n * interval / T_B
    # 3 - 4 p^n + p^2n = 2 (1 - p^n) + (1 - p^n)^2 with the sign of its parts kept.
    decay = -np.expm1(-x)
    closed = (n * (1.0 + p) / q - p * decay * (2.0 + decay) / q**2) / n**2
    # For clusters far shorter than T_B this cancels; the continuous form does not, and the
    # moments sum_ij w_i w_j |i - j|^m of the samples tell what sampling adds to it.
    h = interval / T_B
    added = h / (3.0 * n) - h**3 / 6.0 * (n / 3.0 + 1.0 / (15.0 * n))
    continuous = 2.0 / T_B * gauss_markov_shape(n * interval, T_B) + added
    return T_B / 2.0 * np.where(x < 3e-3, continuous, closed)


@dataclass(frozen=True, kw_only=True)
class NoiseModel:
    """The stochastic error of one axis, z = z_N + z_G + z_K (000 eq. 2).

    Parameters
    ----------
    N : float
        White noise density, rad/s/sqrt(Hz) or m/s^2/sqrt(Hz); 0: none.
    B, T_B : float
        Bias instability, rad/s or m/s^2, and the correlation time, s, of the Gauss-Markov
        process that stands for it; B = 0: none.
    K : float
        Random walk, rad/s/sqrt(s) or m/s^2/sqrt(s); 0: none.

    Raises
    ------
    ValueError
        If a parameter is negative or not finite, or B is without T_B.
    """

    N: float = 0.0
    B: float = 0.0
    T_B: float | None = None
    K: float = 0.0

    def __post_init__(self) -> None:
        for name in ("N", "B", "K"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"{name} is {value}, expected a number from 0")
        if self.B > 0 and not (self.T_B is not None and math.isfinite(self.T_B) and self.T_B > 0):
            raise ValueError(f"T_B is {self.T_B}, expected a time above 0 with B = {self.B}")

    @property
    def terms(self) -> Sequence[Term]:
        """The terms that are not zero."""
        terms: list[Term] = []
        if self.N > 0:
            terms.append(WhiteNoise(self.N))
        if self.B > 0 and self.T_B is not None:
            terms.append(GaussMarkov(self.B, self.T_B))
        if self.K > 0:
            terms.append(RandomWalk(self.K))
        return terms

    @property
    def name(self) -> str:
        """The terms, such as ``N+GM+K``; ``none`` where there are none."""
        return "+".join(term.symbol for term in self.terms) or "none"

    def psd(self, frequency: ArrayLike) -> Array:
        """Return the two-sided power spectral density.

        Parameters
        ----------
        frequency : array_like
            Hz, not 0.

        Returns
        -------
        ndarray
            (rad/s)²/Hz or (m/s²)²/Hz, in the shape of ``frequency``.
        """
        f = np.asarray(frequency, dtype=np.float64)
        return _sum([term.psd(f) for term in self.terms], f)

    def allan_variance(self, tau: ArrayLike, rate: float | None = None) -> Array:
        """Return the Allan variance.

        Parameters
        ----------
        tau : array_like
            Cluster length, s.
        rate : float, optional
            Hz; given, the result is that of the process sampled at this rate, exactly.

        Returns
        -------
        ndarray
            (rad/s)² or (m/s²)², in the shape of ``tau``.
        """
        t = np.asarray(tau, dtype=np.float64)
        if rate is None:
            parts = [term.allan_variance(t) for term in self.terms]
        else:
            n = np.rint(t * rate)
            parts = [term.sampled_allan_variance(n, 1.0 / rate) for term in self.terms]
        return _sum(parts, t)

    def sampled_spectrum(self, omega: ArrayLike, rate: float) -> Array:
        """Return the spectrum of the samples at angular frequencies in rad a sample, SI^2."""
        w = np.asarray(omega, dtype=np.float64)
        return _sum([term.sampled_spectrum(w, 1.0 / rate) for term in self.terms], w)

    def state_space(self, rate: float) -> StateSpace:
        """Return the discrete state space with exact noise covariances at a rate in Hz.

        The states are z_G and z_K, where the model has them (000 eq. 18-23; the printed first
        entry of Q_d, S_B T, is an approximation).
        """
        interval = 1.0 / rate
        phi: list[float] = []
        noise: list[float] = []
        initial: list[float] = []
        for term in self.terms:
            if isinstance(term, GaussMarkov):
                stationary = term.density * term.T_B / 2.0
                phi.append(math.exp(-interval / term.T_B))
                noise.append(-stationary * math.expm1(-2.0 * interval / term.T_B))
                initial.append(stationary)
            elif isinstance(term, RandomWalk):
                phi.append(1.0)
                noise.append(term.K**2 * interval)
                initial.append(0.0)
        return StateSpace(
            np.array(phi),
            np.array(noise),
            np.ones(len(phi)),
            self.N**2 * rate,
            np.array(initial),
        )


def _sum(parts: Sequence[Array], like: Array) -> Array:
    return np.asarray(np.sum(parts, axis=0)) if parts else np.zeros_like(like)
