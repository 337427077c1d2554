import numpy as np
import pytest

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.allan.confidence import deviation_limits
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.extensions.fusion.board import Board, Shared
from imubench_pipeline.extensions.fusion.prediction import fused_allan, prediction_limits
from imubench_pipeline.extensions.fusion.weights import best_weights, fuse
from imubench_pipeline.noise import NoiseModel
from tests.conftest import few
from tests.fusion.boards import FLICKER, ROUGH, SMOOTH, logs

RATE = 100.0


def equal(sensors: int) -> np.ndarray:
    return np.full(sensors, 1.0 / sensors)


TAU = np.array([0.01, 0.1, 1.0, 10.0, 100.0, 1000.0])
TEMPERATURE = Shared(NoiseModel(N=0.02, K=0.01), [1e-4, -2e-4, 3e-4])
BOARD = Board([SMOOTH, FLICKER, ROUGH], [RATE] * 3)


@pytest.mark.parametrize("number", [1, 2, 5, 8])
def test_n_alike_have_one_nth_of_the_allan_variance(number: int) -> None:
    board = Board.alike(FLICKER, number, RATE)
    expected = FLICKER.allan_variance(TAU, RATE) / number
    for weights in (equal(number), best_weights(board, 10.0)):
        found = fused_allan(board, weights, TAU)
        assert found.variance == pytest.approx(expected, rel=1e-7)
        assert np.all(found.common == 0.0) and np.all(found.common_share == 0.0)


def test_what_is_common_is_not_averaged_away() -> None:
    board = Board.alike(SMOOTH, 6, RATE, {"N": 0.3, "K": 1.0})
    found = fused_allan(board, equal(6), TAU)
    floor = NoiseModel(N=SMOOTH.N * np.sqrt(0.3), K=SMOOTH.K).allan_variance(TAU, RATE)
    own = NoiseModel(N=SMOOTH.N * np.sqrt(0.7), B=SMOOTH.B, T_B=SMOOTH.T_B)
    assert found.common == pytest.approx(floor)
    assert found.variance == pytest.approx(floor + own.allan_variance(TAU, RATE) / 6)
    assert found.common_share == pytest.approx(floor / found.variance)


def test_opposite_sensitivities_cancel_what_is_common() -> None:
    board = Board([SMOOTH, SMOOTH], [RATE] * 2, [Shared(NoiseModel(K=1.0), [1e-4, -1e-4])])
    assert fused_allan(board, equal(2), TAU).common == pytest.approx(np.zeros(6), abs=1e-25)


BOARDS = {
    "2 alike": Board.alike(SMOOTH, 2, RATE),
    "3 mixed": BOARD,
    "4 rates": Board([SMOOTH, FLICKER, ROUGH, ROUGH], [50.0, 100.0, 500.0, 50.0]),
    "3 with temperature": Board(BOARD.models, BOARD.rates, [TEMPERATURE]),
    "5 with a floor": Board.alike(FLICKER, 5, RATE, {"N": 0.1, "B": 0.2, "K": 0.5}),
    "8 mixed": Board([SMOOTH, FLICKER] * 4, [RATE] * 8),
}


@pytest.mark.parametrize("name", few(["4 rates"], [name for name in BOARDS if name != "4 rates"]))
def test_the_prediction_lies_within_the_limits_of_simulated_curves(name: str) -> None:
    board = BOARDS[name]
    sizes = np.array([1, 3, 10, 30, 100, 300, 1000, 3000, 10_000])
    given = logs(board, 120_000, seed=11)
    for weights in (equal(board.sensors), best_weights(board, 10.0)):
        curve = allan_variance(fuse(board, weights, given), board.rate, cluster_sizes=sizes)
        predicted = fused_allan(board, weights, curve.tau).deviation
        lower, upper = deviation_limits(curve.deviation, curve.edf, 0.9999)
        assert np.all((lower < predicted) & (predicted < upper)), weights
        lower, upper = curve.limits(0.95)
        assert np.mean((lower < predicted) & (predicted < upper)) >= 6 / 9


def estimated(model: NoiseModel, spread: float) -> Estimate:
    values = {"N": model.N, "B": model.B, "T_B": model.T_B, "K": model.K}
    return Estimate(
        "likelihood",
        {
            name: Parameter(value, lower=value / spread, upper=value * spread)
            for name, value in values.items()
            if value
        },
    )


@pytest.mark.release
@pytest.mark.parametrize(("draws", "known"), few([(1000, 0.1)], [(4000, 0.05)]))
def test_the_limits_follow_from_those_of_the_parameters(draws: int, known: float) -> None:
    estimate = Estimate("likelihood", {"N": Parameter(1e-4, lower=0.5e-4, upper=2e-4)})
    board = Board.alike(NoiseModel(N=1e-4), 4, RATE)
    rng = np.random.default_rng(1)
    lower, upper = prediction_limits(board, [estimate] * 4, equal(4), [1.0], draws=draws, rng=rng)
    # Specimens of one sensor: what is not known of one is not known of the others.
    # Of 1000 draws the limits are known to 3 %.
    assert lower == pytest.approx([0.25e-4], rel=known)
    assert upper == pytest.approx([1e-4], rel=known)


@pytest.mark.release
def test_sensors_of_their_own_estimates_vary_apart() -> None:
    estimates = [estimated(NoiseModel(N=1e-4), 2.0) for _ in range(4)]
    board = Board.alike(NoiseModel(N=1e-4), 4, RATE)
    rng = np.random.default_rng(1)
    lower, upper = prediction_limits(board, estimates, equal(4), [1.0], draws=1000, rng=rng)
    assert 1.2 < upper[0] / lower[0] < 2.8  # 4 if they went together
