import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.extensions.fusion.board import Board, Shared, divided
from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid
from imubench_pipeline.noise.state_space import of_block_means

MODEL = NoiseModel(Q=1e-6, N=1e-4, B=5e-5, T_B=0.4, K=1e-6)


@pytest.mark.parametrize("size", [1, 3, 8])
@pytest.mark.parametrize(
    "model",
    [NoiseModel(Q=1e-3), NoiseModel(B=1.0, T_B=0.05), NoiseModel(N=0.1, B=1.0, T_B=3.0)],
    ids=lambda model: model.name,
)
def test_the_states_of_block_means_have_their_covariances(model: NoiseModel, size: int) -> None:
    rate = 100.0
    space = of_block_means(model.state_space(rate), size)
    variance = space.initial_variance
    for _ in range(2):  # the initial state stands before the first block
        variance = space.transition @ variance @ space.transition.T + space.process_noise
    # Independently: the covariances of the samples, summed over the blocks.
    omega = (np.arange(1 << 18) + 0.5) * 2.0 * np.pi / (1 << 18)
    spectrum = model.sampled_spectrum(omega, rate)
    lags = np.arange(4 * size)
    covariance = np.array([np.mean(spectrum * np.cos(omega * lag)) for lag in lags])
    for apart in (0, 1, 2):
        gaps = np.abs(np.subtract.outer(np.arange(size), np.arange(size) + apart * size))
        expected = covariance[gaps].mean()
        carried = np.linalg.matrix_power(space.transition, apart) @ variance
        found = space.output @ carried @ space.output
        found += space.measurement_noise * (apart == 0)
        assert found == pytest.approx(expected, rel=1e-6, abs=1e-9 * covariance[0])


@given(st.lists(st.floats(0.0, 1.0), min_size=4, max_size=4))
def test_what_is_alone_and_what_is_common_add_up(shares: list[float]) -> None:
    model = NoiseModel(
        Q=1e-6, N=1e-4, B=5e-5, T_B=40.0, K=1e-6, R=-1e-9,
        further=[GaussMarkov(1e-5, 7.0)], sinusoids=[Sinusoid(1e-5, 0.2)],
    )  # fmt: skip
    own, common = divided(model, dict(zip("NBKR", shares, strict=True)))
    tau = np.array([0.1, 1.0, 30.0, 1e4])
    total = own.allan_variance(tau) + common.allan_variance(tau)
    assert total == pytest.approx(model.allan_variance(tau), rel=1e-12)
    assert common.Q == 0.0 and not common.sinusoids
    assert common.N == pytest.approx(model.N * math.sqrt(shares[0]))


def test_only_what_can_be_common_has_a_correlation() -> None:
    with pytest.raises(ValueError, match="correlation of T_B is"):
        divided(MODEL, {"T_B": 0.5})
    with pytest.raises(ValueError, match="correlation of N is"):
        divided(MODEL, {"N": 1.5})


def test_a_common_process_keeps_its_signs() -> None:
    shared = Shared(NoiseModel(K=2.0), [1e-3, -2e-3])
    board = Board([MODEL, MODEL], [100.0, 200.0], [shared])
    tau = np.array([1.0, 10.0])
    walk = 4.0 * NoiseModel(K=1.0).allan_variance(tau, 100.0)
    w = np.array([0.7, 0.3])
    alone, common = board.allan_parts(tau).of_sum(w)
    assert common == pytest.approx((0.7e-3 - 0.6e-3) ** 2 * walk)
    assert alone == pytest.approx(
        0.49 * MODEL.allan_variance(tau, 100.0) + 0.09 * MODEL.allan_variance(tau, 200.0)
    )


def test_a_tau_below_half_a_sample_is_one_sample() -> None:
    board = Board([MODEL, MODEL], [100.0, 200.0], [Shared(MODEL, [1.0, 2.0])])
    found, one = board.allan_parts([0.0, 0.004, 0.01]), board.allan_parts([0.01])
    assert np.array_equal(found.own, np.tile(one.own, (3, 1)))
    assert np.array_equal(found.shared, np.tile(one.shared, (3, 1)))


def test_a_board_that_cannot_be_is_refused() -> None:
    with pytest.raises(ValueError, match="found 1 models and 2 rates"):
        Board([MODEL], [1.0, 2.0])
    with pytest.raises(ValueError, match="numbers above 0"):
        Board([MODEL], [0.0])
    with pytest.raises(ValueError, match="not a whole multiple"):
        Board([MODEL, MODEL], [100.0, 150.0])
    with pytest.raises(ValueError, match="expected one finite sensitivity per sensor"):
        Board([MODEL, MODEL], [1.0, 1.0], [Shared(MODEL, [1.0])])
