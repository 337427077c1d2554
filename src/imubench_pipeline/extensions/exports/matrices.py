"""The matrices of a Kalman filter, as JSON and as ``.npz``.

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
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from imubench_pipeline.extensions.exports.imu import Imu
from imubench_pipeline.extensions.exports.mapping import describe_terms
from imubench_pipeline.extensions.exports.programs import Program, describe
from imubench_pipeline.noise import NoiseModel
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
        "about": describe(imu, JSON),
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
    about = np.array(describe(imu, NPZ))
    stream = io.BytesIO()
    np.savez(stream, about=about, **arrays)  # type: ignore[arg-type]  # its stub takes a flag among the arrays
    return stream.getvalue()


JSON = Program(
    name="json",
    title="any Kalman filter: matrices as JSON",
    file_name="noise.json",
    family="N+GM+K",
    source="https://doi.org/10.1109/TAC.1978.1101743",  # C. Van Loan (1978), the discretisation
    convention=_CONVENTION,
    writer=write_json,
)
NPZ = replace(
    JSON,
    name="npz",
    title="any Kalman filter: matrices as NumPy arrays",
    file_name="noise.npz",
    writer=write_npz,
)
