import math

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from imubench_pipeline.noise import (
    FLOOR,
    PEAK_TAU,
    Flicker,
    GaussMarkov,
    NoiseModel,
    Quantization,
    Ramp,
    RandomWalk,
    WhiteNoise,
    compute_bias_instability,
    compute_driving_density,
    evaluate_sampled_shape,
)
from tests.noise.test_terms import covariance_of_samples

MTI_7 = NoiseModel(N=8.4e-5, B=6.7e-5, T_B=89.5, K=8.2e-7)


def exact_gauss_markov(tau: float, T_B: float) -> mpmath.mpf:
    with mpmath.workdps(40):
        t, c = mpmath.mpf(tau), mpmath.mpf(T_B)
        bracket = 1 - c / (2 * t) * (3 - 4 * mpmath.exp(-t / c) + mpmath.exp(-2 * t / c))
        return c**2 / t * bracket


@given(st.floats(-6, 6), st.floats(-3, 5))
def test_gauss_markov_to_ten_digits_at_every_tau(log_ratio: float, log_time: float) -> None:
    T_B = 10.0**log_time
    tau = T_B * 10.0**log_ratio
    term = GaussMarkov(1.0, T_B)
    expected = float(exact_gauss_markov(tau, T_B)) * term.density
    assert term.allan_variance(np.array([tau]))[0] == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("n", [1, 2, 7, 60])
@pytest.mark.parametrize("T_B", [0.05, 0.8, 200.0])
def test_sampled_gauss_markov_is_the_sum_of_covariances(n: int, T_B: float) -> None:
    interval, variance = 0.1, 1.0
    weights = np.concatenate([-np.ones(n), np.ones(n)]) / n
    lags = np.abs(np.subtract.outer(np.arange(2 * n), np.arange(2 * n)))
    expected = weights @ (variance * np.exp(-lags * interval / T_B)) @ weights / 2
    density = 2 * variance / T_B
    found = density * evaluate_sampled_shape([n], interval, T_B)[0]
    assert found == pytest.approx(expected, rel=1e-8)


@pytest.mark.parametrize("n", [1, 3, 20])
def test_sampled_random_walk_is_the_sum_of_covariances(n: int) -> None:
    interval, K = 0.1, 0.3
    weights = np.concatenate([-np.ones(n), np.ones(n)]) / n
    steps = np.arange(1, 2 * n + 1)
    covariance = K**2 * interval * np.minimum.outer(steps, steps)
    expected = weights @ covariance @ weights / 2
    found = RandomWalk(K).sampled_allan_variance(np.array([float(n)]), interval)[0]
    assert found == pytest.approx(expected, rel=1e-12)


def test_the_peak_of_gauss_markov_is_the_plateau_of_b() -> None:
    term = GaussMarkov(1.0, 10.0)
    tau = np.linspace(1.5, 2.5, 20_001) * 10.0
    deviation = np.sqrt(term.allan_variance(tau))
    assert tau[np.argmax(deviation)] / 10.0 == pytest.approx(PEAK_TAU, abs=1e-4)
    assert deviation.max() == pytest.approx(FLOOR, rel=1e-3)
    assert FLOOR == pytest.approx(0.66428, abs=1e-5)


def test_b_and_its_driving_density_are_inverse() -> None:
    assert compute_bias_instability(compute_driving_density(3e-5, 77.0), 77.0) == pytest.approx(
        3e-5
    )


def test_state_space_is_exact() -> None:
    space = MTI_7.state_space(100.0)
    term = GaussMarkov(MTI_7.B, 89.5)
    stationary = term.density * 89.5 / 2
    decay = np.exp(-0.01 / 89.5)
    np.testing.assert_allclose(space.transition, np.diag([decay, 1.0]))
    np.testing.assert_allclose(
        space.process_noise, np.diag([stationary * (1 - decay**2), 8.2e-7**2 * 0.01])
    )
    np.testing.assert_allclose(space.initial_variance, np.diag([stationary, 0.0]))
    assert space.measurement_noise == pytest.approx(8.4e-5**2 * 100.0)


