"""Block means of a log, and the power of its fast noise in each block: one pass.

`steadiness_of` says whether that power stays the same from the beginning of a log to its end.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan.phase import Span, spans_of, split
from imubench_pipeline.typing import Array

_MOST = 1 << 14
"""Blocks of a log, about: a step is placed to so many parts of it, and better where it is large."""

_LEAST = 10
"""Samples in a block: its mean lies below the low-pass of most sensors."""

_FEWEST = 512
"""Blocks of a short log, whose blocks are smaller for it."""

_SHORTEST_PART = 64
"""Blocks: of a shorter part nothing is told."""

_MAD = 1.4826
"""Standard deviation over the median absolute deviation, of normal noise."""

_LONGEST_HOLE = 1 / 5
"""Part of a segment: a longer hole divides it."""

_SHORTEST_PAUSE = 2.0
"""s: a sensor or its host takes as long to begin anew."""

_MOST_PAUSES = 48

_SECTIONS = 16

_FEWEST_IN_SECTION = 16
"""Blocks of a section."""

_TREND = 4.5
"""Standard errors of a slope, of 14 degrees of freedom: a chance of 1 in 2000."""

_LEAST_TREND = 0.02
"""Relative change of N over the log that is worth a finding."""

_VARIES = 45.0
"""Chi-squared of 15 degrees of freedom: a chance of 1 in 10,000."""

_LEAST_SPREAD = 0.05
"""Relative standard deviation of N over the sections that is worth a finding."""


@dataclass(frozen=True)
class Part:
    """Block means of a part of a log without long holes."""

    start: int  # first sample
    mean: Array
    """(n,): rad/s or m/s²; interpolated, with white noise, where a block has few samples."""
    power: Array
    """(n,): half the mean squared difference of neighbouring samples in each block: the variance of
    white noise, (rad/s)² or (m/s²)². NaN where a block has few samples."""
    kurtosis: float
    """Excess kurtosis of samples that are independent: twice that of their differences."""
    pauses: tuple[tuple[float, float], ...] = ()
    """Middle and length, in blocks, of holes so long that the sensor may have begun anew; the
    longest of them, in order."""


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


def means_of(
    blocks: Iterable[Array],
    samples: int,
    rate: float,
    segments: Sequence[Span] | None = None,
) -> Means:
    """Return the block means of a log in one pass, in bounded memory.

    The blocks are the log in order, in SI, NaN where a sample is missing; ``segments`` first and
    one-past-last sample of each, one by default.
    """
    spans = spans_of(segments, samples)
    total = sum(stop - start for start, stop in spans)
    size = max(-(-total // _MOST), min(_LEAST, max(total // _FEWEST, 1)))
    gathered: list[list[Array]] = [[] for _ in spans]
    rests: list[Array] = [np.empty(0) for _ in spans]
    for number, values in split(blocks, spans):
        values = np.asarray(values, dtype=np.float64)
        rest = rests[number]
        if len(rest):
            values = np.concatenate((rest, values))
        whole = len(values) // size * size
        if whole:
            gathered[number].append(_rows(values[:whole].reshape(-1, size)))
        rests[number] = values[whole:].copy()
    parts: list[Part] = []
    for (start, _), rows in zip(spans, gathered, strict=True):
        if rows:
            parts += _parts(start, size, np.concatenate(rows, axis=1), size / rate)
    return Means(size, rate, tuple(parts))


def _rows(values: Array) -> Array:
    """Return mean, power and fourth moment of differences, share present, shape (4, rows)."""
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


def _parts(start: int, size: int, rows: Array, interval: float) -> list[Part]:
    """Divide a segment at its longest holes, and bridge the others."""
    mean, power, fourth, share = rows
    covered = np.flatnonzero(share >= 0.5)
    if len(covered) < _SHORTEST_PART:
        return []
    longest = max(2.0, _LONGEST_HOLE * len(mean))
    cuts = np.flatnonzero(np.diff(covered) > longest)
    parts = []
    for first, last in zip(
        covered[np.concatenate(([0], cuts + 1))],
        covered[np.append(cuts, len(covered) - 1)],
        strict=True,
    ):
        span = slice(int(first), int(last) + 1)
        if span.stop - span.start < _SHORTEST_PART:
            continue
        parts.append(
            Part(
                start + span.start * size,
                _bridged(mean[span], share[span] >= 0.5),
                np.where(share[span] >= 0.5, power[span], np.nan),
                _kurtosis(power[span], fourth[span], share[span] >= 0.5),
                _pauses(share[span] < 0.5, interval),
            )
        )
    return parts


def _pauses(missing: NDArray[np.bool_], interval: float) -> tuple[tuple[float, float], ...]:
    """Return middle and length of the longest runs of missing blocks, in order."""
    edges = np.flatnonzero(np.diff(missing.astype(np.int8), prepend=0, append=0))
    first, end = edges[::2].astype(np.float64), edges[1::2].astype(np.float64)
    long = np.flatnonzero((end - first) * interval >= _SHORTEST_PAUSE)
    longest = long[np.argsort(first[long] - end[long], kind="stable")][:_MOST_PAUSES]
    in_order = np.sort(longest)
    return tuple(zip(0.5 * (first + end)[in_order], (end - first)[in_order], strict=True))


def _kurtosis(power: Array, fourth: Array, present: NDArray[np.bool_]) -> float:
    """Return the excess kurtosis of samples whose differences have these moments."""
    usable = present & np.isfinite(fourth)
    square = 2.0 * float(power[usable].mean()) if usable.any() else 0.0
    return 2.0 * (float(fourth[usable].mean()) / square**2 - 3.0) if square > 0.0 else 0.0


def _bridged(mean: Array, present: NDArray[np.bool_]) -> Array:
    """Fill blocks without samples: interpolated, with the white noise of the others.

    A long hole is bridged between the means of several blocks, for the white noise of one would
    be a slow course over it.
    """
    if present.all():
        return mean
    filled = mean.copy()
    neighbours = np.diff(mean)[present[1:] & present[:-1]]
    white = _MAD * float(np.median(np.abs(neighbours))) / np.sqrt(2.0) if len(neighbours) else 0.0
    rng = np.random.default_rng(int((~present).sum()))
    missing = np.flatnonzero(~present)
    for run in np.split(missing, np.flatnonzero(np.diff(missing) > 1) + 1):
        first, last = int(run[0]), int(run[-1])
        reach = max(1, len(run) // 4)
        before = slice(max(0, first - reach), first)
        after = slice(last + 1, last + 1 + reach)
        left = mean[before][present[before]].mean()
        right = mean[after][present[after]].mean()
        share = (run - first + 1) / (len(run) + 1)
        filled[run] = left + share * (right - left) + white * rng.standard_normal(len(run))
    return filled


@dataclass(frozen=True)
class Steadiness:
    """How the density of the fast noise changes over a log."""

    trend: float
    trend_error: float
    """Relative change of the density N from beginning to end, and its standard error."""
    spread: float  # relative standard deviation of N over sections of the log beyond chance
    chi_squared: float  # of the sections about their mean
    start: float
    end: float
    """Of the part that was looked at, s."""

    @property
    def grows(self) -> bool:
        """Whether N changes steadily."""
        return abs(self.trend) > _TREND * self.trend_error and abs(self.trend) > _LEAST_TREND

    @property
    def varies(self) -> bool:
        """Whether N changes otherwise."""
        return self.chi_squared > _VARIES and self.spread > _LEAST_SPREAD


def steadiness_of(means: Means) -> Steadiness | None:
    """Return how the power of the fast noise changes over the longest part of a log.

    None for a short log, or one of constant samples.
    """
    part = means.longest
    size = len(part.power) // _SECTIONS
    if size < _FEWEST_IN_SECTION or means.block < 2:
        return None
    sections = part.power[: size * _SECTIONS].reshape(_SECTIONS, size)
    finite = np.isfinite(sections)
    if (finite.sum(axis=1) < _FEWEST_IN_SECTION // 2).any():
        return None
    count = finite.sum(axis=1)
    power = np.nansum(sections, axis=1) / count
    if not (power > 0.0).all():
        return None
    # Heavy tails and bursts scatter the powers of blocks, which widens this with them.
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
    return Steadiness(
        # N is the square root of the power.
        trend=float(np.expm1(0.5 * slope)),
        trend_error=0.5 * slope_error * float(np.exp(0.5 * slope)),
        spread=0.5 * float(np.sqrt(beyond)),
        chi_squared=chi_squared,
        start=start,
        end=start + size * _SECTIONS * means.interval,
    )
