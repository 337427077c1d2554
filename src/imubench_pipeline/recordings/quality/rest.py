"""Find the parts of a log in which the sensor was moved.

A sensor that is moved has slow and large signals. At rest the deviation of means of 0.1 to 3 s is
far smaller than of single samples: also behind a low-pass filter, or in a wrong unit.
"""

import math
from collections.abc import Iterable
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.recordings.quality.summary import ColumnSummary, compute_finite_median
from imubench_pipeline.typing import Array

T = TypeVar("T", int, float)

_MAX_CREST_FACTOR = 6.0  # of extremes over deviation; a knock exceeds it
_CALM_QUANTILE = 0.2  # of the deviations of blocks: at rest, if the log is at rest for a fifth
_MIN_CHANGE = {"gyro": math.radians(2.0), "accel": 0.5}
"""SI, change of the mean that is a rotation, or another attitude: warm-ups are smaller."""

_AVERAGES = np.geomspace(0.1, 3.0, 7)  # s
_MIN_DEVIATION = {"gyro": math.radians(0.5), "accel": 0.2}
"""SI, of means of 0.1 to 3 s. Gyros at rest have at most 0.2 °/s."""

_NARROWEST_FILTER = 5.0  # Hz, of usual sensors
_MIN_SLOW_NOISE = 8.0
"""Ratio of the noise densities of such means and of single samples, over the ratio of white noise
behind the narrowest filter: 190 in all at 100 Hz. Logs of a sensor in a hand have 600 and more in
all, 40 channels of real logs at rest 1 to 2.5."""

_MIN_CLUSTERS = 8
_WINDOW, _MIN_WINDOW = 5.0, 256  # s and samples that are judged together
_MAX_MOVING_SHARE = 0.8  # of windows; beyond, no part is at rest


def find_still_spans(
    moved: Iterable[tuple[float, float]], begin: float, end: float
) -> list[tuple[float, float]]:
    """Return the spans at rest between the spans in which any axis was moved, all in s."""
    spans, reached = [], begin
    for start, stop in sorted(moved):
        if start > reached:
            spans.append((reached, start))
        reached = max(reached, stop)
    return [*spans, (reached, end)] if end > reached else spans


def merge_spans(spans: Iterable[tuple[T, T]]) -> list[tuple[T, T]]:
    """Return the spans, sorted; spans that touch or overlap are joined."""
    merged: list[tuple[T, T]] = []
    for start, stop in sorted(spans):
        if merged and start <= merged[-1][1]:
            merged[-1] = merged[-1][0], max(stop, merged[-1][1])
        else:
            merged.append((start, stop))
    return merged


def find_motion(
    column: ColumnSummary, quantity: str, rate: float, times: float, least: float = 0.0
) -> list[tuple[int, int]]:
    """Return the parts (first, one past last record) in which the sensor was moved.

    ``times``: least ratio of the standard deviation to its value at rest. ``least``: least
    standard deviation, SI. Knocks are no motion.
    """
    # The windows with the slow signals of a sensor in motion
    least_mean = _MIN_DEVIATION[quantity]
    size, windows, slow = max(round(_WINDOW * rate), _MIN_WINDOW), 0, []
    for piece in column.excerpts():
        first = piece.first
        parts = np.array_split(piece.values, max(len(piece.values) // size, 1))
        present = [part[np.isfinite(part)] for part in parts]
        # Windows of one length are judged in one call
        alike = len({len(samples) for samples in present}) == 1
        rows = [np.array(present)] if alike else [samples[None] for samples in present]
        moving = np.concatenate([_have_slow_signals(row, rate, least_mean) for row in rows])
        for part, moves in zip(parts, moving, strict=True):
            if moves:
                slow.append((first, first + len(part)))
            first, windows = first + len(part), windows + 1
    if len(slow) > _MAX_MOVING_SHARE * windows:
        return [(0, column.present + column.missing)]
    blocks = column.blocks()
    # The deviation of calm blocks; coarse registers may have none in many blocks
    spread = blocks.spread[np.isfinite(blocks.spread)]
    if len(spread) == 0:
        calm = 0.0
    else:
        calm = float(np.quantile(spread, _CALM_QUANTILE)) or float(np.median(spread))
    if not calm > 0.0:
        return merge_spans(slow)
    reach = np.maximum(blocks.high - blocks.mean, blocks.mean - blocks.low)
    moving = blocks.spread > max(times * calm, least)
    still = blocks.spread < times * calm
    turned = np.abs(blocks.mean - compute_finite_median(blocks.mean[still]))
    moving |= turned > max(_MIN_CHANGE[quantity], times * calm)
    places = np.flatnonzero(moving & (reach < _MAX_CREST_FACTOR * blocks.spread))
    groups = np.split(places, np.flatnonzero(np.diff(places) > 2) + 1) if len(places) else []
    return merge_spans(
        [*slow, *((int(g[0]) * blocks.size, (int(g[-1]) + 1) * blocks.size) for g in groups)]
    )


def _have_slow_signals(samples: Array, rate: float, least: float) -> NDArray[np.bool_]:
    """Return for windows, shape (w, n), whether they have slow and large signals, shape (w,).

    Means of 0.1 to 3 s then deviate more than ``least``, SI, and far more than noise.
    """
    number, length = samples.shape
    slow = np.zeros(number, np.bool_)
    if length < 2:
        return slow
    single = np.mean(np.diff(samples) ** 2, axis=1)
    pole = math.exp(-2.0 * math.pi * _NARROWEST_FILTER / rate)
    ratio = _MIN_SLOW_NOISE * (1.0 + pole) / (1.0 - pole) ** 2
    for size in np.unique(np.rint(_AVERAGES * rate).astype(int)):
        clusters = length // max(size, 1)
        if size < 2 or clusters < _MIN_CLUSTERS:
            continue
        means = samples[:, : clusters * size].reshape(number, clusters, size).mean(axis=2)
        squares = np.mean(np.diff(means) ** 2, axis=1)
        slow |= (squares > 2.0 * least**2) & (squares * size > ratio * single)
    return slow
