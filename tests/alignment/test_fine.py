import math

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import chi2

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.alignment.accuracy import simulate_triad, true_means
from imubench_pipeline.extensions.calibration.alignment.attitude import (
    cross_matrix,
    euler_angles,
    matrix,
)
from imubench_pipeline.extensions.calibration.alignment.coarse import (
    coarse_alignment,
    coarse_sigma,
    mean_vectors,
)
from imubench_pipeline.extensions.calibration.alignment.fine import (
    INITIAL_ANGLE_SIGMA,
    FineAlignment,
    align,
)
from imubench_pipeline.extensions.calibration.alignment.triad import Positions, Triad
from imubench_pipeline.extensions.calibration.experiment import Dwell, Experiment, block_means
from imubench_pipeline.extensions.calibration.least_squares import NotObservableError
from imubench_pipeline.extensions.earth_rate.simulation import PAPER_MODEL
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.simulate.model import SensorModel
from imubench_pipeline.simulate.simulation import simulate
from tests.alignment.triads import (
    ACCELEROMETER,
    ALIKE,
    ATTITUDE,
    FOUR,
    ONE,
    POSITIONS,
    SITE,
    TWO,
    UNLIKE,
)
from tests.conftest import few
from tests.earth_rate.brute import of_blocks

HORIZONTAL = EARTH_RATE * math.cos(SITE.latitude)


def by_matrices(triad, positions, means):
    """Return psi and its covariance from the covariance of all samples of the six axes."""
    to_body = np.swapaxes(ATTITUDE @ positions.of_blocks, 1, 2)
    x = [
        (to_body @ cross_matrix(v))[:, axis]
        for v in (SITE.earth_rate, SITE.specific_force)
        for axis in range(3)
    ]
    covariance = block_diag(
        *(of_blocks(model, positions.blocks) + bias**2 for model, bias in triad.axes)
    )
    # In units of each mean's own deviation: rates and forces differ by many decades.
    unit = np.sqrt(np.diag(covariance))
    whitened = np.concatenate(x) / unit[:, None]
    inverse = np.linalg.inv(covariance / np.outer(unit, unit))
    left = (means - true_means(positions, SITE, ATTITUDE)).T.ravel() / unit
    found = np.linalg.inv(whitened.T @ inverse @ whitened + np.eye(3) / INITIAL_ANGLE_SIGMA**2)
    return found @ whitened.T @ inverse @ left, found


