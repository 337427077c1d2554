"""How the errors of windows of a log are correlated, by the noise model of the log.

A window weights the noise by a kernel h whose integral is 0. So its error is stationary for every
term, a random walk and flicker noise included, and its covariance at a lag u is the double integral
of h(s) h(s') C(s - s' + u) with C the generalised covariance of the term: what that has beside, a
constant, cancels. All is of means over blocks of a length d, k blocks apart.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from imubench_pipeline.navigation.backtest.windows import Errors, Window, correlated
from imubench_pipeline.noise import (
    Flicker,
    GaussMarkov,
    NoiseModel,
    Quantization,
    Ramp,
    RandomWalk,
    Sinusoid,
    Term,
    WhiteNoise,
)
from imubench_pipeline.typing import Array

SPANS = 4
"""Lags, in lengths of a window, up to which windows are taken for correlated: beyond, the squares
of the correlations of flicker noise and of a process as slow add less than 1 % to their sum."""

_ROUNDING = 1e-12
"""Least relative variance of a mean square: what is deterministic alone does not scatter."""

_FAR = 100
"""Blocks apart from which the series of flicker noise is better than its closed form."""


def block_covariance(term: Term, lags: Array, block: float) -> Array:
    """Return the generalised covariance of means over blocks.

    With x = d / T_B and v the variance of a Gauss-Markov process:

    - N: N^2 / d at k = 0;
    - Q: 2 Q^2 / d^2 at k = 0 and -Q^2 / d^2 at 1;
    - Gauss-Markov: v ((1 - e^-x) / x)^2 e^(-(k-1) x), and 2 v (x - 1 + e^-x) / x^2 at k = 0;
    - flicker: -(B^2 / pi) times the second difference of k^2 (ln k - 3/2) / 2;
    - K: -K^2 d k / 2, and -K^2 d / 6 at k = 0.

    Parameters
    ----------
    term : Term
    lags : ndarray
        k, blocks, whole numbers from 0.
    block : float
        d, s.

    Returns
    -------
    ndarray
        (rad/s)^2 or (m/s^2)^2.

    Raises
    ------
    TypeError
        If the term is deterministic.

    References
    ----------
    I. M. Gelfand and G. E. Shilov, "Generalized Functions", vol. 1, 1964, for those of 1/|f| and
    1/f^2: -ln|t| / pi and -|t| / 2, with the densities of IEEE Std 952-1997, annex C.
    """
    same = lags == 0.0
    match term:
        case WhiteNoise(N):
            return N**2 / block * same
        case Quantization(Q):
            return Q**2 / block**2 * (2.0 * same - (lags == 1.0))
        case GaussMarkov():
            x = block / term.T_B
            variance = term.density * term.T_B / 2.0
            apart = (math.expm1(-x) / x) ** 2 * np.exp(-(np.maximum(lags, 1.0) - 1.0) * x)
            return variance * np.where(same, 2.0 * (x + math.expm1(-x)) / x**2, apart)
        case Flicker(B):
            return -(B**2) / math.pi * _mean_logarithm(lags)
        case RandomWalk(K):
            return -(K**2) * block * np.where(same, 1.0 / 6.0, 0.5 * lags)
    raise TypeError(f"{term} is deterministic")


def _mean_logarithm(lags: Array) -> Array:
    """Return the mean of ln|s - s'| over two blocks of length 1, k apart."""
    k = np.maximum(lags, 1.0)
    far = np.maximum(k, _FAR)
    series = np.log(far) - 1.0 / (12.0 * far**2) - 1.0 / (60.0 * far**4)
    near = np.minimum(k, _FAR)
    closed = 0.5 * (_twice(near + 1.0) - 2.0 * _twice(near) + _twice(near - 1.0))
    return np.where(lags == 0.0, -1.5, np.where(k < _FAR, closed, series))


def _twice(x: Array) -> Array:
    """Return twice the integral of the integral of ln x."""
    return x**2 * (np.log(np.maximum(x, 1e-300)) - 1.5)


@dataclass(frozen=True)
class Spread:
    """What the mean square of the errors of a log is by a noise model.

    Attributes
    ----------
    mean, variance : float
        Of the mean square: rad^2, (m/s)^2 or m^2, and its square.
    """

    mean: float
    variance: float

    @property
    def degrees(self) -> float:
        """Degrees of freedom of the chi-squared distribution with the same mean and variance."""
        return 2.0 * self.mean**2 / self.variance


