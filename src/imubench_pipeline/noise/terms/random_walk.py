"""Random walk of the rate or acceleration."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.noise.growth import Calibrated, SensorStart, of_constant, of_walk
from imubench_pipeline.noise.state_space import ContinuousSpace, StateSpace, draw_block_sums
from imubench_pipeline.noise.terms.base import Term
from imubench_pipeline.noise.terms.traits import (
    Drive,
    Process,
    Reading,
    Role,
    SampleBlocks,
    TermParameter,
)
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class RandomWalk(Term):
    """Rate or acceleration random walk K (IEEE Std 952)."""

    K: float
    symbol = "K"
    label = "random walk"
    standard_name = "{signal} random walk"
    word = "K"
    role = Role.RANDOM_WALK
    parameters = (TermParameter("K", "random walk", 1.0, -0.5),)
    states = ("z_K",)

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

    def continuous_space(self) -> ContinuousSpace:
        """F = 0, Q = K^2."""
        return ContinuousSpace(np.zeros((1, 1)), np.array([[self.K**2]]), np.ones(1))

    @property
    def drive(self) -> Drive:
        """K^2, never forgotten."""
        return Drive(process=Process(math.inf, self.K**2))

    def as_unit(self) -> tuple[float, Term]:
        """K^2 and K = 1."""
        return self.K**2, RandomWalk(1.0)

    def growth(self, order: int, time: float, start: SensorStart) -> float:
        """K^2 (t^(2m+3) / ((2m+3) (m+1)!^2) + c^2 W/3), A in the place of W/3 uncalibrated."""
        lag = start.window / 3.0 if isinstance(start, Calibrated) else start.on_time
        return self.K**2 * (of_walk(order, time) + of_constant(order, time) ** 2 * lag)

    def growth_from_known(self, time: Array) -> tuple[Array, Array]:
        """K^2 t^3 / 3 and K^2 t^5 / 20."""
        return self.K**2 * time**3 / 3.0, self.K**2 * time**5 / 20.0

    def block_covariance(self, lags: Array, block: float) -> Array:
        """-K^2 d k / 2, and -K^2 d / 6 at k = 0."""
        return -(self.K**2) * block * np.where(lags == 0.0, 1.0 / 6.0, 0.5 * lags)

    def mean_covariance(self, blocks: SampleBlocks) -> Array:
        """K^2 times the mean time of the earlier block.

        On the diagonal K^2 T (start + (n - 1) (2 n - 1) / (6 n)).
        """
        n = (blocks.stop - blocks.start).astype(np.float64)
        first = (blocks.start - blocks.start[0]).astype(np.float64)
        means = first + (n - 1.0) / 2.0
        covariance = np.minimum.outer(means, means)
        np.fill_diagonal(covariance, first + (n - 1.0) * (2.0 * n - 1.0) / (6.0 * n))
        covariance *= self.K**2 * (1.0 / blocks.rate)
        return np.asarray(covariance)

    def block_sums(self, blocks: int, width: int, rate: float, rng: np.random.Generator) -> Array:
        """Draw them with the states at their ends."""
        interval = 1.0 / rate
        space = self.state_space(interval)
        return draw_block_sums(space, self.start(rng, interval), blocks, width, rng)

    def reading(self, lowest_tau: float) -> Reading:
        """K at 3 s."""
        return Reading(3.0, self.K, "K")
