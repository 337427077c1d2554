"""Generalised least squares of a log on its temperature, together with the noise: s, q and the lag.

The cosine transforms of the block means of the log and of the temperature are compared. Their
coefficients are independent, with the density of the noise as variance, so that least squares is a
weighted sum. For given noise the lag is scanned; the noise is fitted to the residual in turn.
"""

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.fft

from imubench_pipeline.estimators.deterministic.ordinates import Ordinates, solve_weighted
from imubench_pipeline.estimators.thermal.path import TemperaturePath
from imubench_pipeline.estimators.whittle import Maximum
from imubench_pipeline.typing import Array

LAGS = 16  # lags of a scan
_MAX_LAG_FRACTION = 1 / 20  # longest lag over the log; a longer lag looks like drift
_MAX_LAG = 1800.0  # s
_ROUNDS = 3  # rounds of effect and noise; more change nothing in benchmarks/temperature.py
_FINE_LAGS = 48
_MAX_DELTA_LOG_LIKELIHOOD = 8.0  # below the best; less likely lags are not in the fine scan
_MIN_OTHER_NOISE = 1e-3  # least fraction of the density that is not random walk
_WALK_FACTORS = np.concatenate(([0.0], np.geomspace(0.05, 20.0, 28)))
"""Grid of K over which the posterior is averaged, over the fitted K or the least visible one."""


@dataclass(frozen=True)
class Shape:
    """The terms of an effect."""

    quadratic: bool = False  # whether the square of the temperature is one
    settling: float = 0.0
    """Time from the beginning, s, in which the sensitivity has another value; 0: none."""


@dataclass(frozen=True)
class Effect:
    """Effect of temperature and the noise, fitted together."""

    shape: Shape
    lag: float  # s
    beta: Array
    """(p,): s; q and the change of s while settling, if they are terms; SI per K and K²."""
    covariance: Array  # (p, p): for the noise and the lag as fitted
    noise: Maximum
    density: Array  # (k,): of the noise at each ordinate, SI²/Hz
    log_likelihood: float  # up to a constant that all fits of the log share

    @property
    def free(self) -> int:
        """Number of parameters."""
        return len(self.beta) + (self.lag > 0.0)


@dataclass(frozen=True)
class Posterior:
    """Joint distribution of K, the lag and beta, given the shape of the other noise."""

    lags: Array  # (l,): s
    lag_weights: Array  # (l,): sum 1
    mean_walk: float  # rms of K, SI
    covariance: Array  # (p, p): of beta about its fitted value


