"""Find samples that were interpolated: lost ones that were filled by straight lines."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.recordings.quality.summary import Excerpt
from imubench_pipeline.typing import Array

_ROUNDING = 16.0 * np.finfo(np.float64).eps  # of a second difference, over the largest sample
_CALM = 0.02  # Second differences below it, over their standard deviation, are not noise
_MEDIAN_OF_NORMAL = 0.6745  # Median of the absolute value of a standard normal variate
_DENSITY_OF_NORMAL = 0.8  # Probability of absolute values below x is nearly 0.8 x
_MAX_CHANCE = 1e-3  # Of one such run anywhere in a log without interpolated samples
_MIN_RUN = 3  # samples
_MIN_SAMPLES = 1000
_MAX_SHARE = 0.2  # Beyond it the log was interpolated to a higher rate, and not at gaps


@dataclass(frozen=True)
class StraightLines:
    """What distinguishes interpolated samples: second differences, SI, below a tolerance."""

    tolerance: float
    least: int  # consecutive samples


def detect_interpolation(pieces: Iterable[Excerpt], records: int) -> list[StraightLines]:
    """Return the rules that find interpolated samples; none in a log without any.

    Samples on a straight line have a second difference of 0, to the rounding of float64, or of the
    digits of a file. By chance noise has such a run with a probability of p^n. ``records`` is the
    number of records of the column.
    """
    parts = [piece.values for piece in pieces if len(piece.values) > 2]
    second = np.concatenate([np.abs(np.diff(part, 2)) for part in parts]) if parts else np.empty(0)
    second = second[np.isfinite(second)]
    if len(second) < _MIN_SAMPLES:
        return []
    deviation = float(np.median(second)) / _MEDIAN_OF_NORMAL
    if not deviation > 0.0:
        return []
    largest = float(np.nanmax([np.nanmax(np.abs(part), initial=0.0) for part in parts]))
    rules = []
    for tolerance in (_ROUNDING * largest, _CALM * deviation):
        single = _count_single(parts, tolerance) / len(second)
        chance = min(max(_DENSITY_OF_NORMAL * tolerance / deviation, single, 1e-6), 0.9)
        needed = math.ceil(math.log(_MAX_CHANCE / records) / math.log(chance))
        rule = StraightLines(tolerance, max(_MIN_RUN, needed))
        found = sum(int(mark_straight_lines(part, [rule]).sum()) for part in parts)
        if 0 < found <= _MAX_SHARE * len(second):
            rules.append(rule)
    return rules


def mark_straight_lines(values: Array, rules: Iterable[StraightLines]) -> NDArray[np.bool_]:
    """Return which samples lie on straight lines between their neighbours, bool, shape (n,)."""
    marked = np.zeros(len(values), dtype=np.bool_)
    if len(values) < 3:
        return marked
    second = np.abs(np.diff(values, 2))
    for rule in rules:
        for first, last in _list_runs(second <= rule.tolerance):
            constant = values[last + 1] == values[first]  # repeats, and no line
            if last - first >= rule.least and not constant:
                marked[first + 1 : last + 1] = True
    return marked


def _list_runs(calm: NDArray[np.bool_]) -> list[tuple[int, int]]:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], calm.astype(np.int8), [0]))))
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]


def _count_single(parts: list[Array], tolerance: float) -> int:
    """Return the number of calm second differences between two that are not."""
    number = 0
    for part in parts:
        calm = np.abs(np.diff(part, 2)) <= tolerance
        number += int((calm[1:-1] & ~calm[:-2] & ~calm[2:]).sum())
    return number
