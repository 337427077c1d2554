import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.allan import allan_variance, cluster_sizes
from imubench_pipeline.extensions.exports.mapping import Mapped, as_process, as_walk, bound_walk
from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid
from imubench_pipeline.noise.simulate import simulate
from tests.exports.sensors import ACCEL, GYRO

log10 = st.floats(-1.0, 1.0).map(lambda x: 10.0**x)


def deviation(model: NoiseModel, tau: float) -> float:
    return float(np.sqrt(model.allan_variance(np.array([tau]))[0]))


def stated_errors(found: Mapped) -> list[float]:
    """Return the stated errors at half and at twice the horizon and the largest below it, %."""
    return [float(number) for number in re.findall(r"([+-][\d.]+) %", found.words[0])]


@given(log10, log10, st.floats(-1.5, 3.0), log10, log10, st.booleans())
def test_the_allan_variance_at_the_horizon_stays(
    N: float, B: float, log_time: float, K: float, horizon: float, flicker: bool
) -> None:
    model = NoiseModel(N=N, B=B, T_B=None if flicker else 10.0**log_time, K=0.1 * K)
    h = 60.0 * horizon
    for found in (as_walk(model, h, 100.0), as_process(model, h, 100.0)):
        assert deviation(found.model, h) == pytest.approx(deviation(model, h), rel=1e-9)
        assert found.model.N == model.N
        if found.words:
            ratios = [deviation(found.model, t) / deviation(model, t) for t in (h / 2, 2 * h)]
            expected = [100.0 * (ratio - 1.0) for ratio in ratios]
            assert stated_errors(found)[:2] == pytest.approx(expected, abs=0.051)


def test_far_below_the_correlation_time_the_walk_is_the_drive() -> None:
    process = GaussMarkov(1.0, 1e5)
    found = as_walk(NoiseModel(N=1.0, B=1.0, T_B=1e5), 60.0, 100.0)
    assert found.model.K == pytest.approx(np.sqrt(process.density), rel=1e-3)
    half, twice, _ = stated_errors(found)
    assert abs(half) < 0.1
    assert abs(twice) < 0.15


def test_what_the_program_holds_is_left_as_it_is() -> None:
    walk = NoiseModel(N=1.0, K=0.1)
    assert as_walk(walk, 60.0, 100.0).model == walk
    assert not as_walk(walk, 60.0, 100.0).words
    process = NoiseModel(N=1.0, B=0.1, T_B=30.0)
    assert as_process(process, 60.0, 100.0).model == process
    assert as_process(GYRO, 60.0, 100.0, walk=True).model == GYRO


def test_the_errors_of_the_two_sensors_and_of_flicker_noise() -> None:
    gyro, accel = as_walk(GYRO, 60.0, 100.0), as_walk(ACCEL, 60.0, 100.0)
    flicker = as_walk(NoiseModel(N=8.4e-5, B=6.7e-5), 60.0, 100.0)
    found = [stated_errors(one) for one in (gyro, accel, flicker)]
    np.testing.assert_allclose(
        found, [(-8.4, 22.3, -9.1), (-4.2, 12.8, -4.2), (-25.6, 40.4, -38.1)], atol=0.06
    )
    assert "-8.4 % at 30 s" in gyro.words[0]


def test_a_process_in_place_of_a_process_and_a_walk_is_near() -> None:
    found = as_process(GYRO, 60.0, 100.0)
    _, twice, most = stated_errors(found)
    assert abs(twice) < 1.0 and abs(most) < 1.0
    walk = as_process(NoiseModel(N=1e-4, K=1e-5), 60.0, 100.0)
    assert abs(stated_errors(walk)[2]) < 0.5


def test_two_processes_become_one_beside_a_walk_that_stays() -> None:
    model = NoiseModel(N=1.0, B=0.5, T_B=10.0, K=0.01, further=[GaussMarkov(0.4, 40.0)])
    found = as_process(model, 60.0, 100.0, walk=True)
    assert found.model.K == model.K
    assert deviation(found.model, 60.0) == pytest.approx(deviation(model, 60.0))
    assert "replaced by a Gauss-Markov process" in found.words[0]


def test_the_limit_of_an_unseen_walk_is_above_it_in_19_of_20_logs() -> None:
    rate, N, K, horizon = 10.0, 1e-3, 1e-5, 60.0
    model = NoiseModel(N=N, K=K)
    sizes, above = cluster_sizes(18_000), 0
    for seed in range(100):
        samples = simulate(model, rate, 18_000, np.random.default_rng(seed))
        above += bound_walk(allan_variance(samples, rate, cluster_sizes=sizes), N, horizon) > K
    assert 90 <= above


def test_what_is_left_out_is_said() -> None:
    model = NoiseModel(Q=1e-6, N=1.0, K=0.1, sinusoids=[Sinusoid(0.2, 3.0)])
    words = " ".join(as_walk(model, 60.0, 100.0).words)
    assert "quantization noise Q" in words
    assert "at 3 Hz: not included" in words


def test_a_ramp_is_covered_by_the_walk() -> None:
    model = NoiseModel(N=1e-4, R=1e-7)
    found = as_walk(model, 60.0, 100.0)
    assert deviation(found.model, 60.0) == pytest.approx(deviation(model, 60.0))
    assert "R = 1.000e-07" in found.words[0]
