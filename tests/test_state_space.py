import numpy as np
import pytest

from imubench_pipeline.noise.state_space import repeated


@pytest.mark.parametrize("times", [0, 1, 2, 7, 64, 100])
def test_a_step_done_so_often(times):
    rng = np.random.default_rng(times)
    step, root = 0.4 * rng.standard_normal((2, 3, 3))
    whole, added = np.eye(3), np.zeros((3, 3))
    for _ in range(times):
        whole, added = step @ whole, step @ added @ step.T + root @ root.T
    found = repeated(step, root @ root.T, times)
    np.testing.assert_allclose(found[0], whole, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found[1], added, rtol=1e-9, atol=1e-12)
