"""The least significant bit of a register behind figures that were scaled and rounded again.

A register of steps q gives values k q. Scaled to another unit and written in few digits d, they lie
up to d / 2 off: neighbours differ by 7 d or 8 d where q is 7.6 d, and the least difference is
neither. Their distribution still has period q, and the modulus of its characteristic function

    A(f) = | mean exp(2 pi i f x) |

has a peak at f = 1 / q, of height sinc(d / q) (B. Widrow and I. Kollar, "Quantization Noise",
Cambridge 2008, ch. 4), where noise without steps leaves exp(-2 (pi f sigma)^2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.recordings.quality.summary import Excerpt
from imubench_pipeline.typing import Array

_PIECES = 4
_FEWEST = 1000
"""Samples of a piece that tell."""

_BINS = 4096
_FINEST = 0.02
_COARSEST = 2.0
"""Standard deviations: finer steps do not matter, coarser ones leave too few levels to tell."""

_PEAK = 0.25
"""Height of A that is a period: n independent samples without one reach A with a chance of
exp(-n A^2), for 1000 samples 1e-27 at each frequency."""

_PERIODS = 2.0
"""Steps from the 5 % to the 95 % quantile: two levels alone are no register."""

_MATCH = 0.1
_COARSE_DIGITS = 0.65
"""Digit over step from which the rounding leaves too little of the step to tell it."""

_FULL = 1.01
"""Mean over least difference of neighbouring values, below which that is the step itself."""

_ENOUGH = 8
"""Values in the middle of the distribution that give the mean; with fewer all do."""


def hidden_step(pieces: Sequence[Excerpt]) -> float | None:
    """Return the least significant bit of a register whose values were rounded again.

    Returns
    -------
    float or None
        SI. None where the least difference of values is the step, or where there is none.
    """
    chosen = [piece.present for piece in pieces if len(piece.present) >= _FEWEST]
    chosen = chosen[:: max(1, len(chosen) // _PIECES)][:_PIECES]
    steps = [_hidden_step(values) for values in chosen]
    periods = [step for step in steps if step is not None]
    if 2 * len(periods) <= len(steps):
        return None
    step = float(np.median(periods))
    return step if max(abs(period / step - 1.0) for period in periods) < 0.05 else None


def _hidden_step(values: Array) -> float | None:
    levels, counts = np.unique(values, return_counts=True)
    gaps = np.diff(levels)
    least_sure = 1e-9 * np.abs(values).max()
    gaps = gaps[gaps > least_sure]
    # By the differences: a drift, or a jump, is no noise that steps are compared with.
    sigma = float(np.diff(values).std()) / math.sqrt(2.0)
    if len(gaps) < 2 or sigma == 0.0:
        return None
    low, high = np.quantile(values, [0.05, 0.95])
    usual = levels[(levels >= low) & (levels <= high)]
    usual = usual if len(usual) > _ENOUGH else levels
    if np.diff(usual).mean() < _FULL * gaps.min():
        return None
    frequency = _peak(levels, counts, sigma)
    if frequency is None or frequency * (high - low) < _PERIODS:
        return None
    lengths = np.unique(gaps)
    apart = np.concatenate((lengths[:1], np.diff(lengths)))
    return _without_mirror(levels, counts, float(apart[apart > least_sure].min()), frequency)


def _peak(levels: Array, counts: NDArray[np.int64], sigma: float) -> float | None:
    """Return the lowest frequency at which A has a peak, 1 / SI."""
    span = float(np.ptp(levels)) * (1.0 + 1.0 / _BINS)
    histogram = np.bincount(
        ((levels - levels[0]) / span * _BINS).astype(np.int64), weights=counts, minlength=_BINS
    )
    # Twice the length: a peak between two frequencies is not lost.
    height = np.abs(np.fft.rfft(histogram, 2 * _BINS)) / counts.sum()
    frequencies = np.arange(len(height)) / (2.0 * span)
    inner = slice(1, -1)
    peaks = (height[inner] >= height[:-2]) & (height[inner] >= height[2:]) & (height[inner] > _PEAK)
    peaks &= (frequencies[inner] > 1.0 / (_COARSEST * sigma)) & (
        frequencies[inner] < 1.0 / (_FINEST * sigma)
    )
    places = np.flatnonzero(peaks)
    if len(places) == 0:
        return None
    about = frequencies[places[0] + 1] + np.linspace(-0.75, 0.75, 61) / (2.0 * span)
    return float(about[np.argmax([_height(levels, counts, f) for f in about])])


def _height(levels: Array, counts: NDArray[np.int64], frequency: float) -> float:
    turned = np.exp(2j * np.pi * frequency * (levels - levels[0]))
    return float(np.abs(counts @ turned) / counts.sum())


def _without_mirror(
    levels: Array, counts: NDArray[np.int64], digit: float, frequency: float
) -> float | None:
    """Return the step of a peak; of values on the digits d, A is the same at f and at 1 / d - f."""
    multiples = (levels - levels[0]) / digit
    if np.abs(multiples - np.round(multiples)).max() > 0.05:
        # Scattered, and not by digits.
        scatter = 0.25 / frequency
        return 1.0 / frequency if _explained(levels, counts, frequency, scatter) else None
    height = _height(levels, counts, frequency)
    heights = {
        f: float(np.sinc(digit * f))
        for f in (frequency, 1.0 / digit - frequency)
        if 0.0 < digit * f < _COARSE_DIGITS
    }
    if not heights:
        return None
    best = min(heights, key=lambda f: abs(heights[f] - height))
    sure = abs(heights[best] - height) < _MATCH
    return 1.0 / best if sure and _explained(levels, counts, best, 0.6 * digit) else None


def _explained(levels: Array, counts: NDArray[np.int64], frequency: float, scatter: float) -> bool:
    """Tell whether the samples lie about the multiples of a step."""
    phases = frequency * (levels - levels[0])
    phases -= np.angle(counts @ np.exp(2j * np.pi * phases)) / (2.0 * np.pi)
    off = np.abs(phases - np.round(phases)) / frequency
    return bool(counts[off <= scatter].sum() > 0.95 * counts.sum())
