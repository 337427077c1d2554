"""Samples that repeat the one before more often than a coarse register explains."""

from __future__ import annotations

import math

from imubench_pipeline.recordings.quality.summary import ColumnSummary

_SURE = 4.0
"""Standard errors by which counts may be off."""

_COARSEST, _FINEST = 0.6, 300.0
"""Standard deviation of the difference of neighbours, in steps of the register, that can be told
from how many of the changes are by one step: of smaller ones all are, and it matters where between
two steps the mean lies."""


def repeats_beyond_chance(column: ColumnSummary) -> tuple[float, float]:
    """Return the share of samples that are repeated for another reason than rounding.

    A register that is read faster than it is written repeats samples, and changes as between
    independent samples in between. Two things repeat samples, too, and are taken off, the larger of
    them: as many samples as are equal to one `summary.FAR` before (those of coarse steps, in any
    order), and as many as rounding makes of normal noise of which as many changes are by one step
    (noise behind a low-pass, whose neighbours are alike).

    Returns
    -------
    (beyond, chance) : float
        Parts of all samples, and of those that could be equal.
    """
    pairs, far_pairs = column.pairs, column.far_pairs
    if pairs == 0 or far_pairs == 0:
        return 0.0, 0.0
    share = column.repeats / pairs
    shuffled = column.far_repeats / far_pairs
    shuffled += _SURE * math.sqrt(shuffled * (1.0 - shuffled) / far_pairs)
    chance = min(max(shuffled, _rounded(column.single_steps, column.steps)), 1.0)
    if share <= chance:
        return 0.0, chance
    beyond = (share - chance) / (1.0 - chance)
    return beyond * pairs / max(column.present - 1, 1), chance


def _rounded(single: int, steps: int) -> float:
    """Return the share of repeats in rounded normal noise with so many changes by one step."""
    if steps == 0:
        return 1.0
    part = single / steps
    part += _SURE * math.sqrt((part * (1.0 - part) + 1.0 / steps) / steps)
    low, high = _COARSEST, _FINEST
    if part >= _parts(low)[1]:
        return 1.0
    for _ in range(50):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if _parts(middle)[1] > part else (low, middle)
    return _parts(low)[0]


def _parts(deviation: float) -> tuple[float, float]:
    """Return which part of neighbours is equal, and which part of the changes is by one step.

    Their difference d is normal; rounded at a random place it is k steps with a chance of
    1 - |d - k|, so that with G(x) = E[(d - x)⁺] the part is G(k - 1) - 2 G(k) + G(k + 1).

    Parameters
    ----------
    deviation : float
        Of d, in steps.
    """
    below, none, one, two = (_excess(x, deviation) for x in (-1.0, 0.0, 1.0, 2.0))
    equal = below - 2.0 * none + one
    return equal, 2.0 * (none - 2.0 * one + two) / (1.0 - equal)


def _excess(x: float, deviation: float) -> float:
    """Return E[(d - x)⁺] of a normal d."""
    z = x / deviation
    density = math.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
    return deviation * density - 0.5 * x * math.erfc(z / math.sqrt(2.0))
