"""A Python program with NumPy only: the noise matrices at any rate, and a prediction.

It supports white noise, Gauss-Markov processes, a random walk, and flicker noise as a bank of
Gauss-Markov processes (`noise.terms.flicker`) from the sampling period to four times the horizon.
Ramps, lines and quantization noise are left out.
"""

from __future__ import annotations

from imubench_pipeline.export.comments import describe_model, format_python_comments
from imubench_pipeline.export.imu import Imu
from imubench_pipeline.export.mapping import describe_terms
from imubench_pipeline.export.matrices import FLICKER_TAU_OVER_HORIZON
from imubench_pipeline.noise.terms.base import drives_of
from imubench_pipeline.words.reasons import exports as texts

_CONVENTION = (
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


def write(imu: Imu) -> str:
    """Return the program."""
    entries = ""
    left_out: list[str] = []
    for name, axis in imu.axes.items():
        others = [term for term in axis.model.terms if term.drive is None]
        if others:
            left_out.append(f"{name}: {texts.terms_not_supported(describe_terms(others))}.")
        longest = max(FLICKER_TAU_OVER_HORIZON * imu.horizon, 4.0 / imu.rate)
        drives = drives_of(axis.model.realised(1.0 / imu.rate, longest))
        white = float(drives.white)
        walk = float(sum(walk.density for walk in drives.walks))
        processes = [(float(part.density), float(part.T_B)) for part in drives.processes]
        unit = {"gyro": ("rad/s", "rad"), "accel": ("m/s^2", "m/s")}[name]
        entries += f'    "{name}": {{\n'
        entries += f'        "white": {white!r},  # N^2, ({unit[0]})^2/Hz\n'
        entries += f'        "walk": {walk!r},  # K^2, ({unit[0]})^2/s\n'
        entries += f'        "gauss_markov": [  # S_B in ({unit[0]})^2/s, T_B in s\n'
        entries += "".join(f"            ({S!r}, {T!r}),\n" for S, T in processes)
        entries += f'        ],\n        "integral": "{unit[1]}",\n    }},\n'
    about = [*describe_model(imu, "Python", _CONVENTION), *left_out]
    return format_python_comments(about) + _PROGRAM.format(
        rate=float(imu.rate), horizon=float(imu.horizon), noise=entries
    )
