import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from imubench_pipeline.estimators.thermal.path import apply_lag
from tests.conftest import few

TIMES = np.array([0.0, 1.0, 2.5, 4.0, 9.0, 9.5, 20.0])
VALUES = np.array([20.0, 21.0, 19.5, 25.0, 25.0, 18.0, 30.0])


@pytest.mark.parametrize("lag", few([1.0], [0.05, 7.0, 500.0]))
def test_lag_is_that_of_its_differential_equation(lag):
    found = apply_lag(TIMES, VALUES, lag)
    state = VALUES[0]
    for i in range(1, len(TIMES)):  # a stretch at a time: the slope jumps at knots
        solution = solve_ivp(
            lambda t, y: (np.interp(t, TIMES, VALUES) - y) / lag,
            (TIMES[i - 1], TIMES[i]),
            [state],
            method="Radau",
            rtol=1e-10,
            atol=1e-12,
        )
        state = solution.y[0, -1]
        assert found[i] == pytest.approx(state, abs=1e-6)


def test_a_ramp_is_followed_a_lag_behind():
    times = np.arange(0.0, 1000.0, 5.0)
    assert apply_lag(times, 0.1 * times, 20.0)[-1] == pytest.approx(0.1 * (times[-1] - 20.0))


@given(st.floats(1e-6, 1e6))
def test_lagged_stays_within_the_range_of_the_temperature(lag):
    found = apply_lag(TIMES, VALUES, lag)
    assert VALUES.min() - 1e-9 <= found.min() and found.max() <= VALUES.max() + 1e-9


def test_no_lag_changes_nothing():
    assert np.array_equal(apply_lag(TIMES, VALUES, 0.0), VALUES)
