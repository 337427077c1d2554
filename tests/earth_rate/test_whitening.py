import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import cholesky, solve_triangular

from imubench_pipeline.extensions.calibration.experiment import block_mean_covariance
from imubench_pipeline.extensions.earth_rate.bound import whiten
from imubench_pipeline.extensions.earth_rate.simulation import PAPER_MODEL, design_paper_run
from imubench_pipeline.noise import NoiseModel
from tests.conftest import few
from tests.earth_rate.brute import MODELS, of_blocks
from tests.earth_rate.test_experiment import experiments


@pytest.mark.parametrize("name", MODELS)
@given(experiments(), st.integers(1, 20), st.integers(0, 2**32))
@settings(max_examples=20, deadline=None)
def test_it_is_the_root_of_the_covariance_of_the_samples(name, experiment, longest, seed):
    blocks = experiment.blocks(longest)
    columns = np.random.default_rng(seed).standard_normal((len(blocks), 3))
    root = cholesky(of_blocks(MODELS[name], blocks), lower=True)
    np.testing.assert_allclose(
        whiten(MODELS[name], blocks, columns),
        solve_triangular(root, columns, lower=True),
        rtol=1e-6,
        atol=1e-6,
    )


@pytest.mark.parametrize(
    "model",
    few([PAPER_MODEL], [NoiseModel(N=PAPER_MODEL.N, B=PAPER_MODEL.B, K=PAPER_MODEL.K)]),
    ids=["GM", "flicker"],
)
def test_many_blocks_lose_no_digits(model):
    blocks = design_paper_run(30.0).blocks(32)
    assert len(blocks) > 1600
    columns = np.column_stack([blocks.seen, np.ones(len(blocks))])
    root = cholesky(block_mean_covariance(model, blocks), lower=True)
    wanted = solve_triangular(root, columns, lower=True)
    found = whiten(model, blocks, columns)
    np.testing.assert_allclose(found, wanted, rtol=1e-6, atol=1e-7 * np.abs(wanted).max())


def test_a_mean_without_noise_is_refused():
    # The random walk is 0 at the first sample, and known from then on to the last that was seen.
    blocks = design_paper_run(1.0).blocks(1)
    with pytest.raises(ValueError, match="without noise"):
        whiten(NoiseModel(K=1.0), blocks, np.ones((len(blocks), 1)))
