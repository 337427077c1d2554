"""Block means of a log and the power of its fast noise in each block, in one pass.

`assess_stationarity` tests whether that power is constant over the log.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan.phase import Span, list_spans, split
from imubench_pipeline.typing import Array

_MAX_BLOCKS = 1 << 14  # approximate; it is the resolution of the place of a small step
_MIN_BLOCK_SAMPLES = 10  # the mean is then below the low-pass cut-off of most sensors
_MIN_BLOCKS = 512  # blocks of a short log, whose blocks have fewer samples
_MIN_PART_BLOCKS = 64  # shorter parts are not analysed
_SIGMA_OVER_MAD = 1.4826  # standard deviation over median absolute deviation of normal noise
_MAX_GAP_FRACTION = 1 / 5  # fraction of a segment; a longer gap splits it
_MIN_PAUSE = 2.0  # shortest gap, s, in which a sensor or its host can restart
_MAX_PAUSES = 48

_SECTIONS = 16

_MIN_SECTION_BLOCKS = 16  # blocks that each section needs for the test of stationarity
_MIN_TREND_SIGMAS = 4.5  # 14 degrees of freedom: false-alarm probability 1 in 2000
_MIN_RELATIVE_TREND = 0.02  # smallest relative change of N over the log that is reported
_MIN_CHI_SQUARED = 45.0  # 15 degrees of freedom: false-alarm probability 1 in 10,000
_MIN_RELATIVE_SPREAD = 0.05  # smallest reported relative standard deviation of N over sections


@dataclass(frozen=True)
class Part:
    """Block means of a part of a log without long gaps."""

    start: int  # first sample
    mean: Array
    """(n,): rad/s or m/s²; interpolated, with white noise, where a block has few samples."""
    power: Array
    """(n,): half the mean squared difference of neighbouring samples in each block: the variance of
    white noise, (rad/s)² or (m/s²)². NaN where a block has few samples."""
    kurtosis: float
    """Excess kurtosis of samples that are independent: twice that of their differences."""
    pauses: tuple[tuple[float, float], ...] = ()
    """Middle and length, in blocks, of the longest gaps in which the sensor may have restarted, in
    order."""


@dataclass(frozen=True)
class Means:
    """Block means of a log."""

    block: int  # samples in a block
    rate: float  # of the samples, Hz
    parts: tuple[Part, ...]

    @property
    def interval(self) -> float:
        """Duration of a block, s."""
        return self.block / self.rate

    @property
    def longest(self) -> Part:
        """The part with the most blocks."""
        return max(self.parts, key=lambda part: len(part.mean))


def average_blocks(
    blocks: Iterable[Array], samples: int, rate: float, segments: Sequence[Span] | None = None
) -> Means:
    """Return the block means of a log in one pass, in bounded memory.

    The blocks are the log in order, in SI, NaN where a sample is missing.
    """
    spans = list_spans(segments, samples)
    total = sum(stop - start for start, stop in spans)
    size = max(-(-total // _MAX_BLOCKS), min(_MIN_BLOCK_SAMPLES, max(total // _MIN_BLOCKS, 1)))
    gathered: list[list[Array]] = [[] for _ in spans]
    rests: list[Array] = [np.empty(0) for _ in spans]
    for number, values in split(blocks, spans):
        values = np.concatenate((rests[number], np.asarray(values, dtype=np.float64)))
        whole = len(values) // size * size
        if whole:
            gathered[number].append(_compute_block_moments(values[:whole].reshape(-1, size)))
        rests[number] = values[whole:].copy()
    parts: list[Part] = []
    for (start, _), rows in zip(spans, gathered, strict=True):
        if rows:
            parts += _split_at_gaps(start, size, np.concatenate(rows, axis=1), size / rate)
    return Means(size, rate, tuple(parts))


def _compute_block_moments(values: Array) -> Array:
    """Return mean, power and fourth moment of differences, fraction present, shape (4, rows)."""
    size = values.shape[1]
    if np.isfinite(values.sum()):
        level = values[0, 0]
        mean = (values - level).mean(axis=1) + level
        squares = np.diff(values, axis=1)
        squares *= squares
        pairs = max(size - 1, 1)
        power = squares.sum(axis=1) / (2.0 * pairs)
        fourth = np.einsum("ij,ij->i", squares, squares) / pairs
        return np.array([mean, power, fourth, np.ones(len(values))])
    present = np.isfinite(values)
    count = present.sum(axis=1)
    mean = np.where(present, values, 0.0).sum(axis=1) / np.maximum(count, 1)
    both = present[:, 1:] & present[:, :-1]
    steps = np.where(both, np.diff(np.where(present, values, 0.0), axis=1), 0.0)
    pairs = both.sum(axis=1)
    squares = steps**2
    pairs_or_nan = np.where(pairs > 0, np.maximum(pairs, 1), np.nan)
    power = squares.sum(axis=1) / (2.0 * pairs_or_nan)
    return np.array([mean, power, (squares**2).sum(axis=1) / pairs_or_nan, count / size])


def _split_at_gaps(start: int, size: int, rows: Array, interval: float) -> list[Part]:
    """Split a segment at long gaps; interpolate short ones."""
    mean, power, fourth, share = rows
    covered = np.flatnonzero(share >= 0.5)
    if len(covered) < _MIN_PART_BLOCKS:
        return []
    longest = max(2.0, _MAX_GAP_FRACTION * len(mean))
    cuts = np.flatnonzero(np.diff(covered) > longest)
    parts = []
    for first, last in zip(
        covered[np.concatenate(([0], cuts + 1))],
        covered[np.append(cuts, len(covered) - 1)],
        strict=True,
    ):
        span = slice(int(first), int(last) + 1)
        if span.stop - span.start < _MIN_PART_BLOCKS:
            continue
        present = share[span] >= 0.5
        usable = present & np.isfinite(fourth[span])
        square = 2.0 * float(power[span][usable].mean()) if usable.any() else 0.0
        kurtosis = 0.0
        if square > 0.0:
            kurtosis = 2.0 * (float(fourth[span][usable].mean()) / square**2 - 3.0)
        edges = np.flatnonzero(np.diff((~present).astype(np.int8), prepend=0, append=0))
        begin, end = edges[::2].astype(np.float64), edges[1::2].astype(np.float64)
        pauses = np.flatnonzero((end - begin) * interval >= _MIN_PAUSE)
        pauses = pauses[np.argsort(begin[pauses] - end[pauses], kind="stable")][:_MAX_PAUSES]
        pauses.sort()
        of_pauses = tuple(zip(0.5 * (begin + end)[pauses], (end - begin)[pauses], strict=True))
        filled, powers = _fill_gaps(mean[span], present), np.where(present, power[span], np.nan)
        parts.append(Part(start + span.start * size, filled, powers, kurtosis, of_pauses))
    return parts


def _fill_gaps(mean: Array, present: NDArray[np.bool_]) -> Array:
    """Fill blocks without samples by interpolation, plus white noise as in the other blocks."""
    if present.all():
        return mean
    filled = mean.copy()
    neighbours = np.diff(mean)[present[1:] & present[:-1]]
    white = 0.0
    if len(neighbours):
        white = _SIGMA_OVER_MAD * float(np.median(np.abs(neighbours))) / np.sqrt(2.0)
    rng = np.random.default_rng(int((~present).sum()))
    missing = np.flatnonzero(~present)
    for run in np.split(missing, np.flatnonzero(np.diff(missing) > 1) + 1):
        first, last = int(run[0]), int(run[-1])
        # The white noise of a single block would create a slow signal across a long gap.
        reach = max(1, len(run) // 4)
        before = slice(max(0, first - reach), first)
        after = slice(last + 1, last + 1 + reach)
        left = mean[before][present[before]].mean()
        right = mean[after][present[after]].mean()
        share = (run - first + 1) / (len(run) + 1)
        filled[run] = left + share * (right - left) + white * rng.standard_normal(len(run))
    return filled


@dataclass(frozen=True)
class Stationarity:
    """Change of the density of the fast noise over a log."""

    trend: float
    trend_error: float
    """Relative change of the density N from beginning to end, and its standard error."""
    spread: float  # relative standard deviation of N over sections, less its estimation error
    chi_squared: float  # of the sections about their mean
    start: float
    end: float
    """Start and end of the analysed part, s."""

    @property
    def has_trend(self) -> bool:
        """Whether N has a significant trend."""
        return (
            abs(self.trend) > _MIN_TREND_SIGMAS * self.trend_error
            and abs(self.trend) > _MIN_RELATIVE_TREND
        )

    @property
    def is_variable(self) -> bool:
        """Whether N varies significantly between sections."""
        return self.chi_squared > _MIN_CHI_SQUARED and self.spread > _MIN_RELATIVE_SPREAD


def assess_stationarity(means: Means) -> Stationarity | None:
    """Return the change of the power of the fast noise over the longest part of a log.

    None for a short log, or one with constant samples.
    """
    part = means.longest
    size = len(part.power) // _SECTIONS
    if size < _MIN_SECTION_BLOCKS or means.block < 2:
        return None
    sections = part.power[: size * _SECTIONS].reshape(_SECTIONS, size)
    finite = np.isfinite(sections)
    if (finite.sum(axis=1) < _MIN_SECTION_BLOCKS // 2).any():
        return None
    count = finite.sum(axis=1)
    power = np.nansum(sections, axis=1) / count
    if not (power > 0.0).all():
        return None
    # The error is from the scatter of the block powers: heavy tails and bursts increase both.
    scatter = np.sqrt(np.nansum((sections - power[:, None]) ** 2, axis=1) / (count - 1) / count)
    level = np.log(power)
    error = scatter / power
    x = np.linspace(-0.5, 0.5, _SECTIONS) * (_SECTIONS - 1) / _SECTIONS
    slope = float(x @ (level - level.mean()) / (x @ x))
    left = level - level.mean() - slope * x
    residual = float(left @ left) / (_SECTIONS - 2)
    slope_error = float(np.sqrt(max(residual, float(np.mean(error**2))) / (x @ x)))
    weight = 1.0 / np.maximum(error, 1e-12) ** 2
    middle = float(weight @ level / weight.sum())
    chi_squared = float(weight @ (level - middle) ** 2)
    beyond = max(float(np.var(level, ddof=1) - np.mean(error**2)), 0.0)
    start = part.start / means.rate
    return Stationarity(
        # N is the square root of the power.
        trend=float(np.expm1(0.5 * slope)),
        trend_error=0.5 * slope_error * float(np.exp(0.5 * slope)),
        spread=0.5 * float(np.sqrt(beyond)),
        chi_squared=chi_squared,
        start=start,
        end=start + size * _SECTIONS * means.interval,
    )
