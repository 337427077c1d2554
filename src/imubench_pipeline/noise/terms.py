"""The noise terms of an inertial sensor, with all that follows from each (IEEE Std 952-2020, 647).

A term knows its two-sided power spectral density, its Allan variance in continuous time and as
sampled, the spectrum of its samples, the covariance of their sums, and its discrete state space.
Models, fits, simulation, limits and scores take everything from here.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.noise.sampled_flicker import sampled_flicker_shape, sampled_flicker_sums
from imubench_pipeline.noise.state_space import StateSpace
from imubench_pipeline.typing import Array

PEAK = 0.4365
"""Peak of the Allan deviation of a Gauss-Markov process over sqrt(S_B T_B)."""

PEAK_TAU = 1.8926
"""Tau of that peak over T_B."""

FLOOR = math.sqrt(2.0 * math.log(2.0) / math.pi)
"""Bias instability plateau over B: 0.664."""

_SERIES_BELOW = 0.5
_SERIES = [(-1) ** (k + 1) * (2.0**k - 4.0) / (2.0 * math.factorial(k)) for k in range(3, 24)]
"""The bracket of 000 eq. 26 cancels for tau << T_B; its power series over tau/T_B does not."""

_WALK_BELOW = 1e-3
"""Cluster length over T_B below which a Gauss-Markov process is a random walk to a thousandth, and
the second differences of its sum's covariance begin to cancel."""


class Term(ABC):
    """One noise process of a model; frequencies in Hz, tau and interval in s, results SI."""

    symbol: ClassVar[str]

    @abstractmethod
    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """Two-sided power spectral density in continuous time, SI^2/Hz."""

    @abstractmethod
    def allan_variance(self, tau: Array) -> Array:
        """Allan variance of the process averaged continuously over tau, SI^2."""

    @abstractmethod
    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """Allan variance of the sampled process at n samples a cluster, SI^2."""

    @abstractmethod
    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """Spectrum of the samples, SI^2; its mean over -pi..pi is their variance."""

    @abstractmethod
    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """Generalised covariance of the cumulative sum of the samples at whole lags, SI^2.

        It is that of the second differences at n samples a cluster: what these take out, a
        constant and a square of the lag, may differ from n to n.
        """

    @abstractmethod
    def state_space(self, interval: float) -> StateSpace:
        """Discrete state space at a sampling interval, exact."""

    def start(self, rng: np.random.Generator, interval: float) -> Array:
        """Draw the first state, shape (m,)."""
        space = self.state_space(interval)
        spread = np.sqrt(np.diag(space.initial_variance))
        return space.initial_mean + spread * rng.standard_normal(len(spread))


@dataclass(frozen=True)
class Quantization(Term):
    """Angle or velocity quantization Q of a sensor that rounds its increments (IEEE Std 952)."""

    Q: float
    symbol = "Q"

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """(4 Q^2 / T) sin^2(pi f T): it depends on the sampling.

        Raises
        ------
        ValueError
            If no interval is given.
        """
        if interval is None:
            raise ValueError("the density of quantization noise depends on the rate; give it")
        return self.Q**2 * 4.0 * np.sin(np.pi * frequency * interval) ** 2 / interval

    def allan_variance(self, tau: Array) -> Array:
        """3 Q^2 / tau^2."""
        return 3.0 * self.Q**2 / tau**2

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """3 Q^2 / tau^2: only the first and the last rounding of a cluster are left."""
        return 3.0 * self.Q**2 / (n * interval) ** 2

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """(Q^2 / T^2) (2 - 2 cos(omega))."""
        return self.Q**2 / interval**2 * 4.0 * np.sin(omega / 2.0) ** 2

    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """Q^2 / T^2 at lag 0: the sum is what was rounded last."""
        return self.Q**2 / interval**2 * (lags == 0.0)

    def state_space(self, interval: float) -> StateSpace:
        """Give the states: the present rounding and the one before."""
        return StateSpace(
            np.array([[0.0, 0.0], [1.0, 0.0]]),
            np.diag([self.Q**2, 0.0]),
            np.array([1.0, -1.0]) / interval,
            0.0,
            np.zeros(2),
            np.eye(2) * self.Q**2,
        )


@dataclass(frozen=True)
class WhiteNoise(Term):
    """White noise of density N: angle or velocity random walk (IEEE Std 952)."""

    N: float
    symbol = "N"

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
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

    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """-N^2 / (2 T) |k|: the sum is a random walk."""
        return -0.5 * self.N**2 / interval * np.abs(lags)

    def state_space(self, interval: float) -> StateSpace:
        """No state: R_d = N^2 / T."""
        return StateSpace.without_states(self.N**2 / interval)


@dataclass(frozen=True)
class Flicker(Term):
    """Flicker noise, 1/f: bias instability B as IEEE Std 952 defines it.

    It has no finite state space: `imubench_pipeline.noise.flicker.bank` realises it.
    """

    B: float
    symbol = "F"

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """B^2 / (2 pi f)."""
        return self.B**2 / (2.0 * np.pi * np.abs(frequency))

    def allan_variance(self, tau: Array) -> Array:
        """(2 ln 2 / pi) B^2 at every tau."""
        return np.full_like(tau, FLOOR**2 * self.B**2)

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """2 B^2 / (pi n^2) times the integral of sin^4(n x) / sin^3(x) from 0 to pi/2."""
        return 2.0 / np.pi * self.B**2 * sampled_flicker_shape(n)

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """B^2 / sqrt(2 - 2 cos(omega))."""
        return self.B**2 / np.abs(2.0 * np.sin(omega / 2.0))

    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """B^2 / (2 pi) k^2 ln(k), as sampled."""
        return 0.5 / np.pi * self.B**2 * sampled_flicker_sums(np.abs(lags))

    def state_space(self, interval: float) -> StateSpace:
        """Raise: there is none.

        Raises
        ------
        ValueError
            Always.
        """
        raise ValueError("flicker noise has no finite state space; take its Gauss-Markov bank")


