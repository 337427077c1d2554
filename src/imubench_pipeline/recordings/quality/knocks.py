"""Knocks: isolated outliers, found, counted, and left out with the samples around them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.recordings.quality.summary import BlockStatistics
from imubench_pipeline.typing import Array

_NEIGHBOURS = 16
"""Blocks on either side whose median tells what a block would be without a knock."""

_FEWEST_AROUND = 2
"""Blocks that must be there to compare with."""

_SETTLED = 4.0
"""Standard deviations within which the samples after a knock are as before."""

_CALM = 5
"""So many samples in a row must be settled before a knock is over."""

_STEPS = 2.0
"""Steps of a register that an outlier must be away. By one it always may be, and its level lies
between two where it drifts: 1.5 left one knock in 60 clean logs with registers of up to 6 sigma."""

_AROUND = 5
"""Samples on either side that are left out with a knock."""


@dataclass(frozen=True)
class Knock:
    """One knock."""

    first: int
    last: int
    """First and one-past-last record to leave out."""
    size: float
    """Largest distance from the level, in standard deviations, or in what `suspects` takes for
    them."""


def suspects(
    blocks: BlockStatistics, sigmas: float, step: float | None = None
) -> tuple[NDArray[np.int64], Array, Array]:
    """Return the blocks that hold an outlier, with the level and the noise around them.

    Parameters
    ----------
    sigmas : float
        Distance from the level that counts, in standard deviations of the samples.
    step : float or None
        Least significant bit, SI; a change by one is no outlier. None: of no register.

    Returns
    -------
    number : ndarray of int, shape (n,)
    level, noise : ndarray, shape (n,)
        Median of the means of the blocks around, and what counts as their noise, SI: the median
        of their spreads, or more where that is small against the step.
    """
    least = _STEPS * (step or 0.0) / sigmas
    filled = np.isfinite(blocks.spread)
    usual = np.median(blocks.spread[filled]) if filled.any() else np.inf
    reach = np.maximum(blocks.high - blocks.mean, blocks.mean - blocks.low)
    quick = np.flatnonzero(reach > 0.5 * sigmas * usual)
    number, levels, noises = [], [], []
    for k in quick:
        around = np.r_[max(0, k - _NEIGHBOURS) : k, k + 1 : k + _NEIGHBOURS + 1]
        around = around[(around < len(blocks.mean))]
        around = around[np.isfinite(blocks.mean[around])]
        if len(around) < _FEWEST_AROUND:
            continue
        near = around[np.argsort(np.abs(around - k))[:4]]
        level = float(np.median(blocks.mean[near]))
        noise = float(np.median(blocks.spread[around]))
        noise = max(noise, least) if noise > 0.0 else 0.0
        if max(blocks.high[k] - level, level - blocks.low[k]) > sigmas * noise > 0.0:
            number.append(int(k))
            levels.append(level)
            noises.append(noise)
    return np.array(number, dtype=np.int64), np.array(levels), np.array(noises)


def knocks(
    pieces: Iterable[Array],
    blocks: BlockStatistics,
    sigmas: float,
    longest: int,
    step: float | None = None,
) -> Iterator[Knock]:
    """Yield the knocks of a column.

    Parameters
    ----------
    pieces : iterable of ndarray
        The column in order, SI; NaN where a sample is missing.
    blocks : BlockStatistics
        Of the same column.
    sigmas : float
        As `suspects` takes it.
    longest : int
        Records: what lasts longer is motion, and not a knock.
    step : float or None
        As `suspects` takes it.
    """
    number, level, noise = suspects(blocks, sigmas, step)
    if len(number) == 0:
        return
    wanted = {int(k): i for i, k in enumerate(number)}
    reached = 0
    for k, values in enumerate(_cut(pieces, blocks.size)):
        if k in wanted:
            i = wanted[k]
            away = np.abs(values - level[i]) / noise[i]
            for first, last in _events(away, sigmas):
                if last - first <= longest:
                    size = float(np.nanmax(away[first:last]))
                    yield Knock(reached + first - _AROUND, reached + last + _AROUND, size)
        reached += len(values)


def _cut(pieces: Iterable[Array], size: int) -> Iterator[Array]:
    """Cut a column into blocks of so many records."""
    rest = np.empty(0)
    for piece in pieces:
        joined = np.concatenate((rest, piece)) if len(rest) else piece
        whole = len(joined) // size * size
        yield from joined[:whole].reshape(-1, size)
        rest = joined[whole:]
    if len(rest):
        yield rest


def _events(away: Array, sigmas: float) -> Iterator[tuple[int, int]]:
    """Yield first and one-past-last sample of each stretch about an outlier."""
    out = np.flatnonzero(away > sigmas)
    calm = ~(away > _SETTLED)
    reached = 0
    for peak in out:
        if peak < reached:
            continue
        first, last = int(peak), int(peak) + 1
        while first > reached and not calm[max(reached, first - _CALM) : first].all():
            first -= 1
        while last < len(away) and not calm[last : last + _CALM].all():
            last += 1
        reached = last
        yield first, last
