"""Examine the values of a column: quantisation, saturation, repeats, level and noise."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from imubench_pipeline.recordings.quality.summary import (
    ColumnSummary,
    Excerpt,
    compute_finite_median,
)
from imubench_pipeline.typing import Array

_MAX_PIECES = 4  # pieces of a column that are examined
_MIN_SAMPLES = 1000  # least number of samples of a piece
_HISTOGRAM_BINS = 4096
_MIN_STEP_OVER_NOISE = 0.02
_MAX_STEP_OVER_NOISE = 2.0
"""Range of steps that are searched, in standard deviations of the noise. Finer steps do not matter,
and coarser ones leave too few levels."""

_MIN_PEAK_HEIGHT = 0.25
"""Least height of A at a period. Without a period, n independent samples reach A with probability
exp(-n A^2): 1e-27 for 1000 samples at each frequency."""

_MIN_PERIODS = 2.0  # steps between the 5 % and the 95 % quantile: two are no register
_HEIGHT_TOLERANCE = 0.1  # largest difference of a peak from its expected height sinc(d / q)
_MAX_DIGIT_OVER_STEP = 0.65  # largest ratio of digit to step; above it the rounding hides the step
_MAX_MEAN_OVER_LEAST_GAP = 1.01
"""Ratio of mean to least difference of neighbouring levels, below which the least difference is the
step: nothing was rounded again."""

_MIN_CENTRAL_LEVELS = 8
"""Levels between the 5 % and the 95 % quantile that are needed for the mean difference; with fewer,
all levels are used."""


def find_hidden_step(pieces: Sequence[Excerpt]) -> float | None:
    """Return the least significant bit, SI, of a register that was rounded again, or None.

    Multiples of the bit q, rounded to a digit d, are wrong by up to d / 2: with q = 7.6 d levels
    differ by 7 d or 8 d. The modulus of the characteristic function of samples x, A(f) = |mean
    exp(2πi f x)|, still has a peak at f = 1 / q, of height sinc(d / q) (Widrow and Kollár 2008,
    ch. 4). Normal noise of standard deviation σ without steps gives exp(-2 (π f σ)²).
    """
    chosen = [piece.present for piece in pieces if len(piece.present) >= _MIN_SAMPLES]
    chosen = chosen[:: max(1, len(chosen) // _MAX_PIECES)][:_MAX_PIECES]
    steps = [_find_hidden_step(values) for values in chosen]
    periods = [step for step in steps if step is not None]
    if 2 * len(periods) <= len(steps):
        return None
    step = float(np.median(periods))
    return step if max(abs(period / step - 1.0) for period in periods) < 0.05 else None


def _find_hidden_step(values: Array) -> float | None:
    levels, counts = np.unique(values, return_counts=True)
    gaps = np.diff(levels)
    least_sure = 1e-9 * np.abs(values).max()
    gaps = gaps[gaps > least_sure]
    # From differences of neighbours, so that drift and jumps do not count as noise.
    sigma = float(np.diff(values).std()) / math.sqrt(2.0)
    if len(gaps) < 2 or sigma == 0.0:
        return None
    low, high = np.quantile(values, [0.05, 0.95])
    usual = levels[(levels >= low) & (levels <= high)]
    usual = usual if len(usual) > _MIN_CENTRAL_LEVELS else levels
    if np.diff(usual).mean() < _MAX_MEAN_OVER_LEAST_GAP * gaps.min():
        return None
    frequency = _find_peak(levels, counts, sigma)
    if frequency is None or frequency * (high - low) < _MIN_PERIODS:
        return None
    lengths = np.unique(gaps)
    apart = np.concatenate((lengths[:1], np.diff(lengths)))
    digit = float(apart[apart > least_sure].min())
    # The step of a peak. For values on multiples of d, A is equal at f and at 1 / d - f
    multiples = (levels - levels[0]) / digit
    if np.abs(multiples - np.round(multiples)).max() > 0.05:
        # The values are not on multiples of a digit.
        scatter = 0.25 / frequency
        return 1.0 / frequency if _is_explained(levels, counts, frequency, scatter) else None
    height = _evaluate_height(levels, counts, frequency)
    heights = {
        f: float(np.sinc(digit * f))
        for f in (frequency, 1.0 / digit - frequency)
        if 0.0 < digit * f < _MAX_DIGIT_OVER_STEP
    }
    if not heights:
        return None
    best = min(heights, key=lambda f: abs(heights[f] - height))
    sure = abs(heights[best] - height) < _HEIGHT_TOLERANCE
    return 1.0 / best if sure and _is_explained(levels, counts, best, 0.6 * digit) else None


def _find_peak(levels: Array, counts: NDArray[np.int64], sigma: float) -> float | None:
    """Return the lowest frequency at which A has a peak, 1 / SI."""
    span = float(np.ptp(levels)) * (1.0 + 1.0 / _HISTOGRAM_BINS)
    bins = ((levels - levels[0]) / span * _HISTOGRAM_BINS).astype(np.int64)
    histogram = np.bincount(bins, weights=counts, minlength=_HISTOGRAM_BINS)
    # Zero-padded to twice the length, so that no peak between two frequencies is missed.
    height = np.abs(np.fft.rfft(histogram, 2 * _HISTOGRAM_BINS)) / counts.sum()
    frequencies = np.arange(len(height)) / (2.0 * span)
    inner, f = height[1:-1], frequencies[1:-1]
    peaks = (inner >= height[:-2]) & (inner >= height[2:]) & (inner > _MIN_PEAK_HEIGHT)
    peaks &= f > 1.0 / (_MAX_STEP_OVER_NOISE * sigma)
    peaks &= f < 1.0 / (_MIN_STEP_OVER_NOISE * sigma)
    places = np.flatnonzero(peaks)
    if len(places) == 0:
        return None
    about = frequencies[places[0] + 1] + np.linspace(-0.75, 0.75, 61) / (2.0 * span)
    return float(about[np.argmax([_evaluate_height(levels, counts, f) for f in about])])


def _evaluate_height(levels: Array, counts: NDArray[np.int64], frequency: float) -> float:
    turned = np.exp(2j * np.pi * frequency * (levels - levels[0]))
    return float(np.abs(counts @ turned) / counts.sum())


def _is_explained(
    levels: Array, counts: NDArray[np.int64], frequency: float, scatter: float
) -> bool:
    """Return whether 95 % of the samples are within ``scatter`` of the multiples of a step."""
    phases = frequency * (levels - levels[0])
    phases -= np.angle(counts @ np.exp(2j * np.pi * phases)) / (2.0 * np.pi)
    off = np.abs(phases - np.round(phases)) / frequency
    return bool(counts[off <= scatter].sum() > 0.95 * counts.sum())


_MAX_RUN_PROBABILITY = 1e-9  # probability that a longer run of one value occurs by chance
_MIN_BLOCK_STEPS = 8  # steps between block means: an Allan deviation to a third
_NORMAL_MEDIAN = 0.4549  # median of the square of a standard normal variable
_MAX_STEP_FOR_PILING = 1.0
"""Largest ratio of step to noise at which neighbouring levels are about equally frequent: a level
at the mean has 1.65 times the samples of the next one."""

_COMPARED_LEVELS = 4  # number of levels on either side that a level is compared with
_MIN_PILING_RATIO = 2.5
"""Least ratio to the most frequent of the compared levels. A ratio of 2 is normal if values are
rounded to digits somewhat coarser than the register: some digits then have two of its steps."""

_MIN_PILED_SHARE = 0.005  # least share of the samples at a piled-up level
_MIN_COMPARED_COUNT = 10  # so that few samples do not pile up by chance
_MIN_COUNT_BESIDE_0 = 30  # Samples at each of the three levels on either side of 0
_MIN_SIGNIFICANCE = 3.0  # Of the excess at level 0 in a piece, in standard errors
_RANGE_OF_TRUNCATION = (1.04, 3.5)  # Of the excess: 2 ln 2 + 1.25 (step / sigma)^2 is expected
_MAX_STEP_OF_SATURATION = 1.5  # over the noise
_MIN_MISSING_SAMPLES = 12.0
"""Expected samples beyond the last level above which their absence means saturation. Noise has none
of them with a probability of exp(-12)."""


@dataclass(frozen=True)
class Quantisation:
    """Quantisation of a column."""

    step: float  # least significant bit, SI
    levels: float  # number of levels from the lowest to the highest sample
    over_noise: float  # step over standard deviation; infinite if blocks have one value
    hidden: bool = False  # rounded again: differences are no multiples of the step


def detect_quantisation(column: ColumnSummary) -> Quantisation | None:
    """Return the quantisation of a column, or None if no steps are found."""
    spread = compute_finite_median(column.blocks().spread)
    if not (0.0 < column.step < np.inf):
        return None
    hidden = find_hidden_step(column.excerpts())
    step = column.step if hidden is None else hidden
    # The least difference between n continuous samples is about spread / n.
    if step < 20.0 * spread / column.present:
        return None
    over_noise = step / spread if spread > 0.0 else math.inf  # most blocks have one value
    levels = (column.high - column.low) / step + 1.0
    return Quantisation(step, levels, over_noise, hidden is not None)


def find_piled_value(
    column: ColumnSummary, steps: Quantisation | None
) -> tuple[float, float] | None:
    """Return the value, SI, that is far more frequent than its neighbours, and its share; or None.

    Neighbouring levels of a fine register are about equally frequent. A constant that replaces lost
    samples, or the 0 of a dead band, is more frequent. Coarse registers are not tested.
    """
    if steps is not None and steps.over_noise > _MAX_STEP_FOR_PILING:
        return None
    at, counts = _count_values(column)
    if len(at) == 0:
        return None
    most = int(np.argmax(counts))
    near = counts[max(0, most - _COMPARED_LEVELS) : most + _COMPARED_LEVELS + 1]
    around = np.delete(near, min(most, _COMPARED_LEVELS))
    if at[most] in (column.low, column.high) or len(around) < 2 * _COMPARED_LEVELS:
        return None  # saturated, or too few levels
    share = counts[most] / counts.sum()
    least = _MIN_PILING_RATIO * max(around.max(), _MIN_COMPARED_COUNT)
    if share < _MIN_PILED_SHARE or counts[most] < least:
        return None
    return float(at[most]), float(share)


def is_truncated(column: ColumnSummary, step: float) -> bool:
    """Return whether values were truncated towards 0, so that level 0 is twice as wide.

    The logarithms of the counts of a rounded normal distribution are a parabola. Truncation adds
    ln 2 to the count at 0, and moves the other levels away by half a step.
    """
    weights = np.array([0.5, -1.0, -0.5, 2.0, -0.5, -1.0, 0.5])
    excesses = []
    for piece in column.excerpts():  # each alone: the mean may change between them
        level = np.rint(piece.present / step)
        near = np.array([np.count_nonzero(level == k) for k in range(-3, 4)])
        if near.min() >= _MIN_COUNT_BESIDE_0:
            error = float(np.sqrt(weights**2 @ (1.0 / near)))
            excess = float(weights @ np.log(near))
            excesses.append(excess if excess > _MIN_SIGNIFICANCE * error else 0.0)
    low, high = _RANGE_OF_TRUNCATION
    return bool(excesses) and low < float(np.median(excesses)) < high


def _count_values(column: ColumnSummary) -> tuple[Array, NDArray[np.int64]]:
    pieces = [piece.present for piece in column.excerpts()]
    return np.unique(np.concatenate([np.empty(0), *pieces]), return_counts=True)


@dataclass(frozen=True, kw_only=True)
class Level:
    """Level and noise of a channel, to be compared with its datasheet."""

    mean: float  # median of the block means, SI, which is robust to knocks
    density: tuple[float, float | None]  # see `bound_noise_density`
    unit: str  # as stated in the sensor file
    rate: float  # Hz
    timed: bool = True  # the log has stamps; otherwise the rate is the stated one


def summarise_level(column: ColumnSummary, rate: float, unit: str, *, timed: bool = True) -> Level:
    """Return the level and noise of a channel; for the other arguments see `Level`."""
    level, density = compute_finite_median(column.blocks().mean), bound_noise_density(column, rate)
    return Level(mean=level, density=density, unit=unit, rate=rate, timed=timed)


def bound_noise_density(column: ColumnSummary, rate: float) -> tuple[float, float | None]:
    """Return bounds of the white noise density N of a column, SI/√Hz, two-sided; ``rate`` in Hz.

    The standard deviation within blocks over √rate is too small after a low-pass filter. The Allan
    deviation of the block means times √τ, with the block length τ, is too large if slow noise
    dominates. The upper bound includes the quantisation noise; None if there are too few samples.
    """
    blocks = column.blocks()
    size, spreads = blocks.size, blocks.spread
    means = np.where(blocks.count > 0.9 * size, blocks.mean, np.nan)
    if len(means) <= _MIN_BLOCK_STEPS + 1:  # a short log, which is one excerpt
        values = column.excerpts()[0].values
        size = max(len(values) // (_MIN_BLOCK_STEPS + 1), 1)
        parts = values[: size * (_MIN_BLOCK_STEPS + 1)].reshape(-1, size)
        means, spreads = parts.mean(axis=1), parts.std(axis=1)
    spread = compute_finite_median(spreads) / math.sqrt(rate)
    steps = np.diff(means)
    steps = steps[np.isfinite(steps)]
    if len(steps) < _MIN_BLOCK_STEPS:
        return spread, None
    variance = float(np.median(steps**2)) / (2.0 * _NORMAL_MEDIAN)
    slow = math.sqrt(variance * size / rate)
    least_bit = column.step if np.isfinite(column.step) else 0.0
    return min(spread, slow), max(spread, slow, least_bit / math.sqrt(12.0 * rate))


def _is_end_of_range(column: ColumnSummary, limit: float, window: float) -> bool:
    """Return whether the samples at an extreme belong to the distribution of the others.

    A saturated sensor stays at the limit, or comes from the levels just inside: of normal noise
    with a share p beyond z sigma, those within a ``window`` of one sigma are Q(z - 1) / p - 1 times
    as many.
    """
    values = np.concatenate([piece.present for piece in column.excerpts()])
    there = values == limit
    number = int(there.sum())
    if 2 * np.count_nonzero(there[1:] & there[:-1]) > number:
        return True
    inside = np.count_nonzero(np.abs(values - limit) <= 1.001 * window) - number
    share = number / len(values)
    expected = norm.sf(norm.isf(share) - 1.0) / share - 1.0
    return bool(2 * inside > expected * number)


def compute_longest_chance_run(column: ColumnSummary) -> float:
    """Return the longest run of one value that may occur by chance, in samples."""
    share = min(column.repeats / max(column.present - 1, 1), 0.999)
    if share == 0.0:
        return 1.0
    return 1.0 + math.log(_MAX_RUN_PROBABILITY / column.present) / math.log(share)


def find_saturation(
    column: ColumnSummary, steps: Quantisation | None, share: float
) -> tuple[str, int] | None:
    """Return the saturated side, lowest or highest, and the number of samples there; or None.

    ``share``: least share of the samples of a column at a saturated extreme.
    """
    if steps is not None and steps.over_noise > _MAX_STEP_OF_SATURATION:
        return None  # with so few levels an extreme is frequent in any case
    for side, number in zip(("lowest", "highest"), column.at_extremes, strict=True):
        # Normal noise has a few samples at its last level with any step.
        if number > max(share * column.present, 10) and _is_cut_off(column, steps, side, number):
            return side, number
    return None


def _is_cut_off(column: ColumnSummary, steps: Quantisation | None, side: str, number: int) -> bool:
    """Return whether samples beyond an extreme are missing from the distribution.

    In the tail of normal noise the ratio of the counts of neighbouring levels falls by exp(-q^2)
    per level, with q the step over the noise: the level beyond the last has n_last^2 / n_next
    exp(-q^2).
    """
    at, counts = _count_values(column)
    last, following = (0, 1) if side == "lowest" else (-1, -2)
    limit = column.low if side == "lowest" else column.high
    if len(at) < 2 or at[last] != limit:
        return True
    if steps is None:
        return _is_end_of_range(column, limit, compute_finite_median(column.blocks().spread))
    if not _is_end_of_range(column, limit, math.ceil(1.0 / steps.over_noise) * steps.step):
        return False
    beyond = number * counts[last] / counts[following] * math.exp(-(steps.over_noise**2))
    return bool(beyond > _MIN_MISSING_SAMPLES)
