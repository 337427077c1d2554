"""The matrices of a Kalman filter, as JSON, as ``.npz`` and as a program in Python.

The states depend on the terms: none for white noise; one for a Gauss-Markov process and a random
walk; two for a ramp, a line and quantization noise. Flicker noise is approximated by a bank of
Gauss-Markov processes up to four times the horizon. In continuous time

    x' = F x + w, E[w w'] = Q delta, z = H x + v, E[v v'] = R delta,

and in discrete time, exact for the rate,

    x_(k+1) = Phi x_k + w_k, E[w_k w_k'] = Q_d, z_k = H x_k + v_k, E[v_k^2] = R_d,

with mean x0 and covariance P0 of the first x. Quantization noise has no continuous form.
"""

import io
import json
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from imubench_pipeline.extensions.exports.comments import describe_model, format_python_comments
from imubench_pipeline.extensions.exports.imu import Imu
from imubench_pipeline.extensions.exports.mapping import describe_terms
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.terms.base import drives_of
from imubench_pipeline.typing import Array

FLICKER_TAU_OVER_HORIZON = 4.0
"""Longest tau of the approximation of flicker noise, over the horizon."""

_MATRICES = ("F", "Q", "H_continuous", "R", "Phi", "Q_d", "H", "R_d", "x0", "P0")
_CONVENTION = (
    "SI; densities are two-sided. Continuous: x' = F x + w, z = H x + v with densities Q and R of "
    "w and v. Discrete at {rate:g} Hz: Phi, Q_d, H, R_d, exact; x0 and P0: mean and covariance of "
    "the first x."
)


@dataclass(frozen=True)
class Matrices:
    """A noise model in continuous and discrete time; m states."""

    F: Array  # shape (m, m); continuous in time, without the states of quantization noise
    Q: Array  # shape (m, m)
    H_continuous: Array  # shape (m,)
    R: float  # density of the white noise, N^2
    Phi: Array  # shape (m, m)
    Q_d: Array  # shape (m, m)
    H: Array  # shape (m,)
    R_d: float
    x0: Array  # shape (m,)
    P0: Array  # shape (m, m)
    states: Sequence[str]  # term of each state of the discrete model


def compute_matrices(model: NoiseModel, rate: float, horizon: float) -> Matrices:
    """Return the matrices of a model at a rate, Hz; flicker noise up to four times `horizon`, s."""
    longest = max(FLICKER_TAU_OVER_HORIZON * horizon, 4.0 / rate)
    terms = model.realised(1.0 / rate, longest)
    discrete = model.state_space(rate, longest)
    spaces = [term.continuous_space() for term in terms]
    continuous = [space for space in spaces if space is not None]
    nothing = np.zeros((0, 0))
    return Matrices(
        F=block_diag(nothing, *(space.transition for space in continuous)),
        Q=block_diag(nothing, *(space.density for space in continuous)),
        H_continuous=np.concatenate([np.zeros(0), *(space.output for space in continuous)]),
        R=sum(term.drive.white for term in terms if term.drive is not None and term.drive.white),
        Phi=discrete.transition,
        Q_d=discrete.process_noise,
        H=discrete.output,
        R_d=discrete.measurement_noise,
        x0=discrete.initial_mean,
        P0=discrete.initial_variance,
        states=[describe_terms([t]) for t in terms for _ in t.state_space(1.0 / rate).output],
    )


def write_json(imu: Imu) -> str:
    """Return all matrices as JSON; a quantity without an estimate is absent."""
    content: dict[str, object] = {
        "about": describe_model(imu, "any Kalman filter", _CONVENTION.format(rate=imu.rate)),
        "sensor": imu.sensor,
        "rate": imu.rate,
        "horizon": imu.horizon,
        "gravity": imu.gravity,
        "inflation": imu.inflation,
    }
    for name, axis in imu.axes.items():
        model = axis.model
        of_axis = compute_matrices(model, imu.rate, imu.horizon)
        lists = [np.asarray(getattr(of_axis, key)).tolist() for key in _MATRICES]
        F, Q, H_continuous, R, Phi, Q_d, H, R_d, x0, P0 = lists
        content[name] = {
            "model": model.name,
            "unit": {"gyro": "rad/s", "accel": "m/s^2"}[name],
            "parameters": {
                **{key: getattr(model, key) for key in ("Q", "N", "B", "K", "R", "T_B")},
                "further": [{"term": term.symbol} | term.values for term in model.further],
                "sinusoids": [line.values for line in model.sinusoids],
            },
            "density_bounded": list(axis.bounded) if axis.bounded else None,
            "states": list(of_axis.states),
            "continuous": {"F": F, "Q": Q, "H": H_continuous, "R": R},
            "discrete": {"Phi": Phi, "Q_d": Q_d, "H": H, "R_d": R_d, "x0": x0, "P0": P0},
        }
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def write_npz(imu: Imu) -> bytes:
    """Return the same matrices as NumPy arrays, such as ``gyro_Phi``, and ``about``."""
    arrays: dict[str, Array] = {"rate": np.array(imu.rate), "horizon": np.array(imu.horizon)}
    for name, axis in imu.axes.items():
        of_axis = compute_matrices(axis.model, imu.rate, imu.horizon)
        if axis.bounded:
            arrays[f"{name}_density_bounded"] = np.array(axis.bounded)
        for key in _MATRICES:
            arrays[f"{name}_{key}"] = np.asarray(getattr(of_axis, key))
    about = np.array(describe_model(imu, "any Kalman filter", _CONVENTION.format(rate=imu.rate)))
    stream = io.BytesIO()
    np.savez(stream, about=about, **arrays)  # type: ignore[arg-type]  # its stub takes a flag among the arrays
    return stream.getvalue()