@dataclass(frozen=True)
class WindowCovariance:
    """The covariance of the errors of windows, for any noise model.

    Parameters
    ----------
    window : Window
    order : int
        m: integrations but one.
    factor : float
        By which the errors are multiplied: g, where a gyro's attitude turns gravity.
    """

    window: Window
    order: int
    factor: float = 1.0

    @cached_property
    def weights(self) -> Array:
        """Of the blocks of a window (`Window.weights`), times the factor."""
        return self.factor * self.window.weights(self.order)

    @property
    def lags(self) -> int:
        """Lags that it is computed for, from 0."""
        return SPANS * self.window.blocks

    def of(self, model: NoiseModel) -> Array:
        """Return the covariance of the errors by lag in blocks, without what is deterministic.

        Returns
        -------
        ndarray, shape (lags,)
            rad^2, (m/s)^2 or m^2.
        """
        total = np.zeros(self.lags)
        for term in model.terms:
            match term:
                case WhiteNoise(N):
                    total += N**2 * self._of_white
                case Flicker(B):
                    total += B**2 * self._of_flicker
                case RandomWalk(K):
                    total += K**2 * self._of_walk
                case Ramp() | Sinusoid():
                    pass
                case _:
                    total += self._of_term(term)
        return total

    def spread(self, model: NoiseModel, errors: Errors) -> Spread:
        """Return mean and variance of the mean square of the errors that a log has.

        Of Gaussian errors of covariance c the variance is 2 / n^2 times the sum of c^2 over all
        pairs of windows. A ramp adds its square; a line, at a random phase, half that of its
        amplitude, and both their products with the noise.

        Parameters
        ----------
        model : NoiseModel
        errors : Errors
            Of the log: which windows there are.
        """
        covariance, share = self.of(model), _twofold(errors.pairs) / errors.count**2
        mean, variance = float(covariance[0]), 2.0 * float(share @ covariance**2)
        distance = self.window.block * np.arange(self.lags)
        for power, frequency in self._deterministic(model):
            mean += power
            wave = np.cos(2.0 * math.pi * frequency * distance)
            variance += 4.0 * power * max(float(share @ (covariance * wave)), 0.0)
            if frequency > 0.0:
                # How much of it these windows see goes with its phase, unless they see all phases.
                turn = 2.0 * math.pi * frequency * self.window.block
                variance += 0.5 * power**2 * _coherence(2.0 * turn, errors.count)
        return Spread(mean, max(variance, _ROUNDING * mean**2))

    def _deterministic(self, model: NoiseModel) -> Iterator[tuple[float, float]]:
        """Yield mean square and frequency, Hz, of what is no noise; the ramp has frequency 0."""
        block = self.window.block
        middle = np.arange(self.window.blocks) + 0.5
        for term in model.terms:
            if isinstance(term, Ramp):
                yield float(term.R * block * (self.weights @ middle)) ** 2, 0.0
            elif isinstance(term, Sinusoid):
                turn = 2.0 * math.pi * term.frequency * block
                seen = np.sinc(term.frequency * block) * (self.weights @ np.exp(1j * turn * middle))
                yield 0.5 * float(abs(term.amplitude * seen)) ** 2, term.frequency

    @cached_property
    def _of_white(self) -> Array:
        return self._of_term(WhiteNoise(1.0))

    @cached_property
    def _of_flicker(self) -> Array:
        return self._of_term(Flicker(1.0))

    @cached_property
    def _of_walk(self) -> Array:
        return self._of_term(RandomWalk(1.0))

    def _of_term(self, term: Term) -> Array:
        reach = self.window.blocks - 1
        lags = np.abs(np.arange(-reach, self.lags + reach, dtype=np.float64))
        return correlated(block_covariance(term, lags, self.window.block), self._overlap)

    @cached_property
    def _overlap(self) -> Array:
        """The autocorrelation of the weights, from -(blocks - 1) to blocks - 1."""
        return np.correlate(self.weights, self.weights, "full")


def _twofold(pairs: Array) -> Array:
    """Return the pairs of either sign of the lag."""
    return np.concatenate((pairs[:1], 2.0 * pairs[1:]))


def _coherence(angle: float, count: int) -> float:
    """Return the square of the mean of that many phasors, an angle apart: 1 for whole turns."""
    half = math.remainder(0.5 * angle, math.pi)
    if abs(half) < 1e-9:
        return 1.0
    return (math.sin(count * half) / (count * math.sin(half))) ** 2
