import numpy as np
import pytest

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.estimators.curve import read
from imubench_pipeline.noise import FLOOR, PEAK_TAU, NoiseModel
from imubench_pipeline.noise.simulate import simulate
from tests.estimators.test_least_squares import MTI_7, noiseless, value


def test_every_slope_of_a_classical_curve_is_read() -> None:
    model = NoiseModel(N=1e-3, K=1e-5)
    estimate = read(noiseless(model))
    assert value(estimate, "N") == pytest.approx(1e-3, rel=0.03)
    # read off the sum of the terms: what is left of N at the end adds a few per cent
    assert value(estimate, "K") == pytest.approx(1e-5, rel=0.08)
    tau = np.sqrt(3) * 1e-3 / 1e-5  # where N and K are equal
    lowest = np.sqrt(model.allan_variance(tau))
    assert value(estimate, "B") == pytest.approx(float(lowest) / FLOOR, rel=0.02)
    assert value(estimate, "T_B") == pytest.approx(tau / PEAK_TAU, rel=0.15)


def test_white_noise_shows_nothing_but_n(rng) -> None:
    for _ in range(20):
        curve = allan_variance(simulate(NoiseModel(N=1e-3), 10.0, 100_000, rng), 10.0)
        estimate = read(curve)
        assert value(estimate, "N") == pytest.approx(1e-3, rel=0.02)
        for name in ("B", "T_B", "K"):
            assert estimate.parameters[name].status == "not_shown"
            assert estimate.parameters[name].value is None
            assert estimate.parameters[name].reason


@pytest.mark.release
def test_without_a_random_walk_no_k_is_read(rng) -> None:
    model = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=20.0)
    for _ in range(20):
        estimate = read(allan_variance(simulate(model, 10.0, 360_000, rng), 10.0))
        assert estimate.parameters["K"].status == "not_shown"


def test_a_log_too_short_for_the_minimum_gives_no_b(rng) -> None:
    for _ in range(10):
        estimate = read(allan_variance(simulate(MTI_7, 100.0, 3000, rng), 100.0))
        assert estimate.parameters["B"].status == "not_shown"
        assert estimate.parameters["T_B"].status == "not_shown"
        assert "minimum" in (estimate.parameters["B"].reason or "")


def test_a_random_walk_from_the_start_gives_no_n(rng) -> None:
    estimate = read(allan_variance(simulate(NoiseModel(K=1.0), 1.0, 50_000, rng), 1.0))
    assert estimate.parameters["N"].status == "not_shown"
    assert "slope −1/2" in (estimate.parameters["N"].reason or "")
    assert value(estimate, "K") == pytest.approx(1.0, rel=0.1)


def test_n_is_read_where_the_slope_is_not_at_one_second(rng) -> None:
    # a sensor band-limited far below 1 Hz: its curve rises at tau = 1 s
    log = simulate(NoiseModel(N=1e-3), 100.0, 2_000_000, rng)
    kernel = np.ones(400) / 400
    filtered = np.convolve(log, kernel, mode="valid")
    curve = allan_variance(filtered, 100.0)
    at_one = np.argmin(np.abs(curve.tau - 1.0))
    assert curve.deviation[at_one] > curve.deviation[0]
    assert value(read(curve), "N") == pytest.approx(1e-3, rel=0.06)


def test_a_handful_of_samples_shows_nothing() -> None:
    estimate = read(allan_variance(np.arange(20.0) ** 2, 1.0))
    assert {p.status for p in estimate.parameters.values()} == {"not_shown"}
    assert estimate.model.name == "none"
