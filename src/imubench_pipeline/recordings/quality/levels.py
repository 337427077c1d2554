"""What the values of a column tell by themselves: stuck, saturated, repeated, coarse; how noisy."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.recordings.quality.register import hidden_step
from imubench_pipeline.recordings.quality.summary import ColumnSummary, present_median
from imubench_pipeline.typing import Array

_SURE = 1e-9
"""Chance of a run by accident below which it is none."""

_FEWEST_STEPS = 8
"""Steps between block means that tell an Allan deviation to a third."""

_NORMAL_MEDIAN = 0.4549
"""Median of the square of a standard normal variable."""


_COARSE = 1.0
"""Step over noise up to which neighbouring levels are about as frequent: one has 1.65 times the
samples of the next where the mean lies on it."""

_BESIDE = 4
"""Levels on either side that a level is compared with."""

_TIMES = 2.5
"""Times the fullest of them from which samples pile up: where figures are rounded to digits
somewhat coarser than the register, some digits have two of its steps."""

_PILED = 0.005
"""Part of the samples from which it matters."""

_BY_CHANCE = 10

_BEYOND = 12.0
"""Samples that noise would have beyond its last level, of which one is there but for a chance of
exp(-12)."""


@dataclass(frozen=True)
class Quantisation:
    """The steps of a quantised column."""

    step: float
    """Least significant bit, SI."""
    levels: float
    """Steps between the lowest and the highest sample, and one."""
    over_noise: float
    """Step over the standard deviation of the samples; infinite where they seldom change."""
    hidden: bool = False
    """The figures were rounded again, so that their differences are no multiples of it."""


def quantisation(column: ColumnSummary) -> Quantisation | None:
    """Return the steps of a column, or None where none show."""
    spread = noise_of(column)
    if not (0.0 < column.step < np.inf):
        return None
    hidden = hidden_step(column.excerpts())
    step = column.step if hidden is None else hidden
    # Two neighbours of n continuous samples come as close as spread / n.
    if step < 20.0 * spread / column.present:
        return None
    over_noise = step / spread if spread > 0.0 else math.inf  # most blocks have one value
    return Quantisation(
        step, (column.high - column.low) / step + 1.0, over_noise, hidden is not None
    )


def noise_of(column: ColumnSummary) -> float:
    """Return the usual standard deviation of the samples of a block, SI."""
    return present_median(column.blocks().spread)


def piled(column: ColumnSummary, steps: Quantisation | None) -> tuple[float, float] | None:
    """Return a value within the noise that samples pile up at, where no register is so coarse.

    Neighbouring levels of a register are about as frequent as each other. Samples that were lost
    and filled in by one value, or rates that a dead band reports as 0, are not.

    Parameters
    ----------
    steps : Quantisation or None
        Of the column.

    Returns
    -------
    (value, share) or None
        SI, and the part of the samples that are there.
    """
    if steps is not None and steps.over_noise > _COARSE:
        return None
    at, counts = _counts(column)
    if len(at) == 0:
        return None
    most = int(np.argmax(counts))
    around = np.delete(counts[max(0, most - _BESIDE) : most + _BESIDE + 1], min(most, _BESIDE))
    if at[most] in (column.low, column.high) or len(around) < 2 * _BESIDE:
        return None  # saturated, or too few levels
    share = counts[most] / counts.sum()
    if share < _PILED or counts[most] < _TIMES * max(around.max(), _BY_CHANCE):
        return None
    return float(at[most]), float(share)


def _counts(column: ColumnSummary) -> tuple[Array, NDArray[np.int64]]:
    """Return the values that a column has in its excerpts, and how often each."""
    pieces = [piece.present for piece in column.excerpts()]
    return np.unique(np.concatenate([np.empty(0), *pieces]), return_counts=True)


def kept_level(
    column: ColumnSummary, rate: float, unit: str, *, timed: bool = True
) -> dict[str, Any]:
    """Return what is kept of the level of a channel, to be judged beside its datasheet.

    Parameters
    ----------
    rate : float
        Hz.
    unit : str
        In which the log is said to be written.
    timed : bool
        It has stamps; else the rate is as it is stated.

    Returns
    -------
    dict
        ``mean``, SI, the usual one of a block, which a knock does not move; ``density``, see
        `density_of`; ``unit``; ``rate``; ``timed``.
    """
    level, density = present_median(column.blocks().mean), density_of(column, rate)
    return {"mean": level, "density": density, "unit": unit, "rate": rate, "timed": timed}


def density_of(column: ColumnSummary, rate: float) -> tuple[float, float | None]:
    """Return between which limits the white noise density of a column lies, roughly.

    The spread within blocks over √rate is too small behind a low-pass, the Allan deviation of the
    block means times √τ too large where slow noise reaches τ, and both where it is of a register.

    `column` and `rate`: as of `kept_level`.

    Returns
    -------
    (least, most) : float, float or None
        SI/√Hz, two-sided: N. None: there are too few blocks to tell how large it may be.
    """
    blocks = column.blocks()
    spread = noise_of(column) / math.sqrt(rate)
    steps = np.diff(np.where(blocks.count > 0.9 * blocks.size, blocks.mean, np.nan))
    steps = steps[np.isfinite(steps)]
    if len(steps) < _FEWEST_STEPS:
        return spread, None
    variance = float(np.median(steps**2)) / (2.0 * _NORMAL_MEDIAN)
    slow = math.sqrt(variance * blocks.size / rate)
    least_bit = column.step if np.isfinite(column.step) else 0.0
    return min(spread, slow), max(spread, slow, least_bit / math.sqrt(12.0 * rate))


def longest_by_chance(column: ColumnSummary) -> float:
    """Return how long a run of one value may be by chance, in samples."""
    share = min(column.repeats / max(column.present - 1, 1), 0.999)
    if share == 0.0:
        return 1.0
    return 1.0 + math.log(_SURE / column.present) / math.log(share)


def saturated(
    column: ColumnSummary, steps: Quantisation | None, share: float
) -> tuple[str, int] | None:
    """Tell whether samples pile up at an extreme.

    Parameters
    ----------
    steps : Quantisation or None
        Of the column.
    share : float
        Part of the samples at an extreme that counts.

    Returns
    -------
    (side, number) or None
        ``lowest`` or ``highest``, and the samples there.
    """
    if steps is not None and steps.levels < 10:
        return None  # so few levels that an extreme is nothing special
    for side, number in zip(("lowest", "highest"), column.at_extremes, strict=True):
        # A Gaussian leaves a few samples at its last level, whatever the step.
        if number > max(share * column.present, 10) and _cut_off(column, steps, side, number):
            return side, number
    return None


def _cut_off(column: ColumnSummary, steps: Quantisation | None, side: str, number: int) -> bool:
    """Tell whether samples at an extreme ask for others beyond it, which are not there.

    Counts n of neighbouring levels fall faster and faster in the tail of noise: the level beyond
    the last one has n_last^2 / n_next exp(-q^2), with q the step over the noise.
    """
    if steps is None:
        return True
    at, counts = _counts(column)
    last, following = (0, 1) if side == "lowest" else (-1, -2)
    if len(at) < 2 or at[last] != (column.low if side == "lowest" else column.high):
        return True
    beyond = number * counts[last] / counts[following] * math.exp(-(steps.over_noise**2))
    return bool(beyond > _BEYOND)
