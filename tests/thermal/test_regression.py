"""Regression on a temperature for given noise, and the limits of what it gives."""

import math

import numpy as np
import pytest
import scipy.fft
from scipy.stats import binom

from imubench_pipeline.estimators.deterministic.means import average_blocks
from imubench_pipeline.estimators.deterministic.ordinates import Ordinates
from imubench_pipeline.estimators.thermal.fit import _compute_mean_error, _limit_lag
from imubench_pipeline.estimators.thermal.path import TemperaturePath, apply_lag
from imubench_pipeline.estimators.thermal.regression import Effect, Posterior, Regression, Shape
from imubench_pipeline.estimators.whittle import Maximum, Terms
from tests.conftest import few

RATE, SAMPLES = 2.0, 400
TIMES = np.arange(SAMPLES) / RATE
SWING = 20.0 + 3.0 * np.sin(2.0 * np.pi * TIMES / 90.0 + 0.5) + 1.5 * np.cos(TIMES / 13.0)
N, LAG, S = 0.05, 3.0, 0.2


def path_of(values, draws=None):
    draws = values[None] if draws is None else draws
    whole = ((0, SAMPLES),)
    return TemperaturePath(np.arange(float(SAMPLES)), values, draws, (slice(0, SAMPLES),), whole)


def regression_of(log, path):
    return Regression(Ordinates(average_blocks([log], SAMPLES, RATE)), path, RATE)


def lagged(lag, values=SWING):
    return apply_lag(TIMES, values, lag) - values.mean()


def dct(values):
    """Of means over a sample of what is linear between samples and flat beyond."""
    wide = np.concatenate((values[:1], values, values[-1:]))
    means = (wide[:-2] + 6.0 * wide[1:-1] + wide[2:]) / 8.0
    return scipy.fft.dct(means, norm="ortho")[1:]


@pytest.fixture(scope="module")
def regression():
    noise = N * np.sqrt(RATE) * np.random.default_rng(6).standard_normal(SAMPLES)
    return regression_of(S * lagged(LAG) + noise, path_of(SWING))


DENSITY = N**2 * (1.0 + 30.0 / np.arange(1, SAMPLES) ** 2)


@pytest.mark.parametrize("quadratic", [False, True])
def test_a_fit_is_weighted_least_squares(regression, quadratic):
    columns = regression.columns(1.0, Shape(quadratic))
    X = columns
    np.testing.assert_allclose(X[0], dct(lagged(1.0)), rtol=1e-9, atol=1e-9)
    if quadratic:
        np.testing.assert_allclose(X[1], dct(lagged(1.0) ** 2), rtol=1e-9, atol=1e-9)
    root = np.sqrt(1.0 / RATE / DENSITY)
    y = regression.ordinates.coefficient
    beta, covariance, gain = regression.solve(columns, DENSITY)
    expected, left, *_ = np.linalg.lstsq((X * root).T, y * root)
    np.testing.assert_allclose(beta, expected, rtol=1e-6)
    np.testing.assert_allclose(covariance, np.linalg.inv((X * root**2) @ X.T), rtol=1e-6)
    assert gain == pytest.approx(0.5 * (np.sum((y * root) ** 2) - left[0]))


def test_sensitivity_lag_and_noise_are_fitted_together(regression):
    lags = np.linspace(0.0, 10.0, 101)
    effect = regression.fit(Shape(), lags)
    error = math.sqrt(effect.covariance[0, 0])
    assert effect.beta[0] == pytest.approx(S, abs=4.0 * error)
    assert effect.lag == pytest.approx(LAG, abs=1.5)
    assert np.exp(np.mean(np.log(effect.density))) == pytest.approx(N**2, rel=0.2)
    gains = [regression.solve(regression.columns(lag, Shape()), effect.density)[2]
             for lag in lags.tolist()]  # fmt: skip
    assert effect.lag == lags[int(np.argmax(gains))]
    square = regression.fit(Shape(quadratic=True), lags)
    assert abs(square.beta[1]) < 4.0 * math.sqrt(square.covariance[1, 1])


def test_lags_are_scanned_to_a_twentieth_of_the_log_and_half_an_hour(regression):
    assert regression.lags[[0, 1, -1]] == pytest.approx([0.0, 0.25, 10.0])
    path = path_of(SWING)
    means = average_blocks([SWING], SAMPLES, RATE / 1_000.0)
    assert Regression(Ordinates(means), path, RATE / 1_000.0).lags[-1] == 1_800.0