@dataclass(frozen=True)
class GaussMarkov(Term):
    """First-order Gauss-Markov process that stands for the bias instability B (000 eq. 4-8)."""

    B: float
    T_B: float
    symbol = "GM"

    @property
    def density(self) -> float:
        """S_B = 2 B^2 ln 2 / (pi 0.4365^2 T_B), density of the driving white noise."""
        return driving_density(self.B, self.T_B)

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
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

    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """-v (p e^(-|k| T/T_B) / (1 - p)^2 + |k| (1 + p) / (2 (1 - p))), p = e^(-T/T_B).

        v = S_B T_B / 2. For clusters that are short for T_B the process is a random walk.
        """
        if n * interval < _WALK_BELOW * self.T_B:
            return RandomWalk(math.sqrt(self.density)).sum_covariance(lags, n, interval)
        k, p, rest = np.abs(lags), math.exp(-interval / self.T_B), -math.expm1(-interval / self.T_B)
        variance = self.density * self.T_B / 2.0
        decayed = p / rest**2 * np.exp(-k * (interval / self.T_B))
        return -variance * (decayed + k * ((1.0 + p) / (2.0 * rest)))

    def state_space(self, interval: float) -> StateSpace:
        """Phi = e^(-T/T_B), Q_d = S_B T_B / 2 (1 - e^(-2T/T_B)); it starts stationary."""
        stationary = self.density * self.T_B / 2.0
        return StateSpace.scalar(
            math.exp(-interval / self.T_B),
            -stationary * math.expm1(-2.0 * interval / self.T_B),
            stationary,
        )


@dataclass(frozen=True)
class RandomWalk(Term):
    """Rate or acceleration random walk K (IEEE Std 952)."""

    K: float
    symbol = "K"

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
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

    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """K^2 T (|k|^3 - |k|) / 12."""
        k = np.abs(lags)
        return self.K**2 * interval / 12.0 * (k**3 - k)

    def state_space(self, interval: float) -> StateSpace:
        """Phi = 1, Q_d = K^2 T; it starts at 0."""
        return StateSpace.scalar(1.0, self.K**2 * interval, 0.0)


@dataclass(frozen=True)
class Ramp(Term):
    """Rate or acceleration ramp R, a linear drift (IEEE Std 952); deterministic."""

    R: float
    symbol = "R"

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """R^2 / (2 pi f)^3, as IEEE Std 952 assigns it; a ramp has no density proper."""
        return self.R**2 / (2.0 * np.pi * np.abs(frequency)) ** 3

    def allan_variance(self, tau: Array) -> Array:
        """R^2 tau^2 / 2."""
        return self.R**2 * tau**2 / 2.0

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """R^2 tau^2 / 2."""
        return self.R**2 * (n * interval) ** 2 / 2.0

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """0: a ramp is deterministic."""
        return np.zeros_like(omega)

    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """0: a ramp is deterministic."""
        return np.zeros_like(lags)

    def state_space(self, interval: float) -> StateSpace:
        """Give the states: the drift, and its rate R."""
        return StateSpace(
            np.array([[1.0, interval], [0.0, 1.0]]),
            np.zeros((2, 2)),
            np.array([1.0, 0.0]),
            0.0,
            np.array([0.0, self.R]),
            np.zeros((2, 2)),
        )


@dataclass(frozen=True)
class Sinusoid(Term):
    """A line: a sinusoid of amplitude Omega_0 and frequency f_0 (IEEE Std 952); deterministic."""

    amplitude: float
    frequency: float
    symbol = "S"

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """0: the power amplitude^2 / 2 of a line has no density."""
        return np.zeros_like(frequency)

    def allan_variance(self, tau: Array) -> Array:
        """amplitude^2 (sin^2(pi f_0 tau) / (pi f_0 tau))^2."""
        x = np.pi * self.frequency * tau
        return self.amplitude**2 * (np.sin(x) ** 2 / x) ** 2

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """amplitude^2 sin^4(n x) / (n sin(x))^2 with x = pi f_0 T."""
        x = math.pi * self.frequency * interval
        return self.amplitude**2 * np.sin(n * x) ** 4 / (n * math.sin(x)) ** 2

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """0: a line has no density."""
        return np.zeros_like(omega)

    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """0: a line is deterministic."""
        return np.zeros_like(lags)

    def state_space(self, interval: float) -> StateSpace:
        """Rotate by 2 pi f_0 T a sample; the phase at the start is not known."""
        angle = 2.0 * math.pi * self.frequency * interval
        cosine, sine = math.cos(angle), math.sin(angle)
        return StateSpace(
            np.array([[cosine, sine], [-sine, cosine]]),
            np.zeros((2, 2)),
            np.array([1.0, 0.0]),
            0.0,
            np.zeros(2),
            np.eye(2) * self.amplitude**2 / 2.0,
        )

    def start(self, rng: np.random.Generator, interval: float) -> Array:
        """Draw the phase; the amplitude is as it is."""
        phase = rng.uniform(0.0, 2.0 * math.pi)
        return self.amplitude * np.array([math.cos(phase), math.sin(phase)])


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
