import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.alignment.accuracy import simulate_triad, true_means
from imubench_pipeline.extensions.calibration.alignment.attitude import euler_angles, matrix
from imubench_pipeline.extensions.calibration.alignment.coarse import (
    coarse_alignment,
    coarse_sigma,
    mean_vectors,
)
from imubench_pipeline.extensions.calibration.alignment.triad import Positions, Site, Triad
from imubench_pipeline.extensions.calibration.experiment import Dwell, Experiment
from imubench_pipeline.noise import NoiseModel
from tests.alignment.triads import ALIKE, ATTITUDE, ONE, POSITIONS, SITE, TWO, UNLIKE
from tests.conftest import few

angles = st.floats(-3.1, 3.1)


@given(angles, st.floats(-1.5, 1.5), angles, st.floats(-1.5, 1.5))
def test_without_errors_it_is_exact(roll, pitch, heading, latitude):
    site, true = Site(latitude=latitude), matrix(roll, pitch, heading)
    for positions in (ONE, TWO):
        means = true_means(positions, site, true)
        found = coarse_alignment(*mean_vectors(means, positions), site)
        np.testing.assert_allclose(found, true, atol=1e-9)


def test_roll_and_pitch_are_those_of_gravity_alone():
    force = np.array([0.4, -0.8, -9.7])
    rate = np.array([3e-5, -2e-5, 5e-5])
    roll, pitch, heading = euler_angles(coarse_alignment(force, rate, Site(latitude=0.5)))
    assert roll == pytest.approx(math.atan2(-force[1], -force[2]))
    assert pitch == pytest.approx(math.atan2(force[0], math.hypot(force[1], force[2])))
    level = matrix(roll, pitch, 0.0) @ rate
    assert heading == pytest.approx(math.atan2(-level[1], level[0]))


@pytest.mark.parametrize("triad", few([UNLIKE], [ALIKE]))
@pytest.mark.parametrize("name", few(["four"], ["one", "two"]))
def test_errors_are_as_large_as_it_says(name, triad):
    positions = POSITIONS[name]
    drawn = simulate_triad(
        triad, positions, SITE, ATTITUDE, runs=4000, rng=np.random.default_rng(1)
    )
    found = coarse_alignment(*mean_vectors(drawn.means, positions), SITE)
    error = euler_angles(found) - euler_angles(ATTITUDE)
    said = coarse_sigma(triad, positions, SITE, ATTITUDE)
    np.testing.assert_allclose(np.sqrt(np.mean(error**2, axis=0)), said, rtol=0.05)


def test_level_errors_are_bias_over_gravity_and_over_the_horizontal_rate():
    # Biases alone; level, heading north, so that y is east. Down's rate tilts into the heading.
    triad = Triad(
        gyros=[NoiseModel(N=1e-12)] * 3,
        accelerometers=[NoiseModel(N=1e-12)] * 3,
        gyro_bias=1e-6,
        accelerometer_bias=2e-3,
    )
    found = coarse_sigma(triad, ONE, SITE, np.eye(3))
    tilt = 2e-3 / SITE.gravity
    assert found[0] == pytest.approx(tilt, rel=1e-6)
    assert found[1] == pytest.approx(tilt, rel=1e-6)
    east = 1e-6 / (EARTH_RATE * math.cos(SITE.latitude))
    assert found[2] == pytest.approx(math.hypot(east, math.tan(SITE.latitude) * tilt), rel=1e-6)
    # Turned end for end they go.
    assert np.all(coarse_sigma(triad, TWO, SITE, np.eye(3)) < 1e-6)


def test_every_position_counts_alike():
    run = Experiment((Dwell(0, 30, 1), Dwell(40, 140, 1)), 1.0, 0.0)
    positions = Positions(run.blocks(10), TWO.turned)
    means = true_means(positions, SITE, ATTITUDE) + 1e-5
    found = coarse_alignment(*mean_vectors(means, positions), SITE)
    # A bias of the level axes drops out; that of z is along the vertical of a level body alone.
    force, rate = mean_vectors(np.full((13, 6), 1e-5), positions)
    np.testing.assert_allclose(force[:2], 0.0, atol=1e-18)
    np.testing.assert_allclose(rate[:2], 0.0, atol=1e-18)
    assert rate[2] == pytest.approx(1e-5)
    assert np.abs(euler_angles(found) - euler_angles(ATTITUDE)).max() < 0.1


def test_what_gives_no_attitude_is_refused():
    with pytest.raises(ValueError, match="are parallel"):
        coarse_alignment(np.array([0, 0, -9.8]), np.array([0, 0, -1e-5]), SITE)
    for latitude in (math.pi / 2, -math.pi / 2, 3.0, math.nan):
        with pytest.raises(ValueError, match="between the poles"):
            Site(latitude=latitude)
    with pytest.raises(ValueError, match="gravity"):
        Site(latitude=0.0, gravity=0.0)
    with pytest.raises(ValueError, match="2 gyros, expected three"):
        Triad(
            gyros=ALIKE.gyros[:2],
            accelerometers=ALIKE.accelerometers,
            gyro_bias=0.0,
            accelerometer_bias=0.0,
        )
    with pytest.raises(ValueError, match="accelerometer_bias"):
        replace(ALIKE, accelerometer_bias=math.inf)
    with pytest.raises(ValueError, match="shape"):
        Positions(ONE.blocks, TWO.turned)
    for wrong in (np.eye(3) * 2.0, np.diag([1.0, 1.0, -1.0])):
        with pytest.raises(ValueError, match="not a rotation"):
            Positions(ONE.blocks, wrong[None])
