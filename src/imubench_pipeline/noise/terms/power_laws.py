"""Terms whose density is a power of frequency: quantization, white noise, random walk and ramp."""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.model.states import SourcePath
from imubench_pipeline.noise.growth import (
    Calibrated,
    SensorStart,
    Uncalibrated,
    of_constant,
    of_white,
    of_white_mean,
)
from imubench_pipeline.noise.state_space import ContinuousSpace, StateSpace
from imubench_pipeline.noise.terms import base
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class Quantization(base.Term):
    """Angle or velocity quantization Q of a sensor that rounds its increments (IEEE Std 952)."""

    Q: float
    symbol = "Q"
    label = "quantization"
    standard_name = "{integral} quantization"
    word = "Q"
    role = base.Role.NOT_GROWING
    parameters = (base.TermParameter("Q", "quantization", 1.0, 1.0),)

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """Return (4 Q^2 / T) sin^2(pi f T), which needs the interval T; ValueError without it."""
        if interval is None:
            raise ValueError("the density of quantization noise depends on the rate; pass a rate")
        return self.Q**2 * 4.0 * np.sin(np.pi * frequency * interval) ** 2 / interval

    def allan_variance(self, tau: Array) -> Array:
        """Return 3 Q^2 / tau^2."""
        return 3.0 * self.Q**2 / tau**2

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """Return 3 Q^2 / tau^2: only the rounding errors at the ends of a cluster remain."""
        return 3.0 * self.Q**2 / (n * interval) ** 2

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """Return (Q^2 / T^2) (2 - 2 cos(omega)); T: interval."""
        return self.Q**2 / interval**2 * 4.0 * np.sin(omega / 2.0) ** 2

    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """Return Q^2 / interval^2 at lag 0, else 0: the sum is the last rounding error."""
        return self.Q**2 / interval**2 * (lags == 0.0)

    def state_space(self, interval: float) -> StateSpace:
        """Return a model with two states: the current rounding error and the previous one."""
        return StateSpace(
            np.array([[0.0, 0.0], [1.0, 0.0]]),
            np.diag([self.Q**2, 0.0]),
            np.array([1.0, -1.0]) / interval,
            0.0,
            np.zeros(2),
            np.eye(2) * self.Q**2,
        )

    @property
    def drive(self) -> base.Drive | None:
        """None: the converter that counts increments comes after every filter."""
        return None

    def growth(self, order: int, time: float, start: SensorStart) -> float:
        """Return Q^2 ([m = 0] + (t^m/m! + c/W)^2 + (c/W)^2); uncalibrated, without c/W.

        It is the variance of the integrated error. m is ``order``, t ``time``, W the static window,
        and c = t^(m+1) / (m+1)!; [m = 0] is 1 for m = 0, else 0. The roundings between the ends are
        left out: for m > 0 they add about the fraction 1 / (number of samples).
        """
        # The rounding at the start ends the window and begins the motion.
        first = time**order / math.factorial(order)
        last = 1.0 if order == 0 else 0.0
        mean = of_constant(order, time) / start.window if isinstance(start, Calibrated) else 0.0
        return self.Q**2 * (last + (first + mean) ** 2 + mean**2)

    def block_covariance(self, lags: Array, block: float) -> Array:
        """Return 2 Q^2 / d^2 at lag 0, -Q^2 / d^2 at lag 1, else 0; d is ``block``."""
        return self.Q**2 / block**2 * (2.0 * (lags == 0.0) - (lags == 1.0))

    def mean_covariance(self, blocks: base.SampleBlocks) -> Array:
        """Return 2 Q^2 / (n T)^2 on the diagonal, -Q^2 / (n m T^2) for touching blocks, else 0.

        A block of n samples at intervals T has the mean (q_stop - q_start) / (n T), with rounding
        errors q.
        """
        n = (blocks.stop - blocks.start).astype(np.float64)
        touching = np.zeros((len(n), len(n)))
        i = np.flatnonzero(blocks.start[1:] == blocks.stop[:-1])
        touching[i, i + 1] = touching[i + 1, i] = -1.0 / (n[i] * n[i + 1])
        return (self.Q / (1.0 / blocks.rate)) ** 2 * (touching + np.diag(2.0 / n**2))

    def block_sums(self, blocks: int, width: int, rate: float, rng: np.random.Generator) -> Array:
        """Draw the rounding errors at the ends of the blocks, and return their differences."""
        return np.diff(rng.standard_normal(blocks + 1)) * self.Q * rate


