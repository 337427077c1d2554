"""Readings of an error-free triad that is turned about its z axis."""

from __future__ import annotations

import numpy as np

from imubench_pipeline.extensions.calibration.alignment.triad import Site
from imubench_pipeline.typing import Array


def sensed(site: Site, attitude: Array, angle: Array, turning: Array) -> Array:
    """Return rate and specific force in the body frame, rad/s and m/s^2, shape (n, 6).

    Gyros and accelerometers x, y, z are without errors, and the turns are about the accelerometers.
    The attitude, shape (3, 3), belongs to the first position; ``angle`` is the angle from it about
    z, rad, and ``turning`` the rate of this angle, rad/s, shape (n,).
    """
    cosine, sine = np.cos(angle), np.sin(angle)
    columns = []
    for vector in (site.earth_rate, site.specific_force):
        x, y, z = attitude.T @ vector
        columns += [cosine * x + sine * y, cosine * y - sine * x, np.full(len(angle), z)]
    columns[2] = columns[2] + turning
    return np.stack(columns, axis=1)
