"""Missing samples drawn from their distribution, given the samples present and a noise model.

A spectrum needs a complete log. A missing sample becomes white noise, plus the slow part of the
noise: a simulated path, moved to the block means by a smoothed difference (conditional simulation:
J. Durbin and S. J. Koopman, Biometrika 89, 2002). Fit and filling alternate (data augmentation: M.
Tanner and W. Wong, J. Am. Stat. Assoc. 82, 1987).
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded
from scipy.signal import lfilter

from imubench_pipeline.allan.phase import Span
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

BLOCK_SAMPLES = 64  # Samples whose mean is one measurement of the slow part
_MAX_GAP_BLOCKS = 1024  # A longer gap splits the log: both sides are independent
_MIN_DRIVE = 1e-9  # Least step variance of the slow part, over the white noise variance of a mean


@dataclass(frozen=True)
class BlockMeans:
    """Means over the samples present in blocks of `BLOCK_SAMPLES`, no block over two segments."""

    begin: NDArray[np.int64]  # (b,): first sample
    end: NDArray[np.int64]  # (b,): one-past-last sample
    mean: Array  # (b,): rad/s or m/s²; 0 where no sample is present
    count: NDArray[np.int64]  # (b,): samples present

    def within(self, start: int, stop: int) -> slice:
        """Return the slice of the blocks that begin between two samples."""
        first, last = np.searchsorted(self.begin, [start, stop])
        return slice(int(first), int(last))


@dataclass(frozen=True)
class SlowPath:
    """The slow part of the noise, with the level of the log; it is linear between knots."""

    sample: Array  # (k,): places of the knots: the middles of blocks, and the ends of parts
    value: Array  # (k,): rad/s or m/s²

    def at(self, samples: NDArray[np.int64]) -> Array:
        """Return the slow part at samples of the log."""
        return np.interp(samples, self.sample, self.value)


def average_blocks(blocks: Iterable[Array], segments: Sequence[Span]) -> BlockMeans:
    """Return the means of blocks of a log with missing samples (NaN), in one pass."""
    begin = np.concatenate([np.arange(start, stop, BLOCK_SAMPLES) for start, stop in segments])
    ends = np.concatenate([np.full(-(-(b - a) // BLOCK_SAMPLES), b) for a, b in segments])
    end = np.minimum(begin + BLOCK_SAMPLES, ends)
    total, count = np.zeros(len(begin)), np.zeros(len(begin), dtype=np.int64)
    for place, present in yield_present_samples(blocks, begin, end):
        first, width = place[0], place[-1] + 1 - place[0]
        part = slice(first, first + width)
        total[part] += np.bincount(place - first, weights=present, minlength=width)
        count[part] += np.bincount(place - first, minlength=width)
    return BlockMeans(begin, end, total / np.maximum(count, 1), count)


def yield_present_samples(
    parts: Iterable[Array], begin: NDArray[np.int64], end: NDArray[np.int64]
) -> Iterator[tuple[NDArray[np.int64], Array]]:
    """Yield the block numbers of the samples that are present, and these samples, part by part.

    The parts are the log in order, NaN where a sample is missing. ``begin`` and ``end``, shape
    (b,), are first and one-past-last sample of each block, ascending. Samples outside of all blocks
    are left out.
    """
    reached = 0
    for values in parts:
        finite = np.flatnonzero(np.isfinite(values))
        place = np.searchsorted(begin, reached + finite, side="right") - 1
        inside = (place >= 0) & (reached + finite < end[place])
        if inside.any():
            yield place[inside], values[finite[inside]]
        reached += len(values)


def split_at_gaps(means: BlockMeans, segments: Sequence[Span]) -> tuple[Span, ...]:
    """Return segments divided at gaps that are too long to fill, with their ends trimmed."""
    parts: list[Span] = []
    for start, stop in segments:
        chosen = means.within(start, stop)
        occupied = np.flatnonzero(means.count[chosen] > 0) + chosen.start
        if len(occupied) == 0:
            continue
        cuts = np.flatnonzero(np.diff(occupied) > _MAX_GAP_BLOCKS)
        begins = means.begin[occupied[np.concatenate(([0], cuts + 1))]]
        ends = means.end[occupied[np.append(cuts, len(occupied) - 1)]]
        parts += zip(begins.tolist(), ends.tolist(), strict=True)
    return tuple(parts)


def draw_slow_part(
    means: BlockMeans,
    parts: Sequence[Span],
    model: NoiseModel,
    rate: float,
    rng: np.random.Generator,
) -> SlowPath:
    """Draw the slow part of the noise, given the means of blocks in parts (`split_at_gaps`).

    A slow path is simulated. The difference between the measured and the simulated means is
    smoothed as a random walk in white noise, linear across a gap, and added to the path.
    """
    interval = BLOCK_SAMPLES / rate
    white = max(model.N**2 * rate, 1e-300)
    places, values = [], []
    for start, stop in parts:
        chosen = means.within(start, stop)
        middle = 0.5 * (means.begin[chosen] + means.end[chosen] - 1)
        count, n = means.count[chosen], len(middle)
        path, drive = np.zeros(n), _MIN_DRIVE / BLOCK_SAMPLES
        for term in model.realised(interval, max(n, 2) * interval):
            if term.drive is None or term.drive.process is None:
                continue
            space = term.state_space(interval)
            decay, step = float(space.transition[0, 0]), float(space.process_noise[0, 0])
            noise = math.sqrt(step) * rng.standard_normal(n)
            noise[0] = math.sqrt(float(space.initial_variance[0, 0])) * rng.standard_normal()
            path += lfilter([1.0], [1.0, -decay], noise)
            # Means do not tell the sample beside a mean of a process that is faster than a block.
            drive += decay**2 * step / white
        simulated = path + np.sqrt(white / np.maximum(count, 1)) * rng.standard_normal(n)
        ramp = model.R * middle / rate
        difference = means.mean[chosen] - ramp - simulated
        # The mean of a random walk with steps of variance ``drive``, given the differences.
        if n > 1:
            diagonal = count + 2.0 / drive
            diagonal[[0, -1]] -= 1.0 / drive
            bands = np.array([np.full(n, -1.0 / drive), diagonal])
            difference = solveh_banded(bands, count * difference)
        path += difference
        # The path is level from the last middle to the end of the part, which lies before a
        # jump: between this knot and the first of the next part there is no sample.
        place = np.concatenate(([start - 0.25], middle, [stop - 0.75]))
        places.append(place)
        values.append(np.concatenate((path[:1], path, path[-1:])) + model.R * place / rate)
    return SlowPath(np.concatenate(places), np.concatenate(values))


def fill_missing(
    blocks: Iterable[Array],
    path: SlowPath,
    model: NoiseModel,
    rate: float,
    rng: np.random.Generator,
) -> Iterator[Array]:
    """Yield the blocks of a log, with each NaN replaced by the slow path plus white noise."""
    reached = 0
    for values in blocks:
        missing = np.flatnonzero(~np.isfinite(values))
        complete = values
        if len(missing):
            complete = np.array(values, dtype=np.float64)
            white = model.N * math.sqrt(rate) * rng.standard_normal(len(missing))
            complete[missing] = path.at(reached + missing) + white
        reached += len(values)
        yield complete
