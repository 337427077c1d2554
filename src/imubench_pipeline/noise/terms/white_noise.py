"""White noise: angle or velocity random walk."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.noise.growth import (
    Calibrated,
    SensorStart,
    Uncalibrated,
    of_white,
    of_white_mean,
)
from imubench_pipeline.noise.state_space import ContinuousSpace, StateSpace
from imubench_pipeline.noise.terms.base import Term
from imubench_pipeline.noise.terms.traits import Drive, Reading, Role, SampleBlocks, TermParameter
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class WhiteNoise(Term):
    """White noise of density N: angle or velocity random walk (IEEE Std 952)."""

    N: float
    symbol = "N"
    label = "white noise"
    standard_name = "{integral} random walk"
    word = "N"
    role = Role.WHITE
    parameters = (TermParameter("N", "noise density", 1.0, 0.5),)
    states = ()

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

    def continuous_space(self) -> ContinuousSpace:
        """No state: the density of the measurement is as in `drive`."""
        return ContinuousSpace.without_states()

    @property
    def drive(self) -> Drive:
        """N^2."""
        return Drive(white=self.N**2)

    def as_unit(self) -> tuple[float, Term]:
        """N^2 and N = 1."""
        return self.N**2, WhiteNoise(1.0)

    def growth(self, order: int, time: float, start: SensorStart) -> float:
        """N^2 (t^(2m+1) / ((2m+1) m!^2) + c^2 / W), the last where calibrated (Groves, 2013)."""
        return self.N**2 * (of_white(order, time) + of_white_mean(order, time, start))

    def sources(self, order: int, time: float, start: SensorStart) -> Iterator[tuple[str, float]]:
        """Yield motion and static window apart: white noise in one does not know the other."""
        moving = Uncalibrated(bias=0.0, on_time=0.0)
        yield self.source, math.sqrt(self.growth(order, time, moving))
        if isinstance(start, Calibrated):
            mean = self.N * math.sqrt(of_white_mean(order, time, start))
            yield f"{self.source} in the static window", mean

    def growth_from_known(self, time: Array) -> tuple[Array, Array]:
        """N^2 t and N^2 t^3 / 3."""
        return self.N**2 * time, self.N**2 * time**3 / 3.0

    def block_covariance(self, lags: Array, block: float) -> Array:
        """N^2 / d at k = 0."""
        return self.N**2 / block * (lags == 0.0)

    def mean_covariance(self, blocks: SampleBlocks) -> Array:
        """N^2 / (T count) on the diagonal, count the samples present."""
        return np.diag(self.N**2 / (1.0 / blocks.rate * blocks.count))

    def block_sums(self, blocks: int, width: int, rate: float, rng: np.random.Generator) -> Array:
        """Draw sums of variance n N^2 / T."""
        return rng.standard_normal(blocks) * math.sqrt(width * self.N**2 * rate)

    def reading(self, lowest_tau: float) -> Reading:
        """N at 1 s."""
        return Reading(1.0, self.N, "N")
