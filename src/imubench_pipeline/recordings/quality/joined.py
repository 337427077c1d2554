"""Find logs of two sensors in one: one after the other, or with alternating samples.

Where two of level, noise and register step change at once, the data of another sensor begin, or of
another range. Motion changes the level alone, and vibration the noise.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.recordings.quality.levels import find_hidden_step
from imubench_pipeline.recordings.quality.summary import PIECE_SIZE, ColumnSummary, Excerpt
from imubench_pipeline.tables.findings import Finding, find
from imubench_pipeline.typing import Array
from imubench_pipeline.words.findings.samples import Change, Interleaved, Joined

_CHANGE_SIGMAS = 8.0  # least change of level or noise, in standard deviations
_MIN_LOG_NOISE_CHANGE = math.log(1.2)
"""Least change of the log of the noise: one log of one sensor has a ratio of 1.12 with a small step
of its level."""

_MIN_LOG_NOISE_ALTERNATION = math.log(1.05)
"""Least log ratio of alternating noise; only a spectral line at a quarter of the rate makes the
noise of one sensor alternate."""

_MIN_NOISE_WIDTH, _MAX_NOISE_WIDTH = 8, 64  # blocks on either side that are compared
_LEVEL_WIDTH = 4  # number of blocks on either side whose mean is compared
_MIN_STEP_RATIO = 1.2  # least ratio of the steps of two different registers
_MIN_LEVEL_ALTERNATION = 5.0  # in standard deviations, if nothing else alternates
_PAIRS_PER_PART = 128  # pairs of samples in a part
_MEDIAN_SD_OVER_MEAN_SD = 1.2533  # standard deviations, for normal noise
_SD_OVER_MAD = 1.4826  # standard deviation over the median absolute deviation, of normal noise


def find_joined_logs(channel: str, column: ColumnSummary, rate: float) -> Iterator[Finding]:
    """Yield a finding if the data of another sensor seem to begin in the log; ``rate`` in Hz."""
    blocks = column.blocks()
    filled = np.flatnonzero(blocks.spread > 0.0)
    if len(filled) < 4 * _MIN_NOISE_WIDTH:
        return
    mean, logs = blocks.mean[filled], np.log(blocks.spread[filled])
    level, noise = _scale_level_changes(mean), _scale_noise_changes(logs)
    for place in dict.fromkeys(int(np.argmax(np.abs(series))) for series in (noise, level)):
        near = slice(max(0, place - 2), place + 3)
        if np.abs(level[near]).max() > _CHANGE_SIGMAS:
            last = min(len(mean) - 1, place + _LEVEL_WIDTH + 1)
            around = np.arange(max(1, place - _LEVEL_WIDTH), last)
            place = int(around[np.argmax(np.abs(mean[around + 1] - mean[around - 1]))])
        record = int(filled[place]) * blocks.size + blocks.size // 2
        changes: dict[Change, bool] = {
            "level": bool(np.abs(level[near]).max() > _CHANGE_SIGMAS),
            "noise": bool(np.abs(noise[near]).max() > _CHANGE_SIGMAS)
            and _is_lasting(logs, place)
            and abs(np.median(logs[place:]) - np.median(logs[:place])) > _MIN_LOG_NOISE_CHANGE,
        }
        if any(changes.values()):
            # The margin allows for the unknown record of the change.
            before, after, margin = [], [], 3 * blocks.size
            for piece in column.excerpts():
                begin, end = (max(record - piece.first + m, 0) for m in (-margin, margin))
                before.append(Excerpt(piece.first, piece.values[:begin]))
                after.append(Excerpt(piece.first, piece.values[end:]))
            changes["steps"] = _has_different_steps(
                detect_register_step(before), detect_register_step(after)
            )
        changed = [name for name, differs in changes.items() if differs]
        if len(changed) < 2:
            continue
        ratio = math.exp(float(np.median(logs[place:]) - np.median(logs[:place])))
        at = record / rate
        yield find(Joined(tuple(changed), at, ratio), "warning", ratio, channel, at, at)
        return


def _scale_level_changes(mean: Array) -> Array:
    """Return the change of the level at each block, in standard deviations of such changes."""
    changes = np.zeros(len(mean))
    sums = np.concatenate(([0.0], np.cumsum(mean - mean[0])))
    inner = np.arange(_LEVEL_WIDTH, len(mean) - _LEVEL_WIDTH)
    # The block with the change itself is left out.
    after = sums[inner + _LEVEL_WIDTH + 1] - sums[inner + 1]
    before = sums[inner] - sums[inner - _LEVEL_WIDTH]
    changes[inner] = (after - before) / _LEVEL_WIDTH
    scale = _SD_OVER_MAD * float(np.median(np.abs(changes[inner] - np.median(changes[inner]))))
    return changes / scale if scale > 0.0 else np.zeros(len(mean))


def _scale_noise_changes(logs: Array) -> Array:
    """Return the change of the noise at each block, in standard deviations of such changes."""
    width = min(max(len(logs) // 16, _MIN_NOISE_WIDTH), _MAX_NOISE_WIDTH)
    scatter = _SD_OVER_MAD * float(np.median(np.abs(np.diff(logs)))) / math.sqrt(2.0)
    changes = np.zeros(len(logs))
    if scatter == 0.0 or len(logs) < 3 * width:
        return changes
    sums = np.concatenate(([0.0], np.cumsum(logs)))
    inner = np.arange(width, len(logs) - width)
    after = sums[inner + width + 1] - sums[inner + 1]
    before = sums[inner] - sums[inner - width]
    changes[inner] = (after - before) / width / (scatter * math.sqrt(2.0 / width))
    return changes


def _is_lasting(logs: Array, place: int) -> bool:
    """Return whether the noise differs over all blocks before and after a place."""
    before, after = logs[: max(place - 1, 1)], logs[place + 2 :]
    if min(len(before), len(after)) < _MIN_NOISE_WIDTH:
        return False
    low, high = (before, after) if np.median(before) < np.median(after) else (after, before)
    return bool(np.quantile(low, 0.9) < np.quantile(high, 0.5)) and bool(
        np.quantile(low, 0.5) < np.quantile(high, 0.1)
    )


def detect_register_step(pieces: Sequence[Excerpt]) -> tuple[float, float] | None:
    """Return the register step (infinite if not seen) and the finest detectable, SI; or None."""
    whole = [piece for piece in pieces if len(piece.values) >= PIECE_SIZE // 4]
    values = [piece.present for piece in whole if len(piece.present) >= PIECE_SIZE // 8]
    if not values:
        return None
    joint = np.concatenate(values[:: max(1, len(values) // 4)][:4])
    spread = float(np.median([some.std() for some in values]))
    gaps = np.diff(np.unique(joint))
    gaps = gaps[gaps > 1e-9 * np.abs(joint).max()]
    if len(gaps) == 0 or spread == 0.0:
        return None
    seen = 20.0 * spread / len(joint)
    step = find_hidden_step(whole) or float(gaps.min())
    return (step if step > seen else math.inf), seen


def _has_different_steps(
    first: tuple[float, float] | None, other: tuple[float, float] | None
) -> bool:
    if first is None or other is None:
        return False
    (fine, _), (coarse, seen) = sorted((first, other))
    if math.isinf(coarse):
        # One part has no detected step: a difference only if the other step were detectable there.
        return math.isfinite(fine) and fine > _MIN_LEVEL_ALTERNATION * seen
    return coarse > _MIN_STEP_RATIO * fine


def find_interleaved_samples(channel: str, column: ColumnSummary) -> Iterator[Finding]:
    """Yield a finding if every other sample seems to come from another sensor."""
    levels, noises, units, sizes = [], [], [], []
    pieces = [piece for piece in column.excerpts() if len(piece.values) >= PIECE_SIZE // 4]
    for piece in pieces:
        turns = _compare_even_and_odd(piece.values)
        if turns is None:
            continue
        level, noise, samples = turns
        levels.append(level)
        noises.append(noise)
        # Standard deviations for white noise and a median; differences of neighbours make the
        # variance of the noise estimate 3/2 times as large.
        units.append(_MEDIAN_SD_OVER_MEAN_SD * 2.0 / math.sqrt(samples))
        sizes.append(_MEDIAN_SD_OVER_MEAN_SD * math.sqrt(3.0 / samples))
    if not levels:
        return
    level, noise = float(np.median(levels)), float(np.median(noises))
    changes: dict[Change, bool] = {
        "level": level > _CHANGE_SIGMAS * float(np.median(units)),
        "noise": noise > max(_CHANGE_SIGMAS * float(np.median(sizes)), _MIN_LOG_NOISE_ALTERNATION),
    }
    if any(changes.values()):
        even, odd = (
            detect_register_step([Excerpt(piece.first, piece.values[first::2]) for piece in pieces])
            for first in (0, 1)
        )
        changes["steps"] = _has_different_steps(even, odd)
    changed = [name for name, differs in changes.items() if differs]
    if len(changed) < 2 and not (changed == ["level"] and level > _MIN_LEVEL_ALTERNATION):
        return
    yield find(Interleaved(tuple(changed), level, math.exp(noise)), "warning", level, channel)


def _compare_even_and_odd(values: Array) -> tuple[float, float, int] | None:
    """Return level difference over noise, log ratio of noises, number of samples; or None."""
    whole = len(values) // (2 * _PAIRS_PER_PART) * 2 * _PAIRS_PER_PART
    pairs = values[:whole].reshape(-1, _PAIRS_PER_PART, 2)
    present: NDArray[np.bool_] = np.isfinite(pairs[:, :, 0]) & np.isfinite(pairs[:, :, 1])
    # Differences between samples of one sensor: free of drift and of the other sensor's level.
    steps = np.diff(pairs, axis=1)
    compared = present[:, 1:] & present[:, :-1]
    enough = compared.sum(axis=1) >= _PAIRS_PER_PART // 4
    if not enough.any():
        return None
    present, compared = present[enough], compared[enough]
    apart = np.where(present, pairs[enough, :, 0] - pairs[enough, :, 1], 0.0)
    squares = np.where(compared[:, :, None], steps[enough] ** 2, 0.0).sum(axis=1)
    scatter = np.sqrt(0.5 * squares / compared.sum(axis=1)[:, None])
    if not scatter.min() > 0.0:
        return None
    usual = float(np.median(np.sqrt((scatter**2).mean(axis=1))))
    level = float(np.median(apart.sum(axis=1) / present.sum(axis=1)))
    noise = float(np.median(np.log(scatter[:, 0] / scatter[:, 1])))
    return abs(level) / usual, abs(noise), 2 * int(present.sum())
