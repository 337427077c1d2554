"""Exact discretisation of slow noise states and of the low-pass filter that they drive.

A slow state x (a Gauss-Markov process, or a random walk with 1/T = 0) and the states v of a filter
that it drives form one linear system. It is written in x and the filter deviation e = v - p x,
where p is the steady state of the filter for a unit input:

    dx = -x/T dt + dw,    de = (F e + p x/T) dt - p dw,    y = x + c e.

e is small where x is slow: there is no cancellation between a correlation time of days and a filter
of milliseconds. The covariances are integrated over a short step by Gauss-Legendre quadrature, and
doubled to the sampling interval as triangular factors: no exponential overflows, and no covariance
becomes indefinite, as by the single-step method of Van Loan (1978).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm, solve_continuous_lyapunov

from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.typing import Array

_QUADRATURE_NODES = 14  # quadrature nodes of a step that is short compared with all time constants
_SERIES_TERMS = 20
"""Terms of the power series of the exponential over such a step; the remainder is 1 / 21!."""


@dataclass(frozen=True)
class SlowSources:
    """Discrete slow states x and their filter deviations e, over one sampling interval.

    All driving noises have density 1. The arrays are for n sources and a filter of order m.
    """

    decay: Array  # shape (n,); e^(-interval / T); 1 for a random walk
    lost: Array  # shape (n,); 1 - decay, without cancellation
    own: Array  # shape (n,); standard deviation of the noise of x
    coupling: Array  # shape (n, m); transition from x to e
    shared: Array  # shape (n, m); gain from the noise of x, at unit variance, to e
    # shape (n, m, m); factors of the noise of e that is independent of the noise of x: its
    # covariance is ``residual.T @ residual``
    residual: Array


def discretise_slow_sources(times: Array, interval: float, low_pass: LowPass | None) -> SlowSources:
    """Discretise Gauss-Markov processes and random walks, and the filter that they drive.

    The correlation times, s, shape (n,), are infinite for a random walk. The interval is the
    sampling interval, s. Without a filter m = 0.
    """
    n, m = len(times), low_pass.order if low_pass else 0
    x = interval / times
    lost = -np.expm1(-x)
    decay = np.exp(-x)
    # interval (1 - e^(-2x)) / (2x), which is the interval itself for a random walk.
    slow = x < 1e-300
    ratio = -np.expm1(-2.0 * x) / np.where(slow, 1.0, 2.0 * x)
    own = np.sqrt(interval * np.where(slow, 1.0, ratio))
    if low_pass is None or not n:
        none = np.zeros((n, m))
        return SlowSources(decay, lost, own, none, none, np.zeros((n, m, m)))
    system = np.zeros((n, 1 + m, 1 + m))
    system[:, 0, 0] = -1.0 / times
    system[:, 1:, 0] = low_pass.steady_state / times[:, None]
    system[:, 1:, 1:] = low_pass.transition
    impulse = np.concatenate(([1.0], -low_pass.steady_state))
    impulses = np.broadcast_to(impulse, (n, 1 + m))
    transition, factor = _integrate_covariance(system, impulses, interval)
    shared = factor[:, 0, 1:] * np.sign(factor[:, 0, 0])[:, None]
    return SlowSources(decay, lost, own, transition[:, 1:, 0], shared, factor[:, 1:, 1:])


def compute_white_factor(low_pass: LowPass, interval: float) -> Array:
    """Return a factor R of the process noise of a filter driven by white noise of density 1.

    The covariance over the interval, s, is R.T @ R; R has shape (m, m).
    """
    _, factor = _integrate_covariance(low_pass.transition[None], low_pass.input[None], interval)
    return np.asarray(factor[0])


def _integrate_covariance(system: Array, impulse: Array, interval: float) -> tuple[Array, Array]:
    """Return transition matrices, and factors of the integral of g g', g = e^(system t) impulse.

    The systems have shape (n, k, k) and the impulses shape (n, k). The integral over a step of
    interval / 2^d is doubled d times: with the factor R and the transition P of one step, the QR
    factor of the rows R P' and R is the factor of two steps.
    """
    fastest = float(np.abs(system).sum(axis=2).max()) * interval
    doublings = max(0, math.ceil(math.log2(max(fastest, 1.0))))
    step = interval / 2.0**doublings
    nodes, weights = np.polynomial.legendre.leggauss(_QUADRATURE_NODES)
    # Power series (system step)^k / k!, and its product with the impulse. Over a short step the
    # sums converge fast without cancellation, and cost less than a matrix exponential per node.
    transition = np.broadcast_to(np.eye(system.shape[1]), system.shape)
    part, response = transition, impulse
    responses = np.repeat(impulse[:, None, :], _QUADRATURE_NODES, axis=1)
    for k in range(1, _SERIES_TERMS + 1):
        part = part @ system * (step / k)
        transition = transition + part
        response = np.einsum("nij,nj->ni", system, response) * (step / k)
        responses = responses + ((nodes + 1.0) / 2.0)[:, None] ** k * response[:, None, :]
    rows = responses * np.sqrt(step / 2.0 * weights)[:, None]
    factor: Array = np.asarray(np.linalg.qr(rows, mode="r"))
    for _ in range(doublings):
        later = factor @ transition.swapaxes(1, 2)
        factor = np.asarray(np.linalg.qr(np.concatenate([later, factor], axis=1), mode="r"))
        transition = transition @ transition
    return transition, factor


@dataclass(frozen=True)
class HeldInput:
    """Response of the filter deviation e to an input that is linear between samples."""

    step: Array  # shape (m,); e changes by ``step`` times the change of the input
    # ε, the lagged minus the actual input, becomes ``lag_decay * ε + lag_step * change``
    lag_decay: float
    lag_step: float
    # shape (m,); for a lagged input, e changes by ``lag_coupling * ε + lagged_step * change``
    lag_coupling: Array
    lagged_step: Array


def discretise_held_input(low_pass: LowPass | None, lag: float, interval: float) -> HeldInput:
    """Return the exact discretisation of filter and thermal lag for a first-order hold input.

    The lag (a time constant; 0: none) and the interval are in s.
    """
    m = low_pass.order if low_pass else 0
    x = interval / lag if lag > 0 else math.inf
    decay = math.exp(-x)
    # ε' = -ε/lag - slope, with the slope of the input that is held.
    lag_step = math.expm1(-x) / x if lag > 0 else 0.0
    if low_pass is None:
        return HeldInput(np.zeros(0), decay, lag_step, np.zeros(0), np.zeros(0))
    steady_state, transition = low_pass.steady_state, low_pass.transition
    # Columns of e^(system interval): e from ε and from a slope of 1 / interval.
    plain = np.zeros((m + 1, m + 1))
    plain[:m, :m] = transition
    plain[:m, m] = -steady_state / interval
    step = expm(plain * interval)[:m, m]
    if lag <= 0:
        return HeldInput(step, decay, lag_step, np.zeros(m), step)
    lagged = np.zeros((m + 2, m + 2))
    lagged[:m, :m] = transition
    lagged[:m, m] = steady_state / lag
    lagged[m, m] = -1.0 / lag
    lagged[m, m + 1] = -1.0 / interval
    whole = expm(lagged * interval)
    return HeldInput(step, decay, lag_step, whole[:m, m], whole[:m, m + 1])


def compute_stationary_distribution(
    times: Array, densities: Array, white: float, low_pass: LowPass
) -> tuple[Array, Array]:
    """Return the stationary distribution of the filter deviation e, given x.

    Its mean is x times the first result, shape (n, m); its covariance is the second, shape (m, m).
    The correlation times, s, and the densities of the driving noises have the shape (n,). A time is
    infinite for a random walk, whose x starts at 0. ``white`` is N^2 at the input.
    """
    # In units of the time constant of the filter, for well-conditioned equations.
    unit = low_pass.angular_cutoff
    F, p = low_pass.transition / unit, low_pass.steady_state
    b = low_pass.input / unit
    rates = 1.0 / (times * unit)
    # r = E[e x] and P = E[x^2] satisfy F r - r/T - p P/T = 0: r / P is independent of P, and 0 for
    # a random walk.
    means = np.array([np.linalg.solve(F - rate * np.eye(len(p)), p * rate) for rate in rates])
    means = means.reshape(len(times), len(p))
    drive = white * unit * np.outer(b, b)
    left = np.zeros_like(drive)
    for rate, density, mean in zip(rates, densities, means, strict=True):
        drive = drive + density / unit * np.outer(p, p)
        if rate > 0:
            variance = density / unit / (2.0 * rate)
            cross = np.outer(p, mean) * variance * rate
            drive = drive + cross + cross.T
            left = left + variance * np.outer(mean, mean)
    whole = solve_continuous_lyapunov(F, -drive)
    return means, np.asarray((whole + whole.T) / 2.0 - left)
