import numpy as np
import pytest

from imubench_pipeline.estimators.thermal.uncertainty import assess_lag


def posterior(rng, best, spread=10.0):
    """Draws of a lag that is not below 0."""
    draws = rng.normal(best, spread, 4_000)
    return draws[draws > 0.0][:1_000]


def test_a_lag_of_nothing_is_inside_at_least_as_often_as_it_is_said():
    rng = np.random.default_rng(1)
    errors = rng.normal(0.0, 10.0, 400)
    told = [assess_lag(max(z, 0.0), posterior(rng, z), 1e3, True) for z in errors]
    assert np.mean([lag.lower == 0.0 for lag in told]) > 0.94


def test_a_lag_far_from_nothing_has_equal_tails():
    lag = assess_lag(100.0, posterior(np.random.default_rng(2), 100.0), 1e3, True)
    assert lag.status == "ok"
    assert (lag.lower, lag.upper) == pytest.approx((80.4, 119.6), abs=4.0)
