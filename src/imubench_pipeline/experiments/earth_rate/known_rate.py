"""Bias tracking with known rate: the filter of the paper, for comparison (003 eq. 15, 16).

It cannot find the Earth's rate. Its measurement y = w_ie - w~ is formed with the rate that is
wanted: what it tracks is the gyro's error, and the reading less the error so tracked is, on
average, the rate that was put in, whatever that was. Given twice the Earth's rate it "finds" twice
the Earth's rate, as fast and as surely; the 30 to 60 s after which the paper's runs agree with the
true value are the filter's own time constant. The sign of the dwell, which alone tells the rate
from a bias, is not in it, nor is the latitude. What it is good for is the error of a gyro that
stands still at a known attitude.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.experiments.earth_rate.experiment import Experiment
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_START = 0.1
"""P_0 = 0.1 I of the paper; it prints no unit, here (rad/s)^2."""


@dataclass(frozen=True)
class Tracked:
    """What comes of the filter that is given the rate, for the samples in dwells."""

    sample: NDArray[np.int64]  # shape (n,); number of each sample in the log
    drift: Array  # shape (n,); tracked error of the gyro, z_f + z_rrw, rad/s
    # shape (n,); cumulative mean of what it calls the Earth's rate, reading less drift, as in the
    # paper's figures 10 to 13, rad/s
    mean: Array


def track(log: Array, experiment: Experiment, model: NoiseModel, known_rate: float) -> Tracked:
    """Track the bias of a gyro with the filter of the paper, which is given the Earth's rate.

    F = diag(e^(-T/T_B), 1), H = [1, 1], R_d = N^2/T, Q_d = T diag(S_B, S_K), P_0 = 0.1 I, x_0 = 0
    as printed, also where that is an approximation (the first entry of Q_d). Samples of turning are
    left out, as if no time lay between dwells. The log, shape (samples,), is in rad/s, NaN where a
    sample is missing, and so is the rate that the filter is given, and returns; of the model N, B
    with T_B, and K are used.

    Raises
    ------
    ValueError
        If the model has no white noise, or its B no correlation time.
    """
    processes = [term.gauss_markov for term in model.terms if term.gauss_markov is not None]
    process = processes[0] if processes else None
    if model.N == 0 or (model.B > 0 and model.T_B is None):
        raise ValueError("the paper's filter needs N, and a Gauss-Markov process for B")
    sample = np.concatenate([np.arange(dwell.start, dwell.stop) for dwell in experiment.dwells])
    sample = sample[np.isfinite(log[sample])]
    interval = 1.0 / experiment.rate
    drift = _tracked(
        log[sample] - known_rate,
        math.exp(-interval / process.T_B) if process else 0.0,
        interval * (process.density if process else 0.0),
        interval * model.K**2,
        model.N**2 / interval,
    )
    corrected = log[sample] - drift
    return Tracked(sample, drift, np.cumsum(corrected) / np.arange(1, len(sample) + 1))


@njit(cache=True, nogil=True)
def _tracked(error: Array, decay: float, of_f: float, of_rrw: float, white: float) -> Array:
    """Return z_f + z_rrw after each measurement of their sum."""
    drift = np.empty_like(error)
    f, rrw = 0.0, 0.0
    var_f, cross, var_rrw = _START, 0.0, _START
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
