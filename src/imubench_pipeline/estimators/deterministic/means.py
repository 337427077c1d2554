"""Block means of a log and the power of its fast noise in each block, in one pass.

`assess_stationarity` tests whether that power is constant over the log.
"""

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
_MIN_PAUSE = 2.0  # s without samples, in which a sensor may have restarted
_MAX_PAUSES = 48  # with more, samples are lost, and the sensor does not restart
_MAX_GAP_FRACTION = 1 / 5  # fraction of a segment; a longer gap splits it
_SECTIONS = 16
_MIN_SECTION_BLOCKS = 16  # blocks that each section needs for the test of stationarity
_MIN_SIGMAS = 4.5  # of a trend, with 14 degrees of freedom: one false alarm in 2000 logs
_MIN_RELATIVE_TREND = 0.02  # smallest relative change of N over the log that is reported


@dataclass(frozen=True)
class Part:
    """Block means of a part of a log without long gaps."""

    start: int  # first sample
    mean: Array
    """(n,): rad/s or m/s²; interpolated, with white noise, where a block has few samples."""
    power: Array
    """(n,): half the mean squared difference of neighbouring samples in each block: the variance of
    white noise, (rad/s)² or (m/s²)². NaN where a block has few samples."""
    pauses: tuple[tuple[float, float], ...] = ()
    """Middle and length, in blocks, of the gaps in which the sensor may have restarted."""


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
    """Return the block means of a log, given in parts in order, SI, NaN for missing samples."""
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
    """Return mean, power and fraction present of each row, shape (3, rows)."""
    present = np.isfinite(values)
    if present.all():
        power = np.mean(np.diff(values, axis=1) ** 2, axis=1) if values.shape[1] > 1 else 0.0
        return np.array(np.broadcast_arrays(values.mean(axis=1), 0.5 * power, 1.0))
    count = present.sum(axis=1)
    mean = np.where(present, values, 0.0).sum(axis=1) / np.maximum(count, 1)
    squares = np.diff(values, axis=1) ** 2
    pairs = np.isfinite(squares).sum(axis=1)
    with np.errstate(invalid="ignore"):  # NaN without a pair
        power = np.nansum(squares, axis=1) / (2.0 * pairs)
    return np.array([mean, power, count / values.shape[1]])


def _split_at_gaps(start: int, size: int, rows: Array, interval: float) -> list[Part]:
    """Split a segment at long gaps; interpolate short ones."""
    mean, power, share = rows
    covered = np.flatnonzero(share >= 0.5)
    cuts = np.flatnonzero(np.diff(covered) > max(2.0, _MAX_GAP_FRACTION * len(mean)))
    parts = []
    for blocks in np.split(covered, cuts + 1):
        if len(blocks) and blocks[-1] - blocks[0] + 1 >= _MIN_PART_BLOCKS:
            span = slice(int(blocks[0]), int(blocks[-1]) + 1)
            present = share[span] >= 0.5
            filled, powers = _fill_gaps(mean[span], present), np.where(present, power[span], np.nan)
            edges = np.flatnonzero(np.diff((~present).astype(np.int8), prepend=0, append=0))
            middle, length = edges.reshape(-1, 2).mean(axis=1), np.diff(edges)[::2]
            long = length * interval >= _MIN_PAUSE
            pauses = tuple(zip(middle[long].tolist(), length[long].tolist(), strict=True))
            pauses = pauses if len(pauses) <= _MAX_PAUSES else ()
            parts.append(Part(start + span.start * size, filled, powers, pauses))
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
    start: float
    end: float
    """Start and end of the analysed part, s."""

    @property
    def has_trend(self) -> bool:
        """Whether N has a significant trend that matters."""
        return abs(self.trend) > max(_MIN_SIGMAS * self.trend_error, _MIN_RELATIVE_TREND)


def assess_stationarity(means: Means) -> Stationarity | None:
    """Return the trend of the fast noise over the longest part; None if it cannot be tested."""
    part = means.longest
    size = len(part.power) // _SECTIONS
    if size < _MIN_SECTION_BLOCKS or means.block < 2:
        return None
    sections = part.power[: size * _SECTIONS].reshape(_SECTIONS, size)
    count = np.isfinite(sections).sum(axis=1)
    power = np.nansum(sections, axis=1) / np.maximum(count, 1)
    if (count < _MIN_SECTION_BLOCKS // 2).any() or not (power > 0.0).all():
        return None
    # The error is from the scatter of the block powers: heavy tails and bursts increase both.
    error = np.nanstd(sections, axis=1, ddof=1) / np.sqrt(count) / power
    x = np.linspace(-0.5, 0.5, _SECTIONS) * (_SECTIONS - 1) / _SECTIONS
    level = np.log(power)
    slope = float(x @ level / (x @ x))
    left = level - level.mean() - slope * x
    residual = max(float(left @ left) / (_SECTIONS - 2), float(np.mean(error**2)))
    start = part.start / means.rate
    return Stationarity(
        # N is the square root of the power.
        trend=float(np.expm1(0.5 * slope)),
        trend_error=0.5 * float(np.sqrt(residual / (x @ x)) * np.exp(0.5 * slope)),
        start=start,
        end=start + size * _SECTIONS * means.interval,
    )
