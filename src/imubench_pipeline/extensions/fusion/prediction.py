"""Predicted spectrum and Allan deviation of a virtual sensor, with limits.

The Allan variance of any smooth spectrum of samples is computed by quadrature.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.extensions.fusion.board import Board
from imubench_pipeline.extensions.fusion.weights import Constant, Weights
from imubench_pipeline.navigation.error_budget.uncertainty import draw_models
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_RULE = np.polynomial.legendre.leggauss(16)  # points and weights in a panel
_OCTAVE_PANELS = 40  # below the first zero of sin^4(n w/2): remainder 1e-12 for a random walk
_RAMP_FREQUENCY = 1e-9  # rad per sample, at which the response of a filter to a ramp is evaluated

_RESOLVED_PERIODS = 64
"""Number of resolved periods of sin^4(n w/2). Beyond, its mean of 3/8 is used, with an error of
4e-8 for white noise (first term of the asymptotic series of the remainder, 0.23/X^3 against
pi/4)."""


def nodes(n: int) -> tuple[Array, Array]:
    """Return frequencies, rad per sample, and weights from a spectrum to the Allan variance.

    sigma^2(n T) = (1/pi) int_0^pi P(w) 2 sin^4(n w/2) / (n^2 sin^2(w/2)) dw = ``weights @ P(w)``

    by Gauss-Legendre in panels: octaves up to the first zero of sin^4, then periods; for a cluster
    of many samples n, the mean of sin^4 at high frequencies. Raises ValueError if n is below 1.
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

    The spectrum takes angular frequencies in rad per sample, shape (k,), and returns SI^2, shape
    (k, ...); ``sizes`` are the numbers of samples in a cluster, shape (m,).
    """
    variances = []
    for n in np.atleast_1d(np.asarray(sizes, dtype=np.int64)):
        omega, weights = nodes(int(n))
        variances.append(np.tensordot(weights, spectrum(omega), axes=1))
    return np.array(variances)


def _make_linear_panels(edges: Array) -> tuple[Array, Array]:
    """Return points and weights in panels between edges."""
    points, weights = _RULE
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
    common: Array  # shape (m,); the part from shared processes

    @property
    def deviation(self) -> Array:
        """Allan deviation, rad/s or m/s^2, shape (m,)."""
        return np.sqrt(self.variance)

    @property
    def common_share(self) -> Array:
        """Fraction of the variance that does not average out, 0 to 1, shape (m,)."""
        return np.divide(
            self.common, self.variance, out=np.zeros_like(self.common), where=self.variance > 0
        )


def fused_psd(board: Board, weights: Weights, frequency: ArrayLike) -> tuple[Array, Array]:
    """Return the two-sided density of a virtual sensor, and its common part.

    w^H S w / rate of the samples, in (rad/s)^2/Hz or (m/s^2)^2/Hz, shapes (m,), at frequencies,
    array_like of shape (m,), in Hz, above 0 and up to half the fused rate.
    """
    omega = 2.0 * np.pi * np.atleast_1d(np.asarray(frequency, dtype=np.float64)) / board.rate
    spectra = _compute_spectra(board, weights, omega) / board.rate
    return spectra[:, 0] + spectra[:, 1], spectra[:, 1]


def fused_allan(board: Board, weights: Weights, tau: ArrayLike) -> FusedCurve:
    """Return the Allan variance of a virtual sensor.

    With constant weights it is the sum of w_i^2 AV_i and, of each shared process, of (w^T g)^2 AV.
    Else it is the integral of the fused spectrum (`nodes`; relative error below 1e-7); ramps, of
    random signs, and lines pass with the weights at their frequency. The weights may be from
    another board. The tau are array_like of shape (m,), s, rounded to whole fused samples, at least
    one.
    """
    sizes = np.maximum(np.rint(np.atleast_1d(np.asarray(tau)) * board.rate).astype(np.int64), 1)
    tau = sizes / board.rate
    if isinstance(weights, Constant):
        parts = board.allan_parts(tau).of_sum(np.tile(weights.values, (len(tau), 1)))
    else:
        parts = allan_of_spectrum(lambda omega: _compute_spectra(board, weights, omega), sizes)
        deterministic = np.zeros((len(tau), 2))
        # Ramps and lines, each at its own rate: block means of a faster sensor attenuate its lines.
        alone = list(zip(board.models, board.rates, np.eye(board.sensors), strict=True))
        common = [(s.model, board.rate, np.asarray(s.sensitivity)) for s in board.shared]
        for column, members in enumerate((alone, common)):
            for model, rate, gains in members:
                terms = [(NoiseModel(R=model.R), _RAMP_FREQUENCY)] if model.R else []
                for line in model.sinusoids:
                    omega = 2.0 * np.pi * line.frequency / board.rate
                    terms.append((NoiseModel(sinusoids=[line]), omega))
                for term, omega in terms:
                    power = float(np.abs(weights.response(np.array([omega]))[0] @ gains) ** 2)
                    deterministic[:, column] += term.allan_variance(tau, rate) * power
        parts = parts + deterministic
    return FusedCurve(tau, parts.sum(axis=1), parts[:, 1])


def _compute_spectra(board: Board, weights: Weights, omega: Array) -> Array:
    """Return the fused spectra of the independent and common parts, SI^2, shape (m, 2)."""
    return board.spectral_parts(omega).of_sum(weights.response(omega))


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
    """Return limits, shapes (m,), of the predicted Allan deviation, by uncertain parameters.

    `draw_models` draws the ``draws`` models of each estimate, of the noise of its sensor; sensors
    with the same estimate are drawn together. Weights and shared parts are fixed. The tau are
    array_like of shape (m,), s; ``level`` is the fraction of the boards between the limits.
    """
    drawn: dict[int, list[NoiseModel]] = {}
    for estimate, stream in zip(estimates, rng.spawn(len(estimates)), strict=True):
        if id(estimate) not in drawn:
            drawn[id(estimate)] = draw_models(estimate, draws, stream)
    deviations = []
    for i in range(draws):
        models = [drawn[id(estimate)][i] for estimate in estimates]
        deviations.append(fused_allan(replace(board, models=models), weights, tau).deviation)
    tail = (1.0 - level) / 2.0
    lower, upper = np.quantile(deviations, [tail, 1.0 - tail], axis=0)
    return lower, upper
