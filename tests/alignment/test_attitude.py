import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from imubench_pipeline.extensions.calibration.alignment.attitude import (
    cross_matrix,
    euler_angles,
    euler_jacobian,
    matrix,
    rotation,
)

angles = st.floats(-3.1, 3.1)
pitches = st.floats(-1.5, 1.5)


@given(angles, pitches, angles)
def test_the_matrix_is_three_turns(roll, pitch, heading):
    found = matrix(roll, pitch, heading)
    wanted = Rotation.from_euler("ZYX", [heading, pitch, roll]).as_matrix()
    np.testing.assert_allclose(found, wanted, atol=1e-14)
    np.testing.assert_allclose(euler_angles(found), [roll, pitch, heading], atol=1e-12)


@given(st.tuples(angles, angles, angles), st.floats(-12, 0))
def test_a_rotation_keeps_its_digits(vector, exponent):
    small = np.array(vector) * 10.0**exponent
    np.testing.assert_allclose(
        rotation(small), Rotation.from_rotvec(small).as_matrix(), rtol=1e-12, atol=1e-15
    )


def test_the_cross_matrix_is_the_cross_product():
    u, v = np.random.default_rng(1).standard_normal((2, 5, 3))
    np.testing.assert_allclose(np.einsum("rij,rj->ri", cross_matrix(v), u), np.cross(v, u))


@given(angles, pitches, angles, st.tuples(angles, angles, angles))
def test_small_errors_of_the_angles(roll, pitch, heading, direction):
    true, psi = matrix(roll, pitch, heading), 1e-6 * np.array(direction)
    wrong = (np.eye(3) - cross_matrix(psi)) @ true
    change = euler_angles(wrong) - euler_angles(true)
    change = (change + math.pi) % (2.0 * math.pi) - math.pi
    np.testing.assert_allclose(euler_jacobian(true) @ psi, change, atol=1e-8)
    np.testing.assert_allclose(rotation(psi) @ wrong, true, atol=1e-10)


def test_a_vertical_x_axis_has_no_roll_and_heading():
    with pytest.raises(ValueError, match="x axis is vertical"):
        euler_jacobian(matrix(0.1, math.pi / 2, 0.3))
