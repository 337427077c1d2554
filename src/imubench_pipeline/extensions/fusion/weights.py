"""Weights of the sensors of a board in one virtual sensor, and its samples."""

from collections.abc import Sequence

import numpy as np

from imubench_pipeline.extensions.fusion.board import Board, Parts
from imubench_pipeline.typing import Array

_BLOCK_LENGTH = 1 << 16  # of a product, in samples: its rounding depends on the number of rows
_MIN_VARIANCE_RATIO = 1e-14  # of a sensor without noise, over the noisiest one


def best_weights(board: Board, tau: float | None = None) -> Array:
    """Return the constant weights, shape (n,), of least Allan variance at a tau, s.

    Without tau, N^2 is minimised: if the sensors share no noise, weights are in proportion to N^-2.
    If they share noise, a weight may be negative: a sensor that is more sensitive to this noise
    compensates the other sensors. The tau is rounded to whole fused samples. Raises ValueError for
    a sensor without noise.
    """
    if tau is None:
        own = np.array([[model.N**2 for model in board.models]])
        shared = np.array([process.model.N**2 for process in board.shared]).reshape(1, -1)
        parts = Parts(own, shared, board.sensitivities)
    else:
        parts = board.allan_parts([tau])
    if not np.all(parts.own + parts.shared @ parts.sensitivities**2 > 0.0):
        raise ValueError("a sensor without noise has no weight; expected noise in every model")
    return np.asarray(least(parts)[0])


def least(parts: Parts) -> Array:
    """Return the weights with sum 1 that have the least variance at each of m tau, shape (m, n).

    The model of the readings y is y = x + G c + e, with the signal x, shared processes c of unit
    variance, their sensitivities G, and independent noise e. The normal equations are well
    conditioned if the mean of G is treated separately.
    """
    # A sensor without independent noise is nearly perfect; if none has any, all are equal.
    largest = parts.own.max(axis=1, keepdims=True)
    own = np.where(
        parts.own > 0.0, parts.own, np.where(largest > 0.0, _MIN_VARIANCE_RATIO * largest, 1.0)
    )
    root = np.sqrt(parts.shared)
    mean = parts.sensitivities.mean(axis=1)
    across = parts.sensitivities - mean[:, None]
    seen = np.ones((len(own), 1 + len(mean), own.shape[1]))
    seen[:, 1:] = root[:, :, None] * across
    # Variances in SI units are tiny: scale by the smallest at each point.
    unit = own.min(axis=1)[:, None, None]
    seen[:, 1:] /= np.sqrt(unit)
    weighed = seen * (unit / own[:, None, :])
    normal = weighed @ seen.transpose(0, 2, 1)
    normal[:, range(1, 1 + len(mean)), range(1, 1 + len(mean))] += 1.0
    rows = np.linalg.solve(normal, weighed)
    lever = root * mean / np.sqrt(unit[:, 0])
    weights = rows[:, 0] - np.einsum("ks,ksn->kn", lever, rows[:, 1:])
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))


def at_fused_rate(board: Board, samples: Sequence[Array]) -> Array:
    """Return the samples of all sensors at the fused rate, shape (k, n): means of blocks.

    The samples of each sensor are at its own rate, rad/s or m/s^2, with a common start. A remainder
    that does not fill a block of every sensor is left out. A block with NaN (missing) is NaN.
    Raises ValueError if the number of sensors differs.
    """
    if len(samples) != board.sensors:
        raise ValueError(f"found samples of {len(samples)} sensors, expected {board.sensors}")
    number = min(len(log) // size for log, size in zip(samples, board.blocks, strict=True))
    fused = np.empty((number, board.sensors))
    for i, (log, size) in enumerate(zip(samples, board.blocks, strict=True)):
        fused[:, i] = np.asarray(log[: number * size]).reshape(number, size).mean(axis=1)
    return fused


def fuse(board: Board, weights: Array, samples: Sequence[Array]) -> Array:
    """Return the samples of the virtual sensor, shape (k,); ``samples`` as in `at_fused_rate`.

    The weights have the shape (n,) and the sum 1, or ValueError.
    """
    board.check_weights(weights)
    fused = at_fused_rate(board, samples)
    blocks = range(0, len(fused), _BLOCK_LENGTH)
    sums = [fused[start : start + _BLOCK_LENGTH] @ weights for start in blocks]
    return np.concatenate([*sums, np.empty(0)])
