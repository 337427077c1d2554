"""The spectrum and the Allan deviation of a virtual sensor, in closed form, and how sure.

The Allan variance of any smooth spectrum of samples is taken by quadrature.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.navigation.error_budget.uncertainty import draw_models
from imubench_pipeline.navigation.fusion.board import Board
from imubench_pipeline.navigation.fusion.weights import Constant, Weights
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_QUADRATURE_POINTS = 16
"""Of Gauss and Legendre in a panel."""

_OCTAVE_PANELS = 40
"""Panels below the first zero of sin^4(n w/2): the rest is 1e-12 of a random walk's."""

_RESOLVED_PERIODS = 64
"""Periods of sin^4(n w/2) that are resolved; beyond, 3/8 stands for it, wrong by 4e-8 of white
noise (the first term of the asymptotic series of the rest, 0.23/X^3 against pi/4)."""


_RAMP_FREQUENCY = 1e-9
"""rad a sample; the frequency of a ramp, for a filter."""


def nodes(n: int) -> tuple[Array, Array]:
    """Return frequencies and weights that integrate a spectrum to the Allan variance.

    sigma^2(n T) = (1/pi) int_0^pi P(w) 2 sin^4(n w/2) / (n^2 sin^2(w/2)) dw = ``weights @ P(w)``

    with w in rad a sample and n samples in a cluster, from 1, by Gauss and Legendre, in panels of
    an octave of w up to the first zero of sin^4, where P is smooth over log w, then of one period;
    the many periods of a long cluster at high frequencies are replaced by their mean, again in
    octaves.

    Raises
    ------
    ValueError
        If n is below 1.
    """
    if n < 1:
        raise ValueError(f"a cluster has {n} samples, expected 1 or more")
    end = n * np.pi / 2.0  # of x = n w / 2
    first = min(np.pi, end)
    x, dx = _make_octave_panels(first * 2.0**-_OCTAVE_PANELS, first)
    resolved = min(_RESOLVED_PERIODS * np.pi, end)
    edges = np.append(np.arange(np.pi, resolved - 1e-9, np.pi), resolved)
    if len(edges) > 1:
        more, width = _make_linear_panels(edges)
        x, dx = np.append(x, more), np.append(dx, width)
    fourth = np.sin(x) ** 4
    if end > resolved:
        far, width = _make_octave_panels(resolved, end)
        x, dx = np.append(x, far), np.append(dx, width)
        fourth = np.append(fourth, np.full(len(far), 3.0 / 8.0))
    omega = 2.0 * x / n
    weights = 2.0 / np.pi * fourth / (n * np.sin(omega / 2.0)) ** 2 * 2.0 / n * dx
    return omega, weights


def allan_of_spectrum(spectrum: Callable[[Array], NDArray[Any]], sizes: ArrayLike) -> NDArray[Any]:
    """Return the Allan variance of samples of a given spectrum, SI^2, shape (m, ...).

    The spectrum takes angular frequencies in rad a sample, shape (k,), and returns SI^2, shape (k,
    ...); ``sizes`` are samples in a cluster, shape (m,).
    """
    variances = []
    for n in np.atleast_1d(np.asarray(sizes, dtype=np.int64)):
        omega, weights = nodes(int(n))
        variances.append(np.tensordot(weights, spectrum(omega), axes=1))
    return np.array(variances)


@lru_cache(maxsize=1)
def _compute_rule() -> tuple[Array, Array]:
    points, weights = np.polynomial.legendre.leggauss(_QUADRATURE_POINTS)
    return np.asarray(points), np.asarray(weights)


def _make_linear_panels(edges: Array) -> tuple[Array, Array]:
    """Return points and weights in panels between edges."""
    points, weights = _compute_rule()
    middle, half = (edges[1:] + edges[:-1]) / 2.0, np.diff(edges) / 2.0
    return (middle[:, None] + half[:, None] * points).ravel(), np.outer(half, weights).ravel()


def _make_octave_panels(start: float, end: float) -> tuple[Array, Array]:
    """Return points and weights in panels of about an octave, linear in the logarithm."""
    number = max(1, int(np.ceil(np.log2(end / start) - 1e-9)))
    u, du = _make_linear_panels(np.linspace(np.log(start), np.log(end), number + 1))
    x = np.exp(u)
    return x, du * x


@dataclass(frozen=True)
class FusedCurve:
    """The predicted Allan variance of a virtual sensor."""

    tau: Array  # shape (m,); s
    variance: Array  # shape (m,); (rad/s)^2 or (m/s^2)^2
    # shape (m,); the part of it that comes of what the sensors share: more sensors do not lower it
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

    w^H S w / rate of the samples, in (rad/s)^2/Hz or (m/s^2)^2/Hz, shapes (m,), at frequencies,
    array_like of shape (m,), in Hz, above 0 and up to half the fused rate.
    """
    omega = 2.0 * np.pi * np.atleast_1d(np.asarray(frequency, dtype=np.float64)) / board.rate
    spectra = _compute_spectra(board, weights, omega) / board.rate
    return spectra[:, 0] + spectra[:, 1], spectra[:, 1]


def fused_allan(board: Board, weights: Weights, tau: ArrayLike) -> FusedCurve:
    """Return the Allan variance of a virtual sensor.

    With constant weights it is the sum of w_i^2 AV_i and, of each shared process, of
    (w^T g)^2 AV. With weights that change with the frequency it is the integral of the
    fused spectrum (`nodes`; relative error below 1e-7). A ramp passes with the weights
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
        parts = allan_of_spectrum(lambda omega: _compute_spectra(board, weights, omega), sizes)
        parts = parts + _compute_deterministic_variance(board, weights, tau)
    return FusedCurve(tau, parts.sum(axis=1), parts[:, 1])


def _compute_spectra(board: Board, weights: Weights, omega: Array) -> Array:
    """Return the fused spectra of what is alone and what is common, SI^2, shape (m, 2)."""
    return board.spectral_parts(omega).of_sum(weights.response(omega))


def _compute_deterministic_variance(board: Board, weights: Weights, tau: Array) -> Array:
    """Return the Allan variances of ramps and lines, alone and common, shape (m, 2)."""
    # Each at its own rate: the means of the blocks of a faster sensor weaken its lines.
    alone = list(zip(board.models, board.rates, np.eye(board.sensors), strict=True))
    common = [
        (process.model, board.rate, np.asarray(process.sensitivity)) for process in board.shared
    ]
    parts = np.zeros((len(tau), 2))
    for column, members in enumerate((alone, common)):
        for model, rate, gains in members:
            if model.R:
                ramp = NoiseModel(R=model.R).allan_variance(tau, rate)
                parts[:, column] += ramp * _compute_power(weights, _RAMP_FREQUENCY, gains)
            for line in model.sinusoids:
                omega = 2.0 * np.pi * line.frequency / board.rate
                alone_line = NoiseModel(sinusoids=[line]).allan_variance(tau, rate)
                parts[:, column] += alone_line * _compute_power(weights, omega, gains)
    return parts


def _compute_power(weights: Weights, omega: float, gains: Array) -> float:
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
    deviations = [
        fused_allan(
            replace(board, models=[drawn[id(estimate)][i] for estimate in estimates]), weights, tau
        ).deviation
        for i in range(draws)
    ]
    tail = (1.0 - level) / 2.0
    lower, upper = np.quantile(deviations, [tail, 1.0 - tail], axis=0)
    return lower, upper