@dataclass(frozen=True)
class WhiteNoise(base.Term):
    """White noise of density N: angle or velocity random walk (IEEE Std 952)."""

    N: float
    symbol = "N"
    label = "white noise"
    standard_name = "{integral} random walk"
    word = "N"
    role = base.Role.WHITE
    parameters = (base.TermParameter("N", "noise density", 1.0, 0.5),)

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """Return N^2."""
        return np.full_like(frequency, self.N**2)

    def allan_variance(self, tau: Array) -> Array:
        """Return N^2 / tau."""
        return self.N**2 / tau

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """Return N^2 / tau, for samples of variance N^2 / interval."""
        return self.N**2 / (n * interval)

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """Return N^2 / interval."""
        return np.full_like(omega, self.N**2 / interval)

    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """Return -N^2 / (2 interval) |lag|: the sum is a random walk."""
        return -0.5 * self.N**2 / interval * np.abs(lags)

    def state_space(self, interval: float) -> StateSpace:
        """Return a model without states, with the measurement noise N^2 / interval."""
        return StateSpace.without_states(self.N**2 / interval)

    def continuous_space(self) -> ContinuousSpace:
        """Return a model without states; `drive` has the density of the measurement noise."""
        return ContinuousSpace(np.zeros((0, 0)), np.zeros((0, 0)), np.zeros(0))

    @property
    def drive(self) -> base.Drive:
        """White noise of density N^2."""
        return base.Drive(white=self.N**2)

    def as_unit(self) -> tuple[float, base.Term]:
        """Return N^2, and the term with N = 1."""
        return self.N**2, WhiteNoise(1.0)

    def growth(self, order: int, time: float, start: SensorStart) -> float:
        """Return N^2 (t^(2m+1) / ((2m+1) m!^2) + c^2/W) (Groves, 2013); uncalibrated, no c^2/W.

        It is the variance of the integrated error. m is ``order``, t ``time``, W the static window,
        and c = t^(m+1) / (m+1)!.
        """
        return self.N**2 * (of_white(order, time) + of_white_mean(order, time, start))

    def sources(
        self, order: int, time: float, start: SensorStart
    ) -> Iterator[tuple[SourcePath | None, float]]:
        """Yield motion and static window separately, as white noise in them is independent."""
        yield None, math.sqrt(self.growth(order, time, Uncalibrated(bias=0.0, on_time=0.0)))
        if isinstance(start, Calibrated):
            yield "static_window", self.N * math.sqrt(of_white_mean(order, time, start))

    def growth_from_known(self, time: Array) -> tuple[Array, Array]:
        """Return N^2 t and N^2 t^3 / 3."""
        return self.N**2 * time, self.N**2 * time**3 / 3.0

    def block_covariance(self, lags: Array, block: float) -> Array:
        """Return N^2 / block at lag 0, else 0."""
        return self.N**2 / block * (lags == 0.0)

    def mean_covariance(self, blocks: base.SampleBlocks) -> Array:
        """Return N^2 rate / count on the diagonal, else 0; count: samples present in a block."""
        return np.diag(self.N**2 / (1.0 / blocks.rate * blocks.count))

    def block_sums(self, blocks: int, width: int, rate: float, rng: np.random.Generator) -> Array:
        """Draw sums of variance width N^2 rate."""
        return rng.standard_normal(blocks) * math.sqrt(width * self.N**2 * rate)

    def reading(self, lowest_tau: float) -> base.Reading:
        """Return N, the level of N / sqrt(tau) at 1 s."""
        return base.Reading(1.0, self.N, "N")


