"""The mechanisation against its inverse, another program's, and an Earth that turns."""

import math

import inu
import numpy as np
import pytest
import r3f

from imubench_pipeline.earth import EARTH_RATE, STANDARD_GRAVITY
from imubench_pipeline.extensions.aided.strapdown import EARTH_RADIUS, invert_mechanisation
from imubench_pipeline.extensions.aided.trajectories import (
    DEFAULT_LATITUDE,
    TRAJECTORY_NAMES,
    Trajectory,
    simulate_trajectory,
)
from imubench_pipeline.extensions.calibration.alignment.attitude import euler_angles
from tests.aided.mechanisation import mechanise


@pytest.mark.parametrize("name", TRAJECTORY_NAMES)
def test_mechanisation_of_ideal_measurements_follows_the_trajectory(name: str) -> None:
    way = simulate_trajectory(name, 600.0, 100.0)
    reached = mechanise(
        way.position[0], way.velocity[0], way.attitude[0], way.rate, way.force, 0.01, way.earth
    )
    for got, true, most in zip(
        reached, (way.position, way.velocity, way.attitude), (1e-5, 1e-7, 1e-9), strict=True
    ):
        np.testing.assert_allclose(got, true, rtol=0, atol=most)


def test_at_rest_sensors_measure_the_earth() -> None:
    way = simulate_trajectory("rest", 10.0, 50.0)
    north, down = EARTH_RATE * math.cos(DEFAULT_LATITUDE), -EARTH_RATE * math.sin(DEFAULT_LATITUDE)
    np.testing.assert_allclose(way.rate, np.tile([north, 0.0, down], (500, 1)), atol=1e-12)
    np.testing.assert_allclose(way.force, np.tile([0, 0, -STANDARD_GRAVITY], (500, 1)), atol=1e-9)


def _elsewhere(way: Trajectory, every: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position in the plane, velocity and angles at the end, by curvilinear mechanisation."""
    T = every / way.sampling
    _, rate, force = invert_mechanisation(
        way.position[0], way.velocity[::every], way.attitude[::every], T, way.earth
    )
    llh = np.array([DEFAULT_LATITUDE, 0.1, 0.0])
    start = r3f.dcm_to_rpy(way.attitude[0].T)
    padded = [np.vstack([samples, samples[-1:]]) for samples in (force, rate)]
    at, velocity, angles = inu.mech(
        *padded,
        llh,
        way.velocity[0],
        np.array(start),
        T,
        grav_model=lambda llh: np.array(
            [0.0, 0.0, STANDARD_GRAVITY * (1.0 - 2.0 * llh[2] / EARTH_RADIUS)]
        ),
        show_progress=False,
    )
    origin = r3f.geodetic_to_ecef(llh)
    return r3f.ecef_to_tangent(r3f.geodetic_to_ecef(at[-1]), origin), velocity[-1], angles[-1]


@pytest.mark.release
@pytest.mark.parametrize(("name", "drive"), [("car", 60.0), ("drone", 60.0), ("field", 60.0)])
def test_another_program_gets_as_far(name: str, drive: float) -> None:
    # Its steps are of first order: the limit of small ones, by Richardson from 10 and 5 ms.
    way = simulate_trajectory(name, drive, 200.0)
    coarse, fine = (_elsewhere(way, every) for every in (2, 1))
    position, velocity, angles = (2.0 * f - c for c, f in zip(coarse, fine, strict=True))
    # Its frame goes with the vehicle and lies on the ellipsoid; 1 km is 0.2 mrad.
    np.testing.assert_allclose(position, way.position[-1], atol=0.03)
    np.testing.assert_allclose(velocity, way.velocity[-1], atol=0.005)
    off = angles[2] - euler_angles(way.attitude[-1])[2]
    assert abs(math.remainder(off, 2.0 * math.pi)) < 1e-3
