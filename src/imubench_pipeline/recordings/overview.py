"""Compute envelope over time and histogram of each channel, to draw 1e8 samples on a page.

Each channel is read twice, in bounded memory. Times are on the uniform grid, from the first sample
of the file on: holes have their length, pauses between segments have none.
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.model.estimates import EnvelopeRow, HistogramRow
from imubench_pipeline.recordings import recording as kept
from imubench_pipeline.settings.sensor import TEMPERATURE
from imubench_pipeline.tables.keys import Key
from imubench_pipeline.typing import Array

BUCKETS = 400  # default number of intervals of time of an envelope
BUCKETS_OF_TURNS = 2400  # the same of a recording with turns in it, which should be seen
MOST_BINS = 120  # bins of a histogram; at least half as many, if there are the levels
_BINS = 100  # where no steps show
_DRAWN = 1 << 16  # samples, spread over the recording, from which the bins are derived
_BEYOND = 0.8  # widths of the middle that bins go beyond it: to 6 standard deviations
_SAME = 0.01  # part of the mean gap between levels within which two are one, written in two ways
_GOLDEN_RATIO = 0.6180339887498949
_LOW, _HIGH, TOTAL, PRESENT = range(4)


@dataclass(frozen=True)
class Overview:
    """Rows of the tables ``envelope`` and ``histogram`` of one recording."""

    envelope: list[EnvelopeRow]
    histogram: list[HistogramRow]


def overview(folder: Path, sensor: str, recording: str, buckets: int | None = None) -> Overview:
    """Return envelopes and histograms of a recording; no row if it was rejected.

    Channels that cannot be analysed are left out. The temperature has only an envelope. ``folder``:
    of its ``log*.parquet``. ``buckets``: largest number of intervals of an envelope; None:
    `BUCKETS`, or `BUCKETS_OF_TURNS` if the sensor was turned.
    """
    result = Overview([], [])
    logs = [*kept.open_channel_logs(folder).values()]
    for path in kept.list_log_files(folder):
        if TEMPERATURE in pq.read_schema(path).names:
            about = kept.read_metadata(path)
            logs.append(kept.ChannelLog(path, TEMPERATURE, about.rate, about.grid, (), holes=True))
    if buckets is None:
        buckets = BUCKETS if kept.was_at_rest(folder) else BUCKETS_OF_TURNS
    for log in logs:
        key = Key(sensor, recording, log.channel)
        edges = bucket_edges(log.grid, buckets)
        stride = max(1.0, pq.read_metadata(log.path).num_rows / _DRAWN)
        figures, picked, reached = no_figures(edges), [], 0
        for values in log.blocks():
            gather(values, reached, edges, figures)
            reached += len(values)
            present = values[~np.isnan(values)] if log.holes else values
            # A sample out of so many, at distances that no oscillation has for its period.
            number = np.arange(np.ceil(len(present) / stride))
            at = (number + number * _GOLDEN_RATIO % 1.0) * stride
            picked.append(present[at[at < len(present)].astype(np.int64)])
        drawn = np.concatenate(picked)
        if len(drawn) == 0:
            continue
        times = edges / log.rate + kept.read_metadata(log.path).begins
        result.envelope.extend(envelope_rows(key, times, figures))
        if log.channel != TEMPERATURE:
            low, high = float(figures[:, _LOW].min()), float(figures[:, _HIGH].max())
            limits = bin_edges(drawn, low, high)
            counts = np.zeros(len(limits) - 1, dtype=np.int64)
            for values in log.blocks():
                _count(values, limits, counts)
            bins = zip(limits[:-1].tolist(), limits[1:].tolist(), counts.tolist(), strict=True)
            result.histogram.extend(
                HistogramRow(**asdict(key), lower=a, upper=b, count=n) for a, b, n in bins
            )
    return result


def bucket_edges(grid: int, buckets: int) -> NDArray[np.int64]:
    """Return the first grid point of each bucket, and the end of the last one, shape (b + 1,)."""
    number = min(buckets, grid)
    return np.array([grid * i // number for i in range(number + 1)], dtype=np.int64)


def no_figures(edges: NDArray[np.int64]) -> Array:
    """Return minimum, maximum, sum and number of samples of empty buckets, shape (b, 4)."""
    return np.tile([np.inf, -np.inf, 0.0, 0.0], (len(edges) - 1, 1))


def envelope_rows(key: Key, times: Array, figures: Array) -> Iterator[EnvelopeRow]:
    """Yield rows of ``envelope``: ``times`` of edges, s, shape (b + 1,); figures: `no_figures`."""
    spans = zip(times[:-1].tolist(), times[1:].tolist(), figures.tolist(), strict=True)
    for start, end, (low, high, total, present) in spans:
        row = EnvelopeRow(**asdict(key), start=start, end=end, samples=int(present))
        # Rounding can put the mean of equal samples beside them.
        mean = min(max(total / present, low), high) if present else None
        yield replace(row, low=low, high=high, mean=mean) if present else row


def bin_edges(drawn: Array, low: float, high: float) -> Array:
    """Return the edges of the bins of a histogram, SI, increasing, shape (n + 1,).

    ``drawn``: some of the samples, SI; ``low``, ``high``: extremes of all samples. The bins are
    equally wide, over some 6 standard deviations on either side; the outermost ones end at the
    extremes. If the samples are quantised, each bin has a whole number of levels. If all samples
    are equal, two equal edges are returned.
    """
    if low == high:
        return np.array([low, high])
    # The sorted samples without the outermost ones, of which few may be outliers.
    ordered = np.sort(drawn)
    size = len(ordered)
    for tail in (max(size // 100, 2), size // 1000, size // 10000, 0):
        cut = min(tail, size // 4)
        middle = ordered[cut : size - cut]
        if middle[0] < middle[-1]:
            break
    beyond = _BEYOND * (middle[-1] - middle[0])
    start, stop = max(middle[0] - beyond, low), min(middle[-1] + beyond, high)
    lattice = _lattice(middle)
    if lattice is None:
        edges = np.linspace(start, stop, _BINS + 1)
        edges[[0, -1]] = low, high
    else:
        step, level = lattice
        if high - low < (MOST_BINS - 1) * step:
            start, stop = low, high
        lowest, highest = np.rint((np.array([start, stop]) - level) / step)
        together = np.ceil((highest - lowest + 1.0) / MOST_BINS)
        number = np.ceil((highest - lowest + 1.0) / together)
        edges = level + (lowest - 0.5 + together * np.arange(number + 1.0)) * step
        edges[0], edges[-1] = min(edges[0], low), max(edges[-1], high)
    return np.unique(edges)  # the steps of float64 can be wider than a bin


def _lattice(ordered: Array) -> tuple[float, float] | None:
    """Return the step and one level of quantised samples; None if no steps are visible."""
    levels = np.unique(ordered)
    if not 1 < len(levels) <= 0.5 * len(ordered):
        return None
    gaps = np.diff(levels)
    levels = levels[np.append(True, gaps > _SAME * gaps.mean())]
    gaps = np.diff(levels)
    centre = levels.mean()
    # Steps of 0.0061 are printed as 0.006 or 0.007: their number decides, unless levels are
    # missing.
    counted = np.append(0.0, np.cumsum(np.rint(gaps / gaps.min())))
    for number in (np.arange(float(len(levels))), counted):
        centred = number - number.mean()
        step = float(centred @ (levels - centre) / (centred @ centred))
        if np.abs(levels - centre - step * centred).max() < 0.5 * step:
            return step, float(centre - step * number.mean())
    return None


@njit(cache=True, nogil=True)
def gather(values: Array, reached: int, edges: NDArray[np.int64], figures: Array) -> None:
    """Add values, from grid point ``reached`` on, to ``figures`` of the buckets, shape (b, 4)."""
    bucket, begin = 0, 0
    while edges[bucket + 1] <= reached:
        bucket += 1
    while begin < values.size:
        end = min(values.size, edges[bucket + 1] - reached)
        low, high = figures[bucket, 0], figures[bucket, 1]
        total, present = figures[bucket, 2], figures[bucket, 3]
        for i in range(begin, end):
            x = values[i]
            if not np.isnan(x):
                low, high = min(low, x), max(high, x)
                total += x
                present += 1.0
        figures[bucket, 0], figures[bucket, 1] = low, high
        figures[bucket, 2], figures[bucket, 3] = total, present
        begin = end
        bucket += 1


@njit(cache=True, nogil=True)
def _count(values: Array, edges: Array, counts: NDArray[np.int64]) -> None:
    """Count samples by bin, as `numpy.histogram` does; NaN is missing."""
    last = counts.size - 1
    # The bins at the ends may be wider than the others.
    width = (edges[last] - edges[1]) / max(last - 1, 1)
    scale = 1.0 / width if width > 0.0 else 0.0
    for i in range(values.size):
        x = values[i]
        if np.isnan(x):
            continue
        guess = 1.0 + (x - edges[1]) * scale
        k = last if guess >= last else int(guess) if guess > 0.0 else 0
        while k > 0 and x < edges[k]:
            k -= 1
        while k < last and x >= edges[k + 1]:
            k += 1
        counts[k] += 1
