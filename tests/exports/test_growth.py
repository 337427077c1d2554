import mpmath  # type: ignore[import-untyped]  # has no types
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from imubench_pipeline.extensions.exports.overbound import growth
from imubench_pipeline.noise import (
    GaussMarkov,
    NoiseModel,
    RandomWalk,
)


def exact(T_B: float, time: float) -> tuple[float, float]:
    """Return the two integrals of a process of density 1, in closed form."""
    with mpmath.workdps(60):
        T, t = mpmath.mpf(T_B), mpmath.mpf(time)
        e = mpmath.exp(-t / T)
        first = T**2 * (t - 2 * T * (1 - e) + T / 2 * (1 - e**2))
        second = (
            T**2 * t**3 / 3
            - 2 * T**3 * (t**2 / 2 - T**2 * (1 - e) + T * t * e)
            + T**4 * (t - 2 * T * (1 - e) + T / 2 * (1 - e**2))
        )
        return float(first), float(second)


@given(st.floats(-3, 4), st.floats(-4, 6))
@example(0.0, 2.05)  # the longest time of a series
@example(0.0, 1.95)
def test_gauss_markov_process(log_time: float, log_ratio: float) -> None:
    time, T_B = 10.0**log_time, 10.0 ** (log_time + log_ratio)
    term = GaussMarkov(2.0, T_B)
    first, second = exact(T_B, time)
    of_first, of_second = term.growth_from_known(np.array([time]))
    # within 2e-14
    assert of_first[0] == pytest.approx(term.density * first, rel=1e-12)
    assert of_second[0] == pytest.approx(term.density * second, rel=1e-12)


def test_a_long_process_grows_like_a_random_walk() -> None:
    process = GaussMarkov(1.0, 1e7)
    walk = RandomWalk(np.sqrt(process.density))
    time = np.array([1.0, 100.0])
    for found, expected in zip(
        process.growth_from_known(time), walk.growth_from_known(time), strict=True
    ):
        assert found == pytest.approx(expected, rel=1e-4)


def test_it_is_what_a_filter_propagates() -> None:
    model = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=20.0, K=8.2e-6)
    rate, time = 200.0, 30.0
    space = model.state_space(rate)
    m = len(space.output)
    step = np.eye(2 + m)
    step[0, 1] = 1.0 / rate
    step[1, 2:] = space.output / rate
    step[2:, 2:] = space.transition
    drive = np.zeros((2 + m, 2 + m))
    drive[1, 1] = space.measurement_noise / rate**2
    drive[2:, 2:] = space.process_noise
    covariance = np.zeros_like(step)
    for _ in range(round(time * rate)):
        covariance = step @ covariance @ step.T + drive
    first, second = growth(model, np.array([time]), rate)
    assert covariance[1, 1] == pytest.approx(first[0], rel=1e-3)
    assert covariance[0, 0] == pytest.approx(second[0], rel=2e-3)


def test_flicker_noise_grows_as_its_bank() -> None:
    time = np.array([10.0, 60.0])
    first, second = growth(NoiseModel(B=1.0), time, 100.0)
    bank = [term.growth_from_known(time) for term in NoiseModel(B=1.0).realised(0.01, 240.0)]
    np.testing.assert_allclose(first, sum(grown for grown, _ in bank))
    assert np.all(second > 0.0)
    # between white noise and a random walk
    assert 10.0**1 < (first[1] / first[0]) ** (1 / np.log10(6.0)) < 10.0**3
