import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from imubench_pipeline.extensions.calibration.experiment import (
    Dwell,
    Experiment,
    block_mean_covariance,
    block_means,
)
from imubench_pipeline.noise import Flicker, NoiseModel, RandomWalk, WhiteNoise
from tests.earth_rate.brute import MODELS, of_blocks
from tests.earth_rate.test_experiment import experiments


@pytest.mark.parametrize("name", MODELS)
@given(experiment=experiments(), longest=st.integers(1, 50))
@settings(max_examples=15, deadline=None)
def test_closed_forms_are_the_sums_over_samples(name, experiment, longest):
    blocks = experiment.blocks(longest)
    found, wanted = block_mean_covariance(MODELS[name], blocks), of_blocks(MODELS[name], blocks)
    np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-11 * np.abs(wanted).max())


def test_a_slow_process_keeps_its_digits():
    # T_B of 10^7 samples: differences of neighbours are those of a random walk of S_B.
    blocks = Experiment.regular(dwell=10, turning=0, dwells=2, rate=32, latitude=0).blocks(320)
    model = NoiseModel(B=1.0, T_B=1e7 / 32)
    step = np.array([1.0, -1.0])
    walk = RandomWalk(model.terms[0].density ** 0.5)
    assert step @ block_mean_covariance(model, blocks) @ step == pytest.approx(
        step @ walk.mean_covariance(blocks) @ step, rel=1e-4
    )


def test_white_noise_counts_the_samples_present():
    log = np.array([1.0, np.nan, 2.0, 3.0])
    found = block_means([log], Experiment((Dwell(0, 4, 1),), 4.0, 0.0), 4)
    assert WhiteNoise(2.0).mean_covariance(found.blocks)[0, 0] == pytest.approx(4.0 * 4.0 / 3)


def test_flicker_noise_has_none():
    with pytest.raises(TypeError, match="no covariance"):
        Flicker(1.0).mean_covariance(Experiment((Dwell(0, 4, 1),), 4.0, 0.0).blocks(4))