@dataclass(frozen=True)
class RandomWalk(base.Term):
    """Rate or acceleration random walk K (IEEE Std 952)."""

    K: float
    symbol = "K"
    label = "random walk"
    standard_name = "{signal} random walk"
    word = "K"
    role = base.Role.RANDOM_WALK
    parameters = (base.TermParameter("K", "random walk", 1.0, -0.5),)

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """Return K^2 / (2 pi f)^2."""
        return self.K**2 / (2.0 * np.pi * frequency) ** 2

    def allan_variance(self, tau: Array) -> Array:
        """Return K^2 tau / 3."""
        return self.K**2 * tau / 3.0

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """Return K^2 tau / 3 (1 + 1 / (2 n^2)), with tau = n interval."""
        return self.K**2 * n * interval / 3.0 * (1.0 + 0.5 / n**2)

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """Return K^2 interval / (2 - 2 cos(omega))."""
        return self.K**2 * interval / (4.0 * np.sin(omega / 2.0) ** 2)

    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """Return K^2 T (|k|^3 - |k|) / 12; k: lag, T: interval."""
        k = np.abs(lags)
        return self.K**2 * interval / 12.0 * (k**3 - k)

    def state_space(self, interval: float) -> StateSpace:
        """Return a model with Phi = 1 and Q_d = K^2 interval; the state starts at 0."""
        return StateSpace.scalar(1.0, self.K**2 * interval, 0.0)

    def continuous_space(self) -> ContinuousSpace:
        """Return a model with F = 0 and Q = K^2."""
        return ContinuousSpace(np.zeros((1, 1)), np.array([[self.K**2]]), np.ones(1))

    @property
    def drive(self) -> base.Drive:
        """A process of density K^2 with an infinite correlation time."""
        return base.Drive(process=base.Process(math.inf, self.K**2))

    def as_unit(self) -> tuple[float, base.Term]:
        """Return K^2, and the term with K = 1."""
        return self.K**2, RandomWalk(1.0)

    def growth(self, order: int, time: float, start: SensorStart) -> float:
        """Return K^2 (t^(2m+3) / ((2m+3) (m+1)!^2) + c^2 W/3); uncalibrated, A replaces W/3.

        It is the variance of the integrated error. m is ``order``, t ``time``, W the static window,
        A the time since switch-on, and c = t^(m+1) / (m+1)!.
        """
        lag = start.window / 3.0 if isinstance(start, Calibrated) else start.on_time
        return self.K**2 * (of_white(order + 1, time) + of_constant(order, time) ** 2 * lag)

    def growth_from_known(self, time: Array) -> tuple[Array, Array]:
        """Return K^2 t^3 / 3 and K^2 t^5 / 20."""
        return self.K**2 * time**3 / 3.0, self.K**2 * time**5 / 20.0

    def block_covariance(self, lags: Array, block: float) -> Array:
        """Return -K^2 d k / 2, and -K^2 d / 6 at k = 0; k: lag, d: ``block``."""
        return -(self.K**2) * block * np.where(lags == 0.0, 1.0 / 6.0, 0.5 * lags)

    def mean_covariance(self, blocks: base.SampleBlocks) -> Array:
        """Return K^2 times the mean time of the earlier block.

        The diagonal is K^2 T (start + (n - 1) (2 n - 1) / (6 n)), for blocks of n samples at
        intervals T, with start counted from the first block.
        """
        n = (blocks.stop - blocks.start).astype(np.float64)
        first = (blocks.start - blocks.start[0]).astype(np.float64)
        means = first + (n - 1.0) / 2.0
        covariance = np.minimum.outer(means, means)
        np.fill_diagonal(covariance, first + (n - 1.0) * (2.0 * n - 1.0) / (6.0 * n))
        covariance *= self.K**2 * (1.0 / blocks.rate)
        return np.asarray(covariance)

    def reading(self, lowest_tau: float) -> base.Reading:
        """Return K, the level of K sqrt(tau / 3) at 3 s."""
        return base.Reading(3.0, self.K, "K")


@dataclass(frozen=True)
class Ramp(base.Deterministic):
    """Rate or acceleration ramp R, a linear drift (IEEE Std 952); deterministic."""

    R: float
    symbol = "R"
    label = "ramp"
    standard_name = "{signal} ramp"
    word = "R"
    role = base.Role.SLOW
    parameters = (base.TermParameter("R", "ramp", 1.0, -1.0, signed=True),)

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """Return R^2 / (2 pi f)^3 by convention of IEEE Std 952: a ramp has no true density."""
        return self.R**2 / (2.0 * np.pi * np.abs(frequency)) ** 3

    def allan_variance(self, tau: Array) -> Array:
        """Return R^2 tau^2 / 2."""
        return self.R**2 * tau**2 / 2.0

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """Return R^2 tau^2 / 2."""
        return self.R**2 * (n * interval) ** 2 / 2.0

    def state_space(self, interval: float) -> StateSpace:
        """Return a model with two states: the drift, and its rate R."""
        return StateSpace(
            np.array([[1.0, interval], [0.0, 1.0]]),
            np.zeros((2, 2)),
            np.array([1.0, 0.0]),
            0.0,
            np.array([0.0, self.R]),
            np.zeros((2, 2)),
        )

    def continuous_space(self) -> ContinuousSpace:
        """Return a model with two states: the drift, and its rate."""
        F = np.array([[0.0, 1.0], [0.0, 0.0]])
        return ContinuousSpace(F, np.zeros((2, 2)), np.array([1.0, 0.0]))

    def growth(self, order: int, time: float, start: SensorStart) -> float:
        """Return R^2 (t^(m+2) / (m+2)! + c W/2)^2; uncalibrated, A replaces W/2.

        It is the squared integrated error. m is ``order``, t ``time``, W the static window, A the
        time since switch-on, and c = t^(m+1) / (m+1)!.
        """
        lag = start.window / 2.0 if isinstance(start, Calibrated) else start.on_time
        rise = of_constant(order + 1, time) + of_constant(order, time) * lag
        return (self.R * rise) ** 2

    def mean_covariance(self, blocks: base.SampleBlocks) -> Array:
        """Return R^2 times the product of the mean times: the slope has the variance R^2."""
        return np.asarray(self.R**2 * np.outer(blocks.middle, blocks.middle))

    def block_sums(self, blocks: int, width: int, rate: float, rng: np.random.Generator) -> Array:
        """Return the drift in the middle of each block, times the ``width``."""
        firsts = np.arange(blocks) * width
        return np.asarray(self.R * (1.0 / rate) * (firsts + (width - 1) / 2.0) * width)

    def swing(self, weights: Array, block: float) -> tuple[float, float]:
        """Return the square of the weighted sum of the drift, and the frequency 0."""
        middle = np.arange(len(weights)) + 0.5
        return float(self.R * block * (weights @ middle)) ** 2, 0.0
