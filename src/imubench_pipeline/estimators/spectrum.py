"""The spectrum of a log for the likelihood: one pass, bounded memory, two resolutions.

The orthonormal DCT-II diagonalises white noise and a random walk exactly, and a Gauss-Markov
process nearly; its squared coefficients are the spectrum without the leakage of the Fourier
transform. Low frequencies come from the means of blocks of samples over the whole log, high ones
from segments of it. Beside it, for lines, stands the Hann-windowed Fourier spectrum of segments.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from imubench_pipeline.allan.phase import Span, spans_of, split
from imubench_pipeline.typing import Array

SINGLE = 64
"""Number of lowest ordinates that are not binned."""

WIDTH = 1.05
"""Upper over lower frequency of the other bins."""

_MAX_WHOLE_SAMPLES = 1 << 18
"""Maximum number of samples of a log that is transformed as a whole."""

_MAX_SEGMENT = 1 << 15
_MIN_SEGMENT = 1 << 9
_SEGMENT_OVER_BLOCK = 512
_ENOUGH_SEGMENTS = 0.75
BLOCK_BAND = 0.25
"""Highest frequency taken from block means, rad a block."""

_MIN_AVERAGED_SEGMENTS = 8
"""Minimum number of segments that a spectrum for lines averages."""

_MIN_LINE_SEGMENT = 256


@dataclass(frozen=True)
class Spectrum:
    """The binned DCT-II spectrum of a log: two-sided densities, in bins of nu ordinates.

    Attributes
    ----------
    frequency, lower, upper : ndarray, shape (b,)
        Mean frequency of the ordinates of a bin, and its edges, Hz.
    ordinates : ndarray, shape (b,)
        nu, degrees of freedom: the number of ordinates averaged.
    density : ndarray, shape (b,)
        Their mean, (rad/s)²/Hz or (m/s²)²/Hz.
    block : ndarray of int, shape (b,)
        Samples in the blocks whose means were transformed.
    length : ndarray, shape (b,)
        Duration of the transform, s.
    ramp : ndarray, shape (b,)
        What a ramp of 1 SI unit a second adds to the density.
    cross : ndarray, shape (b,)
        Mean product of the log's and that ramp's coefficients, as a density.
    rate : float
        Hz.
    duration : float
        Of the parts of the log that were used, s.
    mean : float
        Mean of the samples, rad/s or m/s².
    """

    frequency: Array
    lower: Array
    upper: Array
    ordinates: Array
    density: Array
    block: NDArray[np.int64]
    length: Array
    ramp: Array
    cross: Array
    rate: float
    duration: float
    mean: float

    def select(self, chosen: NDArray[np.bool_]) -> Spectrum:
        """Return the spectrum of chosen bins."""
        columns: dict[str, Any] = {
            name: column[chosen]
            for name, column in vars(self).items()
            if isinstance(column, np.ndarray)
        }
        return replace(self, **columns)


@dataclass(frozen=True)
class LineSpectrum:
    """A Hann-windowed Fourier spectrum, averaged over segments, in which lines stand out.

    Attributes
    ----------
    frequency : ndarray, shape (f,)
        Hz, equally spaced.
    density : ndarray, shape (f,)
        Two-sided, (rad/s)²/Hz or (m/s²)²/Hz.
    segments : int
        Segments averaged.
    points : int
        Samples, or block means, in a segment.
    interval : float
        Time between them, s.
    block : int
        Samples in a block.
    """

    frequency: Array
    density: Array
    segments: int
    points: int
    interval: float
    block: int


def spectra(
    blocks: Iterable[Array],
    samples: int,
    rate: float,
    segments: Sequence[Span] | None = None,
) -> tuple[Spectrum, list[LineSpectrum]]:
    """Return the spectrum of a log, and those in which lines are looked for.

    Parameters
    ----------
    blocks : iterable of ndarray
        The log in order, in SI, without missing samples inside the segments
        (`missing.fill_missing`).
    samples : int
        L, the length of all blocks together.
    rate : float
        Hz.
    segments : sequence of (int, int), optional
        First and one-past-last sample of each part of the log; one by default. Each part has its
        own transform of low frequencies.

    Raises
    ------
    ValueError
        If a sample inside a segment is missing, or fewer than 16 samples are there.

    References
    ----------
    N. Ahmed, T. Natarajan and K. Rao, "Discrete cosine transform", IEEE Trans. Computers C-23,
    1974; P. Whittle, "Estimation and information in stationary time series", 1953.
    """
    spans = spans_of(segments, samples)
    sums = _Sums(spans, rate)
    for number, part in split(blocks, spans):
        sums.push(number, np.asarray(part, dtype=np.float64))
    return sums.finish()


def block_of(segments: Sequence[Span]) -> int:
    """Return samples in the blocks whose means give the low frequencies of a spectrum."""
    return _resolution(np.array([stop - start for start, stop in segments]))[1]


class _Sums:
    """Takes the parts of a log, block by block."""

    def __init__(self, spans: Sequence[Span], rate: float) -> None:
        lengths = np.array([stop - start for start, stop in spans])
        self._rate = rate
        self._segment, self._block = _resolution(lengths)
        self._rest: list[Array] = [np.empty(0) for _ in spans]
        self._means: list[list[Array]] = [[] for _ in spans]
        self._squares = np.zeros(self._segment)
        self._hann = np.zeros(self._segment // 2 + 1)
        self._number = 0
        self._level: float | None = None
        self._window = _hann(self._segment)

    def push(self, part: int, values: Array) -> None:
        """Take the next samples of a part."""
        if self._level is None and len(values):
            self._level = float(values[: self._segment].mean())
        joined = np.concatenate((self._rest[part], values)) if len(self._rest[part]) else values
        ready = len(joined) // self._segment * self._segment
        if ready:
            rows = joined[:ready].reshape(-1, self._segment) - (self._level or 0.0)
            self._means[part].append(rows.reshape(-1, self._block).mean(axis=1))
            if self._block > 1:
                self._add(rows)
        self._rest[part] = joined[ready:].copy()

    def _add(self, rows: Array) -> None:
        """Add segments to the spectra of high frequencies."""
        coefficients = scipy.fft.dct(rows, type=2, norm="ortho", axis=1)
        self._squares += np.einsum("ij,ij->j", coefficients, coefficients)
        self._hann += _hann_power(rows, self._window)
        self._number += len(rows)

    def finish(self) -> tuple[Spectrum, list[LineSpectrum]]:
        """Transform the block means, and bin everything."""
        block, interval = self._block, self._block / self._rate
        level = self._level or 0.0
        series = []
        total, count = 0.0, 0
        for means, rest in zip(self._means, self._rest, strict=True):
            whole = len(rest) // block * block
            tail = (rest[:whole] - level).reshape(-1, block).mean(axis=1)
            values = np.concatenate([*means, tail])
            if len(values) >= 2:
                series.append(values)
            total += float(np.sum(values)) * block
            count += len(values) * block
        if count < 16:
            raise ValueError(f"the log has {count} samples, expected 16 or more")
        if not math.isfinite(total):
            raise ValueError("a sample is missing; fill it before the spectrum is taken")
        parts = [_transform(values, interval) for values in series]
        low = tuple(np.concatenate(column) for column in zip(*parts, strict=True))
        if block > 1:
            low = tuple(column[2.0 * np.pi * low[0] * interval <= BLOCK_BAND] for column in low)
        bins = [_binned(low, block)]
        if block > 1:
            beyond = float(bins[0]["upper"][-1])
            bins.append(_high_bins(self._squares, self._number, self._rate, beyond))
        spectrum = Spectrum(
            **{name: np.concatenate([part[name] for part in bins]) for name in bins[0]},
            rate=self._rate,
            duration=count / self._rate,
            mean=level + total / count,
        )
        lines = [_lines_of_means(series, interval, block)]
        if block > 1:
            lines.append(self._lines_of_segments())
        return spectrum, [line for line in lines if line is not None]

    def _lines_of_segments(self) -> LineSpectrum:
        return LineSpectrum(
            np.arange(len(self._hann)) * self._rate / self._segment,
            self._hann / self._number / self._rate,
            self._number,
            self._segment,
            1.0 / self._rate,
            1,
        )


def _resolution(lengths: NDArray[np.int64]) -> tuple[int, int]:
    """Return samples in a segment of high frequencies and in a block of low ones."""
    total = int(lengths.sum())
    if total <= _MAX_WHOLE_SAMPLES:
        return _MAX_SEGMENT, 1
    segment = _MAX_SEGMENT
    while segment > _MIN_SEGMENT:
        covered = int((lengths // segment).sum()) * segment
        # A million samples and more lose little at their end; fewer take shorter segments.
        if covered >= (1.0 - 1.0 / 32.0 if len(lengths) == 1 else _ENOUGH_SEGMENTS) * total:
            break
        segment //= 2
    return segment, segment // _SEGMENT_OVER_BLOCK


def _transform(values: Array, interval: float) -> tuple[Array, Array, Array, Array, Array]:
    """Return frequency, density, ramp, cross and length of the ordinates of one part."""
    n = len(values)
    coefficients = scipy.fft.dct(values - values.mean(), type=2, norm="ortho")[1:]
    k = np.arange(1, n)
    half = np.pi * k / (2.0 * n)
    # sum of (i + 1/2) cos(2 half (i + 1/2)) in closed form: only odd ordinates have a ramp.
    ramp = np.where(
        k % 2 == 1, -math.sqrt(2.0 / n) * interval * np.cos(half) / (2.0 * np.sin(half) ** 2), 0.0
    )
    return (
        k / (2.0 * n * interval),
        coefficients**2 * interval,
        ramp**2 * interval,
        coefficients * ramp * interval,
        np.full(n - 1, n * interval),
    )


def _binned(ordinates: Sequence[Array], block: int) -> dict[str, NDArray[np.generic]]:
    """Average ordinates in bins: the lowest stay single, then each is 5 % wide."""
    order = np.argsort(ordinates[0], kind="stable")
    frequency, density, ramp, cross, length = (column[order] for column in ordinates)
    edges = bin_edges(frequency)
    counts = np.diff(np.append(edges, len(frequency)))
    last = edges + counts - 1
    return {
        "frequency": np.add.reduceat(frequency, edges) / counts,
        "lower": frequency[edges] - 0.25 / length[edges],
        "upper": frequency[last] + 0.25 / length[last],
        "ordinates": counts.astype(np.float64),
        "density": np.add.reduceat(density, edges) / counts,
        "block": np.full(len(edges), block),
        "length": np.add.reduceat(length, edges) / counts,
        "ramp": np.add.reduceat(ramp, edges) / counts,
        "cross": np.add.reduceat(cross, edges) / counts,
    }


def bin_edges(frequency: Array) -> NDArray[np.int64]:
    """Return the first ordinate of each bin."""
    edges = list(range(min(SINGLE, len(frequency))))
    while edges[-1] + 1 < len(frequency):
        beyond = np.searchsorted(frequency, frequency[edges[-1]] * WIDTH * (1 - 1e-12))
        following = max(edges[-1] + 1, int(beyond)) if len(edges) > SINGLE else edges[-1] + 1
        if following >= len(frequency):
            break
        edges.append(following)
    return np.array(edges, dtype=np.int64)


def _high_bins(
    squares: Array, number: int, rate: float, beyond: float
) -> dict[str, NDArray[np.generic]]:
    """Average the ordinates of segments above a frequency in bins 5 % wide."""
    n = len(squares)
    frequency = np.arange(n) * rate / (2.0 * n)
    first = int(np.searchsorted(frequency - 0.25 * rate / n, beyond - 1e-9 * beyond))
    edges = [first]
    while True:
        following = max(edges[-1] + 1, int(np.ceil(edges[-1] * WIDTH)))
        if following >= n:
            break
        edges.append(following)
    starts = np.array(edges)
    counts = np.diff(np.append(starts, n))
    zeros = np.zeros(len(starts))
    half = 0.25 * rate / n
    return {
        "frequency": np.add.reduceat(frequency, starts) / counts,
        "lower": frequency[starts] - half,
        "upper": frequency[starts + counts - 1] + half,
        "ordinates": counts.astype(np.float64) * number,
        "density": np.add.reduceat(squares, starts) / counts / number / rate,
        "block": np.ones(len(starts), dtype=np.int64),
        "length": np.full(len(starts), n / rate),
        "ramp": zeros,
        "cross": zeros,
    }


def _lines_of_means(series: Sequence[Array], interval: float, block: int) -> LineSpectrum | None:
    """Return the spectrum for lines of block means, or None where there are too few."""
    total = sum(len(values) for values in series)
    points = min(_MAX_SEGMENT, 1 << max(0, int(math.log2(max(total / _MIN_AVERAGED_SEGMENTS, 1)))))
    while points >= _MIN_LINE_SEGMENT:
        number = sum(len(values) // points for values in series)
        if number >= _MIN_AVERAGED_SEGMENTS // 2:
            break
        points //= 2
    else:
        return None
    window = _hann(points)
    power = np.zeros(points // 2 + 1)
    for values in series:
        power += _hann_power(values[: len(values) // points * points].reshape(-1, points), window)
    return LineSpectrum(
        np.arange(points // 2 + 1) / (points * interval),
        power / number * interval,
        number,
        points,
        interval,
        block,
    )


def _hann(points: int) -> Array:
    """Return a periodic Hann window whose squares sum up to 1."""
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(points) / points)
    return np.asarray(window / math.sqrt(float(window @ window)))


def _hann_power(rows: Array, window: Array) -> Array:
    """Return the summed squared magnitudes of the windowed Fourier transforms of rows."""
    if len(rows) == 0:
        return np.zeros(len(window) // 2 + 1)
    transformed = scipy.fft.rfft((rows - rows.mean(axis=1, keepdims=True)) * window, axis=1)
    power: Array = np.einsum("ij,ij->j", transformed.real, transformed.real)
    power += np.einsum("ij,ij->j", transformed.imag, transformed.imag)
    return power
