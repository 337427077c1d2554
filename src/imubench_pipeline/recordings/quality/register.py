"""Find the least significant bit of a register whose values were scaled and rounded again.

A register with the step q gives values k q. Scaled to another unit and rounded to a digit d, they
are wrong by up to d / 2: with q = 7.6 d neighbouring levels differ by 7 d or 8 d, and neither is
the step. The distribution of the values still has period q. The modulus of its characteristic
function

    A(f) = | mean exp(2 pi i f x) |

has a peak at f = 1 / q, of height sinc(d / q) (B. Widrow and I. Kollar, "Quantization Noise",
Cambridge 2008, ch. 4). Normal noise without steps gives exp(-2 (pi f sigma)^2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.recordings.quality.summary import Excerpt
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
    """Return the least significant bit, SI, of a register that was rounded again, or None."""
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
