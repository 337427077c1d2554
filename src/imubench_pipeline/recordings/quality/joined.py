"""Logs of two sensors in one: halves of different sensors, or samples of two in turn.

Level, noise and register are three witnesses. A sensor that is moved changes its level, one that is
shaken its noise; a place where two of the three change at once is where another sensor begins, or
another range of the same one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.recordings.quality.register import hidden_step
from imubench_pipeline.recordings.quality.summary import PIECE, ColumnSummary, Excerpt
from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.typing import Array

_SURE = 8.0
"""Standard deviations of a change that count."""

_NOISE = math.log(1.2)
"""Change of the noise that counts: a real log has one of 1.12 with a small step of its level."""

_ALTERNATING = math.log(1.05)
"""That of noise that alternates, which nothing but a line at a quarter of the rate does."""

_NEAR, _FAR = 8, 64
"""Blocks on either side whose noise is compared."""

_LEVEL = 4
"""Blocks on either side whose mean is compared."""

_STEP = 1.2
"""Ratio of two steps that are of different registers."""

_APART = 5.0
"""Standard deviations of the noise by which two sensors in turn differ if only their levels do."""

_PART = 128
"""Pairs of samples of a part."""

_MEDIAN = 1.2533
"""Standard deviation of a median over that of a mean."""

_MAD = 1.4826


def joined(channel: str, column: ColumnSummary, rate: float) -> Iterator[Finding]:
    """Yield where the samples of another sensor seem to begin.

    ``rate``: Hz.
    """
    blocks = column.blocks()
    filled = np.flatnonzero(blocks.spread > 0.0)
    if len(filled) < 4 * _NEAR:
        return
    mean, logs = blocks.mean[filled], np.log(blocks.spread[filled])
    level, noise = _level_changes(mean), _noise_changes(logs)
    for place in dict.fromkeys(int(np.argmax(np.abs(series))) for series in (noise, level)):
        near = slice(max(0, place - 2), place + 3)
        if np.abs(level[near]).max() > _SURE:
            around = np.arange(max(1, place - _LEVEL), min(len(mean) - 1, place + _LEVEL + 1))
            place = int(around[np.argmax(np.abs(mean[around + 1] - mean[around - 1]))])
        record = int(filled[place]) * blocks.size + blocks.size // 2
        changes = {
            "level": bool(np.abs(level[near]).max() > _SURE),
            "noise": bool(np.abs(noise[near]).max() > _SURE)
            and _stays(logs, place)
            and abs(np.median(logs[place:]) - np.median(logs[:place])) > _NOISE,
        }
        if any(changes.values()):
            changes["steps"] = _differ(*_registers(column.excerpts(), record, 3 * blocks.size))
        changed = [name for name, differs in changes.items() if differs]
        if len(changed) < 2:
            continue
        ratio = math.exp(float(np.median(logs[place:]) - np.median(logs[:place])))
        at = record / rate
        detail = (
            f"{' and '.join(changed)} of {channel} change at once at {at:.5g} s (its noise is "
            f"{ratio:.3g} times as large after): two sensors, or two ranges of one, are joined in "
            "this log; use one part ('use:' beside the log)"
        )
        yield Finding("joined", "warning", detail, ratio, channel, at, at)
        return


def _level_changes(mean: Array) -> Array:
    """Return the change of the level at each block, in standard deviations of such changes."""
    changes = np.zeros(len(mean))
    sums = np.concatenate(([0.0], np.cumsum(mean - mean[0])))
    inner = np.arange(_LEVEL, len(mean) - _LEVEL)
    # Without the block in which it may be.
    after = sums[inner + _LEVEL + 1] - sums[inner + 1]
    before = sums[inner] - sums[inner - _LEVEL]
    changes[inner] = (after - before) / _LEVEL
    scale = _MAD * float(np.median(np.abs(changes[inner] - np.median(changes[inner]))))
    return changes / scale if scale > 0.0 else np.zeros(len(mean))


def _noise_changes(logs: Array) -> Array:
    """Return the change of the noise at each block, in standard deviations of such changes."""
    width = min(max(len(logs) // 16, _NEAR), _FAR)
    scatter = _MAD * float(np.median(np.abs(np.diff(logs)))) / math.sqrt(2.0)
    changes = np.zeros(len(logs))
    if scatter == 0.0 or len(logs) < 3 * width:
        return changes
    sums = np.concatenate(([0.0], np.cumsum(logs)))
    inner = np.arange(width, len(logs) - width)
    after = sums[inner + width + 1] - sums[inner + 1]
    before = sums[inner] - sums[inner - width]
    changes[inner] = (after - before) / width / (scatter * math.sqrt(2.0 / width))
    return changes


def _stays(logs: Array, place: int) -> bool:
    """Tell whether all that is after a place is unlike all that is before it."""
    before, after = logs[: max(place - 1, 1)], logs[place + 2 :]
    if min(len(before), len(after)) < _NEAR:
        return False
    low, high = (before, after) if np.median(before) < np.median(after) else (after, before)
    return bool(np.quantile(low, 0.9) < np.quantile(high, 0.5)) and bool(
        np.quantile(low, 0.5) < np.quantile(high, 0.1)
    )


def _registers(
    pieces: Sequence[Excerpt], record: int, margin: int
) -> tuple[tuple[float, float] | None, tuple[float, float] | None]:
    """Return step and least step that could be seen, before and after a record."""
    before, after = [], []
    for piece in pieces:
        inside = record - piece.first
        # Where exactly the other begins is not known.
        before.append(Excerpt(piece.first, piece.values[: max(inside - margin, 0)]))
        after.append(Excerpt(piece.first, piece.values[max(inside + margin, 0) :]))
    return register_of(before), register_of(after)


def register_of(pieces: Sequence[Excerpt]) -> tuple[float, float] | None:
    """Return the step of a register, and what it would be by chance without one; None: untold.

    Returns
    -------
    (step, seen) or None
        SI. ``step`` is infinite where no step shows; ``seen`` is the finest that would.
    """
    whole = [piece for piece in pieces if len(piece.values) >= PIECE // 4]
    values = [piece.present for piece in whole if len(piece.present) >= PIECE // 8]
    if not values:
        return None
    joint = np.concatenate(values[:: max(1, len(values) // 4)][:4])
    spread = float(np.median([some.std() for some in values]))
    gaps = np.diff(np.unique(joint))
    gaps = gaps[gaps > 1e-9 * np.abs(joint).max()]
    if len(gaps) == 0 or spread == 0.0:
        return None
    seen = 20.0 * spread / len(joint)
    step = hidden_step(whole) or float(gaps.min())
    return (step if step > seen else math.inf), seen


def _differ(first: tuple[float, float] | None, other: tuple[float, float] | None) -> bool:
    """Tell whether two registers are different ones."""
    if first is None or other is None:
        return False
    (fine, _), (coarse, seen) = sorted((first, other))
    if math.isinf(coarse):
        # No step shows in one part: told if that of the other would show well.
        return math.isfinite(fine) and fine > _APART * seen
    return coarse > _STEP * fine


def interleaved(channel: str, column: ColumnSummary) -> Iterator[Finding]:
    """Yield whether every other sample is of another sensor."""
    levels, noises, units, sizes = [], [], [], []
    pieces = [piece for piece in column.excerpts() if len(piece.values) >= PIECE // 4]
    for piece in pieces:
        turns = _of_turns(piece.values)
        if turns is None:
            continue
        level, noise, samples = turns
        levels.append(level)
        noises.append(noise)
        # Of white noise, and of a median; the differences make that of the noise 3/2 times as
        # large.
        units.append(_MEDIAN * 2.0 / math.sqrt(samples))
        sizes.append(_MEDIAN * math.sqrt(3.0 / samples))
    if not levels:
        return
    level, noise = float(np.median(levels)), float(np.median(noises))
    changes = {
        "level": level > _SURE * float(np.median(units)),
        "noise": noise > max(_SURE * float(np.median(sizes)), _ALTERNATING),
    }
    if any(changes.values()):
        changes["steps"] = _differ(*(register_of(_every_other(pieces, first)) for first in (0, 1)))
    changed = [name for name, differs in changes.items() if differs]
    if len(changed) < 2 and not (changed == ["level"] and level > _APART):
        return
    detail = (
        f"{' and '.join(changed)} of {channel} alternate from sample to sample (levels "
        f"{level:.3g} standard deviations apart, noise {math.exp(noise):.3g} times as large): "
        "every other sample seems to be of another sensor; write each sensor into a log of its own"
    )
    yield Finding("interleaved", "warning", detail, level, channel)


def _of_turns(values: Array) -> tuple[float, float, int] | None:
    """Return how even and odd samples differ: level over noise, log of the noises, and of how many.

    Medians over parts of the piece, so that a knock decides nothing.
    """
    whole = len(values) // (2 * _PART) * 2 * _PART
    pairs = values[:whole].reshape(-1, _PART, 2)
    present: NDArray[np.bool_] = np.isfinite(pairs[:, :, 0]) & np.isfinite(pairs[:, :, 1])
    # Differences between samples of one sensor: neither drift nor the other's level.
    steps = np.diff(pairs, axis=1)
    compared = present[:, 1:] & present[:, :-1]
    enough = compared.sum(axis=1) >= _PART // 4
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


def _every_other(pieces: Sequence[Excerpt], first: int) -> list[Excerpt]:
    return [Excerpt(piece.first, piece.values[first::2]) for piece in pieces]
