"""Weights of the sensors of a board in one virtual sensor; their sum is 1 at every frequency."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.navigation.fusion.board import Board, Parts
from imubench_pipeline.typing import Array

_MIN_VARIANCE_RATIO = 1e-14
"""Variance of a perfect sensor over that of the poorest beside it."""


class Weights(Protocol):
    """What weighs the sensors of a board."""

    def response(self, omega: Array) -> NDArray[Any]:
        """Return the weight of each sensor, shape (m, n), complex where a filter delays.

        At angular frequencies in rad a fused sample, shape (m,).
        """


@dataclass(frozen=True)
class Constant:
    """Weights that are the same at every frequency.

    Raises
    ------
    ValueError
        If there is not one weight a sensor, or their sum is not 1 or not a number.
    """

    values: Array  # shape (n,); their sum is 1: what all sensors measure alike passes unchanged

    def __post_init__(self) -> None:
        if self.values.ndim != 1 or not abs(self.values.sum() - 1.0) <= 1e-9:
            raise ValueError("expected a weight for each sensor, with a sum of 1")

    def response(self, omega: Array) -> Array:
        """Return the weights, shape (m, n), at every frequency the same (see `Weights`)."""
        return np.broadcast_to(self.values, (len(omega), len(self.values)))


@dataclass(frozen=True)
class ByFrequency:
    """The best weights at each frequency: those of least fused spectrum.

    w(f) = S^-1 1 / (1^T S^-1 1) with S the matrix of spectra: the inverse spectra where nothing is
    shared. They are those of an optimal smoother, which looks ahead as far as back; no filter of
    the past alone can have less noise at any frequency, and the Kalman filter
    (`imubench_pipeline.navigation.fusion.kalman`) has some more where the weights change.

    Attributes
    ----------
    board : Board
        Whose models give the weights.
    """

    board: Board

    def response(self, omega: Array) -> Array:
        """Return the weights, shape (m, n), real: no delay (see `Weights`)."""
        return least(self.board.spectral_parts(omega))


def equal(sensors: int) -> Constant:
    """Return equal weights of a number of sensors, from 1; else a ValueError is raised."""
    if sensors < 1:
        raise ValueError(f"found {sensors} sensors, expected at least one")
    return Constant(np.full(sensors, 1.0 / sensors))


def best_constant(board: Board, tau: float | None = None) -> Constant:
    """Return the constant weights of least Allan variance at a tau.

    Without common parts they are the inverse Allan variances. With them, a weight may be negative:
    a poor sensor that follows the temperature more than the others takes its effect off.

    Parameters
    ----------
    board : Board
    tau : float, optional
        s, taken to the nearest whole number of fused samples, at least one; without it the
        weights are the best for white noise, N^-2.

    Raises
    ------
    ValueError
        If a sensor has no noise to weigh it by.
    """
    if tau is None:
        own = np.array([[model.N**2 for model in board.models]])
        shared = np.array([process.model.N**2 for process in board.shared]).reshape(1, -1)
        parts = Parts(own, shared, board.sensitivities)
    else:
        parts = board.allan_parts([tau])
    if not np.all(parts.own + parts.shared @ parts.sensitivities**2 > 0.0):
        raise ValueError("a sensor without noise cannot be weighed by it")
    return Constant(least(parts)[0])


def least(parts: Parts) -> Array:
    """Return the weights of least variance with a sum of 1, shape (m, n), at m frequencies or tau.

    The sensors are y = 1 x + G c + e, with x not known at all, and c of unit variance the shared
    processes. Their best estimates follow from normal equations that stay well conditioned however
    large c is, if what c has in common with x (the mean of G) is set apart.
    """
    # What has nothing of its own is nearly perfect; where none has, all are alike.
    largest = parts.own.max(axis=1, keepdims=True)
    own = np.where(
        parts.own > 0.0, parts.own, np.where(largest > 0.0, _MIN_VARIANCE_RATIO * largest, 1.0)
    )
    root = np.sqrt(parts.shared)
    mean = parts.sensitivities.mean(axis=1)
    across = parts.sensitivities - mean[:, None]
    seen = np.ones((len(own), 1 + len(mean), own.shape[1]))
    seen[:, 1:] = root[:, :, None] * across
    # Variances of SI units are tiny: the best of each point is the unit.
    unit = own.min(axis=1)[:, None, None]
    seen[:, 1:] /= np.sqrt(unit)
    weighed = seen * (unit / own[:, None, :])
    normal = weighed @ seen.transpose(0, 2, 1)
    normal[:, range(1, 1 + len(mean)), range(1, 1 + len(mean))] += 1.0
    rows = np.linalg.solve(normal, weighed)
    lever = root * mean / np.sqrt(unit[:, 0])
    weights = rows[:, 0] - np.einsum("ks,ksn->kn", lever, rows[:, 1:])
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))
