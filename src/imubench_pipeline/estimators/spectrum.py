"""The spectrum of a log for the likelihood: one pass, bounded memory, two resolutions.

The orthonormal DCT-II diagonalises white noise and a random walk exactly, and a Gauss-Markov
process nearly; its squared coefficients are a spectrum without the leakage of the Fourier
transform. Low frequencies come from the means of blocks of samples over the whole log, high ones
from segments of it. Lines are detected in a Hann-windowed Fourier spectrum of segments.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from imubench_pipeline.allan.phase import Span, list_spans, split
from imubench_pipeline.typing import Array

SINGLE = 64  # Number of lowest ordinates that are not binned
WIDTH = 1.05  # Upper over lower frequency of the other bins
_MAX_WHOLE_SAMPLES = 1 << 18  # Maximum number of samples of a log that is transformed as a whole
_MAX_SEGMENT = 1 << 15
_MIN_SEGMENT = 1 << 9
_SEGMENT_OVER_BLOCK = 512
_ENOUGH_SEGMENTS = 0.75
BLOCK_BAND = 0.25  # Highest frequency taken from block means, rad a block
_MIN_AVERAGED_SEGMENTS = 8  # Minimum number of segments that a spectrum for lines averages
_MIN_LINE_SEGMENT = 256


@dataclass(frozen=True)
class Spectrum:
    """The binned DCT-II spectrum of a log: two-sided densities, in bins of nu ordinates."""

    frequency: Array  # (b,): mean frequency of the ordinates of a bin, Hz
    lower: Array
    upper: Array  # (b,): edges of a bin, Hz
    ordinates: Array  # (b,): nu, degrees of freedom: the number of ordinates averaged
    density: Array  # (b,): their mean, (rad/s)²/Hz or (m/s²)²/Hz
    block: NDArray[np.int64]  # (b,): samples in the blocks whose means were transformed
    length: Array  # (b,): duration of the transform, s
    ramp: Array  # (b,): density that a ramp of 1 SI unit a second adds
    cross: Array  # (b,): mean product of the coefficients of log and ramp, as a density
    rate: float  # Hz
    duration: float  # of the parts of the log that were used, s
    mean: float  # of the samples, rad/s or m/s²

    def select(self, chosen: NDArray[np.bool_]) -> "Spectrum":
        """Return the spectrum of chosen bins."""
        arrays = {name: each for name, each in vars(self).items() if isinstance(each, np.ndarray)}
        columns: dict[str, Any] = {name: each[chosen] for name, each in arrays.items()}
        return replace(self, **columns)


@dataclass(frozen=True)
class LineSpectrum:
    """A Hann-windowed Fourier spectrum, averaged over segments, in which lines are detected."""

    frequency: Array  # (f,): Hz, equally spaced
    density: Array  # (f,): two-sided, (rad/s)²/Hz or (m/s²)²/Hz
    segments: int  # averaged
    block: int  # samples in a block


def compute_spectra(
    blocks: Iterable[Array], samples: int, rate: float, segments: Sequence[Span] | None = None
) -> tuple[Spectrum, list[LineSpectrum]]:
    """Return the spectrum of a log, and the spectra for the detection of lines.

    The blocks are the log in order, in SI, ``samples`` long together. Each segment (first and
    one-past-last sample; one by default) has its own transform of low frequencies. Raises
    ValueError if a sample inside a segment is missing, or the log has fewer than 16 samples. (N.
    Ahmed, T. Natarajan and K. Rao, "Discrete cosine transform", IEEE Trans. Comput. C-23, 1974.)
    """
    spans = list_spans(segments, samples)
    segment, block = _resolution(np.array([stop - start for start, stop in spans]))
    level, series, squares, hann, number = _sum_segments(blocks, spans, segment, block)
    interval = block / rate
    total = sum(float(np.sum(values)) * block for values in series)
    count = sum(len(values) * block for values in series)
    if count < 16:
        raise ValueError(f"the log has {count} samples, expected 16 or more")
    if not math.isfinite(total):
        raise ValueError("a sample is missing; fill it before the spectrum is taken")
    series = [values for values in series if len(values) >= 2]
    parts = [_transform(values, interval) for values in series]
    low = tuple(np.concatenate(column) for column in zip(*parts, strict=True))
    lines = [_lines_of_means(series, interval, block)]
    if block > 1:
        low = tuple(column[2.0 * np.pi * low[0] * interval <= BLOCK_BAND] for column in low)
        frequency = np.arange(len(hann)) * rate / segment
        lines.append(LineSpectrum(frequency, hann / number / rate, number, 1))
    bins = [_binned(low, block)]
    if block > 1:
        bins.append(_high_bins(squares, number, rate, float(bins[0]["upper"][-1])))
    spectrum = Spectrum(
        **{name: np.concatenate([part[name] for part in bins]) for name in bins[0]},
        rate=rate,
        duration=count / rate,
        mean=level + total / count,
    )
    return spectrum, [line for line in lines if line is not None]


def _sum_segments(
    blocks: Iterable[Array], spans: Sequence[Span], segment: int, block: int
) -> tuple[float, list[Array], Array, Array, int]:
    """Return a level, block means less it, summed DCT-II and Hann power, their number."""
    window = _hann(segment)
    rests: list[Array] = [np.empty(0) for _ in spans]
    means: list[list[Array]] = [[] for _ in spans]
    squares, hann, number = np.zeros(segment), np.zeros(segment // 2 + 1), 0
    level: float | None = None
    for part, new in split(blocks, spans):
        values = np.asarray(new, dtype=np.float64)
        if level is None and len(values):
            level = float(values[:segment].mean())
        joined = np.concatenate((rests[part], values)) if len(rests[part]) else values
        ready = len(joined) // segment * segment
        if ready:
            rows = joined[:ready].reshape(-1, segment) - (level or 0.0)
            means[part].append(rows.reshape(-1, block).mean(axis=1))
            if block > 1:
                coefficients = scipy.fft.dct(rows, type=2, norm="ortho", axis=1)
                squares += np.einsum("ij,ij->j", coefficients, coefficients)
                hann += _hann_power(rows, window)
                number += len(rows)
        rests[part] = joined[ready:].copy()
    level = level or 0.0
    for of_part, rest in zip(means, rests, strict=True):
        whole = len(rest) // block * block
        tail = (rest[:whole] - level).reshape(-1, block).mean(axis=1)
        of_part.append(tail)
    return level, [np.concatenate(of_part) for of_part in means], squares, hann, number


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
    edges, columns = make_bins(frequency, length)
    counts = np.diff(np.append(edges, len(frequency)))
    return columns | {
        "ordinates": counts.astype(np.float64),
        "density": np.add.reduceat(density, edges) / counts,
        "block": np.full(len(edges), block),
        "ramp": np.add.reduceat(ramp, edges) / counts,
        "cross": np.add.reduceat(cross, edges) / counts,
    }


def make_bins(frequency: Array, length: Array) -> tuple[NDArray[np.int64], dict[str, Array]]:
    """Return the first ordinate of each bin, and the columns of `Spectrum` that the bins give."""
    edges = list(range(min(SINGLE, len(frequency))))
    while edges[-1] + 1 < len(frequency):
        beyond = np.searchsorted(frequency, frequency[edges[-1]] * WIDTH * (1 - 1e-12))
        following = max(edges[-1] + 1, int(beyond)) if len(edges) > SINGLE else edges[-1] + 1
        if following >= len(frequency):
            break
        edges.append(following)
    first = np.array(edges, dtype=np.int64)
    counts = np.diff(np.append(first, len(frequency)))
    last = first + counts - 1
    return first, {
        "frequency": np.add.reduceat(frequency, first) / counts,
        "lower": frequency[first] - 0.25 / length[first],
        "upper": frequency[last] + 0.25 / length[last],
        "length": np.add.reduceat(length, first) / counts,
    }


def _high_bins(
    squares: Array, number: int, rate: float, beyond: float
) -> dict[str, NDArray[np.generic]]:
    """Average the ordinates of segments above a frequency in bins 5 % wide."""
    n = len(squares)
    frequency = np.arange(n) * rate / (2.0 * n)
    edges = [int(np.searchsorted(frequency - 0.25 * rate / n, beyond - 1e-9 * beyond))]
    while (following := max(edges[-1] + 1, int(np.ceil(edges[-1] * WIDTH)))) < n:
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
    frequency = np.arange(points // 2 + 1) / (points * interval)
    return LineSpectrum(frequency, power / number * interval, number, block)


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
