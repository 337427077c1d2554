"""Generalised least squares of a log on its temperature, for given noise: s, q and the lag.

A mean beta . x in a log changes the density I of a bin to I - 2 beta . cross + beta . gram beta.
The temperature varies slowly: it is compared at low frequencies only, in the DCT coefficients of
the log or of its block means.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from imubench_pipeline.allan.phase import Span
from imubench_pipeline.estimators.spectrum import BLOCK_BAND, Spectrum
from imubench_pipeline.estimators.thermal.path import TemperaturePath, apply_lag_to_path
from imubench_pipeline.typing import Array

_LAG_GRID_SIZE = 16
_MAX_LAG_FRACTION = 1 / 20  # longest lag over the log; a longer lag looks like drift
_MAX_LAG = 1800.0
_MIN_ORDINATES = 0.02
_LAGS_PER_BATCH = 8  # lags whose regressors are in memory at the same time


class BlockSeries:
    """Block means of a log, gathered while its samples pass.

    An incomplete block at the end of a segment is dropped.
    """

    def __init__(self, segments: Sequence[Span], block: int) -> None:
        self.segments, self.block = tuple(segments), block
        self._sums: list[Array] = [np.zeros((stop - start) // block) for start, stop in segments]

    def watch(self, blocks: Iterable[Array]) -> Iterator[Array]:
        """Yield the blocks of a complete log, in order, SI, unchanged, and gather the means."""
        reached = 0
        for values in blocks:
            for sums, (start, _) in zip(self._sums, self.segments, strict=True):
                first = max(start, reached)
                last = min(start + len(sums) * self.block, reached + len(values))
                if first < last:
                    inside = values[first - reached : last - reached]
                    place = (np.arange(first, last) - start) // self.block
                    low = int(place[0])
                    sums[low : int(place[-1]) + 1] += np.bincount(place - low, weights=inside)
            reached += len(values)
            yield values

    @property
    def means(self) -> list[Array]:
        """Means of the blocks of each part that has two and more."""
        return [np.asarray(sums / self.block) for sums in self._sums if len(sums) >= 2]

    @property
    def places(self) -> list[tuple[int, int, int]]:
        """First sample, samples in a block, and number of blocks of these parts."""
        return [
            (start, self.block, len(sums))
            for sums, (start, _) in zip(self._sums, self.segments, strict=True)
            if len(sums) >= 2
        ]


@dataclass(frozen=True)
class Products:
    """Mean products of coefficients in each bin of a spectrum, as densities."""

    cross: Array  # (b, p): of the log and each of p regressors, SI times its unit, per Hz
    gram: Array  # (b, p, p): of the regressors, in the product of their units, per Hz


class Coefficients:
    """The DCT coefficients of a log at low frequencies, and their products with regressors.

    They are computed from its block means, for the bins of the spectrum with the same blocks.
    """

    def __init__(self, spectrum: Spectrum, series: BlockSeries) -> None:
        self._interval = series.block / spectrum.rate
        self.places = series.places
        low = spectrum.block == series.block
        self._bins, self._low = len(low), np.flatnonzero(low)
        counts = np.rint(spectrum.ordinates[low]).astype(np.int64)
        lengths = [len(means) for means in series.means]
        f = np.concatenate([np.arange(1, n) / (2.0 * n * self._interval) for n in lengths])
        highest = BLOCK_BAND if series.block > 1 else np.inf
        low_ordinates = np.flatnonzero(2.0 * np.pi * f * self._interval <= highest)
        self._order = low_ordinates[np.argsort(f[low_ordinates], kind="stable")]
        self._edges = np.concatenate(([0], np.cumsum(counts)[:-1]))
        self._counts = counts
        self.ordinates = spectrum.ordinates
        self.log = self._of(series.means)

    def _of(self, parts: Sequence[Array]) -> Array:
        centred = [values - values.mean(axis=-1, keepdims=True) for values in parts]
        transformed = [
            scipy.fft.dct(values, type=2, norm="ortho", axis=-1)[..., 1:] for values in centred
        ]
        return np.asarray(np.concatenate(transformed, axis=-1)[..., self._order])

    def of_knots(self, path: TemperaturePath, values: Sequence[Array]) -> Array:
        """Return the coefficients of regressors that are linear between knots, shape (p, n).

        ``values``: p regressors at the knots, shape (k,). Several together take half the time, or
        less if the length of the log has large prime factors.
        """
        rows = np.array(values)
        return self._of([path.means(*place, rows) for place in self.places])

    def of_time(self, rate: float) -> Array:
        """Return the coefficients of a ramp of 1 a second, shape (n,), s."""
        return self._of(
            [
                (first + (np.arange(count, dtype=np.float64) + 0.5) * block - 0.5) / rate
                for first, block, count in self.places
            ]
        )

    def density(self) -> Array:
        """Return the density of the log in each bin with coefficients, else 0."""
        return self._binned(self.log**2)

    def products(self, regressors: Sequence[Array]) -> Products:
        """Return the products of log and regressors in each bin with coefficients, else 0."""
        p = len(regressors)
        cross, gram = np.zeros((self._bins, p)), np.zeros((self._bins, p, p))
        for i, left in enumerate(regressors):
            cross[:, i] = self._binned(left * self.log)
            for j in range(i + 1):
                gram[:, i, j] = gram[:, j, i] = self._binned(left * regressors[j])
        return Products(cross, gram)

    def _binned(self, products: Array) -> Array:
        result = np.zeros(self._bins)
        result[self._low] = np.add.reduceat(products, self._edges) / self._counts * self._interval
        return result


@dataclass(frozen=True)
class Regression:
    """A fit for given noise."""

    beta: Array
    """(p,): s; q and the change of s while settling, if they are in the model; R, if there is a
    ramp. SI per K, K², K and s."""
    information: Array  # (p, p): inverse of their covariance
    lag: float  # s
    log_likelihood_gain: float  # log likelihood minus the value for beta = 0

    @property
    def covariance(self) -> Array:
        """Covariance of beta, for given noise and lag."""
        return np.asarray(np.linalg.inv(self.information))

    @property
    def error(self) -> float:
        """Standard deviation of s, for given noise and lag."""
        return math.sqrt(float(self.covariance[0, 0]))


class Regressors:
    """The regressors of a log, and their products with it, for any lag.

    ``rate`` is in Hz, ``reference`` is T_0, °C, and ``used``, shape (b,), are the bins to use.
    """

    def __init__(
        self,
        coefficients: Coefficients,
        path: TemperaturePath,
        rate: float,
        reference: float,
        used: NDArray[np.bool_],
    ) -> None:
        self.coefficients, self.path, self.rate = coefficients, path, rate
        self.reference, self.used = reference, used
        # Whether the square of the temperature and time are regressors, and the duration, s, of
        # settling from the beginning, in which the sensitivity may be different.
        self.quadratic, self.ramp, self.settling = False, False, 0.0
        self._products: dict[float, Products] = {}
        self._time = coefficients.of_time(rate)
        # With the ramp and in all bins, shared by `also`, since the transforms take most time.
        self._full: dict[tuple[float, bool, float], Products] = {}
        self.ordinates = coefficients.ordinates[used]

    def also(
        self,
        *,
        quadratic: bool | None = None,
        ramp: bool | None = None,
        settling: float | None = None,
        used: NDArray[np.bool_] | None = None,
    ) -> Regressors:
        """Return the regressors with other terms, or in other bins; None: unchanged."""
        other = copy.copy(self)
        other.used = self.used if used is None else used
        other.quadratic = self.quadratic if quadratic is None else quadratic
        other.ramp = self.ramp if ramp is None else ramp
        other.settling = self.settling if settling is None else settling
        other._products = {}
        other.ordinates = self.coefficients.ordinates[other.used]
        return other

    @property
    def thermal(self) -> int:
        """Number of regressors of temperature."""
        return 1 + self.quadratic + (self.settling > 0.0)

    def knots(self, lag: float) -> Array:
        """Return T_lag - T_0 at the knots of the path, shape (k,), K, for a lag in s."""
        return apply_lag_to_path(self.path, self.path.value, self.rate, lag) - self.reference

    def effect(self, regression: Regression) -> Array:
        """Return the effect of temperature at the knots of the path, shape (k,), SI."""
        terms = np.array(self._make_terms(self.knots(regression.lag)))
        return np.asarray(np.einsum("i,ik->k", regression.beta[: self.thermal], terms))

    def _make_terms(self, knots: Array) -> list[Array]:
        """Return the regressors of temperature at the knots."""
        terms = [knots, knots**2] if self.quadratic else [knots]
        if self.settling > 0.0:
            end = self._get_first_settled()
            settled = knots[min(end, len(knots) - 1)]
            terms.append(np.where(np.arange(len(knots)) < end, knots - settled, 0.0))
        return terms

    def slope(self, regression: Regression) -> Array:
        """Return the derivative of the effect by temperature at the knots, shape (k,), SI per K."""
        knots = self.knots(regression.lag)
        slope = np.full(len(knots), regression.beta[0])
        if self.quadratic:
            slope += 2.0 * regression.beta[1] * knots
        if self.settling > 0.0:
            slope[: self._get_first_settled()] += regression.beta[self.thermal - 1]
        return slope

    def _get_first_settled(self) -> int:
        """Return the first knot at which the sensor has settled."""
        begin = self.path.sample[0] + self.settling * self.rate
        return int(np.searchsorted(self.path.sample, begin))

    def means(self, lag: float) -> Array:
        """Return the mean over the log of each regressor of temperature, K, or K² of the square."""
        return np.array([float(term.mean()) for term in self._make_terms(self.knots(lag))])

    def columns(self, lag: float) -> list[Array]:
        """Return the coefficients of the regressors, shape (n,), ordered as `Regression.beta`."""
        columns = self.coefficients.of_knots(self.path, self._make_terms(self.knots(lag)))
        return [*columns] + [self._time] * self.ramp

    def prepare(self, lags: Sequence[float] | Array) -> None:
        """Compute the products for several lags together, which takes less time."""
        lags_to_do = [float(lag) for lag in lags if self._make_key(float(lag)) not in self._full]
        for first in range(0, len(lags_to_do), _LAGS_PER_BATCH):
            batch = lags_to_do[first : first + _LAGS_PER_BATCH]
            terms = [term for lag in batch for term in self._make_terms(self.knots(lag))]
            columns = self.coefficients.of_knots(self.path, terms).reshape(
                len(batch), self.thermal, -1
            )
            for lag, own in zip(batch, columns, strict=True):
                self._full[self._make_key(lag)] = self.coefficients.products([*own, self._time])

    def _make_key(self, lag: float) -> tuple[float, bool, float]:
        return lag, self.quadratic, self.settling

    def products(self, lag: float) -> Products:
        """Return the products of log and regressors at a lag in the bins used."""
        if lag not in self._products:
            self.prepare([lag])
            full, own = self._full[self._make_key(lag)], slice(None if self.ramp else self.thermal)
            cross, gram = full.cross[self.used, own], full.gram[self.used, own, own]
            self._products[lag] = Products(cross, gram)
        return self._products[lag]

    def at(self, lag: float, weights: Array) -> Regression:
        """Return the fit at a lag in s.

        ``weights``, shape (b,): ordinates nu over density S of the noise in the bins used, Hz/SI².
        """
        products = self.products(lag)
        information = np.einsum("b,bij->ij", weights, products.gram)
        target = weights @ products.cross
        information += 1e-12 * np.diag(np.diag(information)) + 1e-300 * np.eye(len(target))
        beta = np.linalg.solve(information, target)
        return Regression(beta, information, lag, 0.5 * float(target @ beta))

    def lags(self, longest: float | None = None) -> Array:
        """Return the lags to scan, s: 0, then ascending; only 0 if the knots are too far apart.

        The longest is by default a twentieth of the longest segment, at most half an hour.
        """
        duration = max(stop - start for start, stop in self.path.segments) / self.rate
        knot = float(np.median(np.diff(self.path.sample))) / self.rate
        last = longest if longest is not None else min(_MAX_LAG_FRACTION * duration, _MAX_LAG)
        first = max(0.5 * knot, last / 1000.0)
        if first >= last:
            return np.array([0.0])
        return np.concatenate(([0.0], np.geomspace(first, last, _LAG_GRID_SIZE)))

    def best(self, weights: Array, lags: Array) -> Regression:
        """Return the fit with the maximum log likelihood, by a scan of the lags and optimisation.

        ``weights``: as for `at`.
        """
        self.prepare(lags)
        fits = [self.at(float(lag), weights) for lag in lags]
        place = int(np.argmax([fit.log_likelihood_gain for fit in fits]))
        best = fits[place]
        if len(lags) == 1:
            return best
        low, high = float(lags[max(place - 1, 0)]), float(lags[min(place + 1, len(lags) - 1)])
        polished = minimize_scalar(
            lambda lag: -self.at(float(lag), weights).log_likelihood_gain,
            bounds=(low, high),
            method="bounded",
            options={"xatol": 2e-3 * high, "maxiter": 25},
        )
        other = self.at(float(polished.x), weights)
        return other if other.log_likelihood_gain > best.log_likelihood_gain + 1e-9 else best

    def without(self, spectrum: Spectrum, regression: Regression, weights: Array) -> Spectrum:
        """Return the spectrum (of the bins used) less the effect of temperature.

        The degrees of freedom of the fit are subtracted from the ordinates of each bin, so that the
        density stays unbiased. ``weights``: of the fit, as for `at`.
        """
        products = self.products(regression.lag)
        p = self.thermal
        beta, cross, gram = regression.beta[:p], products.cross[:, :p], products.gram[:, :p, :p]
        left = spectrum.density - 2.0 * cross @ beta + np.einsum("i,bij,j->b", beta, gram, beta)
        covariance = np.linalg.inv(regression.information[:p, :p])
        degrees = np.minimum(weights * np.einsum("bij,ij->b", gram, covariance), 1.0)
        ordinates = np.maximum(spectrum.ordinates - degrees, _MIN_ORDINATES * spectrum.ordinates)
        with_time = self.also(ramp=True).products(regression.lag) if not self.ramp else products
        return replace(
            spectrum,
            ordinates=ordinates,
            density=np.maximum(left, 1e-12 * spectrum.density) * spectrum.ordinates / ordinates,
            cross=(spectrum.cross - with_time.gram[:, :p, -1] @ beta)
            * spectrum.ordinates
            / ordinates,
            ramp=spectrum.ramp * spectrum.ordinates / ordinates,
        )
