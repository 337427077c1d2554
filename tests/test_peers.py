"""The programs of benchmarks/peers.py on simulated logs."""

import importlib.util
import math
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import curve_fit, least_squares

from imubench_pipeline.noise import FLOOR, NoiseModel
from imubench_pipeline.noise.simulate import simulate
from tests.conftest import few

PATH = Path(__file__).parents[1] / "benchmarks" / "peers.py"
SPEC = importlib.util.spec_from_file_location("peers", PATH)
peers = importlib.util.module_from_spec(SPEC)
sys.modules["peers"] = peers  # where a dataclass looks its module up
SPEC.loader.exec_module(peers)

MODEL = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)
WHITE = NoiseModel(N=8.4e-5)
WALK = NoiseModel(N=8.4e-5, K=8.2e-5)
RATE = 100.0
BY_NAME = {peer.name: peer for peer in peers.PEERS}


def of_program(name: str, log: np.ndarray, rate: float = RATE) -> dict[str, float | None]:
    return BY_NAME[name].estimate(log, rate)


@cache
def one_hour(model: NoiseModel) -> np.ndarray:
    return simulate(model, RATE, 360_000, np.random.default_rng(20260101))


@cache
def of_hour(name: str, model: NoiseModel = MODEL) -> dict[str, float | None]:
    """What a program says of an hour of a model, which several tests ask for."""
    return of_program(name, one_hour(model))


@pytest.fixture(scope="module")
def log() -> np.ndarray:
    return one_hour(MODEL)


@pytest.mark.parametrize("name", BY_NAME)
def test_every_program_gives_every_symbol(name: str) -> None:
    found = of_hour(name)
    assert list(found) == ["N", "B", "T_B", "K"]
    for value in found.values():
        assert value is None or math.isfinite(value)


@pytest.mark.parametrize("name", ["allan_variance_ros", "kalibr_allan", "allan-variance"])
def test_white_noise_alone(name: str) -> None:
    # The fits give the few clusters of long tau the weight of the many of short tau.
    assert of_hour(name, WHITE)["N"] == pytest.approx(WHITE.N, rel=0.1)


@pytest.mark.parametrize("name", ["allan_variance_ros", "allan-variance"])
def test_white_noise_beside_a_gauss_markov_process(name: str) -> None:
    assert of_hour(name)["N"] == pytest.approx(MODEL.N, rel=0.12)


def test_kalibr_allan_fits_its_white_noise_line_up_to_the_minimum() -> None:
    assert of_hour("kalibr_allan")["N"] > 1.3 * MODEL.N


def test_a_strong_random_walk() -> None:
    assert of_hour("allan-variance", WALK)["K"] == pytest.approx(WALK.K, rel=0.25)


def test_imu_utils_publishes_the_deviation_of_a_sample() -> None:
    assert of_hour("imu_utils")["N"] == pytest.approx(MODEL.N * RATE**0.5, rel=0.06)


def test_imu_utils_per_sample_figure_follows_the_rate() -> None:
    # One sensor, logged at 100 Hz and as means of four samples: the density is the same.
    log = one_hour(WALK)
    slow = log.reshape(-1, 4).mean(axis=1)
    ratio = of_hour("imu_utils", WALK)["N"] / of_program("imu_utils", slow, RATE / 4)["N"]
    assert ratio == pytest.approx(2.0, rel=0.05)


def test_allan_variance_ros_reports_a_random_walk_where_there_is_none() -> None:
    assert of_hour("allan_variance_ros", WHITE)["K"] > 1e-7
    assert of_hour("kalibr_allan", WHITE)["K"] is None


@pytest.mark.release  # the benchmark alone asks it of hours
def test_allan_variance_ros_stops_on_a_log_shorter_than_2000_s(log) -> None:
    assert of_program("allan_variance_ros", log[:199_979])["N"] is None
    assert of_program("allan_variance_ros", log[:199_980])["N"] is not None


