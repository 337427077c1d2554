"""Coarse alignment: the attitude from the mean specific force and the mean rate of the Earth.

Two vectors that are known in both frames give the matrix between them in closed form (TRIAD;
H. D. Black, AIAA Journal 2(7), 1964). Gravity comes first: roll and pitch depend on the
accelerometers alone, and the heading on the horizontal part of the Earth's rate. With mean errors
df and dw in the navigation frame (K. R. Britting, "Inertial Navigation Systems Analysis",
Wiley 1971, chapter 9)

    psi_N = df_E / g,   psi_E = -df_N / g,   psi_D = dw_E / (w_ie cos(L)) - tan(L) psi_N.
"""

import numpy as np

from imubench_pipeline.extensions.calibration.alignment.attitude import euler_jacobian
from imubench_pipeline.extensions.calibration.alignment.triad import Positions, Site, Triad
from imubench_pipeline.extensions.calibration.experiment import block_mean_covariance
from imubench_pipeline.typing import Array


def coarse_alignment(force: Array, rate: Array, site: Site) -> Array:
    """Return the attitude from mean specific force and mean rate, shape (..., 3, 3).

    The matrices turn from body to navigation frame. Force, m/s^2, and rate, rad/s, are in the body
    frame, shape (..., 3). Raises ValueError if the two vectors are parallel.
    """
    return np.asarray(
        _build_triad(site.specific_force, site.earth_rate)
        @ np.swapaxes(_build_triad(force, rate), -1, -2)
    )


def mean_vectors(means: Array, positions: Positions) -> tuple[Array, Array]:
    """Return mean specific force and rate in the body frame of the first position, shapes (..., 3).

    Positions are weighted equally; opposite ones cancel the biases, except along the axis of the
    turns. The block means are of gyros and accelerometers x, y, z, rad/s and m/s^2, shape (..., b,
    6).
    """
    weighted = _weigh_blocks(positions)
    rate = np.einsum("bij,...bj->...i", weighted, means[..., :3])
    return np.einsum("bij,...bj->...i", weighted, means[..., 3:]), rate


def coarse_sigma(triad: Triad, positions: Positions, site: Site, attitude: Array) -> Array:
    """Return the standard deviations of roll, pitch and heading by coarse alignment, rad, (3,).

    ``attitude``, shape (3, 3), is the true attitude.
    """
    weighted = _weigh_blocks(positions)
    of_sensor = []
    for three in (triad.axes[:3], triad.axes[3:]):
        covariance = np.zeros((3, 3))
        for i, (model, bias) in enumerate(three):
            along = weighted[:, :, i].T
            covariance += (
                along @ (block_mean_covariance(model, positions.blocks) + bias**2) @ along.T
            )
        of_sensor.append(attitude @ covariance @ attitude.T)
    north, _, down = site.earth_rate
    of_rate, of_force = np.zeros((3, 3)), np.zeros((3, 3))
    of_force[0, 1], of_force[1, 0] = 1.0 / site.gravity, -1.0 / site.gravity
    of_force[2, 1] = down / north / site.gravity
    of_rate[2, 1] = 1.0 / north
    psi = of_rate @ of_sensor[0] @ of_rate.T + of_force @ of_sensor[1] @ of_force.T
    euler = euler_jacobian(attitude)
    return np.sqrt(np.diag(euler @ psi @ euler.T))


def _weigh_blocks(positions: Positions) -> Array:
    """Return the matrices of blocks, (b, 3, 3), with weights of sum 1: equal for all dwells."""
    blocks = positions.blocks
    of_dwell = np.bincount(blocks.dwell, weights=blocks.count)
    weights = blocks.count / of_dwell[blocks.dwell] / np.count_nonzero(of_dwell)
    return np.asarray(weights[:, None, None] * positions.of_blocks)


def _build_triad(first: Array, second: Array) -> Array:
    """Return an orthonormal triad as columns: first vector, normal, and the vector across."""
    along = _normalise(first)
    normal = _normalise(np.cross(first, second))
    return np.stack([along, normal, np.cross(along, normal)], axis=-1)


def _normalise(vector: Array) -> Array:
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    if np.any(length == 0.0):
        raise ValueError("specific force and rate are parallel: they do not determine the attitude")
    return np.asarray(vector / length)
