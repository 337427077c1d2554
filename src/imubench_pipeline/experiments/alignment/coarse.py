"""Coarse alignment: the attitude from the mean specific force and the mean rate of the Earth.

Two vectors that are known in both frames give the matrix between them in closed form (TRIAD;
H. D. Black, AIAA Journal 2(7), 1964). Gravity comes first: roll and pitch are those of the
accelerometers alone, and the heading is that of the horizontal part of the Earth's rate. With mean
errors df and dw in the navigation frame (K. R. Britting, "Inertial Navigation Systems Analysis",
Wiley 1971, chapter 9)

    psi_N = df_E / g,   psi_E = -df_N / g,   psi_D = dw_E / (w_ie cos(L)) - tan(L) psi_N.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from imubench_pipeline.experiments.alignment.attitude import of_euler_angles
from imubench_pipeline.experiments.alignment.triad import Positions, Site, Triad
from imubench_pipeline.experiments.earth_rate.covariance import of_means
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class CoarseAccuracy:
    """How well an attitude is known."""

    psi: Array  # shape (3, 3); covariance of the small errors about north, east and down, rad^2
    sigma: Array  # shape (3,); standard deviations of roll, pitch and heading, rad


def coarse_alignment(force: Array, rate: Array, site: Site) -> Array:
    """Return the attitude from mean specific force and mean rate, shape (..., 3, 3).

    From body to navigation frame; force, m/s^2, and rate, rad/s, are in the body frame, shape (...,
    3).

    Raises
    ------
    ValueError
        If the two vectors are along each other.
    """
    return np.asarray(
        _frame(site.specific_force, site.earth_rate) @ np.swapaxes(_frame(force, rate), -1, -2)
    )


def mean_vectors(means: Array, positions: Positions) -> tuple[Array, Array]:
    """Return mean specific force and rate in the body frame of the first position, shapes (..., 3).

    Every position counts alike, however long it is: where they are opposite, biases go. What turns
    do not reverse stays, such as the bias of the gyro about whose axis they are: where that is
    large and the axis is not vertical, only fine alignment finds the heading. The means of blocks
    are of gyros and accelerometers x, y, z, rad/s and m/s^2, shape (..., b, 6).
    """
    weighed = _weights(positions)[:, None, None] * positions.of_blocks
    rate = np.einsum("bij,...bj->...i", weighed, means[..., :3])
    force = np.einsum("bij,...bj->...i", weighed, means[..., 3:])
    return force, rate


def coarse_accuracy(
    triad: Triad, positions: Positions, site: Site, attitude: Array
) -> CoarseAccuracy:
    """Return how well coarse alignment finds an attitude, to the first order.

    The attitude, shape (3, 3), is the true one, in the first position.

    Raises
    ------
    ValueError
        If the x axis is vertical.
    """
    weighed = _weights(positions)[:, None, None] * positions.of_blocks
    of_sensor = []
    for three in (triad.axes[:3], triad.axes[3:]):
        covariance = np.zeros((3, 3))
        for i, (model, bias) in enumerate(three):
            along = weighed[:, :, i].T
            covariance += along @ (of_means(model, positions.blocks) + bias**2) @ along.T
        of_sensor.append(attitude @ covariance @ attitude.T)
    north, _, down = site.earth_rate
    of_rate, of_force = np.zeros((3, 3)), np.zeros((3, 3))
    of_force[0, 1], of_force[1, 0] = 1.0 / site.gravity, -1.0 / site.gravity
    of_force[2, 1] = down / north / site.gravity
    of_rate[2, 1] = 1.0 / north
    psi = of_rate @ of_sensor[0] @ of_rate.T + of_force @ of_sensor[1] @ of_force.T
    euler = of_euler_angles(attitude)
    return CoarseAccuracy(psi, np.sqrt(np.diag(euler @ psi @ euler.T)))


def _weights(positions: Positions) -> Array:
    """Return the weight of each block, whose sum is 1: samples present, dwells alike."""
    blocks = positions.blocks
    of_dwell = np.bincount(blocks.dwell, weights=blocks.count)
    dwells_with_samples = np.count_nonzero(of_dwell)
    return np.asarray(blocks.count / of_dwell[blocks.dwell] / dwells_with_samples)


def _frame(first: Array, second: Array) -> Array:
    """Return unit columns: the first, the normal of both, and what is across these."""
    along = _unit(first)
    normal = _unit(np.cross(first, second))
    return np.stack([along, normal, np.cross(along, normal)], axis=-1)


def _unit(vector: Array) -> Array:
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    if np.any(length == 0.0):
        raise ValueError("specific force and rate are along each other: they give no attitude")
    return np.asarray(vector / length)
