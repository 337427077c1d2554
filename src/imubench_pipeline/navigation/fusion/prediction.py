"""The spectrum and the Allan deviation of a virtual sensor, in closed form, and how sure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.navigation.error_budget.uncertainty import draw_models
from imubench_pipeline.navigation.fusion.board import Board
from imubench_pipeline.navigation.fusion.quadrature import allan_of_spectrum
from imubench_pipeline.navigation.fusion.weights import Constant, Weights
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_SLOW = 1e-9
"""rad a sample; the frequency of a ramp, for a filter."""


@dataclass(frozen=True)
class FusedCurve:
    """The predicted Allan variance of a virtual sensor.

    Attributes
    ----------
    tau : ndarray, shape (m,)
        s.
    variance : ndarray, shape (m,)
        (rad/s)^2 or (m/s^2)^2.
    common : ndarray, shape (m,)
        The part of it that comes of what the sensors share: more sensors do not lower it.
    """

    tau: Array
    variance: Array
    common: Array

    @property
    def deviation(self) -> Array:
        """Allan deviation, rad/s or m/s^2, shape (m,)."""
        return np.sqrt(self.variance)

    @property
    def common_share(self) -> Array:
        """Part of the variance that cannot be averaged away, 0 to 1, shape (m,)."""
        return np.divide(
            self.common, self.variance, out=np.zeros_like(self.common), where=self.variance > 0
        )


def fused_psd(board: Board, weights: Weights, frequency: ArrayLike) -> tuple[Array, Array]:
    """Return the two-sided density of a virtual sensor, and the part that is common.

    Parameters
    ----------
    board : Board
    weights : Weights
    frequency : array_like, shape (m,)
        Hz, above 0 and up to half the fused rate.

    Returns
    -------
    (ndarray, ndarray), shapes (m,)
        (rad/s)^2/Hz or (m/s^2)^2/Hz, of the samples: w^H S w / rate.
    """
    omega = 2.0 * np.pi * np.atleast_1d(np.asarray(frequency, dtype=np.float64)) / board.rate
    spectra = _spectra(board, weights, omega) / board.rate
    return spectra[:, 0] + spectra[:, 1], spectra[:, 1]


def fused_allan(board: Board, weights: Weights, tau: ArrayLike) -> FusedCurve:
    """Return the Allan variance of a virtual sensor.

    With constant weights it is the sum of w_i^2 AV_i and, of each shared process, of
    (w^T g)^2 AV. With weights that change with the frequency it is the integral of the
    fused spectrum (`quadrature.nodes`; relative error below 1e-7). A ramp passes with the weights
    at frequency 0, a line with those at its own; ramps of several sensors are taken as
    independent, of either sign.

    Parameters
    ----------
    board : Board
        What the sensors are.
    weights : Weights
        Of `weights` or a filter of `kalman`; they may be made for another board, for sensors
        that are not quite what they were thought to be.
    tau : array_like, shape (m,)
        s; taken to the nearest whole number of fused samples, at least one.
    """
    sizes = np.maximum(np.rint(np.atleast_1d(np.asarray(tau)) * board.rate).astype(np.int64), 1)
    tau = sizes / board.rate
    if isinstance(weights, Constant):
        parts = board.allan_parts(tau).of_sum(np.tile(weights.values, (len(tau), 1)))
    else:
        parts = allan_of_spectrum(lambda omega: _spectra(board, weights, omega), sizes)
        parts = parts + _of_deterministic(board, weights, tau)
    return FusedCurve(tau, parts.sum(axis=1), parts[:, 1])


def _spectra(board: Board, weights: Weights, omega: Array) -> Array:
    """Return the fused spectra of what is alone and what is common, SI^2, shape (m, 2)."""
    return board.spectral_parts(omega).of_sum(weights.response(omega))


def _of_deterministic(board: Board, weights: Weights, tau: Array) -> Array:
    """Return the Allan variances of ramps and lines, alone and common, shape (m, 2)."""
    # Each at its own rate: the means of the blocks of a faster sensor weaken its lines.
    alone = list(zip(board.models, board.rates, np.eye(board.sensors), strict=True))
    common = [(one.model, board.rate, np.asarray(one.sensitivity)) for one in board.shared]
    parts = np.zeros((len(tau), 2))
    for column, members in enumerate((alone, common)):
        for model, rate, gains in members:
            if model.R:
                ramp = NoiseModel(R=model.R).allan_variance(tau, rate)
                parts[:, column] += ramp * _power(weights, _SLOW, gains)
            for line in model.sinusoids:
                omega = 2.0 * np.pi * line.frequency / board.rate
                alone_line = NoiseModel(sinusoids=[line]).allan_variance(tau, rate)
                parts[:, column] += alone_line * _power(weights, omega, gains)
    return parts


def _power(weights: Weights, omega: float, gains: Array) -> float:
    return float(np.abs(weights.response(np.array([omega]))[0] @ gains) ** 2)


def prediction_limits(
    board: Board,
    estimates: Sequence[Estimate],
    weights: Weights,
    tau: ArrayLike,
    *,
    draws: int,
    rng: np.random.Generator,
    level: float = 0.95,
) -> tuple[Array, Array]:
    """Return limits of the predicted Allan deviation that follow from those of the parameters.

    The weights stay as they are, made from the estimates; what the sensors are is drawn by
    `draw_models`: all parameters together where the estimates have joint draws, else one by one,
    and then the limits are too wide where the parameters trade off.
    Sensors with one and the same estimate are specimens of one sensor and are drawn together:
    not to know a parameter is a common error.

    Parameters
    ----------
    board : Board
        Made from the estimates; its shared parts are taken as known.
    estimates : sequence of Estimate
        One a sensor, of what it has alone.
    weights : Weights
    tau : array_like, shape (m,)
        s.
    draws : int
        Boards that are drawn.
    rng : numpy.random.Generator
    level : float
        Share of the draws between the limits.

    Returns
    -------
    (ndarray, ndarray), shapes (m,)
        rad/s or m/s^2.
    """
    streams = rng.spawn(len(estimates))
    drawn: dict[int, list[NoiseModel]] = {}
    for estimate, stream in zip(estimates, streams, strict=True):
        if id(estimate) not in drawn:
            drawn[id(estimate)] = draw_models(estimate, draws, stream)
    found = [
        fused_allan(
            replace(board, models=[drawn[id(one)][i] for one in estimates]), weights, tau
        ).deviation
        for i in range(draws)
    ]
    tail = (1.0 - level) / 2.0
    lower, upper = np.quantile(found, [tail, 1.0 - tail], axis=0)
    return lower, upper