@pytest.mark.parametrize("triad", [ALIKE, UNLIKE])
@pytest.mark.parametrize("name", ["one", "two"])
def test_it_is_the_conditional_distribution(name, triad):
    short = {
        "one": Positions.at_rest(20.0, 2.5, 4.0),
        "two": Positions.turned_about_z([0.0, 2.0], dwell=10.0, turning=3.0, block=2.5, rate=4.0),
    }[name]
    rng = np.random.default_rng(1)
    means = true_means(short, SITE, ATTITUDE) + 1e-6 * rng.standard_normal((8, 6))
    psi, covariance = by_matrices(triad, short, means)
    fine = FineAlignment(triad, short, SITE, ATTITUDE)
    unit = np.sqrt(np.diag(covariance))
    found = fine.psi_covariance[-1] / np.outer(unit, unit)
    np.testing.assert_allclose(found, covariance / np.outer(unit, unit), rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(fine.run(means[None]).psi[0, -1] / unit, psi / unit, atol=1e-6)


@pytest.mark.parametrize("triad", few([UNLIKE], [ALIKE]))
@pytest.mark.parametrize("name", few([*POSITIONS][:1], [*POSITIONS][1:]))
def test_errors_are_as_large_as_it_says(name, triad):
    positions, runs = POSITIONS[name], 2000
    drawn = simulate_triad(
        triad, positions, SITE, ATTITUDE, runs=runs, rng=np.random.default_rng(2)
    )
    fine = FineAlignment(triad, positions, SITE, ATTITUDE)
    coarse = coarse_alignment(*mean_vectors(drawn.means, positions), SITE)
    found = fine.run(drawn.means, coarse)
    error = euler_angles(found.attitude) - euler_angles(ATTITUDE)
    np.testing.assert_allclose(np.sqrt(np.mean(error**2, axis=0)), fine.sigma[-1], rtol=0.05)
    drift = np.sqrt(np.mean((found.drift - drawn.drift)[:, -1] ** 2, axis=0))
    np.testing.assert_allclose(drift, fine.drift_sigma[-1], rtol=0.06)
    # Attitude and all: the filter's three angles are not known at the start, and use three means.
    assert found.nis[:, 3:].mean() == pytest.approx(6.0, rel=0.02)
    inside = found.nis[:, 3:] < chi2.ppf(0.95, 6)
    assert inside.mean() == pytest.approx(0.95, abs=0.01)
    # On the way, about the true attitude.
    on_the_way = fine.run(drawn.means).psi
    squares = np.linalg.solve(fine.psi_covariance, on_the_way[..., None])[..., 0] * on_the_way
    nees = squares.sum(axis=2).mean(axis=0)
    assert np.all(np.abs(nees[2:] / 3.0 - 1.0) < 5.0 * math.sqrt(2.0 / (3.0 * runs)))


def test_in_one_position_biases_stay_as_they_are():
    # Level, heading north: y is east. After long enough only the fixed biases are left.
    quiet = Triad(
        gyros=[NoiseModel(N=1e-7)] * 3,
        accelerometers=[NoiseModel(N=1e-5)] * 3,
        gyro_bias=1e-6,
        accelerometer_bias=5e-3,
    )
    fine = FineAlignment(quiet, Positions.at_rest(3600.0, 60.0, 1.0), SITE, np.eye(3))
    tilt = 5e-3 / SITE.gravity
    heading = math.hypot(1e-6 / HORIZONTAL, math.tan(SITE.latitude) * tilt)
    np.testing.assert_allclose(fine.sigma[-1], [tilt, tilt, heading], rtol=5e-3)
    assert fine.drift_sigma[-1, 1] == pytest.approx(1e-6, rel=1e-2)  # the east gyro
    assert fine.drift_sigma[-1, 0] < 2e-8 + 1.1 * EARTH_RATE * tilt  # the north one is told


def test_with_known_biases_white_noise_sets_the_heading():
    noise = Triad(
        gyros=[NoiseModel(N=1e-6)] * 3,
        accelerometers=[NoiseModel(N=1e-6)] * 3,
        gyro_bias=0.0,
        accelerometer_bias=0.0,
    )
    fine = FineAlignment(noise, Positions.at_rest(900.0, 30.0, 2.0), SITE, np.eye(3))
    time = fine.positions.blocks.end
    np.testing.assert_allclose(fine.sigma[:, 2], 1e-6 / np.sqrt(time) / HORIZONTAL, rtol=1e-4)
    np.testing.assert_allclose(
        fine.sigma[:, :2],
        (1e-6 / np.sqrt(time) / SITE.gravity)[:, None] * [1, 1],
        rtol=1e-4,
    )


@pytest.mark.parametrize("name", POSITIONS)
def test_it_is_never_worse_than_coarse_alignment_and_never_loses(name):
    positions = POSITIONS[name]
    fine = FineAlignment(UNLIKE, positions, SITE, ATTITUDE)
    coarse = coarse_sigma(UNLIKE, positions, SITE, ATTITUDE)
    assert np.all(fine.sigma[-1] <= coarse * (1.0 + 1e-6))
    assert np.all(np.diff(fine.sigma, axis=0) <= 1e-9)


def test_turning_tells_biases_from_attitude():
    sigmas = [FineAlignment(ALIKE, one, SITE, ATTITUDE).sigma[-1] for one in (ONE, TWO, FOUR)]
    assert np.all(sigmas[1] < 0.1 * sigmas[0])
    assert np.all(sigmas[2] < 0.1 * sigmas[0])


@pytest.mark.release
@pytest.mark.parametrize("runs", few([4], [20]))
def test_the_gyro_of_the_paper_needs_turns(runs):
    # Its bias is many times the Earth's rate: in one position nothing is known of the heading.
    triad = Triad(
        gyros=[PAPER_MODEL] * 3,
        accelerometers=[ACCELEROMETER] * 3,
        gyro_bias=math.radians(0.5),
        accelerometer_bias=0.02,
    )
    one = Positions.at_rest(1800.0, 30.0, 32.0)
    fine = FineAlignment(triad, one, SITE, ATTITUDE)
    assert fine.not_observable[0].quantity == "heading"
    means = simulate_triad(triad, one, SITE, ATTITUDE, runs=1, rng=np.random.default_rng(3)).means
    with pytest.raises(NotObservableError, match="turn the triad"):
        align(means[0], triad, one, SITE)
    many = Positions.turned_about_z(
        [0.0, math.pi] * 30, dwell=28.0, turning=2.0, block=28.0, rate=32.0
    )
    drawn = simulate_triad(triad, many, SITE, ATTITUDE, runs=runs, rng=np.random.default_rng(4))
    squares = []
    for means in drawn.means:
        found, fine = align(means, triad, many, SITE)
        assert not fine.not_observable
        error = euler_angles(found.attitude[0]) - euler_angles(ATTITUDE)
        squares.append(error[2] ** 2 / fine.sigma[-1, 2] ** 2)
    assert 0.03 < fine.sigma[-1, 2] < 0.3
    low, high = chi2.ppf([0.001, 0.999], runs)
    assert low < np.sum(squares) < high


def test_large_errors_of_the_start_go():
    means = true_means(TWO, SITE, ATTITUDE)
    start = matrix(0.32, -0.25, 1.6)
    once = FineAlignment(ALIKE, TWO, SITE, start).run(means[None]).attitude
    assert np.abs(euler_angles(once[0]) - euler_angles(ATTITUDE)).max() < 0.15
    found, _ = align(means, ALIKE, TWO, SITE)
    np.testing.assert_allclose(found.attitude[0], ATTITUDE, atol=1e-9)


def test_whole_logs_of_the_simulator_are_aligned_as_it_says():
    positions = Positions.at_rest(60.0, 5.0, 10.0)
    true = true_means(positions, SITE, ATTITUDE)[0]
    rng = np.random.default_rng(5)
    triad = Triad(
        gyros=[NoiseModel(N=2e-6, B=4e-7, T_B=8.0)] * 3,
        accelerometers=[ACCELEROMETER] * 3,
        gyro_bias=1e-6,
        accelerometer_bias=5e-3,
    )
    experiment = Experiment((Dwell(0, 600, 1),), 10.0, 0.0)
    squares = []
    fine = FineAlignment(triad, positions, SITE, ATTITUDE)
    for _ in range(40):
        columns = []
        for (noise, bias), value in zip(triad.axes, true, strict=True):
            model = SensorModel(noise=noise, bias=bias * rng.standard_normal())
            log = simulate(model, 10.0, 600, rng, true=lambda a, b, v=value: np.full(b - a, v))
            columns.append(block_means([log], experiment, 50).means[0])
        error = -fine.run(np.stack(columns, axis=1)[None]).psi[0, -1]
        squares.append(error @ np.linalg.solve(fine.psi_covariance[-1], error))
    assert 76.0 < np.sum(squares) < 173.0  # 99.8 % of chi-squared of 120


def test_what_cannot_be_aligned_is_refused():
    fine = FineAlignment(ALIKE, ONE, SITE, ATTITUDE)
    with pytest.raises(ValueError, match=r"expected \(runs, 30, 6"):
        fine.run(np.zeros((1, 30, 3)))
    with pytest.raises(ValueError, match="not finite"):
        fine.run(np.full((1, 30, 6), np.nan))
    with pytest.raises(ValueError, match="x axis is vertical"):
        FineAlignment(ALIKE, ONE, SITE, matrix(0.0, math.pi / 2, 0.0))
