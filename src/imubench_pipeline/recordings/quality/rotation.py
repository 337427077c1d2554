"""Whether gravity turns steadily against an accelerometer, which is turned or tilted then."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.recordings.quality.summary import BlockStatistics
from imubench_pipeline.typing import Array

_QUARTERS = 4
_FEWEST_BLOCKS = 8
"""Block means that show a turn: two in a quarter of the log."""

_STEADY = 0.5
"""Part of the mean rate that gravity turns with in every quarter of the log."""

_SCATTER = 0.1
"""Part of gravity that steps between block means may be off the turn."""

_SEEN = 0.01
"""Square of the sine of gravity's angle with an axis about which a turn of it is seen."""


@dataclass(frozen=True)
class GravityTurn:
    """A steady turn of gravity against the sensor."""

    rate: tuple[float, float, float]
    """Of the sensor about x, y and z, rad/s, as far as gravity shows it: not about the vertical."""
    swept: float
    """Angle that it turns by over the log, rad."""


def gravity_turn(axes: Sequence[BlockStatistics], rate: float) -> GravityTurn | None:
    """Return the steady turn that block means of an accelerometer show; None: there is none.

    In the frame of a sensor that turns with ω, gravity changes by dg/dt = -ω × g. A block mean is
    shorter than g by the arc of a block and points to its middle, so that means turn alike. For
    steps d between neighbours with mean m, -w × m = d is solved for w by least squares, where
    |w| = 2 tan(θ/2) and θ is the angle of a block.

    ``axes``: of x, y and z, SI, over the same records.
    ``rate``: of the samples, Hz.
    """
    whole = np.all([blocks.count > 0.9 * blocks.size for blocks in axes], axis=0)
    means = np.column_stack([np.where(whole, blocks.mean, np.nan) for blocks in axes])
    steps, middles = np.diff(means, axis=0), 0.5 * (means[1:] + means[:-1])
    present = np.isfinite(steps).all(axis=1)
    steps, middles = steps[present], middles[present]
    if len(steps) < _FEWEST_BLOCKS:
        return None
    per_block = _turn(steps, middles)
    off = np.linalg.norm(steps + np.cross(per_block, middles), axis=1)
    if np.median(off) > _SCATTER * np.median(np.linalg.norm(middles, axis=1)):
        return None
    square = float(per_block @ per_block)
    for number in range(_QUARTERS):
        part = slice(len(steps) * number // _QUARTERS, len(steps) * (number + 1) // _QUARTERS)
        # One move, or a warm-up, is over in the others.
        if not float(_turn(steps[part], middles[part]) @ per_block) > _STEADY * square:
            return None
    length = math.sqrt(square)
    angle = 2.0 * math.atan(0.5 * length)
    x, y, z = (per_block * (angle / length * rate / axes[0].size)).tolist()
    return GravityTurn((x, y, z), angle * len(steps))


def _turn(steps: Array, middles: Array) -> Array:
    """Return the turn of a block that explains steps best, shape (3,); none about the vertical."""
    squares = np.einsum("ki,kj->ij", middles, middles)
    total = float(np.trace(squares))
    normal = total * np.eye(3) - squares
    seen: Array = np.linalg.pinv(normal, rcond=_SEEN, hermitian=True)
    rate: Array = seen @ -np.cross(middles, steps).sum(axis=0)
    return rate
