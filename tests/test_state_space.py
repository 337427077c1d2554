import numpy as np
import pytest

from imubench_pipeline.noise import Ramp
from imubench_pipeline.noise.state_space import factor_covariance, repeat_step


@pytest.mark.parametrize("times", [0, 1, 2, 7, 64, 100])
def test_a_step_done_so_often(times):
    rng = np.random.default_rng(times)
    step, root = 0.4 * rng.standard_normal((2, 3, 3))
    whole, added = np.eye(3), np.zeros((3, 3))
    for _ in range(times):
        whole, added = step @ whole, step @ added @ step.T + root @ root.T
    found = repeat_step(step, root @ root.T, times)
    np.testing.assert_allclose(found[0], whole, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found[1], added, rtol=1e-9, atol=1e-12)


def test_the_root_of_a_covariance_in_which_something_does_not_vary():
    own = np.array([[2.0, -0.7], [-0.7, 1.0]])
    covariance = np.zeros((4, 4))
    covariance[np.ix_([0, 2], [0, 2])] = own
    root = factor_covariance(covariance)
    np.testing.assert_allclose(root @ root.T, covariance, atol=1e-15)
    assert (np.triu(root, 1) == 0.0).all()
    assert factor_covariance(np.zeros((0, 0))).shape == (0, 0)


def test_of_either_sign_the_mean_square_is_the_same():
    space = Ramp(0.7).state_space(0.01)
    either = space.of_either_sign()
    assert (either.initial_mean == 0.0).all()
    square = np.diag(space.initial_variance) + space.initial_mean**2
    np.testing.assert_allclose(np.diag(either.initial_variance), square, rtol=1e-15)
    assert square[1] == pytest.approx(0.7**2)
