"""Ramp: a linear drift of the rate or acceleration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imubench_pipeline.noise.growth import Calibrated, SensorStart, of_constant
from imubench_pipeline.noise.state_space import ContinuousSpace, StateSpace
from imubench_pipeline.noise.terms.base import Deterministic
from imubench_pipeline.noise.terms.traits import Role, SampleBlocks, TermParameter
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class Ramp(Deterministic):
    """Rate or acceleration ramp R, a linear drift (IEEE Std 952); deterministic."""

    R: float
    symbol = "R"
    label = "ramp"
    standard_name = "{signal} ramp"
    word = "R"
    role = Role.SLOW
    parameters = (TermParameter("R", "ramp", 1.0, -1.0, signed=True),)
    states = ("z_R", "z_R slope")

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """R^2 / (2 pi f)^3, as IEEE Std 952 assigns it; a ramp has no density proper."""
        return self.R**2 / (2.0 * np.pi * np.abs(frequency)) ** 3

    def allan_variance(self, tau: Array) -> Array:
        """R^2 tau^2 / 2."""
        return self.R**2 * tau**2 / 2.0

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """R^2 tau^2 / 2."""
        return self.R**2 * (n * interval) ** 2 / 2.0

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

    def continuous_space(self) -> ContinuousSpace:
        """Give the states: the drift, and its rate."""
        return ContinuousSpace(
            np.array([[0.0, 1.0], [0.0, 0.0]]), np.zeros((2, 2)), np.array([1.0, 0.0])
        )

    def growth(self, order: int, time: float, start: SensorStart) -> float:
        """R^2 (t^(m+2) / (m+2)! + c W/2)^2, A in the place of W/2 where not calibrated."""
        lag = start.window / 2.0 if isinstance(start, Calibrated) else start.on_time
        rise = of_constant(order + 1, time) + of_constant(order, time) * lag
        return (self.R * rise) ** 2

    def mean_covariance(self, blocks: SampleBlocks) -> Array:
        """R^2 times the product of the mean times: a slope of variance R^2, of either sign."""
        return np.asarray(self.R**2 * np.outer(blocks.middle, blocks.middle))

    def block_sums(self, blocks: int, width: int, rate: float, rng: np.random.Generator) -> Array:
        """Return the drift in the middle of each block, n times."""
        firsts = np.arange(blocks) * width
        return np.asarray(self.R * (1.0 / rate) * (firsts + (width - 1) / 2.0) * width)

    def swing(self, weights: Array, block: float) -> tuple[float, float]:
        """Return the square of what it rises, at the frequency 0."""
        middle = np.arange(len(weights)) + 0.5
        return float(self.R * block * (weights @ middle)) ** 2, 0.0