@pytest.mark.release  # its white noise and its minimum are checked every day
def test_allan_variance_ros_as_its_own_fit_does(log) -> None:
    periods = np.arange(1, 10_000)
    deviation = []
    sums = np.concatenate(([0.0], np.cumsum(log)))
    for n in 10 * periods:
        means = np.diff(sums[::n]) / n
        deviation.append(np.sqrt(np.mean(np.diff(means) ** 2) / 2))
    x, y = np.log(0.1 * periods), np.log(deviation)

    def read(part: slice, slope: float, at: float) -> float:
        (m, c), _ = curve_fit(
            lambda x, m, c: m * x + c,
            x[part],
            y[part],
            bounds=([slope, -np.inf], [slope + 0.001, np.inf]),
        )
        return math.exp(m * math.log(at) + c)

    found = BY_NAME["allan_variance_ros"].printed(log, RATE)
    assert found["N"] == pytest.approx(read(slice(0, 99), -0.5, 1.0), rel=1e-5)
    assert found["K"] == pytest.approx(read(slice(None), 0.5, 3.0), rel=1e-5)
    assert found["B"] == pytest.approx(min(deviation), rel=1e-9)


def test_dogleg_reaches_the_minimum_where_its_steps_suffice() -> None:
    tau = np.geomspace(0.01, 1000.0, 60)
    powers = tau[:, None] ** np.array([-1.0, 0.0, 1.0])
    true = np.array([8.4e-5, 2e-5, 5e-6])
    measured = np.log10(powers @ true**2) + 0.05 * np.sin(5 * np.log(tau))
    found = peers.dogleg_fit(powers, measured, 2.0 * true)
    best = least_squares(
        lambda terms: np.log10(powers @ terms**2) - measured, true, x_scale=true, xtol=1e-12
    ).x
    np.testing.assert_allclose(np.abs(found), np.abs(best), rtol=0.02)
    assert np.array_equal(peers.dogleg_fit(powers, measured, true, steps=0), true)


@pytest.mark.release
def test_a_printed_minimum_is_made_the_b_that_it_stands_for(log) -> None:
    for name in ("allan_variance_ros", "imu_utils"):
        printed = BY_NAME[name].printed(log, RATE)
        assert BY_NAME[name].comparable(printed)["B"] == pytest.approx(printed["B"] / FLOOR)
        assert BY_NAME[name].comparable(printed)["N"] == printed["N"]
    assert of_hour("kalibr_allan")["B"] is None


@pytest.mark.release
@pytest.mark.parametrize("name", few([*BY_NAME][:1], [*BY_NAME][1:]))
def test_a_constant_makes_no_difference(name: str, log) -> None:
    expected, found = of_hour(name), of_program(name, log + 9.81)
    for symbol, value in expected.items():
        assert found[symbol] == (value if value is None else pytest.approx(value, rel=1e-3))


def test_kalibr_allan_reads_its_lines_beside_the_minimum() -> None:
    # A curve of white noise and a walk, whose samples are few: literally, point by point.
    log = simulate(WALK, 10.0, 20_000, np.random.default_rng(5))
    tau, deviation = [], []
    for x in np.logspace(np.log10(0.1), np.log10(9999), 2000):
        n = math.floor(0.1 * x * 10.0)
        tau.append(n / 10.0)
        means = log[: len(log) // n * n].reshape(-1, n).mean(axis=1) if n else np.empty(0)
        deviation.append(np.sqrt(np.mean(np.diff(means) ** 2) / 2) if n else np.nan)
    tau, deviation = np.array(tau), np.array(deviation)
    bottom = int(np.nanargmin(deviation))
    before = [i for i in range(2000) if i <= bottom - 50 and np.isfinite(deviation[i])]
    after = [i for i in range(2000) if i >= bottom + 50]
    at_1, at_3 = (tau[np.argmin(np.abs(tau - value))] for value in (1.0, 3.0))
    found = of_program("kalibr_allan", log, 10.0)
    assert found["N"] == pytest.approx(
        math.exp(np.mean(np.log(deviation[before] * tau[before] ** 0.5))) * at_1**-0.5
    )
    assert found["K"] == pytest.approx(
        math.exp(np.mean(np.log(deviation[after] / tau[after] ** 0.5))) * at_3**0.5
    )
