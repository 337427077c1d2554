"""Bias tracking with known rate: the filter of Silva et al. (eq. 15, 16), for comparison.

It cannot estimate the Earth's rate: its measurement y = w_ie - w~ contains the unknown rate. Given
twice the rate it "finds" twice the rate. It contains neither the latitude nor the sign of the
dwell, which alone separates the rate from a bias. The scatter of its mean (`mean_sigma`) is the
scatter of white noise, N / sqrt(t), once the filter has forgotten its start. The paper prints the
start, P_0 = 0.1 I, without a unit (`STARTS`).

Equation 13 is printed as P+ = (I - K H)^-1 P- instead of (I - K H) P-. Each measurement then
increases the covariance instead of reducing it, and P grows without bound (`as_printed`).
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.extensions.calibration.experiment import Experiment
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

STARTS = {"degrees": 0.1 * math.radians(1.0) ** 2, "radians": 0.1}
"""P_0 = 0.1 I of Silva et al. in (rad/s)^2, by the assumed unit: the paper prints none."""


@dataclass(frozen=True)
class Tracked:
    """Result of the filter with known rate, for the samples in dwells."""

    sample: NDArray[np.int64]  # shape (n,); number of each sample in the log
    drift: Array  # shape (n,); tracked error of the gyro, z_f + z_rrw, rad/s
    mean: Array  # shape (n,); cumulative mean of its "Earth's rate", rad/s (figures 10 to 13)


@dataclass(frozen=True)
class _Filter:
    """Matrices: F = diag(decay, 1), H = [1, 1], Q_d = diag(of_f, of_rrw), R_d = white."""

    decay: float
    of_f: float
    of_rrw: float
    white: float
    stationary: float  # variance of the process; that of Q_d is approximate


def _build_filter(model: NoiseModel, rate: float) -> _Filter:
    processes = [term.gauss_markov for term in model.terms if term.gauss_markov is not None]
    process = processes[0] if processes else None
    if model.N == 0 or (model.B > 0 and model.T_B is None):
        raise ValueError("the filter of Silva et al. needs N, and a Gauss-Markov process for B")
    interval = 1.0 / rate
    return _Filter(
        math.exp(-interval / process.T_B) if process else 0.0,
        interval * (process.density if process else 0.0),
        interval * model.K**2,
        model.N**2 / interval,
        process.density * process.T_B / 2.0 if process else 0.0,
    )


def track(
    log: Array,
    experiment: Experiment,
    model: NoiseModel,
    known_rate: float,
    start: float = STARTS["degrees"],
) -> Tracked:
    """Track the bias of a gyro with the filter of Silva et al., which needs the Earth's rate.

    F = diag(e^(-T/T_B), 1), H = [1, 1], R_d = N^2/T, Q_d = T diag(S_B, S_K), x_0 = 0 as printed,
    although the first entry of Q_d is an approximation; P_0 = ``start`` I, (rad/s)^2. Samples of
    turning are left out. The log, shape (samples,), and the known rate are in rad/s; a missing
    sample is NaN. Raises ValueError if the model has no N, or a B without T_B.
    """
    one = _build_filter(model, experiment.rate)
    sample = np.concatenate([np.arange(dwell.start, dwell.stop) for dwell in experiment.dwells])
    sample = sample[np.isfinite(log[sample])]
    drift = _run_filter(log[sample] - known_rate, start, one.decay, one.of_f, one.of_rrw, one.white)
    corrected = log[sample] - drift
    return Tracked(sample, drift, np.cumsum(corrected) / np.arange(1, len(sample) + 1))


@njit(cache=True, nogil=True)
def _run_filter(
    error: Array, start: float, decay: float, of_f: float, of_rrw: float, white: float
) -> Array:
    """Return z_f + z_rrw after each measurement of their sum."""
    drift = np.empty_like(error)
    f, rrw = 0.0, 0.0
    var_f, cross, var_rrw = start, 0.0, start
    for k in range(error.size):
        to_f, to_rrw = var_f + cross, cross + var_rrw
        total = to_f + to_rrw + white
        wrong = (error[k] - f - rrw) / total
        f += to_f * wrong
        rrw += to_rrw * wrong
        drift[k] = f + rrw
        var_f -= to_f * to_f / total
        cross -= to_f * to_rrw / total
        var_rrw -= to_rrw * to_rrw / total
        f *= decay
        var_f = decay * decay * var_f + of_f
        cross *= decay
        var_rrw += of_rrw
    return drift


def settled(mean: Array, rate: float, known_rate: float, part: float = 0.1) -> float:
    """Return the time, s, from which a mean, shape (n,), stays near the known rate; else inf."""
    out = np.flatnonzero(np.abs(mean - known_rate) > part * abs(known_rate))
    if len(out) == 0:
        return 0.0
    return math.inf if out[-1] == len(mean) - 1 else float(out[-1] + 1) / rate


def mean_sigma(
    model: NoiseModel, rate: float, samples: int, start: float, turn_on_bias: float
) -> Array:
    """Return the exact sigma of the mean of `track` after each sample, rad/s, shape (n,).

    It includes the noise of the model, and a fixed bias with the sigma ``turn_on_bias``, rad/s.
    ``start`` is as in `track`, in (rad/s)^2; the rate is in Hz. Raises ValueError as `track`.
    """
    one = _build_filter(model, rate)
    decay, of_f, of_rrw, white = one.decay, one.of_f, one.of_rrw, one.white
    sigma = np.empty(samples)
    # Covariance of [z_f, z_rrw, tracked z_f, tracked z_rrw, sum of residuals].
    joint = np.zeros((5, 5))
    joint[0, 0], joint[1, 1] = one.stationary, turn_on_bias**2
    var_f, cross, var_rrw = start, 0.0, start
    seen = np.array([[1.0, 1.0, -1.0, -1.0, 0.0]])
    moved = np.array([decay, 1.0, decay, 1.0, 1.0])
    for k in range(samples):
        to_f, to_rrw = var_f + cross, cross + var_rrw
        total = to_f + to_rrw + white
        left = 1.0 - (to_f + to_rrw) / total
        noise = np.array([[0.0], [0.0], [to_f / total], [to_rrw / total], [left]])
        step = np.eye(5) + noise @ seen
        joint = step @ joint @ step.T + white * (noise @ noise.T)
        sigma[k] = math.sqrt(joint[4, 4]) / (k + 1)
        joint = joint * np.outer(moved, moved)
        joint[0, 0] += one.stationary * (1.0 - decay * decay)
        joint[1, 1] += of_rrw
        var_f = decay * decay * (var_f - to_f * to_f / total) + of_f
        cross = decay * (cross - to_f * to_rrw / total)
        var_rrw += of_rrw - to_rrw * to_rrw / total
    return sigma


def as_printed(model: NoiseModel, rate: float, steps: int, start: float) -> Array:
    """Return the trace of P after each measurement by eq. 13 as printed, (rad/s)^2, shape (steps,).

    (I - K H)^-1 P replaces (I - K H) P. The start is in (rad/s)^2, the rate in Hz; on overflow the
    trace is infinite. Raises ValueError as `track`.
    """
    one = _build_filter(model, rate)
    moved, driven = np.diag([one.decay, 1.0]), np.diag([one.of_f, one.of_rrw])
    seen, covariance = np.ones((1, 2)), start * np.eye(2)
    traces = np.full(steps, math.inf)
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(steps):
            innovation = (seen @ covariance @ seen.T).item() + one.white
            # (I - K H)^-1 = I + K H / (1 - H K): of one measurement, H K = 1 - R / S.
            gain = covariance @ seen.T / innovation
            covariance = covariance + gain @ (seen @ covariance) * (innovation / one.white)
            trace = float(np.trace(covariance))
            if not math.isfinite(trace):
                break
            traces[k] = trace
            covariance = moved @ covariance @ moved.T + driven
    return traces
