import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from imubench_pipeline.extensions.fusion.board import Board, Parts, Shared
from imubench_pipeline.extensions.fusion.weights import (
    at_fused_rate,
    best_weights,
    fuse,
    least,
)
from imubench_pipeline.noise import NoiseModel

GOOD = NoiseModel(N=1e-4, B=5e-5, T_B=40.0, K=1e-6)
POOR = NoiseModel(N=3e-4, B=2e-5)
BOARD = Board([GOOD, POOR, GOOD], [100.0, 100.0, 200.0])


def test_the_weights_for_white_noise_are_the_inverse_variances() -> None:
    assert best_weights(BOARD) == pytest.approx([9 / 19, 1 / 19, 9 / 19])


@pytest.mark.parametrize("shared", [(), (Shared(NoiseModel(K=1e-3), [1e-3, 3e-3, 2e-3]),)])
def test_no_other_constant_weights_have_a_lower_allan_variance(shared: tuple[Shared, ...]) -> None:
    board = Board(BOARD.models, BOARD.rates, shared)
    parts = board.allan_parts([30.0])

    def variance(two: np.ndarray) -> float:
        return float(np.sum(parts.of_sum(np.array([*two, 1.0 - two.sum()])))) * 1e9

    found = minimize(variance, [0.3, 0.3], method="Nelder-Mead", options={"xatol": 1e-9})
    assert best_weights(board, 30.0)[:2] == pytest.approx(found.x, abs=1e-4)


@given(st.floats(-12.0, 12.0), st.integers(0, 1000))
def test_with_common_parts_they_solve_the_matrix_of_covariances(size: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    own, shared = rng.uniform(1.0, 5.0, (1, 4)), rng.uniform(1.0, 5.0, (1, 2))
    gains = rng.normal(size=(2, 4))
    unit = 10.0**size  # of the sensors: the weights do not depend on it
    matrix = np.diag(own[0]) + gains.T @ np.diag(shared[0]) @ gains
    expected = np.linalg.solve(matrix, np.ones(4))
    found = least(Parts(own * unit**2, shared, gains * unit))
    assert found[0] == pytest.approx(expected / expected.sum(), rel=1e-9, abs=1e-9)


def test_what_all_follow_alike_does_not_matter_however_large_it_is() -> None:
    own = np.array([[1.0, 4.0, 2.0]])
    for size in (0.0, 1.0, 1e20, 1e300):
        found = least(Parts(own, np.array([[size]]), np.ones((1, 3))))
        assert found[0] == pytest.approx(np.array([4, 1, 2]) / 7, rel=1e-12)


def test_a_sensor_that_is_perfect_but_for_what_all_share_is_taken_alone() -> None:
    parts = Parts(np.array([[0.0, 2.0]]), np.array([[5.0]]), np.ones((1, 2)))
    assert least(parts)[0] == pytest.approx([1.0, 0.0], abs=1e-12)
    none = Parts(np.zeros((1, 3)), np.array([[5.0]]), np.ones((1, 3)))
    assert least(none)[0] == pytest.approx([1 / 3] * 3)


def test_what_is_large_is_taken_off_where_two_see_it_unlike() -> None:
    parts = Parts(np.ones((1, 2)), np.array([[1e25]]), np.array([[1.0, 3.0]]))
    assert least(parts)[0] == pytest.approx([1.5, -0.5])


def test_weights_pass_the_signal_unchanged() -> None:
    for wrong in ([0.5, 0.4], [0.5, np.nan], [0.5, 0.5, 0.0]):
        with pytest.raises(ValueError, match="sum of 1"):
            fuse(TWO_RATES, np.array(wrong), [np.zeros(8)] * 2)


def test_the_weights_for_a_tau_below_half_a_sample_are_those_for_one_sample() -> None:
    assert best_weights(BOARD, 0.004) == pytest.approx(best_weights(BOARD, 0.01))


def test_a_sensor_without_noise_is_refused() -> None:
    with pytest.raises(ValueError, match="without noise"):
        best_weights(Board([GOOD, NoiseModel(K=1e-6)], [1.0, 1.0]))


TWO_RATES = Board([NoiseModel(N=1e-4)] * 2, [100.0, 200.0])


def test_a_faster_sensor_is_brought_to_the_fused_rate_by_means_of_blocks() -> None:
    found = at_fused_rate(TWO_RATES, [np.array([1.0, 2.0]), np.array([1.0, 3.0, 5.0, 9.0, 4.0])])
    assert found.tolist() == [[1.0, 2.0], [2.0, 7.0]]


@pytest.mark.parametrize("logs", [1, 3])
def test_a_wrong_number_of_logs_is_said(logs: int) -> None:
    samples = [np.zeros(8)] * logs
    with pytest.raises(ValueError, match=f"found samples of {logs} sensors, expected 2"):
        fuse(TWO_RATES, np.array([0.5, 0.5]), samples)
