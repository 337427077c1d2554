"""Correlation of the errors of windows of a log, from the noise model of the log.

A window weights the noise by a kernel h with the integral 0, so its error is stationary for every
term. The covariance at a lag u is the double integral of h(s) h(s') C(s - s' + u), with C the
generalised covariance of the term, and is computed from means over blocks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from imubench_pipeline.navigation.backtest.windows import Errors, Window, correlate
from imubench_pipeline.noise import Deterministic, NoiseModel, Term
from imubench_pipeline.typing import Array

MAX_CORRELATED_SPANS = 4
"""Maximum lag of correlated windows, in lengths of a window. Beyond it, the squared correlations of
flicker noise and of a similarly slow process add less than 1 % to their sum."""

_MIN_RELATIVE_VARIANCE = 1e-12
"""Minimum relative variance of a mean square: purely deterministic errors have no scatter."""


@dataclass(frozen=True)
class Spread:
    """Distribution of the mean square of the errors of a log, from a noise model."""

    # mean, variance: of the mean square: rad^2, (m/s)^2 or m^2, and its square
    mean: float
    variance: float

    @property
    def degrees(self) -> float:
        """Degrees of freedom of the chi-squared distribution with the same mean and variance."""
        return 2.0 * self.mean**2 / self.variance


@dataclass(frozen=True)
class WindowCovariance:
    """The covariance of the errors of windows, for any noise model."""

    window: Window
    order: int  # m: number of integrations minus one
    # multiplier of the errors: g if a gyro's attitude error projects gravity
    factor: float = 1.0

    @cached_property
    def weights(self) -> Array:
        """Weights of the blocks of a window (`Window.weights`), times the factor."""
        return self.factor * self.window.weights(self.order)

    @property
    def lags(self) -> int:
        """Number of lags, from 0."""
        return MAX_CORRELATED_SPANS * self.window.blocks

    def of(self, model: NoiseModel) -> Array:
        """Return the covariance of the errors by lag in blocks, without deterministic terms.

        Shape (lags,), in rad^2, (m/s)^2 or m^2.
        """
        total = np.zeros(self.lags)
        reach = self.window.blocks - 1
        lags = np.abs(np.arange(-reach, self.lags + reach, dtype=np.float64))
        for term in model.terms:
            if not isinstance(term, Deterministic):
                power, unit = term.as_unit()
                if unit not in self._unit_covariances:
                    covariance = correlate(
                        unit.block_covariance(lags, self.window.block), self._autocorrelation
                    )
                else:
                    covariance = self._unit_covariances[unit]
                if unit is not term:  # all models share it
                    self._unit_covariances[unit] = covariance
                total += power * covariance
        return total

    def spread(self, model: NoiseModel, errors: Errors) -> Spread:
        """Return mean and variance of the mean square of the errors of a log.

        For Gaussian errors with covariance c, the variance is 2 / n^2 times the sum of c^2 over all
        pairs of windows, which ``errors`` counts. A ramp adds its square to the mean square. A
        line, at a random phase, adds half the square of its amplitude. Both add their products with
        the noise to the variance.
        """
        covariance = self.of(model)
        both_signs = np.concatenate((errors.pairs[:1], 2.0 * errors.pairs[1:]))
        share = both_signs / errors.count**2
        mean, variance = float(covariance[0]), 2.0 * float(share @ covariance**2)
        distance = self.window.block * np.arange(self.lags)
        for term in model.terms:
            if not isinstance(term, Deterministic):
                continue
            power, frequency = term.swing(self.weights, self.window.block)  # 0 Hz for a ramp
            mean += power
            wave = np.cos(2.0 * math.pi * frequency * distance)
            variance += 4.0 * power * max(float(share @ (covariance * wave)), 0.0)
            if frequency > 0.0:
                # Its mean square depends on the phase, unless the windows cover all phases.
                turn = 2.0 * math.pi * frequency * self.window.block
                half = math.remainder(turn, math.pi)
                coherence = 1.0  # squared mean of phasors that are two turns apart
                if abs(half) >= 1e-9:
                    mean_phasor = math.sin(errors.count * half) / (errors.count * math.sin(half))
                    coherence = mean_phasor**2
                variance += 0.5 * power**2 * coherence
        return Spread(mean, max(variance, _MIN_RELATIVE_VARIANCE * mean**2))

    @cached_property
    def _unit_covariances(self) -> dict[Term, Array]:
        return {}

    @cached_property
    def _autocorrelation(self) -> Array:
        """The autocorrelation of the weights, from -(blocks - 1) to blocks - 1."""
        return np.correlate(self.weights, self.weights, "full")
