"""Error budgets against simulated runs of dead reckoning."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import fftconvolve

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.navigation.error_budget.budget import Start, budget
from imubench_pipeline.navigation.error_budget.gyrocompass import Gyrocompass
from imubench_pipeline.navigation.error_budget.in_use import Figure
from imubench_pipeline.navigation.error_budget.parts import Quantity
from imubench_pipeline.noise import (
    GaussMarkov,
    NoiseModel,
    Sinusoid,
    Term,
)
from imubench_pipeline.noise.growth import Calibrated, SensorStart, Uncalibrated
from imubench_pipeline.noise.simulate import simulate
from tests.conftest import few
from tests.noise.examples import EXAMPLES, model_of, named
from tests.starts import uncalibrated

Array = NDArray[np.float64]

G = 9.80665
RATE = 20.0
BEFORE = 20.0
TIMES = (4.0, 30.0)
RUNS = 1000


def fractional_noise(shape: tuple[int, int], rng: np.random.Generator, earlier: int) -> Array:
    """Return flicker noise of B = 1 that began so many samples earlier (N. J. Kasdin, 1995)."""
    runs, samples = shape
    k = np.arange(1, samples + earlier, dtype=np.float64)
    weights = np.concatenate(([1.0], np.cumprod((k - 0.5) / k)))
    white = rng.standard_normal((runs, samples + earlier))
    return np.asarray(fftconvolve(white, weights[None, :], axes=1)[:, earlier : samples + earlier])


def logs(model: NoiseModel, begun: bool, rng: np.random.Generator, runs: int = RUNS) -> Array:
    """Return simulated logs; flicker noise has a long past, or it begins with the log."""
    samples = round((BEFORE + max(TIMES)) * RATE)
    flicker = model.B if model.T_B is None else 0.0
    rest = replace(model, B=0.0) if flicker else model
    log = np.array([simulate(rest, RATE, samples, stream) for stream in rng.spawn(runs)])
    if flicker:
        earlier = 0 if begun else 8 * samples
        log += flicker * fractional_noise(log.shape, rng, earlier)
    return log


def integrated(rate: Array) -> Array:
    """Return the integrals of samples that hold for an interval: once, twice and three times."""
    T = 1.0 / RATE
    first = np.cumsum(rate, axis=1) * T
    before = first - rate * T
    second = np.cumsum(before * T + rate * T**2 / 2.0, axis=1)
    start = second - before * T - rate * T**2 / 2.0
    third = np.cumsum(start * T + before * T**2 / 2.0 + rate * T**3 / 6.0, axis=1)
    return np.stack([first, second, third])


def spread(errors: Array) -> tuple[float, float]:
    """Return the root mean square of errors, and its standard error."""
    squares = errors**2
    sigma = math.sqrt(float(squares.mean()))
    return sigma, float(squares.std()) / math.sqrt(len(errors)) / (2.0 * sigma)


@pytest.mark.parametrize("runs", few([300], [RUNS]))
@pytest.mark.parametrize("calibrated", [True, False])
@pytest.mark.parametrize("term", EXAMPLES, ids=named)
def test_each_term_grows_as_in_simulated_runs(term: Term, calibrated: bool, runs: int) -> None:
    rng = np.random.default_rng([7, EXAMPLES.index(term), calibrated])
    log = logs(model_of(term), not calibrated, rng, runs)
    rest = round(BEFORE * RATE)
    # A sample stands for the middle of its interval: a walk begins half an interval later.
    start: SensorStart = Uncalibrated(bias=0.0, on_time=BEFORE - 0.5 / RATE)
    moving = log[:, rest:]
    if calibrated:
        start = Calibrated(BEFORE)
        moving = moving - log[:, :rest].mean(axis=1)[:, None]
    errors = integrated(moving)
    for time in TIMES:
        for order in range(3):
            found, error = spread(errors[order, :, round(time * RATE) - 1])
            expected = math.sqrt(term.growth(order, time, start))
            assert abs(found - expected) < 4.0 * error + 2e-3 * expected, (time, order)


@pytest.mark.release
@pytest.mark.parametrize("levelled", [True, False])
def test_dead_reckoning_of_simulated_runs(levelled: bool) -> None:
    rng = np.random.default_rng([8, levelled])
    gyro = NoiseModel(N=1e-3, B=4e-4, K=1e-4, further=(GaussMarkov(1e-3, 8.0),))
    accel = NoiseModel(N=1e-2, B=1e-2, T_B=5.0, K=2e-3, sinusoids=(Sinusoid(0.02, 0.05),))
    # Flicker with a long past has no place in an uncalibrated start, nor in an absolute tilt.
    rates, forces = (logs(model, not levelled, rng) for model in (gyro, accel))
    rest = round(BEFORE * RATE)
    normal = rng.standard_normal((3, RUNS))
    if levelled:
        start = Start.calibrated(BEFORE)
        of_accel = {"turn_on_bias": Figure(sigma=0.05)}
        forces += 0.05 * normal[0][:, None]
        # The accelerometer at rest reads its error, and the tilt is set as if it were gravity.
        tilt = -forces[:, :rest].mean(axis=1) / G
        rates = rates - rates[:, :rest].mean(axis=1)[:, None]
    else:
        start = uncalibrated(
            gyro_bias=2e-3, accel_bias=0.05, on_time=BEFORE - 0.5 / RATE, tilt=3e-3
        )
        of_accel = {}
        tilt = 3e-3 * normal[0]
        rates += 2e-3 * normal[1][:, None]
        forces += 0.05 * normal[2][:, None]
    turned = integrated(rates[:, rest:])
    moved = integrated(forces[:, rest:])
    t = np.arange(1, turned.shape[2] + 1) / RATE
    errors: dict[Quantity, Array] = {
        "attitude": tilt[:, None] + turned[0],
        "velocity": moved[0] + G * (tilt[:, None] * t + turned[1]),
        "position": moved[1] + G * (tilt[:, None] * t**2 / 2.0 + turned[2]),
    }
    for time in TIMES:
        for quantity, runs in errors.items():
            found, error = spread(runs[:, round(time * RATE) - 1])
            expected = budget(
                quantity, time, gyro=gyro, accel=accel, start=start, accel_figures=of_accel
            ).total
            assert abs(found - expected) < 4.0 * error + 2e-3 * expected, (time, quantity)


@pytest.mark.release
def test_gyrocompassing_on_simulated_windows(rng: np.random.Generator) -> None:
    gyro = NoiseModel(N=1e-3, B=4e-4, K=1e-4, further=(GaussMarkov(1e-3, 8.0),))
    log = logs(gyro, True, rng)
    time = log.shape[1] / RATE
    found, error = spread(log.mean(axis=1) / EARTH_RATE)
    compass = Gyrocompass(gyro=gyro, latitude=0.0, bias=0.0)
    assert abs(found - compass.heading(time).total) < 4.0 * error
    first, second = np.split(log, 2, axis=1)
    found, error = spread((first.mean(axis=1) - second.mean(axis=1)) / 2.0 / EARTH_RATE)
    compass = Gyrocompass(gyro=gyro, latitude=0.0, positions=2)
    assert abs(found - compass.heading(time).total) < 4.0 * error
