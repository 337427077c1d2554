"""What temperature shares with a log: products of their DCT coefficients in the spectrum's bins.

A mean beta . x in a log moves the density I of a bin to I - 2 beta . cross + beta . gram beta, as
a ramp does. The temperature varies slowly: it is compared at the low frequencies only, those of
the whole log or of its block means.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.fft

from imubench_pipeline.allan.phase import Span
from imubench_pipeline.estimators.spectrum import BLOCK_BAND, Spectrum
from imubench_pipeline.estimators.thermal.path import TemperaturePath
from imubench_pipeline.typing import Array


class BlockSeries:
    """The means of blocks of a log, taken while it goes by.

    Of each segment, first and one-past-last sample, what is left over at the end is dropped.
    """

    def __init__(self, segments: Sequence[Span], block: int) -> None:
        self.segments, self.block = tuple(segments), block
        self._sums: list[Array] = [np.zeros((stop - start) // block) for start, stop in segments]

    def watch(self, blocks: Iterable[Array]) -> Iterator[Array]:
        """Yield the blocks of a complete log, in order, SI, as they are, and keep the means."""
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
        """First sample, samples in a block, and number of blocks of those parts."""
        return [
            (start, self.block, len(sums))
            for sums, (start, _) in zip(self._sums, self.segments, strict=True)
            if len(sums) >= 2
        ]

    @property
    def centres(self) -> list[Array]:
        """Middle of each block of those parts, samples."""
        return [
            np.asarray(first + (np.arange(count) + 0.5) * block - 0.5, dtype=np.float64)
            for first, block, count in self.places
        ]


@dataclass(frozen=True)
class Products:
    """Mean products of coefficients in each bin of a spectrum, as densities."""

    cross: Array  # (b, p): of the log and each of p regressors, SI times its unit, per Hz
    gram: Array  # (b, p, p): of the regressors, in the product of their units, per Hz


class Coefficients:
    """The DCT coefficients of a log at low frequencies, to be multiplied by those of regressors.

    They are in the bins of the spectrum of the log, from its series of blocks of
    `imubench_pipeline.estimators.spectrum.block_of` samples.
    """

    def __init__(self, spectrum: Spectrum, series: BlockSeries) -> None:
        self._interval = series.block / spectrum.rate
        self.places, self.centres = series.places, series.centres
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
        transformed = [
            scipy.fft.dct(
                values - values.mean(axis=-1, keepdims=True), type=2, norm="ortho", axis=-1
            )[..., 1:]
            for values in parts
        ]
        return np.asarray(np.concatenate(transformed, axis=-1)[..., self._order])

    def of_knots(self, path: TemperaturePath, values: Sequence[Array]) -> Array:
        """Return the coefficients of regressors that are linear between knots, shape (p, n).

        A row for each, in the unit of its values, shape (k,). Several together take half the time
        of one after the other, and less where the length of the log has great prime factors.
        """
        rows = np.array(values)
        return self._of([path.means(*place, rows) for place in self.places])

    def of_time(self, rate: float) -> Array:
        """Return the coefficients of a ramp of 1 a second, shape (n,), s."""
        return self._of([centres / rate for centres in self.centres])

    def density(self) -> Array:
        """Return the log's own density in each bin that has these coefficients, else 0."""
        return self._binned(self.log**2)

    def products(self, regressors: Sequence[Array]) -> Products:
        """Return the products of log and regressors in every bin, 0 where there are none."""
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
