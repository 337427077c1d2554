"""Decimate the samples of the sensors of a board to one rate, and fuse them."""

from collections.abc import Iterator, Sequence

import numpy as np

from imubench_pipeline.extensions.fusion.board import Board
from imubench_pipeline.extensions.fusion.kalman import KalmanFusion
from imubench_pipeline.extensions.fusion.weights import Constant
from imubench_pipeline.typing import Array

_BLOCK_LENGTH = 1 << 16  # number of fused samples in a block of processing


def at_fused_rate(board: Board, samples: Sequence[Array]) -> Array:
    """Return the samples of all sensors at the fused rate, shape (k, n): means of blocks.

    The samples of each sensor are at its own rate, rad/s or m/s^2, with a common start. A remainder
    that does not fill a block of every sensor is left out. A block with NaN (missing) is NaN.
    Raises ValueError if the number of sensors differs.
    """
    number = _count_fused_samples(board, samples)
    fused = np.empty((number, board.sensors))
    for i, (log, size) in enumerate(zip(samples, board.blocks, strict=True)):
        fused[:, i] = np.asarray(log[: number * size]).reshape(number, size).mean(axis=1)
    return fused


def fuse(board: Board, how: Constant | KalmanFusion, samples: Sequence[Array]) -> Array:
    """Return the samples of the virtual sensor, shape (k,), of samples as of `at_fused_rate`."""
    number = _count_fused_samples(board, samples)
    sizes = board.blocks

    def blocks() -> Iterator[Array]:
        for start in range(0, number, _BLOCK_LENGTH):
            stop = min(start + _BLOCK_LENGTH, number)
            parts = [log[start * n : stop * n] for log, n in zip(samples, sizes, strict=True)]
            yield at_fused_rate(board, parts)

    if isinstance(how, Constant):
        parts = [block @ how.values for block in blocks()]
    else:
        parts = list(how.fuse(blocks()))
    return np.concatenate(parts) if parts else np.empty(0)


def _count_fused_samples(board: Board, samples: Sequence[Array]) -> int:
    """Return the number of fused samples in the logs of all sensors."""
    if len(samples) != board.sensors:
        raise ValueError(f"found samples of {len(samples)} sensors, expected {board.sensors}")
    return min(len(log) // size for log, size in zip(samples, board.blocks, strict=True))