_PROGRAM_CONVENTION = (
    "White noise and random walk by their two-sided densities N^2 and K^2, Gauss-Markov processes "
    "by the density S_B of their drive and T_B: SI, continuous in time; the matrices are exact at "
    "any rate."
)

_PROGRAM = '''
import numpy as np

RATE = {rate!r}  # Hz
HORIZON = {horizon!r}  # s
NOISE = {{
{noise}}}


def matrices(noise, rate):
    """Return Phi, Q_d, H, R_d, x0 and P0: x' = Phi x + w, z = H x + v."""
    dt = 1.0 / rate
    density, time = np.array(noise["gauss_markov"]).reshape(-1, 2).T
    stationary = density * time / 2.0
    phi = np.append(np.exp(-dt / time), 1.0)
    drive = np.append(-stationary * np.expm1(-2.0 * dt / time), noise["walk"] * dt)
    start = np.append(stationary, 0.0)
    one = np.ones(len(phi))
    return np.diag(phi), np.diag(drive), one, noise["white"] / dt, 0.0 * one, np.diag(start)


def propagate(x, P, noise, rate, steps):
    """Return mean and covariance of (integral, states) after steps without a measurement.

    ``x`` and ``P`` begin with the integral of the noise: angle, or velocity.
    """
    Phi, Q_d, H, R_d, _, _ = matrices(noise, rate)
    m = len(H)
    A = np.eye(1 + m)
    A[0, 1:], A[1:, 1:] = H / rate, Phi
    Q = np.zeros((1 + m, 1 + m))
    Q[0, 0], Q[1:, 1:] = R_d / rate**2, Q_d
    for _ in range(steps):
        x, P = A @ x, A @ P @ A.T + Q
    return x, P


if __name__ == "__main__":
    for name, noise in NOISE.items():
        size = 1 + len(matrices(noise, RATE)[2])
        _, P = propagate(
            np.zeros(size), np.zeros((size, size)), noise, RATE, round(HORIZON * RATE)
        )
        print(name, repr(float(np.sqrt(P[0, 0]))), noise["integral"], "after", HORIZON, "s")
'''


def write_python(imu: Imu) -> str:
    """Return a Python program with NumPy only: the noise matrices at any rate, and a prediction.

    It supports white noise, Gauss-Markov processes, a random walk, and flicker noise as a bank of
    Gauss-Markov processes (`noise.terms.flicker`) from the sampling period to four times the
    horizon. Ramps, lines and quantization noise are left out.
    """
    entries = ""
    left_out: list[str] = []
    for name, axis in imu.axes.items():
        others = [term for term in axis.model.terms if term.drive is None]
        if others:
            left_out.append(f"{name}: not included: {describe_terms(others)}.")
        longest = max(FLICKER_TAU_OVER_HORIZON * imu.horizon, 4.0 / imu.rate)
        drives = drives_of(axis.model.realised(1.0 / imu.rate, longest))
        white = float(drives.white)
        slow = list(zip(drives.densities.tolist(), drives.times.tolist(), strict=True))
        walk = float(sum(S for S, T in slow if T == np.inf))
        processes = [part for part in slow if part[1] < np.inf]
        unit = {"gyro": ("rad/s", "rad"), "accel": ("m/s^2", "m/s")}[name]
        entries += f'    "{name}": {{\n'
        entries += f'        "white": {white!r},  # N^2, ({unit[0]})^2/Hz\n'
        entries += f'        "walk": {walk!r},  # K^2, ({unit[0]})^2/s\n'
        entries += f'        "gauss_markov": [  # S_B in ({unit[0]})^2/s, T_B in s\n'
        entries += "".join(f"            ({S!r}, {T!r}),\n" for S, T in processes)
        entries += f'        ],\n        "integral": "{unit[1]}",\n    }},\n'
    about = [*describe_model(imu, "Python", _PROGRAM_CONVENTION), *left_out]
    return format_python_comments(about) + _PROGRAM.format(
        rate=float(imu.rate), horizon=float(imu.horizon), noise=entries
    )
