"""Detect a steady rotation of an accelerometer from the direction of gravity."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.recordings.quality.summary import BlockStatistics
from imubench_pipeline.typing import Array

_QUARTERS = 4
_MIN_BLOCKS = 8  # least number of steps between block means: two in a quarter of the log
_MIN_RATE_SHARE = 0.5  # in every quarter of the log, of the mean rotation rate
_MAX_MISFIT = 0.1  # largest median misfit of the steps between block means, as a share of gravity
_MIN_OBSERVABLE_SINE_SQUARED = 0.01  # of the angle of gravity and the axis


@dataclass(frozen=True)
class GravityTurn:
    """A steady rotation of the sensor relative to gravity."""

    rate: tuple[float, float, float]  # about x, y, z, rad/s, without the vertical part
    swept: float  # angle of rotation over the log, rad


def detect_gravity_turn(axes: Sequence[BlockStatistics], rate: float) -> GravityTurn | None:
    """Return the steady rotation in the block means of an accelerometer; None if there is none.

    In the frame of a sensor with the angular rate ω, gravity changes by dg/dt = -ω × g. The mean of
    a block has the direction of g at its middle, and all means are shorter by the same factor:
    means rotate like g. For neighbouring means with difference d and average m, -w × m = d is
    solved for w by least squares, where |w| = 2 tan(θ/2) and θ is the angle per block. ``axes``:
    statistics of x, y and z, SI, over the same records. ``rate``: Hz.
    """
    whole = np.all([blocks.count > 0.9 * blocks.size for blocks in axes], axis=0)
    means = np.column_stack([np.where(whole, blocks.mean, np.nan) for blocks in axes])
    steps, middles = np.diff(means, axis=0), 0.5 * (means[1:] + means[:-1])
    present = np.isfinite(steps).all(axis=1)
    steps, middles = steps[present], middles[present]
    if len(steps) < _MIN_BLOCKS:
        return None
    per_block = _fit_turn(steps, middles)
    off = np.linalg.norm(steps + np.cross(per_block, middles), axis=1)
    if np.median(off) > _MAX_MISFIT * np.median(np.linalg.norm(middles, axis=1)):
        return None
    square = float(per_block @ per_block)
    for number in range(_QUARTERS):
        part = slice(len(steps) * number // _QUARTERS, len(steps) * (number + 1) // _QUARTERS)
        # A single move or a warm-up does not continue in all quarters.
        if not float(_fit_turn(steps[part], middles[part]) @ per_block) > _MIN_RATE_SHARE * square:
            return None
    length = math.sqrt(square)
    angle = 2.0 * math.atan(0.5 * length)
    x, y, z = (per_block * (angle / length * rate / axes[0].size)).tolist()
    return GravityTurn((x, y, z), angle * len(steps))


def _fit_turn(steps: Array, middles: Array) -> Array:
    """Return the least-squares rotation per block, shape (3,); 0 about the vertical."""
    squares = np.einsum("ki,kj->ij", middles, middles)
    total = float(np.trace(squares))
    normal = total * np.eye(3) - squares
    seen: Array = np.linalg.pinv(normal, rcond=_MIN_OBSERVABLE_SINE_SQUARED, hermitian=True)
    return seen @ -np.cross(middles, steps).sum(axis=0)
