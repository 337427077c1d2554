import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2, norm

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.extensions.calibration.experiment import Experiment
from imubench_pipeline.extensions.calibration.kalman import RateFilter
from imubench_pipeline.extensions.calibration.least_squares import LeastSquares
from imubench_pipeline.extensions.calibration.sigma_range import sigma_range
from imubench_pipeline.navigation.error_budget.uncertainty import draw_models
from imubench_pipeline.noise import NoiseModel
from tests.conftest import few

RUN = Experiment.regular(dwell=10.0, turning=2.0, dwells=6, rate=4.0, latitude=0.3)
MODEL = NoiseModel(N=1e-3, B=2e-4, T_B=20.0, K=1e-5)


def drawn_from_covariance(names, covariance, draws, rng):
    """Models with jointly log-normal parameters, with the medians of `MODEL`."""
    medians = [getattr(MODEL, name) for name in names]
    factors = np.exp(rng.multivariate_normal(np.zeros(len(names)), covariance, draws))
    rows = (medians * factors).tolist()
    return [replace(MODEL, **dict(zip(names, row, strict=True))) for row in rows]


@pytest.mark.parametrize(("draws", "known"), few([(1000, 0.03)], [(4000, 0.01)]))
def test_what_is_proportional_to_a_parameter_has_its_limits(draws, known):
    # The mean of white noise: N over the root of the time.
    estimate = Estimate("made", {"N": Parameter(1e-3, lower=0.8e-3, upper=1.5e-3)})
    blocks = RUN.blocks(40)

    def sigma(model):
        return LeastSquares(blocks, model, np.ones((len(blocks), 1))).sigma

    drawn = draw_models(estimate, draws, np.random.default_rng(1))
    found = sigma_range(sigma, estimate.model, drawn)
    root = math.sqrt(60.0)
    assert found.value[0] == pytest.approx(1e-3 / root)
    assert found.lower[0] == pytest.approx(0.8e-3 / root, rel=known)
    assert found.upper[0] == pytest.approx(1.5e-3 / root, rel=1.5 * known)
    assert found.lower < found.value < found.pooled < found.upper


@given(st.floats(0.01, 0.3), st.floats(0.01, 0.3), st.floats(-0.99, 0.99))
@settings(max_examples=3, deadline=None)
def test_a_product_of_powers_is_log_normal(of_n, of_k, correlation):
    # log(sqrt(N K)) has the variance (s_N^2 + s_K^2 + 2 r s_N s_K) / 4.
    cross = correlation * of_n * of_k
    covariance = np.array([[of_n**2, cross], [cross, of_k**2]])
    rng = np.random.default_rng(2)
    drawn = drawn_from_covariance(["N", "K"], covariance, 6000, rng)
    found = sigma_range(lambda one: math.sqrt(one.N * one.K), MODEL, drawn, level=0.9)
    spread = math.sqrt(covariance.sum()) / 2.0
    middle = math.sqrt(MODEL.N * MODEL.K)
    assert found.value == pytest.approx(middle)
    assert np.log(found.upper / middle) == pytest.approx(norm.ppf(0.95) * spread, rel=0.1)
    assert np.log(found.lower / middle) == pytest.approx(norm.ppf(0.05) * spread, rel=0.1)
    assert found.pooled == pytest.approx(middle * math.exp(spread**2), rel=0.03)
    assert all(one.B == MODEL.B and one.T_B == MODEL.T_B for one in drawn)


@pytest.mark.parametrize(("runs", "least", "most"), few([(50, 0.84, 1.01)], [(300, 0.91, 0.985)]))
def test_the_true_sigma_lies_in_it_as_often_as_it_says(runs, least, most):
    # N from the variance of 50 samples, with the exact chi-squared limits of it.
    rng = np.random.default_rng(3)
    true, inside = 1e-3, 0
    for estimated in true * np.sqrt(rng.chisquare(50, runs) / 50.0):
        lower, upper = (estimated * math.sqrt(50.0 / chi2.ppf(p, 50)) for p in (0.975, 0.025))
        parameter = Parameter(float(estimated), lower=lower, upper=upper)
        drawn = draw_models(Estimate("made", {"N": parameter}), 300, rng)
        found = sigma_range(lambda one: one.N / 8.0, NoiseModel(N=float(estimated)), drawn)
        inside += bool(found.lower < true / 8.0 < found.upper)
    assert least < inside / runs < most


@pytest.mark.parametrize(("runs", "known"), few([(500, 0.15)], [(1500, 0.09)]))
def test_errors_of_runs_whose_model_is_drawn_are_as_large_as_the_pooled_one(runs, known):
    # A model for each run: the error of the mean is normal with that run's sigma.
    rng = np.random.default_rng(4)
    blocks = RUN.blocks(40)
    drawn = drawn_from_covariance(["N", "B", "K"], 0.2 * np.eye(3), runs, rng)

    def sigma(model):
        return LeastSquares(blocks, model, np.ones((len(blocks), 1))).sigma[0]

    found = sigma_range(sigma, MODEL, drawn)
    errors = np.array([sigma(one) for one in drawn]) * rng.standard_normal(runs)
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(float(found.pooled), rel=known)
    assert found.pooled > 1.05 * found.value


def test_a_filter_over_time_has_a_range_at_each_epoch():
    blocks = RUN.blocks(40)
    drawn = drawn_from_covariance(
        ["N", "B", "T_B", "K"], 0.04 * np.eye(4), 60, np.random.default_rng(5)
    )
    found = sigma_range(lambda one: RateFilter(blocks, one).rate_sigma, MODEL, drawn)
    assert found.value.shape == found.lower.shape == (len(blocks),)
    known = slice(2, None)
    assert np.all((found.lower < found.value)[known] & (found.value < found.upper)[known])
    same = sigma_range(lambda one: RateFilter(blocks, one).rate_sigma, MODEL, [MODEL] * 3)
    np.testing.assert_array_equal(same.lower, same.upper)


def test_a_range_needs_draws_and_a_level():
    with pytest.raises(ValueError, match="there is none"):
        sigma_range(lambda one: one.N, MODEL, [])
    with pytest.raises(ValueError, match="level"):
        sigma_range(lambda one: one.N, MODEL, [MODEL], level=1.0)
