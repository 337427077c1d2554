import numpy as np
import pytest
from scipy.linalg import solve_discrete_are

from imubench_pipeline.extensions.fusion.kalman import steady_covariance


def test_it_is_the_solution_of_the_riccati_equation() -> None:
    rng = np.random.default_rng(3)
    phi = np.diag([0.5, 0.9, 0.999, 0.99999]) + np.triu(rng.normal(size=(4, 4)), 1) / 10
    root, h = rng.normal(size=(4, 4)), rng.normal(size=(2, 4))
    q, r = root @ root.T, np.diag([2.0, 3.0])
    expected = solve_discrete_are(phi.T, h.T, q, r)
    found = steady_covariance(phi, q, h.T @ np.linalg.inv(r) @ h)
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("size", [1e-20, 1.0, 1e20])
def test_a_walk_seen_through_white_noise_has_the_known_covariance(size: float) -> None:
    # P^2 - q P - q r = 0.
    q, r = 1e-6 * size, 2.0 * size
    expected = (q + np.sqrt(q**2 + 4 * q * r)) / 2
    found = steady_covariance(np.eye(1), np.array([[q]]), np.array([[1 / r]]))
    assert found[0, 0] == pytest.approx(expected, rel=1e-10)


def test_a_slow_process_that_is_not_seen_keeps_its_stationary_variance() -> None:
    phi = np.exp(-1e-9)
    found = steady_covariance(np.array([[phi]]), np.array([[-np.expm1(-2e-9)]]), np.zeros((1, 1)))
    assert found[0, 0] == pytest.approx(1.0, rel=1e-6)


def test_a_walk_that_is_not_seen_has_no_steady_state() -> None:
    with pytest.raises(ValueError, match="no steady state"):
        steady_covariance(np.eye(1), np.eye(1), np.zeros((1, 1)))
