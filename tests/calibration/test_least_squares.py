import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from imubench_pipeline.extensions.calibration.experiment import Dwell, Experiment
from imubench_pipeline.extensions.calibration.least_squares import (
    LeastSquares,
    NotObservableError,
    choose_block_length,
)
from imubench_pipeline.extensions.earth_rate.simulation import simulate_runs
from imubench_pipeline.noise import NoiseModel
from tests.earth_rate.brute import MODELS, of_blocks
from tests.earth_rate.test_experiment import experiments

RUN = Experiment((Dwell(0, 40, 1), Dwell(45, 60, 1), Dwell(90, 121, 1)), 4.0, 0.0)


def regressors(blocks):
    return np.column_stack([np.ones(len(blocks)), blocks.middle, np.cos(blocks.middle)])


@given(experiments(), st.sampled_from(list(MODELS)), st.integers(0, 2**32))
@settings(max_examples=40, deadline=None)
def test_it_is_the_normal_equations_with_the_covariance_of_the_samples(experiment, name, seed):
    blocks = experiment.blocks(5)
    rng = np.random.default_rng(seed)
    x = np.column_stack([np.ones(len(blocks)), rng.standard_normal(len(blocks))])
    if len(blocks) < 3:
        return
    means = rng.standard_normal((2, len(blocks)))
    inverse = np.linalg.inv(of_blocks(MODELS[name], blocks) + 0.01)
    covariance = np.linalg.inv(x.T @ inverse @ x)
    found = LeastSquares(blocks, MODELS[name], x, further=np.full((len(blocks),) * 2, 0.01)).fit(
        means
    )
    np.testing.assert_allclose(found.covariance, covariance, rtol=1e-5, atol=1e-10)
    np.testing.assert_allclose(
        found.value, means @ (covariance @ x.T @ inverse).T, rtol=1e-5, atol=1e-6
    )
    left = means - found.value @ x.T
    np.testing.assert_allclose(
        found.chi_squared, np.einsum("ri,ij,rj->r", left, inverse, left), rtol=1e-5, atol=1e-6
    )
    assert found.freedom == len(blocks) - 2


@pytest.mark.parametrize("name", ["N+GM+K", "N+F+K", "Q+N+K"])
def test_errors_intervals_and_residuals_are_as_they_say(name):
    blocks = RUN.blocks(8)
    x = regressors(blocks)
    runs = simulate_runs(
        MODELS[name],
        blocks,
        earth_rate=0.0,
        turn_on_bias=0.0,
        runs=6000,
        rng=np.random.default_rng(4),
    )
    true = np.array([3.0, -0.1, 0.4])
    found = LeastSquares(blocks, MODELS[name], x).fit(runs.means + x @ true)
    error = (found.value - true) / found.sigma
    np.testing.assert_allclose(error.std(axis=0), 1.0, atol=0.05)
    np.testing.assert_allclose(
        np.cov(error.T), found.covariance / np.outer(found.sigma, found.sigma), atol=0.06
    )
    assert np.mean(np.abs(error) < 1.96) == pytest.approx(0.95, abs=0.01)
    assert found.chi_squared.mean() == pytest.approx(found.freedom, rel=0.03)
    assert np.mean(found.p_value < 0.1) == pytest.approx(0.1, abs=0.02)
    assert found.p_value[0] == pytest.approx(chi2.sf(found.chi_squared[0], found.freedom))


def test_white_noise_gives_the_mean():
    blocks = Experiment((Dwell(0, 100, 1),), 4.0, 0.0).blocks(7)
    found = LeastSquares(blocks, NoiseModel(N=0.3), np.ones((len(blocks), 1)))
    assert found.sigma[0] == pytest.approx(0.3 / math.sqrt(25.0), rel=1e-12)


def test_blocks_are_as_short_as_it_takes():
    def ones(blocks):
        return np.ones((len(blocks), 1))

    run = Experiment((Dwell(0, 400, 1),), 4.0, 0.0)
    fast, slow = NoiseModel(N=0.1), NoiseModel(N=0.05, K=0.1)
    assert choose_block_length(run, fast, ones) == 400
    longest = choose_block_length(run, slow, ones)
    assert 1 <= longest < 100
    samples = LeastSquares(run.blocks(1), slow, ones(run.blocks(1))).sigma
    means = LeastSquares(run.blocks(longest), slow, ones(run.blocks(longest))).sigma
    assert 1.0 <= means / samples < 1.005


def test_what_cannot_be_told_is_said():
    blocks = RUN.blocks(8)
    ones = np.ones((len(blocks), 1))
    for x, says in (
        (np.hstack([ones, 2.0 * ones]), "cannot separate the parameters"),
        (np.hstack([ones, 0.0 * ones]), "0 in all blocks"),
    ):
        with pytest.raises(NotObservableError, match=says):
            LeastSquares(blocks, MODELS["N"], x)
    with pytest.raises(
        NotObservableError, match="2 parameters cannot be determined from 1 block mean;"
    ):
        LeastSquares(blocks.chosen(slice(0, 1)), MODELS["N"], np.ones((1, 2)))


def test_what_cannot_be_fitted_is_refused():
    blocks = RUN.blocks(8)
    squares = LeastSquares(blocks, MODELS["N"], np.ones((len(blocks), 1)))
    with pytest.raises(ValueError, match="columns"):
        squares.fit(np.zeros((2, 3)))
    with pytest.raises(ValueError, match="not finite"):
        squares.fit(np.full((1, len(blocks)), np.nan))
