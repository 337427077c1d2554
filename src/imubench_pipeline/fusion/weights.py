"""Weights of the sensors of a board in one virtual sensor; their sum is 1 at every frequency."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.fusion.board import Board

Array = NDArray[np.float64]


class Weights(Protocol):
    """What weighs the sensors of a board."""

    def response(self, omega: Array) -> NDArray[Any]:
        """Return the weight of each sensor at angular frequencies, shape (m, n).

        rad a fused sample; complex where a filter delays.
        """


@dataclass(frozen=True)
class Constant:
    """Weights that are the same at every frequency.

    Attributes
    ----------
    values : ndarray, shape (n,)
        Their sum is 1: what all sensors measure alike passes unchanged.
    """

    values: Array

    def __post_init__(self) -> None:
        if self.values.ndim != 1 or abs(self.values.sum() - 1.0) > 1e-9:
            raise ValueError("expected a weight for each sensor, with a sum of 1")

    def response(self, omega: Array) -> Array:
        """Return the weights, at every frequency the same."""
        return np.broadcast_to(self.values, (len(omega), len(self.values)))


@dataclass(frozen=True)
class ByFrequency:
    """The best weights at each frequency: those of least fused spectrum.

    w(f) = S^-1 1 / (1^T S^-1 1) with S the matrix of spectra: the inverse spectra where nothing is
    shared. They are those of an optimal smoother, which looks ahead as far as back; no filter of
    the past alone can have less noise at any frequency, and the Kalman filter
    (`imubench_pipeline.fusion.kalman`) has some more where the weights change.

    Attributes
    ----------
    board : Board
        Whose models give the weights.
    """

    board: Board

    def response(self, omega: Array) -> Array:
        """Return the weights, real: no delay."""
        alone, common = self.board.spectral_matrices(omega)
        return _least(alone + common)


def equal(sensors: int) -> Constant:
    """Return equal weights.

    Parameters
    ----------
    sensors : int
        From 1.
    """
    return Constant(np.full(sensors, 1.0 / sensors))


def best_constant(board: Board, tau: float | None = None) -> Constant:
    """Return the constant weights of least Allan variance at a tau.

    Without common parts they are the inverse Allan variances. With them, a weight may be negative:
    a poor sensor that follows the temperature more than the others takes its effect off.

    Parameters
    ----------
    board : Board
    tau : float, optional
        s; without one the weights are the best for white noise, N^-2.

    Raises
    ------
    ValueError
        If a sensor has no noise to weigh it by.
    """
    if tau is None:
        matrix = np.diag([model.N**2 for model in board.models])
        for one in board.shared:
            matrix += one.model.N**2 * np.outer(one.sensitivity, one.sensitivity)
    else:
        alone, common = board.allan_matrices([tau])
        matrix = (alone + common)[0]
    if not np.all(np.diag(matrix) > 0.0):
        raise ValueError("a sensor without noise cannot be weighed by its noise")
    return Constant(_least(matrix[None])[0])


def _least(matrices: Array) -> Array:
    """Return the weights of least w^T S w with a sum of 1, shape (m, n)."""
    # Matrices of SI units are tiny: solve them scaled to a diagonal of 1.
    scale = np.sqrt(np.einsum("kii->ki", matrices))
    unit = matrices / (scale[:, :, None] * scale[:, None, :])
    solved = np.linalg.solve(unit, (1.0 / scale)[:, :, None])[:, :, 0] / scale
    return np.asarray(solved / solved.sum(axis=1, keepdims=True))
