import math

import numpy as np
import pytest

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.low_pass import LowPass
from imubench_pipeline.simulate.model import SensorModel, before_the_filter, folding, in_the_log
from imubench_pipeline.simulate.simulation import simulate

N = 2e-4


def first_order(cutoff: float, rate: float) -> float:
    """The sum over the folds of 1 / (1 + (k rate / cutoff)^2): (pi c / r) coth(pi c / r)."""
    x = math.pi * cutoff / rate
    return x / math.tanh(x)


def butterworth(cutoff: float, rate: float, order: int) -> float:
    """The same of a Butterworth filter, fold by fold."""
    k = np.arange(1, 200_000)
    return float(1.0 + 2.0 * np.sum(1.0 / (1.0 + (k * rate / cutoff) ** (2 * order))))


@pytest.mark.parametrize("rate", [50.0, 500.0])
@pytest.mark.parametrize("part", [0.002, 0.12, 0.376, 0.64, 3.0])
def test_a_first_order_filter_folds_as_the_closed_form_says(part: float, rate: float) -> None:
    model = SensorModel(noise=NoiseModel(N=N), low_pass=LowPass(part * rate))
    assert folding(model, rate) == pytest.approx(first_order(part * rate, rate), rel=1e-4)
    wanted = N * math.sqrt(first_order(part * rate, rate))
    assert in_the_log(model, rate) == pytest.approx(wanted, rel=1e-4)


@pytest.mark.parametrize("order", [2, 3, 6])
@pytest.mark.parametrize("part", [0.2, 0.64, 3.0])
def test_a_butterworth_filter_folds_as_the_sum_says(part: float, order: int) -> None:
    model = SensorModel(noise=NoiseModel(N=N), low_pass=LowPass(part * 100.0, order))
    assert folding(model, 100.0) == pytest.approx(butterworth(part * 100.0, 100.0, order), rel=1e-4)


def test_without_a_filter_nothing_folds() -> None:
    assert in_the_log(SensorModel(noise=NoiseModel(N=N)), 100.0) == pytest.approx(N, rel=1e-12)


@pytest.mark.parametrize("rate", [10.0, 1000.0])
def test_rounding_adds_a_twelfth_of_its_step_squared(rate: float) -> None:
    # A register of LSB adds LSB^2 / 12 a sample, that is LSB^2 / (12 rate) of density.
    model = SensorModel(noise=NoiseModel(N=N), resolution=1e-2)
    wanted = math.hypot(N, 1e-2 / math.sqrt(12.0 * rate))
    assert in_the_log(model, rate) == pytest.approx(wanted, rel=1e-12)
    both = SensorModel(noise=NoiseModel(N=N), resolution=1e-2, low_pass=LowPass(0.4 * rate))
    wanted = math.hypot(N * math.sqrt(first_order(0.4, 1.0)), 1e-2 / math.sqrt(12.0 * rate))
    assert in_the_log(both, rate) == pytest.approx(wanted, rel=1e-4)


def test_slow_noise_is_not_in_n() -> None:
    slow = NoiseModel(N=N, B=1e-2, T_B=10.0, K=1e-2)
    model = SensorModel(noise=slow, low_pass=LowPass(30.0))
    wanted = N * math.sqrt(first_order(30.0, 100.0))
    assert in_the_log(model, 100.0) == pytest.approx(wanted, rel=1e-4)


@pytest.mark.parametrize("resolution", [0.0, 1e-3])
@pytest.mark.parametrize("low_pass", [None, LowPass(64.0), LowPass(20.0, 2)])
def test_from_the_log_back_before_the_filter(low_pass: LowPass | None, resolution: float) -> None:
    noise = NoiseModel(N=N, B=1e-3, T_B=10.0)
    model = SensorModel(noise=noise, low_pass=low_pass, resolution=resolution)
    shown = NoiseModel(N=in_the_log(model, 100.0), B=1e-3, T_B=10.0)
    back = before_the_filter(model, shown, 100.0)
    assert back.N == pytest.approx(N, rel=1e-9)
    assert back.allan_variance(100.0) == pytest.approx(noise.allan_variance(100.0), rel=1e-9)


def test_noise_before_filter_is_zero_if_below_rounding() -> None:
    model = SensorModel(noise=NoiseModel(), resolution=1e-2)
    assert before_the_filter(model, NoiseModel(N=1e-4), 100.0).N == 0.0


@pytest.mark.parametrize(
    ("low_pass", "resolution"), [(LowPass(64.0), 0.0), (LowPass(20.0), 2e-3), (None, 4e-3)]
)
def test_a_simulated_log_shows_it(low_pass: LowPass | None, resolution: float) -> None:
    # Of block means of 1 s: their variance is N^2 / (1 s), but for the correlation at the ends.
    rate, samples = 100.0, 400_000
    model = SensorModel(noise=NoiseModel(N=N), low_pass=low_pass, resolution=resolution)
    log = simulate(model, rate, samples, np.random.default_rng(5))
    means = log.reshape(-1, 100).mean(axis=1)
    assert means.std() == pytest.approx(in_the_log(model, rate), rel=0.05)
