"""Errors in turns, at several positions and in the plane, by closed forms and simulation."""

import cmath
import math

import numpy as np
import pytest

from imubench_pipeline.model.verdicts import ErrorSource
from imubench_pipeline.navigation.error_budget.budget import Start, budget
from imubench_pipeline.navigation.error_budget.gyrocompass import EARTH_RATE, Gyrocompass
from imubench_pipeline.navigation.error_budget.in_use import Figure, Use
from imubench_pipeline.navigation.error_budget.parts import Budget, Contribution
from imubench_pipeline.noise import NoiseModel

G = 9.80665
NOISELESS = NoiseModel()
SOURCE = ErrorSource("scale_factor", "gyro")


def test_half_a_turn_with_one_percent_at_3_metres_a_second() -> None:
    """4 s v T / pi = 0.38 m, which no axis by itself shows."""
    found = budget(
        "position",
        10.0,
        gyro=NOISELESS,
        accel=NOISELESS,
        start=Start.calibrated(10.0),
        use=Use(turns=math.pi, speed=3.0, over=10.0),
        gyro_figures={"scale_factor": Figure(sigma=0.01)},
    )
    assert found.total == pytest.approx(4.0 * 0.01 * 3.0 * 10.0 / math.pi)
    # Along one line: a radius has the quantile of one axis.
    assert found.to_radius(0.95).total == pytest.approx(found.total, rel=1e-3)


@pytest.mark.parametrize("confidence", [0.5, 0.95, 0.997])
@pytest.mark.parametrize("ratio", [0.0, 0.1, 0.5, 1.0])
def test_a_radius_has_its_confidence(confidence: float, ratio: float) -> None:
    rng = np.random.default_rng(3)
    turned = cmath.exp(0.7j)  # the main axes differ from the axes of the plane
    parts = [
        Contribution(SOURCE, 1.0, None, turned),
        Contribution(SOURCE, ratio, None, 1j * ratio * turned),
    ]
    sigmas = rng.standard_normal((400_000, 2)) * [1.0, ratio]
    radius = np.quantile(np.hypot(*sigmas.T), confidence)
    z = np.quantile(np.abs(rng.standard_normal(400_000)), confidence)
    found = Budget(1.0, "position", parts).to_radius(confidence).total
    assert found == pytest.approx(radius / z, rel=0.01)


def test_vibration_is_no_tilt() -> None:
    """2 g rms and 0.1 deg/s/g: some 0.003 deg, and not the 2 deg of a constant acceleration."""
    figure = {"g_sensitivity": Figure(sigma=math.radians(0.1) / G)}
    found = budget(
        "attitude",
        10.0,
        gyro=NOISELESS,
        accel=NOISELESS,
        start=Start.calibrated(10.0),
        use=Use(vibration=2.0 * G, over=10.0),
        gyro_figures=figure,
    )
    # Root of 6 of three axes that swing from a first phase, over 2 pi times 10 Hz.
    assert found.total == pytest.approx(math.radians(0.2) * math.sqrt(6.0) / (20.0 * math.pi))


def test_north_has_the_tilt_of_the_levelling() -> None:
    latitude, bias = math.radians(50.0), 0.02
    level = {"turn_on_bias": Figure(sigma=bias)}
    one = Gyrocompass(gyro=NOISELESS, latitude=latitude, bias=0.0, accel_figures=level)
    assert one.heading(60.0).total == pytest.approx(math.tan(latitude) * bias / G)
    two = Gyrocompass(gyro=NOISELESS, latitude=latitude, positions=2, accel_figures=level)
    assert two.heading(60.0).total == 0.0


@pytest.mark.parametrize("positions", [2, 4, 8])
def test_alternating_positions_average_the_noise(positions: int) -> None:
    """White noise and a random walk, against means of simulated rates with alternating signs."""
    rng = np.random.default_rng(4)
    runs, samples, step = 4000, 960, 0.5
    N, K = 1e-5, 3e-7
    white = N / math.sqrt(step) * rng.standard_normal((runs, samples))
    walk = np.cumsum(K * math.sqrt(step) * rng.standard_normal((runs, samples)), axis=1)
    signs = np.repeat((-1.0) ** np.arange(positions), samples // positions)
    simulated = np.std(np.mean((white + walk) * signs, axis=1))
    compass = Gyrocompass(gyro=NoiseModel(N=N, K=K), latitude=0.0, positions=positions)
    found = compass.heading(samples * step).total * EARTH_RATE
    assert found == pytest.approx(simulated, rel=0.05)
