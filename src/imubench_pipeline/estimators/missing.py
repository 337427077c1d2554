"""Missing samples drawn from their distribution, given the samples present and a noise model.

A spectrum needs a complete log. A missing sample becomes white noise, plus the slow part of the
noise, which a Kalman smoother interpolates from the block means on both sides (J. Durbin and S. J.
Koopman, Biometrika 89, 2002). Fit and filling alternate (data augmentation: M. Tanner and W. Wong,
J. Am. Stat. Assoc. 82, 1987).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.allan.phase import Span
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.state_space import StateSpace
from imubench_pipeline.typing import Array

BLOCK_SAMPLES = 64  # Samples whose mean is one measurement of the slow part
_WINDOW_BLOCKS = 4096
_MAX_GAP_BLOCKS = 1024  # A longer gap splits the log: both sides are independent
_DIFFUSE_RATIO = 1e4


@dataclass(frozen=True)
class BlockMeans:
    """Means over the samples present in blocks of `BLOCK_SAMPLES`, no block over two segments."""

    begin: NDArray[np.int64]  # (b,): first sample
    end: NDArray[np.int64]  # (b,): one-past-last sample
    mean: Array  # (b,): rad/s or m/s²; 0 where no sample is present
    count: NDArray[np.int64]  # (b,): samples present

    def within(self, start: int, stop: int) -> slice:
        """Return the blocks from one sample to another."""
        first, last = np.searchsorted(self.begin, [start, stop])
        return slice(int(first), int(last))


@dataclass(frozen=True)
class SlowPath:
    """The slow part of the noise, the level of the log included, linear between knots."""

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
    """Yield the samples of a log that are present, and the blocks that they belong to.

    The parts are the log in order, NaN where a sample is missing; ``begin`` and ``end``, shape
    (b,), first and one-past-last sample of each block, rising. Samples outside the blocks are left
    out.
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
    """Divide segments at gaps that are too long to fill, and trim their ends."""
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
    """Draw the slow part of the noise, given the means of blocks in parts (`split_at_gaps`)."""
    interval = BLOCK_SAMPLES / rate
    white = max(model.N**2 * rate, 1e-300)
    places, values = [], []
    for start, stop in parts:
        chosen = means.within(start, stop)
        middle = 0.5 * (means.begin[chosen] + means.end[chosen] - 1)
        ramp = model.R * middle / rate
        mean, count = means.mean[chosen] - ramp, means.count[chosen]
        spread = float(np.std(mean[count > 0])) + math.sqrt(white)
        level = float(mean[count > 0].mean())
        terms = [
            term.state_space(interval)
            for term in model.realised(interval, max(len(mean), 2) * interval)
            if term.drive is not None and term.drive.process is not None
        ]
        # The level is constant, but unknown.
        terms.append(StateSpace.scalar(1.0, 0.0, _DIFFUSE_RATIO * spread**2))
        decay = np.array([space.transition[0, 0] for space in terms])
        drive = np.array([space.process_noise[0, 0] for space in terms])
        begin = np.array([space.initial_variance[0, 0] for space in terms])
        # A random walk starts at the level.
        normals = rng.standard_normal((len(mean), len(terms) + 1))
        state = np.sqrt(np.append(begin[:-1], 0.0)) * rng.standard_normal(len(terms))
        error = white / np.maximum(count, 1)
        path = level + _draw_state_sum(
            mean - level, count > 0, error, decay, drive, begin, state, normals
        )
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
    """Yield the blocks of a log with missing samples (NaN) drawn: path plus white noise."""
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


@njit(cache=True)
def _draw_state_sum(
    mean: Array,
    present: NDArray[np.bool_],
    error: Array,
    decay: Array,
    drive: Array,
    begin: Array,
    state: Array,
    normals: Array,
) -> Array:
    """Draw the sum of scalar states given measurements of it (Durbin and Koopman's smoother)."""
    # The smoothed difference between the real and simulated measurements is added to a simulated
    # path, in windows, each with a look ahead.
    # Plain loops: expressions of arrays take four times as long to compile.
    n, s = len(mean), len(decay)
    simulated, difference, path = np.empty(n), np.zeros(n), np.empty(n)
    for k in range(n):
        simulated[k] = 0.0
        for a in range(s):
            simulated[k] += state[a]
        if present[k]:
            difference[k] = mean[k] - simulated[k] - math.sqrt(error[k]) * normals[k, s]
        for a in range(s):
            state[a] = decay[a] * state[a] + math.sqrt(drive[a]) * normals[k, a]
    size = min(n, _WINDOW_BLOCKS + _MAX_GAP_BLOCKS)
    means, gains = np.zeros((size + 1, s)), np.zeros((size, s))
    spreads = np.zeros((size + 1, s, s))
    innovations = np.empty(size)
    total, back = np.empty(s), np.empty(s)
    for a in range(s):
        spreads[0, a, a] = begin[a]
    for first in range(0, n, _WINDOW_BLOCKS):
        last = min(n, first + _WINDOW_BLOCKS + _MAX_GAP_BLOCKS)
        for k in range(first, last):
            i = k - first
            wrong, variance = difference[k], error[k]
            for a in range(s):
                wrong -= means[i, a]
                total[a] = 0.0
                for b in range(s):
                    total[a] += spreads[i, a, b]
                variance += total[a]
            innovations[i] = wrong / variance
            for a in range(s):
                gains[i, a] = total[a] / variance if present[k] else 0.0
            for a in range(s):
                means[i + 1, a] = decay[a] * (means[i, a] + gains[i, a] * wrong)
                for b in range(s):
                    spread = spreads[i, a, b] - gains[i, a] * total[b]
                    spreads[i + 1, a, b] = decay[a] * decay[b] * spread
                spreads[i + 1, a, a] += drive[a]
        back[:] = 0.0
        for k in range(last - 1, first - 1, -1):
            i = k - first
            along = 0.0
            for a in range(s):
                back[a] *= decay[a]
                along += gains[i, a] * back[a]
            if present[k]:
                # L = Phi (I - gain H): its transpose, and H / F times the innovation.
                for a in range(s):
                    back[a] += innovations[i] - along
            if k < first + _WINDOW_BLOCKS:
                path[k] = simulated[k]
                for a in range(s):
                    path[k] += means[i, a]
                    for b in range(s):
                        path[k] += spreads[i, a, b] * back[b]
        # The next window begins with what was known where this one ends.
        if first + _WINDOW_BLOCKS < last:
            means[0], spreads[0] = means[_WINDOW_BLOCKS], spreads[_WINDOW_BLOCKS]
    return path
