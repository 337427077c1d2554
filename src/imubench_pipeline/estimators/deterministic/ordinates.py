"""Cosine transform of block means, and the joint fit of noise and regressors to it.

The coefficients c_k are independent with the variance S(omega_k) of the noise model, so that
generalised least squares reduces to weighted sums. Removing regressors also removes noise from the
lowest ordinates: an ordinate with leverage h_k counts as 1 - h_k of one. Regressors are steps,
exponentials, sinusoids and ramps at the block means of one part of a log; time is in blocks.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import scipy.fft

from imubench_pipeline.estimators.deterministic.means import Means
from imubench_pipeline.estimators.spectrum import Spectrum, make_bins
from imubench_pipeline.estimators.whittle import COARSE, Maximum, Terms, Whittle, make_whittle
from imubench_pipeline.typing import Array

NOISE_TERMS = Terms("NFK", 1)  # includes the models of logs without regressors
_FIT_ROUNDS = 2
_MIN_WEIGHT = 0.05  # weight of an ordinate that the regressors explain almost completely


RegressorKind = Literal["step", "exponential", "sinusoid", "ramp"]


@dataclass(frozen=True)
class Regressor:
    """A deterministic signal of unit amplitude in one part of a log."""

    kind: RegressorKind
    """``step``: 0 before its place, 1 from there on, a line over a gap; ``exponential``: 1 at
    the start of the part; ``sinusoid``: a cosine and a sine; ``ramp``: slope 1 per block."""
    part: int  # number of the part
    where: float = 0.0
    """Place of a step, time constant of an exponential, both in blocks; frequency of a sinusoid in
    cycles per block."""
    length: float = 0.0  # of the gap that a step is in, blocks

    @property
    def columns(self) -> int:
        """Number of amplitudes."""
        return 2 if self.kind == "sinusoid" else 1

    def means(self, n: int) -> Array:
        """Return the means of the signal in n blocks, shape (columns, n)."""
        i = np.arange(n, dtype=np.float64)
        if self.kind == "step":
            first = self.where - 0.5 * self.length
            return np.clip((i + 1.0 - first) / (self.length + 1.0), 0.0, 1.0)[None]
        if self.kind == "exponential":
            return -self.where * math.expm1(-1.0 / self.where) * self.at(i)
        scale = np.sinc(self.where) if self.kind == "sinusoid" else 1.0
        return np.asarray(scale * self.at(i + 0.5))

    def coefficients(self, n: int) -> Array:
        """Return orthonormal DCT-II coefficients 1 ... n - 1 of the signal, (columns, n - 1)."""
        return np.asarray(scipy.fft.dct(self.means(n), type=2, norm="ortho", axis=1)[:, 1:])

    def at(self, blocks: Array) -> Array:
        """Return the signal, (columns, s), at times in blocks from the start of its part, (s,)."""
        if self.kind == "step":
            return (blocks >= self.where).astype(np.float64)[None]
        if self.kind == "exponential":
            return np.exp(-blocks / self.where)[None]
        if self.kind == "ramp":
            return blocks[None]
        phase = 2.0 * np.pi * self.where * blocks
        return np.array([np.cos(phase), np.sin(phase)])


@dataclass(frozen=True)
class Fit:
    """Noise and regressors fitted together."""

    regressors: tuple[Regressor, ...]
    sizes: Array  # (p,): amplitudes, SI, in the order of the regressors' columns
    covariance: Array  # (p, p): of the amplitudes, for the noise as fitted
    noise: Maximum
    density: Array  # (k,): of the noise at each ordinate, SI²/Hz
    residual: Array  # (k,): coefficients less the regressors
    leverage: Array  # (k,): part of each ordinate that the regressors take
    log_likelihood: float  # up to a constant that all fits of the ordinates share


class Ordinates:
    """The DCT-II coefficients of all parts of a log; fits use them up to ``highest``, Hz."""

    def __init__(self, means: Means, highest: float | None = None) -> None:
        self.means = means
        interval = means.interval
        self.sizes = [len(part.mean) for part in means.parts]
        self.starts = np.cumsum([0, *(n - 1 for n in self.sizes)])
        centred = [part.mean - part.mean.mean() for part in means.parts]
        self.coefficient = np.concatenate(
            [scipy.fft.dct(mean, type=2, norm="ortho")[1:] for mean in centred]
        )
        self.frequency = np.concatenate(
            [np.arange(1, n) / (2.0 * n * interval) for n in self.sizes]
        )
        self.length = np.concatenate([np.full(n - 1, n * interval) for n in self.sizes])
        self.used = self.frequency <= (highest or math.inf)
        order = np.argsort(self.frequency, kind="stable")
        self._order = order[self.used[order]]
        self._columns: dict[Regressor, Array] = {}

    @property
    def is_usable(self) -> bool:
        """Whether there are enough ordinates for the noise model."""
        return int(self.used.sum()) >= 64 and float(np.ptp(self.coefficient)) > 0.0

    def part(self, number: int) -> slice:
        """Return the slice of the ordinates that belong to a part of the log."""
        return slice(int(self.starts[number]), int(self.starts[number + 1]))

    def columns(self, regressor: Regressor) -> Array:
        """Return the coefficients of a regressor in its part of n blocks, (columns, n - 1)."""
        if regressor not in self._columns:
            self._columns[regressor] = regressor.coefficients(self.sizes[regressor.part])
        return self._columns[regressor]

    def spectrum(self, residual: Array, weight: Array) -> Spectrum:
        """Return the binned spectrum of coefficients, each counted with its ``weight``."""
        order, interval = self._order, self.means.interval
        edges, columns = make_bins(self.frequency[order], self.length[order])
        ordinates = np.add.reduceat(weight[order], edges)
        power = np.add.reduceat(residual[order] ** 2, edges) * interval
        zeros = np.zeros(len(edges))
        return Spectrum(
            **columns,
            ordinates=ordinates,
            density=power / ordinates,
            block=np.full(len(edges), self.means.block),
            ramp=zeros,
            cross=zeros,
            rate=self.means.rate,
            duration=float(sum(self.sizes)) * interval,
            mean=0.0,
        )

    @cached_property
    def whittle(self) -> Whittle:
        """The likelihood of the coefficients, without regressors."""
        spectrum = self.spectrum(self.coefficient, np.ones_like(self.length))
        return make_whittle(spectrum, float(self.frequency[self.used].max()), COARSE)

    def fit_noise(self, residual: Array, leverage: Array | float = 0.0) -> tuple[Maximum, Array]:
        """Return the noise model fitted to a residual, (k,), and the density of the model, (k,)."""
        weight = np.maximum(np.ones_like(residual) - leverage, _MIN_WEIGHT)
        noise = self.whittle.of(self.spectrum(residual, weight)).maximum(NOISE_TERMS)
        return noise, self.density(noise)

    def density(self, noise: Maximum) -> Array:
        """Return the density of a noise model at each ordinate, SI^2/Hz, shape (k,)."""
        bins = self.whittle.spectrum.frequency
        logarithm = np.log(self.whittle.density(noise))
        return np.exp(np.interp(np.log(self.frequency), np.log(bins), logarithm))

    def fit(self, regressors: Sequence[Regressor], start: Array | None = None) -> Fit:
        """Fit noise and regressors; ``start``, shape (k,), is the density for the first weights."""
        residual, leverage = self.coefficient, np.zeros_like(self.coefficient)
        density = start
        for _ in range(_FIT_ROUNDS if regressors else 1):
            if density is not None:
                _, _, residual, leverage = self.solve(regressors, density)
            noise, density = self.fit_noise(residual, leverage)
        assert density is not None  # it was set in every round
        sizes, covariance, residual, leverage = self.solve(regressors, density)
        fitted = sizes, covariance, noise, density, residual, leverage
        return Fit(tuple(regressors), *fitted, self.log_likelihood(residual, density))

    def extrapolate_density(self, fit: Fit, held_out: int) -> Array:
        """Fit noise without the lowest ordinates; return its density at all, (k,)."""
        spectrum = self.spectrum(fit.residual, np.maximum(1.0 - fit.leverage, _MIN_WEIGHT))
        beyond = np.rint(2.0 * spectrum.frequency * spectrum.length) > held_out
        if beyond.sum() < 4 * NOISE_TERMS.parameters:
            return fit.density
        whittle = self.whittle.select(spectrum, beyond)
        return self.density(whittle.maximum(fit.noise.terms))

    def log_likelihood(self, residual: Array, density: Array) -> float:
        """Return the log likelihood of coefficients, up to a constant."""
        used = self.used
        variance = density[used] / self.means.interval
        return -0.5 * float(np.sum(np.log(variance) + residual[used] ** 2 / variance))

    def weights(self, density: Array) -> Array:
        """Return the inverse variance of each coefficient; 0 where it is not used."""
        return np.where(self.used, self.means.interval / density, 0.0)

    def solve(
        self, regressors: Sequence[Regressor], density: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Return amplitudes, their covariance, the residual, and the leverage of each ordinate."""
        weight = self.weights(density)
        X = np.zeros((sum(r.columns for r in regressors), len(weight)))
        row = 0
        for regressor in regressors:
            X[row : row + regressor.columns, self.part(regressor.part)] = self.columns(regressor)
            row += regressor.columns
        sizes, covariance, _ = solve_weighted(X, weight, self.coefficient)
        leverage = np.einsum("ak,ak->k", X * weight, covariance @ X)
        return sizes, covariance, self.coefficient - sizes @ X, leverage


def solve_weighted(columns: Array, weight: Array, coefficient: Array) -> tuple[Array, Array, Array]:
    """Solve weighted least squares; return amplitudes (p,), covariance (p, p), right side (p,)."""
    weighted = columns * weight
    gram = weighted @ columns.T
    norm = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    inverse = np.linalg.pinv(gram / np.outer(norm, norm), rcond=1e-10, hermitian=True)
    covariance = inverse / np.outer(norm, norm)
    target = weighted @ coefficient
    return covariance @ target, covariance, target
