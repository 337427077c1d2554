"""Quantization noise of a sensor that rounds its increments."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.noise.growth import Calibrated, SensorStart, of_constant
from imubench_pipeline.noise.state_space import StateSpace
from imubench_pipeline.noise.terms.base import Term
from imubench_pipeline.noise.terms.traits import Drive, Role, SampleBlocks, TermParameter
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class Quantization(Term):
    """Angle or velocity quantization Q of a sensor that rounds its increments (IEEE Std 952)."""

    Q: float
    symbol = "Q"
    label = "quantization"
    standard_name = "{integral} quantization"
    word = "Q"
    role = Role.NOT_GROWING
    parameters = (TermParameter("Q", "quantization", 1.0, 1.0),)
    states = ("z_Q", "z_Q before")

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """(4 Q^2 / T) sin^2(pi f T): it depends on the sampling; ValueError without an interval."""
        if interval is None:
            raise ValueError("the density of quantization noise depends on the rate; give it")
        return self.Q**2 * 4.0 * np.sin(np.pi * frequency * interval) ** 2 / interval

    def allan_variance(self, tau: Array) -> Array:
        """3 Q^2 / tau^2."""
        return 3.0 * self.Q**2 / tau**2

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """3 Q^2 / tau^2: only the rounding errors at the ends of a cluster remain."""
        return 3.0 * self.Q**2 / (n * interval) ** 2

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """(Q^2 / T^2) (2 - 2 cos(omega))."""
        return self.Q**2 / interval**2 * 4.0 * np.sin(omega / 2.0) ** 2

    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """Q^2 / T^2 at lag 0: the sum is the last rounding error."""
        return self.Q**2 / interval**2 * (lags == 0.0)

    def state_space(self, interval: float) -> StateSpace:
        """States: the current rounding error and the previous one."""
        return StateSpace(
            np.array([[0.0, 0.0], [1.0, 0.0]]),
            np.diag([self.Q**2, 0.0]),
            np.array([1.0, -1.0]) / interval,
            0.0,
            np.zeros(2),
            np.eye(2) * self.Q**2,
        )

    @property
    def drive(self) -> Drive | None:
        """None: a converter that counts increments follows every filter."""
        return None

    def growth(self, order: int, time: float, start: SensorStart) -> float:
        """Q^2 ([m = 0] + (t^m/m! + c/W)^2 + (c/W)^2), without c/W where not calibrated.

        The roundings between the ends are left out: for m > 0 they add a part of about one over
        the number of samples.
        """
        # The rounding at the start ends the window and begins the motion.
        first = time**order / math.factorial(order)
        last = 1.0 if order == 0 else 0.0
        mean = of_constant(order, time) / start.window if isinstance(start, Calibrated) else 0.0
        return self.Q**2 * (last + (first + mean) ** 2 + mean**2)

    def growth_from_known(self, time: Array) -> tuple[Array, Array]:
        """0: it does not grow."""
        return np.zeros_like(time), np.zeros_like(time)

    def block_covariance(self, lags: Array, block: float) -> Array:
        """2 Q^2 / d^2 at k = 0 and -Q^2 / d^2 at 1."""
        return self.Q**2 / block**2 * (2.0 * (lags == 0.0) - (lags == 1.0))

    def mean_covariance(self, blocks: SampleBlocks) -> Array:
        """2 Q^2 / (n T)^2 on the diagonal, -Q^2 / (n m T^2) for blocks without a gap between.

        A block's mean is (q_stop - q_start) / (n T), n its samples.
        """
        n = (blocks.stop - blocks.start).astype(np.float64)
        touching = np.zeros((len(n), len(n)))
        i = np.flatnonzero(blocks.start[1:] == blocks.stop[:-1])
        touching[i, i + 1] = touching[i + 1, i] = -1.0 / (n[i] * n[i + 1])
        return (self.Q / (1.0 / blocks.rate)) ** 2 * (touching + np.diag(2.0 / n**2))

    def block_sums(self, blocks: int, width: int, rate: float, rng: np.random.Generator) -> Array:
        """Drawn from the rounding errors at the ends of the blocks."""
        return np.diff(rng.standard_normal(blocks + 1)) * self.Q * rate
