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
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.extensions.exports.imu import Imu
from imubench_pipeline.extensions.exports.mapping import describe_terms
from imubench_pipeline.extensions.exports.programs import Program, describe
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

FLICKER_TAU_OVER_HORIZON = 4.0
"""Longest tau of the approximation of flicker noise, over the horizon."""

_CONVENTION = (
    "SI; densities are two-sided. Continuous: x' = F x + w, z = H x + v with densities Q and R of "
    "w and v. Discrete at {rate:g} Hz: Phi, Q_d, H, R_d, exact; x0 and P0: mean and covariance of "
    "the first x."
)


Matrices = dict[str, Array]


def compute_matrices(
    model: NoiseModel, rate: float, horizon: float
) -> tuple[Matrices, Matrices, list[str]]:
    """Return a model in continuous and in discrete time, and the term of each discrete state.

    The rate is in Hz; flicker noise is approximated up to four times `horizon`, s. Continuous, with
    m states, none for quantization noise: F and Q, shape (m, m), H, shape (m,), and the density R
    of the white noise. Discrete, with n states: Phi, Q_d and P0, shape (n, n), H and x0, shape
    (n,), and the variance R_d.
    """
    longest = max(FLICKER_TAU_OVER_HORIZON * horizon, 4.0 / rate)
    terms = model.realised(1.0 / rate, longest)
    spaces = [space for term in terms if (space := term.continuous_space()) is not None]
    white = sum(term.drive.white for term in terms if term.drive is not None and term.drive.white)
    nothing = np.zeros((0, 0))
    continuous = {
        "F": block_diag(nothing, *(space.transition for space in spaces)),
        "Q": block_diag(nothing, *(space.density for space in spaces)),
        "H": np.concatenate([np.zeros(0), *(space.output for space in spaces)]),
        "R": np.asarray(white),
    }
    sampled = model.state_space(rate, longest)
    discrete = {
        "Phi": sampled.transition,
        "Q_d": sampled.process_noise,
        "H": sampled.output,
        "R_d": np.asarray(sampled.measurement_noise),
        "x0": sampled.initial_mean,
        "P0": sampled.initial_variance,
    }
    states = [describe_terms([t]) for t in terms for _ in t.state_space(1.0 / rate).output]
    return continuous, discrete, states


def write_json(imu: Imu) -> str:
    """Return all matrices as JSON; a quantity without an estimate is absent."""
    content: dict[str, object] = {
        "about": describe(imu, JSON),
        "sensor": imu.sensor,
        "rate": imu.rate,
        "horizon": imu.horizon,
        "gravity": STANDARD_GRAVITY,
        "inflation": imu.inflation,
    }
    for name, axis in imu.axes.items():
        model = axis.model
        continuous, discrete, states = compute_matrices(model, imu.rate, imu.horizon)
        content[name] = {
            "model": model.name,
            "unit": {"gyro": "rad/s", "accel": "m/s^2"}[name],
            "parameters": {
                **{key: getattr(model, key) for key in ("Q", "N", "B", "K", "R", "T_B")},
                "further": [{"term": term.symbol} | term.values for term in model.further],
                "sinusoids": [line.values for line in model.sinusoids],
            },
            "density_bounded": list(axis.bounded) if axis.bounded else None,
            "states": states,
            "continuous": {key: matrix.tolist() for key, matrix in continuous.items()},
            "discrete": {key: matrix.tolist() for key, matrix in discrete.items()},
        }
    return json.dumps(content, indent=1, allow_nan=False) + "\n"


def write_npz(imu: Imu) -> bytes:
    """Return the matrices of `write_json` as a ``.npz`` file, with arrays such as ``gyro_Phi``."""
    arrays: dict[str, Array] = {"rate": np.array(imu.rate), "horizon": np.array(imu.horizon)}
    for name, axis in imu.axes.items():
        continuous, discrete, _ = compute_matrices(axis.model, imu.rate, imu.horizon)
        if axis.bounded:
            arrays[f"{name}_density_bounded"] = np.array(axis.bounded)
        continuous["H_continuous"] = continuous.pop("H")
        arrays |= {f"{name}_{key}": array for key, array in (continuous | discrete).items()}
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