@pytest.mark.parametrize("number", few([16], [40]))
def test_the_posterior_covers_the_truth_as_often_as_it_says(number):
    rng = np.random.default_rng(3)
    inside, lags_inside = 0, 0
    for _ in range(number):
        log = S * lagged(LAG) + N * np.sqrt(RATE) * rng.standard_normal(SAMPLES)
        own = regression_of(log, path_of(SWING))
        effect = own.fit(Shape(), np.linspace(0.0, 10.0, 41))
        lags = own.bracket_likely_lags(effect)
        posterior = own.posterior(effect, effect.noise, effect.density, lags)
        assert posterior.lag_weights.sum() == pytest.approx(1.0)
        inside += abs(effect.beta[0] - S) < 1.96 * math.sqrt(posterior.covariance[0, 0])
        lag = _limit_lag(effect.lag, posterior, 0.0, 100.0)
        lags_inside += lag.lower <= LAG <= lag.upper
    # Of 40 at 95 %: fewer than 33 has a probability of 0.1 %.
    assert min(inside, lags_inside) >= binom.ppf(0.001, number, 0.95)


def test_errors_of_the_path_move_the_fit():
    rng = np.random.default_rng(9)
    draws = SWING + 0.1 * rng.standard_normal((5, SAMPLES))
    own = regression_of(S * lagged(LAG), path_of(SWING, draws))
    beta, covariance, _ = own.solve(own.columns(LAG, Shape()), DENSITY)
    noise = Maximum(Terms("NFK", 1), np.zeros(4), np.ones(1), 0.0, 0.0)
    effect = Effect(Shape(), LAG, beta, covariance, noise, DENSITY, 0.0)
    changes = own.path_errors(effect)
    step = 0.25  # half a block
    by_lag = beta[0] * (lagged(LAG + step) - lagged(LAG)) / step
    root = np.sqrt(1.0 / DENSITY)
    X = np.array([dct(lagged(LAG)), dct(by_lag)])
    for moved, draw in zip(changes, draws, strict=True):
        error = dct(beta[0] * apply_lag(TIMES, draw - SWING, LAG))
        np.testing.assert_allclose(
            moved, np.linalg.lstsq((X * root).T, error * root)[0], rtol=1e-3, atol=1e-6
        )


def test_a_lag_with_zero_among_its_likely_values_has_an_upper_limit_only():
    lags = np.linspace(0.0, 100.0, 101)
    for middle, status in ((10.0, "not_identified"), (50.0, "ok")):
        weights = np.exp(-0.5 * ((lags - middle) / 11.0) ** 2)
        posterior = Posterior(lags, weights / weights.sum(), 0.0, np.eye(1))
        found = _limit_lag(middle, posterior, 0.0, 1e3)
        assert found.status == status
        assert found.upper == pytest.approx(middle + 1.96 * 11.0, abs=5.0)
    assert found.lower == pytest.approx(50.0 - 1.96 * 11.0, abs=1.5)
    # An interval of more than half of the scan gives no value.
    assert _limit_lag(50.0, posterior, 0.0, 80.0).status == "not_identified"
    # Errors of the path widen it.
    assert _limit_lag(50.0, posterior, 11.0, 1e3).upper == pytest.approx(80.5, abs=2.0)


def test_the_mean_of_a_log_is_known_as_its_noise_lets_it():
    D, K, B, T_B = SAMPLES / RATE, 0.01, 0.03, 4.0
    variance = B**2 * np.log(2.0) / np.pi / 0.4365**2
    process = 2.0 * variance * T_B / D * (1.0 - T_B / D * (1.0 - np.exp(-D / T_B)))
    for walk, bias, expected in (
        (0.0, 0.0, N**2 / D),
        (K, 0.0, N**2 / D + K**2 * D / 3.0),
        (0.0, B, N**2 / D + process),
    ):
        powers = np.array([N**2, 0.0, 0.0, bias**2])
        noise = Maximum(Terms("NFK", 1), powers, np.array([T_B]), 0.0, 0.0)
        posterior = Posterior(np.zeros(1), np.ones(1), walk, np.empty((0, 0)))
        found = _compute_mean_error(noise, posterior, D, RATE)
        assert found == pytest.approx(np.sqrt(expected), rel=0.02)
