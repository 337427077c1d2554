import numpy as np
import pytest
from scipy.optimize import minimize

from imubench_pipeline.fusion.board import Board, Shared
from imubench_pipeline.fusion.weights import ByFrequency, Constant, best_constant, equal
from imubench_pipeline.noise import NoiseModel

GOOD = NoiseModel(N=1e-4, B=5e-5, T_B=40.0, K=1e-6)
POOR = NoiseModel(N=3e-4, B=2e-5)
BOARD = Board([GOOD, POOR, GOOD], [100.0, 100.0, 200.0])


def test_the_weights_for_white_noise_are_the_inverse_variances() -> None:
    assert best_constant(BOARD).values == pytest.approx([9 / 19, 1 / 19, 9 / 19])
    assert equal(4).values == pytest.approx([0.25] * 4)


@pytest.mark.parametrize("shared", [(), (Shared(NoiseModel(K=1e-3), [1e-3, 3e-3, 2e-3]),)])
def test_no_other_constant_weights_have_a_lower_allan_variance(shared: tuple[Shared, ...]) -> None:
    board = Board(BOARD.models, BOARD.rates, shared)
    own, common = board.allan_matrices([30.0])
    matrix = (own + common)[0] * 1e9

    def variance(two: np.ndarray) -> float:
        w = np.array([*two, 1.0 - two.sum()])
        return float(w @ matrix @ w)

    found = minimize(variance, [0.3, 0.3], method="Nelder-Mead", options={"xatol": 1e-9})
    assert best_constant(board, 30.0).values[:2] == pytest.approx(found.x, abs=1e-4)


def test_the_weights_by_frequency_are_the_inverse_spectra() -> None:
    omega = np.geomspace(1e-7, np.pi, 50)
    weights = ByFrequency(BOARD).response(omega)
    spectra = np.einsum("kii->ki", BOARD.spectral_matrices(omega)[0])
    assert weights == pytest.approx((1 / spectra) / (1 / spectra).sum(axis=1, keepdims=True))
    assert weights[-1, 1] == pytest.approx(1 / 19, rel=1e-3)  # as for white noise
    assert weights[0, 1] == pytest.approx(1.0, abs=1e-2)  # one sensor does not walk


def test_weights_pass_the_signal_unchanged() -> None:
    with pytest.raises(ValueError, match="sum of 1"):
        Constant(np.array([0.5, 0.4]))


def test_a_sensor_without_noise_is_refused() -> None:
    with pytest.raises(ValueError, match="without noise"):
        best_constant(Board([GOOD, NoiseModel(K=1e-6)], [1.0, 1.0]))