def test_a_model_is_the_sum_of_its_terms() -> None:
    tau = np.geomspace(0.01, 1e4, 20)
    parts = [WhiteNoise(8.4e-5), GaussMarkov(6.7e-5, 89.5), RandomWalk(8.2e-7)]
    np.testing.assert_allclose(MTI_7.allan_variance(tau), sum(p.allan_variance(tau) for p in parts))
    np.testing.assert_allclose(MTI_7.psd(tau), sum(p.psd(tau) for p in parts))
    assert MTI_7.name == "N+GM+K"
    assert NoiseModel().name == "none"
    assert (NoiseModel().allan_variance(tau) == 0).all()


@pytest.mark.parametrize(
    "values", [{"N": -1.0}, {"K": np.nan}, {"R": np.inf}, {"B": 1.0, "T_B": 0.0}, {"N": np.inf}]
)
def test_impossible_models(values: dict) -> None:
    with pytest.raises(ValueError, match="expected"):
        NoiseModel(**values)


def test_terms_of_a_kind_have_their_states_side_by_side() -> None:
    model = NoiseModel(Q=0.01, N=0.2, B=0.5, T_B=3.0, K=0.1, R=0.3, further=[GaussMarkov(0.4, 0.3)])
    found = covariance_of_samples([model.state_space(10.0)], 8)
    parts = covariance_of_samples([term.state_space(0.1) for term in model.terms], 8)
    np.testing.assert_allclose(found, parts, rtol=1e-12)
    assert model.name == "Q+N+GM+GM+K+R"


def test_ramp_and_quantization_in_closed_form() -> None:
    tau = np.array([0.5, 2.0, 30.0])
    np.testing.assert_allclose(Ramp(-0.2).allan_variance(tau), 0.04 * tau**2 / 2)
    np.testing.assert_allclose(Quantization(0.3).allan_variance(tau), 3 * 0.09 / tau**2)
    with pytest.raises(ValueError, match="depends on the rate"):
        NoiseModel(Q=1.0).psd([1.0])


@pytest.mark.parametrize("tau", [0.004, 0.0, [1.0, 0.004]])
def test_a_cluster_without_a_sample_has_no_variance(tau: float | list[float]) -> None:
    with pytest.raises(ValueError, match="has no sample at 100 Hz"):
        NoiseModel(N=1.0).allan_variance(tau, 100.0)
    assert NoiseModel(N=1.0).allan_variance(0.006, 100.0) == pytest.approx(100.0)


@pytest.mark.parametrize("n", [1, 2, 3, 17, 60])
def test_sampled_flicker_is_its_integral(n: int) -> None:
    def of(x: float) -> float:
        return np.sin(n * x) ** 4 / np.sin(x) ** 3

    integral = quad(of, 0, np.pi / 2, limit=1000)[0]
    found = Flicker(1.0).sampled_allan_variance(np.array([float(n)]), 0.1)[0]
    assert found == pytest.approx(2 / np.pi * integral / n**2, rel=1e-8)


def test_the_flicker_table_and_its_continuation_meet() -> None:
    n = np.array([4095.0, 4096.0, 4097.0, 4098.0])
    values = Flicker(1.0).sampled_allan_variance(n, 1.0)
    steps = np.diff(values)
    assert (steps < 0).all()
    np.testing.assert_allclose(steps, steps.mean(), rtol=1e-2)
    assert values[-1] == pytest.approx(FLOOR**2, rel=1e-6)


@pytest.mark.parametrize(
    ("further", "said"),
    [
        (
            GaussMarkov(-1e-5, 3.0),
            "bias instability B is -1e-05, expected a finite number, 0 or more",
        ),
        (GaussMarkov(1e-5, -3.0), "correlation time T_B is -3.0, expected a time above 0 s"),
        (
            GaussMarkov(math.nan, 3.0),
            "bias instability B is nan, expected a finite number, 0 or more",
        ),
    ],
)
def test_a_further_term_has_values_that_a_model_can_have(further: GaussMarkov, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        NoiseModel(N=1e-4, further=[further])
