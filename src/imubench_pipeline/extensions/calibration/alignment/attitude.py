"""Attitude: matrices, Euler angles, and small errors of them.

The navigation frame is north, east, down; the body frame forward, right, down. C turns vectors of
the body frame into the navigation frame, C = R_z(heading) R_y(pitch) R_x(roll). An estimate C~ is
in error by the small angles psi of the navigation frame,

    C~ = (I - [psi x]) C        (D. H. Titterton and J. L. Weston, "Strapdown Inertial Navigation
                                 Technology", IET 2004, section 12.3).
"""

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.typing import Array

MIN_COS_PITCH = 1e-6  # below it roll and heading are not separable (gimbal lock)


def matrix(roll: ArrayLike, pitch: ArrayLike, heading: ArrayLike) -> Array:
    """Return matrices from body to navigation frame, (..., 3, 3), of angles, rad, shape (...)."""
    (cr, cp, ch), (sr, sp, sh) = (
        [f(np.asarray(angle)) for angle in (roll, pitch, heading)] for f in (np.cos, np.sin)
    )
    rows = [
        [ch * cp, ch * sp * sr - sh * cr, ch * sp * cr + sh * sr],
        [sh * cp, sh * sp * sr + ch * cr, sh * sp * cr - ch * sr],
        [-sp, cp * sr, cp * cr],
    ]
    return np.ascontiguousarray(np.moveaxis(np.array(rows), (0, 1), (-2, -1)))


def euler_angles(attitude: Array) -> Array:
    """Return roll, pitch (-pi/2 to pi/2) and heading, rad, of attitudes of shape (..., 3, 3)."""
    c = attitude
    level = np.hypot(c[..., 0, 0], c[..., 1, 0])
    return np.stack(
        [
            np.arctan2(c[..., 2, 1], c[..., 2, 2]),
            np.arctan2(-c[..., 2, 0], level),
            np.arctan2(c[..., 1, 0], c[..., 0, 0]),
        ],
        axis=-1,
    )


def cross_matrix(vector: ArrayLike) -> Array:
    """Return [v x], shape (..., 3, 3), for v, shape (..., 3), so that [v x] u is v x u."""
    v = np.asarray(vector, dtype=np.float64)
    cross = np.zeros((*v.shape, 3))
    cross[..., 0, 1], cross[..., 0, 2], cross[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    return cross - np.swapaxes(cross, -1, -2)


def rotation(vector: ArrayLike) -> Array:
    """Return the matrix of a rotation vector, rad, (..., 3): exp([v x]), shape (..., 3, 3)."""
    v = np.asarray(vector, dtype=np.float64)
    angle = np.linalg.norm(v, axis=-1)[..., None, None]
    across = cross_matrix(v)
    # sin(x)/x and (1 - cos(x))/x^2 = sinc^2(x/2)/2, which stay accurate near 0.
    sine_part = np.sinc(angle / np.pi)
    cosine_part = 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2
    return np.asarray(np.eye(3) + sine_part * across + cosine_part * across @ across)


def euler_jacobian(attitude: Array) -> Array:
    """Return d(roll, pitch, heading)/d(psi), shape (3, 3); ValueError if the pitch is +-pi/2.

    ``psi``: small error angles of the attitude about the navigation axes, rad (see the module).
    """
    _, pitch, heading = euler_angles(attitude)
    cp, sp, ch, sh = np.cos(pitch), np.sin(pitch), np.cos(heading), np.sin(heading)
    if cp < MIN_COS_PITCH:
        raise ValueError("the x axis is vertical: roll and heading cannot be separated")
    # Columns: small rotations in the navigation frame due to roll, pitch and heading.
    turns = np.array([[cp * ch, -sh, 0.0], [cp * sh, ch, 0.0], [-sp, 0.0, 1.0]])
    return -np.linalg.inv(turns)
