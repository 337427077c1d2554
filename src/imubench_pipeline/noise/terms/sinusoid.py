"""A line: a sinusoid in the signal."""

import math
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.noise.exponentials import evaluate_phi
from imubench_pipeline.noise.growth import SensorStart, Uncalibrated, of_constant
from imubench_pipeline.noise.state_space import ContinuousSpace, StateSpace
from imubench_pipeline.noise.terms.base import Deterministic, Role, SampleBlocks, TermParameter
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class Sinusoid(Deterministic):
    """A line: a sinusoid of amplitude Omega_0 and frequency f_0 (IEEE Std 952); deterministic."""

    amplitude: float
    frequency: float
    symbol = "S"
    label = "line"
    standard_name = "lines"
    word = "line"
    role = Role.NO_NOISE
    parameters = (
        TermParameter("amplitude", "amplitude", 1.0, 0.0),
        TermParameter("frequency", "frequency", 0.0, -1.0),
    )

    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """Return 0: the power amplitude^2 / 2 of a line has no density."""
        return np.zeros_like(frequency)

    def allan_variance(self, tau: Array) -> Array:
        """Return amplitude^2 (sin^2(pi f_0 tau) / (pi f_0 tau))^2."""
        x = np.pi * self.frequency * tau
        return self.amplitude**2 * (np.sin(x) ** 2 / x) ** 2

    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """Return amplitude^2 sin^4(n x) / (n sin(x))^2 with x = pi f_0 interval."""
        x = math.pi * self.frequency * interval
        return self.amplitude**2 * np.sin(n * x) ** 4 / (n * math.sin(x)) ** 2

    def state_space(self, interval: float) -> StateSpace:
        """Return a rotation by 2 pi f_0 interval per sample; the initial phase is not known."""
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

    def continuous_space(self) -> ContinuousSpace:
        """Return a rotation at 2 pi f_0, rad/s."""
        speed = 2.0 * math.pi * self.frequency
        F = np.array([[0.0, speed], [-speed, 0.0]])
        return ContinuousSpace(F, np.zeros((2, 2)), np.array([1.0, 0.0]))

    def start(self, rng: np.random.Generator, interval: float) -> Array:
        """Draw the initial state: a random phase, with the amplitude of the line."""
        phase = rng.uniform(0.0, 2.0 * math.pi)
        return self.amplitude * np.array([math.cos(phase), math.sin(phase)])

    def growth(self, order: int, time: float, start: SensorStart) -> float:
        """Return A^2 c^2 |(m+1)! phi_{m+1}(i w t) - phi_1(-i w W)|^2 / 2 with w = 2 pi f_0.

        It is the variance of the integrated error. A is the amplitude, m ``order``, t ``time``, W
        the static window, and c = t^(m+1) / (m+1)!; phi is `evaluate_phi`; the phase is random.
        Uncalibrated, the term phi_1(-i w W) is absent.
        """
        omega = 2.0 * math.pi * self.frequency
        constant, x = of_constant(order, time), omega * time
        factorial = math.factorial(order + 1)
        if isinstance(start, Uncalibrated):
            gain = constant * abs(factorial * evaluate_phi(order + 1, 1j * x))
        else:
            y = omega * start.window
            # Both less 1: the difference itself would cancel for slow lines.
            gain = constant * abs(
                factorial * 1j * x * evaluate_phi(order + 2, 1j * x)
                + 1j * y * evaluate_phi(2, -1j * y)
            )
        return 0.5 * (self.amplitude * gain) ** 2

    def mean_covariance(self, blocks: SampleBlocks) -> Array:
        """Return A^2 / 2 times the gains of both blocks and the cosine of their phase difference.

        A is the amplitude, w = 2 pi f_0. The gain of a block of n samples at intervals T is
        sin(n w T/2) / (n sin(w T/2)).
        """
        n = (blocks.stop - blocks.start).astype(np.float64)
        half = math.pi * self.frequency * (1.0 / blocks.rate)
        gain = np.sin(n * half) / (n * math.sin(half))
        turned = 2.0 * math.pi * self.frequency * blocks.middle
        turns = np.cos(np.subtract.outer(turned, turned))
        return np.asarray(0.5 * self.amplitude**2 * np.outer(gain, gain) * turns)

    def block_sums(self, blocks: int, width: int, rate: float, rng: np.random.Generator) -> Array:
        """Return the sums for a random phase."""
        half = math.pi * self.frequency * (1.0 / rate)
        gain = self.amplitude * math.sin(width * half) / math.sin(half)
        phase = rng.uniform(0.0, 2.0 * math.pi)
        firsts = np.arange(blocks) * width
        return gain * np.cos(half * (2.0 * firsts + width - 1) + phase)

    def swing(self, weights: Array, block: float) -> tuple[float, float]:
        """Return half the squared amplitude of the weighted sum, and the frequency of the line."""
        turn = 2.0 * math.pi * self.frequency * block
        middle = np.arange(len(weights)) + 0.5
        seen = np.sinc(self.frequency * block) * (weights @ np.exp(1j * turn * middle))
        return 0.5 * float(abs(self.amplitude * seen)) ** 2, self.frequency

    @property
    def in_words(self) -> str:
        """Amplitude, SI, and frequency, in words."""
        return f"line of amplitude {self.amplitude:.3e} at {self.frequency:.6g} Hz"
