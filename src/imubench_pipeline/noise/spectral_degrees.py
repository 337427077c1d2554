"""Degrees of freedom of an Allan variance from the noise model of the log, exact for any spectrum.

The Allan variance at n samples per cluster is the mean square of M second differences of cumulative
sums, which are Gaussian with covariance r_k at lag k. Its variance is 2 / M^2 times the sum of
r_k^2 over all pairs. Ramps and lines contribute by their products with the noise only.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan.confidence import match_lower_tail, match_variance
from imubench_pipeline.allan.phase import Presence, Span, list_spans
from imubench_pipeline.noise.model import NoiseModel
from imubench_pipeline.noise.terms.base import Deterministic
from imubench_pipeline.noise.terms.power_laws import Quantization
from imubench_pipeline.typing import Array

_LAGS_PER_CLUSTER = 32  # at which the covariance is evaluated; linear in between
_MAX_LAG_CLUSTERS = 10  # beyond it differences are nearly independent for all noise types
_TAIL_LAGS_PER_CLUSTER = 12
_MAX_DEGREES_WITH_TAIL = 30.0  # above it the lower tail is not computed from eigenvalues
_MAX_EIGENVALUES = 320

_ROUNDING_COVARIANCE = ((0, 6.0), (1, -4.0), (2, 1.0))
"""Lags, in clusters, at which the differences of rounding errors are correlated, and the covariance
over the variance of a rounding error."""


def compute_degrees_of_freedom(
    model: NoiseModel,
    rate: float,
    sizes: NDArray[np.int64],
    samples: int,
    segments: Sequence[Span] | None = None,
    presence: Presence | None = None,
    share: Array | None = None,
) -> tuple[Array, Array]:
    """Return the degrees of freedom of the Allan variances of a Gaussian log of a noise model.

    The first belong to the chi-squared variate with the same relative variance, the second to the
    variate with the same lower tail, for the upper limit; both have shape (m,).

    ``sizes``, shape (m,), are the samples per cluster; no difference spans two segments. If samples
    are missing, ``presence`` counts the samples present, and ``share``, (m,), is the fraction of
    the differences that remain. The ramp and the lines of the model add to the Allan variance, but
    are not noise. (C. Greenhall and W. Riley, "Uncertainty of stability variances based on finite
    differences", PTTI 2003, for power laws; W. Satterthwaite, Biometrics Bulletin 2, 1946.)
    """
    spans = list_spans(segments, samples)
    left = np.ones(len(sizes)) if share is None else share
    pairs = [
        _find_degrees(model, 1.0 / rate, int(n), spans, presence, float(part))
        for n, part in zip(sizes, left, strict=True)
    ]
    edf, upper = (np.array(column, dtype=np.float64) for column in zip(*pairs, strict=True))
    return edf, upper


def _find_degrees(
    model: NoiseModel,
    interval: float,
    n: int,
    spans: tuple[Span, ...],
    presence: Presence | None,
    share: float,
) -> tuple[float, float]:
    terms = np.array([stop - start - 2 * n + 1 for start, stop in spans])
    terms = terms[terms > 0]
    if not len(terms) or not share > 0:
        return 1.0, 1.0
    noise = _Covariance(model, n, interval)
    if not noise.at_zero > 0:
        return 1.0, 1.0
    mask = presence.differences(n) if presence is not None else None
    if mask is None:
        squares, products = zip(*(noise.sums(int(M)) for M in terms), strict=True)
        square, product, counted = sum(squares), sum(products), float(terms.sum())
    else:
        present, stride = mask
        if not present.any():
            return 1.0, 1.0
        square, product = noise.masked_sums(present, stride)
        counted = float(present.sum()) * stride
    differences = share * float(terms.sum())
    relative, crossed = square / counted / differences, product / counted / differences
    # edf follows from variance over squared mean = 2 / edf.
    mean = noise.at_zero + noise.ramp**2 + noise.lines
    varied = 2.0 * noise.at_zero**2 * relative
    ramp = 4.0 * noise.ramp**2 * noise.at_zero * crossed
    varied += ramp + 4.0 * noise.line_products / differences
    edf = max(2.0 * mean**2 / varied, 1.0)
    if edf > _MAX_DEGREES_WITH_TAIL:
        return edf, edf
    weights = noise.eigenvalues(terms, mask)
    if weights is None:
        return edf, edf
    return edf, edf * max(match_lower_tail(weights) / match_variance(weights), 1.0)


class _Covariance:
    """Covariance of the second differences of the cumulative sums of a model, by lag."""

    def __init__(self, model: NoiseModel, n: int, interval: float) -> None:
        self._n, self._interval = n, interval
        # Rounding errors are correlated at single lags, which interpolation would miss.
        self._noise = [t for t in model.terms if not isinstance(t, Quantization | Deterministic)]
        self._rounding = model.Q**2 / interval**2
        self.at_zero = float(self._smooth(np.zeros(1))[0]) + 6.0 * self._rounding
        self.ramp = model.R * interval * n**2
        self.lines = self.line_products = 0.0
        for line in model.sinusoids:
            omega = 2.0 * math.pi * line.frequency * interval
            half = math.sin(omega / 2.0) or 1e-12
            gain = 4.0 * math.sin(n * omega / 2.0) ** 4 / half**2
            power = 0.5 * line.amplitude**2 * gain
            density = float(model.sampled_spectrum(np.array([omega]), 1.0 / interval)[0])
            self.lines += power
            self.line_products += power * density * gain

    def _smooth(self, lags: Array) -> Array:
        n = self._n
        total = np.zeros(len(lags))
        shifted = np.abs(lags[None, :] + n * np.arange(-2.0, 3.0)[:, None])
        second_difference = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
        for term in self._noise:
            total += second_difference @ term.sum_covariance(shifted, n, self._interval)
        return total

    def _at(self, lags: NDArray[np.int64]) -> tuple[Array, Array]:
        """Return covariances without rounding, and of rounding only, over the total at lag 0."""
        smooth = self._smooth(lags.astype(np.float64))
        rounding = np.zeros(len(lags))
        for place, factor in _ROUNDING_COVARIANCE:
            rounding[lags == place * self._n] = factor * self._rounding
        return smooth / self.at_zero, rounding / self.at_zero

    def sums(self, terms: int) -> tuple[float, float]:
        """Return the sums of r_k^2 and r_k over all pairs of consecutive differences."""
        n = self._n
        parts = min(n, _LAGS_PER_CLUSTER)
        lags = np.arange(_MAX_LAG_CLUSTERS * parts + 1) * n // parts
        longest = terms - 1
        lags = np.append(lags[lags < longest], longest) if lags[-1] > longest else lags
        smooth, rounding = self._at(lags)
        pairs = (terms - lags).astype(np.float64)
        width = np.diff(lags, prepend=lags[0], append=lags[-1])
        # Trapezoidal sums between the lags; each end counts as a whole lag.
        weight = (width[1:] + width[:-1]) / 2.0
        weight[-1] += 0.5
        weight[0] = weight[0] + 0.5 if len(lags) > 1 else 1.0
        both = np.where(lags == 0, 2.0 * weight - 1.0, 2.0 * weight) * pairs
        sharp = np.where(lags == 0, 1.0, 2.0) * pairs * rounding
        square = both @ smooth**2 + sharp @ (2.0 * smooth + rounding)
        return float(square), float(both @ smooth + sharp.sum())

    def masked_sums(self, mask: NDArray[np.bool_], stride: int) -> tuple[float, float]:
        """Return the same sums over the valid differences, which begin a stride apart."""
        reach = min(len(mask), _MAX_LAG_CLUSTERS * self._n // stride + 2)
        size = 1 << (len(mask) + reach).bit_length()
        pairs = np.fft.irfft(np.abs(np.fft.rfft(mask.astype(np.float64), size)) ** 2, size)[:reach]
        lags = np.arange(reach) * stride
        smooth, _ = self._at(lags)
        both = np.where(lags == 0, 1.0, 2.0) * pairs * stride**2
        # Rounding contributes at single lags, at the nearest multiple of the stride.
        square, product = float(both @ smooth**2), float(both @ smooth)
        for place, factor in _ROUNDING_COVARIANCE:
            index = min(round(place * self._n / stride), reach - 1)
            sharp = factor * self._rounding / self.at_zero
            count = pairs[index] * stride * (1.0 if place == 0 else 2.0)
            square += float(count * sharp * (2.0 * smooth[index] + sharp))
            product += float(count * sharp)
        return square, product

    def eigenvalues(
        self, terms: NDArray[np.int64], mask: tuple[NDArray[np.bool_], int] | None
    ) -> Array | None:
        """Return the eigenvalues of the covariance of thinned differences; None if too many."""
        eigenvalues = []
        if mask is not None:
            present, stride = mask
            thinning = max(1, round(self._n / _TAIL_LAGS_PER_CLUSTER / stride))
            places = np.flatnonzero(present[::thinning])
            if not len(places):
                places = np.flatnonzero(present)[:1]
            layouts = [(places, float(thinning * stride))]
        else:
            layouts = []
            for M in terms.tolist():
                least = 2 * _TAIL_LAGS_PER_CLUSTER
                m = min(M, max(least, round(M * _TAIL_LAGS_PER_CLUSTER / self._n)))
                layouts.append((np.arange(m), M / m))
        if sum(len(places) for places, _ in layouts) > _MAX_EIGENVALUES:
            return None
        for places, step in layouts:
            lags = np.rint(np.arange(places[-1] - places[0] + 1) * step).astype(np.int64)
            smooth, rounding = self._at(lags)
            row = smooth + rounding / step
            matrix = row[np.abs(np.subtract.outer(places, places))]
            eigenvalues.append(np.maximum(np.linalg.eigvalsh(matrix), 0.0))
        return np.concatenate(eigenvalues)