class Regression:
    """The ordinates of a log at a rate, Hz, and of its temperature at any lag."""

    def __init__(self, ordinates: Ordinates, path: TemperaturePath, rate: float) -> None:
        self.ordinates, self.path, self.rate = ordinates, path, rate
        self.block = ordinates.means.block
        self._known: dict[tuple[float, Shape], Array] = {}
        self.bins = len(ordinates.whittle.spectrum.density)

    def means(self, knots: Array) -> Array:
        """Return the block means of a signal whose values are given at the knots of the path."""
        parts = zip(self.ordinates.means.parts, self.ordinates.sizes, strict=True)
        return np.concatenate(
            [self.path.means(part.start, self.block, size, knots) for part, size in parts]
        )

    def transform(self, means: Array) -> Array:
        """Return the DCT-II coefficients, shape (..., k), of signals from their block means."""
        parts = np.split(means, np.cumsum(self.ordinates.sizes)[:-1], axis=-1)
        transformed = [scipy.fft.dct(part, type=2, norm="ortho")[..., 1:] for part in parts]
        return np.concatenate(transformed, axis=-1)

    def knots(self, lag: float) -> Array:
        """Return T_lag - T_0 at the knots of the path, shape (k,), K."""
        return self.path.apply_lag(self.path.value, self.rate, lag) - self.path.mean

    def terms(self, lag: float, shape: Shape) -> Array:
        """Return the terms of a temperature effect at the knots, shape (p, k), K or K²."""
        knots = self.knots(lag)
        terms = [knots, knots**2] if shape.quadratic else [knots]
        if shape.settling > 0.0:
            end = self.first_settled(shape)
            terms.append(np.where(np.arange(len(knots)) < end, knots - knots[end], 0.0))
        return np.array(terms)

    def first_settled(self, shape: Shape) -> int:
        """Return the first knot at which the sensor has settled."""
        end = self.path.sample[0] + shape.settling * self.rate
        return min(int(np.searchsorted(self.path.sample, end)), len(self.path.sample) - 1)

    def columns(self, lag: float, shape: Shape) -> Array:
        """Return the DCT-II coefficients of the terms of a temperature effect, shape (p, k)."""
        if (lag, shape) not in self._known:
            means = [self.means(term) for term in self.terms(lag, shape)]
            self._known[lag, shape] = self.transform(np.array(means))
        return self._known[lag, shape]

    @cached_property
    def time(self) -> Array:
        """The DCT-II coefficients of a ramp of slope 1, shape (k,), s."""
        places = [part.start + self.block * np.arange(len(part.mean))
                  for part in self.ordinates.means.parts]  # fmt: skip
        return self.transform(np.concatenate(places) / self.rate)

    @cached_property
    def lags(self) -> Array:
        """The lags to scan, s: 0, then ascending to a twentieth of the longest segment."""
        duration = max(stop - start for start, stop in self.path.segments) / self.rate
        last = min(_MAX_LAG_FRACTION * duration, _MAX_LAG)
        first = min(max(0.5 * self.block / self.rate, last / 1000.0), 0.5 * last)
        return np.concatenate(([0.0], np.geomspace(first, last, LAGS)))

    def solve(self, columns: Array, density: Array) -> tuple[Array, Array, float]:
        """Return beta, the covariance of beta, and the log likelihood that the columns add."""
        weight, coefficient = self.ordinates.weights(density), self.ordinates.coefficient
        beta, covariance, target = solve_weighted(columns, weight, coefficient)
        return beta, covariance, 0.5 * float(target @ beta)

    def gain(self, effect: Effect, shape: Shape) -> float:
        """Return the log likelihood that a shape adds, with noise and lag of ``effect``."""
        return self.solve(self.columns(effect.lag, shape), effect.density)[2]

    @cached_property
    def plain(self) -> tuple[Maximum, Array]:
        """The noise of the log without a temperature effect, and its density at each ordinate."""
        return self.ordinates.fit_noise(self.ordinates.coefficient)

    def fit(self, shape: Shape, lags: Array) -> Effect:
        """Fit effect and noise in turns, at the best of ``lags``, shape (l,), s."""
        density = self.plain[1]
        for _ in range(_ROUNDS):
            gains = [self.solve(self.columns(lag, shape), density)[2] for lag in lags.tolist()]
            lag = float(lags[int(np.argmax(gains))])
            columns = self.columns(lag, shape)
            beta, covariance, _ = self.solve(columns, density)
            residual = self.ordinates.coefficient - beta @ columns
            leverage = np.einsum("ik,ij,jk->k", columns, covariance, columns)
            leverage *= self.ordinates.weights(density)
            noise, density = self.ordinates.fit_noise(residual, leverage)
        log_likelihood = self.ordinates.log_likelihood(residual, density)
        return Effect(shape, lag, beta, covariance, noise, density, log_likelihood)

    def bracket_likely_lags(self, effect: Effect) -> Array:
        """Return a fine grid of lags, s, over those that the log does not exclude."""
        lags = self.lags
        for _ in range(2):
            effects = [replace(effect, lag=lag) for lag in lags.tolist()]
            gains = np.array([self.gain(each, effect.shape) for each in effects])
            likely = np.flatnonzero(gains > gains.max() - _MAX_DELTA_LOG_LIKELIHOOD)
            low, high = lags[max(likely[0] - 1, 0)], lags[min(likely[-1] + 1, len(lags) - 1)]
            lags = np.linspace(low, high, _FINE_LAGS)
        return lags

    def posterior(
        self, effect: Effect | None, noise: Maximum, density: Array, lags: Array
    ) -> Posterior:
        """Return the distribution of beta and the lag, averaged over K.

        A weak walk is often fitted as none, and the error of s would be too small. The prior of K
        and of the lag is uniform, the weights are the restricted likelihood (REML; D. A. Harville,
        J. Am. Stat. Assoc. 72, 1977), and the other noise is fixed. Without an effect, only K is
        uncertain.
        """
        ordinates = self.ordinates
        walk = 1.0 / (2.0 * np.pi * ordinates.frequency) ** 2
        K = noise.parameter("K")
        rest = np.maximum(density - K**2 * walk, _MIN_OTHER_NOISE * density)
        lowest = int(np.argmin(ordinates.frequency))
        walks = _WALK_FACTORS * max(K, math.sqrt(rest[lowest] / walk[lowest]))
        densities = [rest + each**2 * walk for each in walks]
        alone = np.array([ordinates.log_likelihood(ordinates.coefficient, d) for d in densities])
        chance = np.repeat(alone[:, None], len(lags), axis=1)
        p = len(effect.beta) if effect else 0
        second = np.zeros((len(walks), len(lags), p, p))
        for i, lag in enumerate(lags.tolist()):
            if effect is None:
                continue
            columns = self.columns(lag, effect.shape)
            fitted = np.linalg.slogdet(self.solve(columns, density)[1])[1]
            for j, each in enumerate(densities):
                beta, covariance, gain = self.solve(columns, each)
                # Less the determinant for the fitted noise: no lag is preferred by its size.
                chance[j, i] += gain + 0.5 * (np.linalg.slogdet(covariance)[1] - fitted)
                away = beta - effect.beta
                second[j, i] = covariance + np.outer(away, away)
        mass = np.exp(chance - chance.max()) * np.gradient(walks)[:, None]
        mass /= mass.sum()
        return Posterior(
            lags,
            mass.sum(axis=0),
            math.sqrt(float(mass.sum(axis=1) @ walks**2)),
            np.einsum("wl,wlij->ij", mass, second),
        )

    def path_errors(self, effect: Effect) -> Array:
        """Return changes of beta and lag due to errors of the drawn paths, shape (d, p + 1)."""
        knots = self.knots(effect.lag)
        slope = np.full(len(knots), effect.beta[0])
        if effect.shape.quadratic:
            slope += 2.0 * effect.beta[1] * knots
        if effect.shape.settling > 0.0:
            slope[: self.first_settled(effect.shape)] += effect.beta[-1]
        step = max(0.05 * effect.lag, 0.5 * self.block / self.rate)
        by_lag = self.means(slope * (self.knots(effect.lag + step) - knots) / step)
        columns = np.vstack([self.columns(effect.lag, effect.shape), self.transform(by_lag)])
        weighted = columns * self.ordinates.weights(effect.density)
        information = weighted @ columns.T
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        # A poorly determined lag must not absorb the error of the path.
        ridge = information / np.outer(scale, scale) + 1e-6 * np.eye(len(scale))
        drawn = [self.path.apply_lag(draw - self.path.value, self.rate, effect.lag)
                 for draw in self.path.draws]  # fmt: skip
        errors = self.transform(np.array([self.means(slope * each) for each in drawn]))
        return np.asarray(np.linalg.solve(ridge, (weighted @ errors.T) / scale[:, None]).T / scale)
