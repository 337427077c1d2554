import numpy as np
import pytest
from scipy.integrate import quad

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.allan.confidence import deviation_limits
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.extensions.fusion.board import Board, Shared
from imubench_pipeline.extensions.fusion.kalman import KalmanFusion
from imubench_pipeline.extensions.fusion.prediction import fused_allan, fused_psd, prediction_limits
from imubench_pipeline.extensions.fusion.samples import fuse
from imubench_pipeline.extensions.fusion.weights import ByFrequency, Constant, best_constant, equal
from imubench_pipeline.noise import NoiseModel, Sinusoid
from tests.conftest import few
from tests.fusion.boards import FLICKER, ROUGH, SMOOTH, logs

RATE = 100.0
TAU = np.array([0.01, 0.1, 1.0, 10.0, 100.0, 1000.0])
TEMPERATURE = Shared(NoiseModel(N=0.02, K=0.01), [1e-4, -2e-4, 3e-4])
BOARD = Board([SMOOTH, FLICKER, ROUGH], [RATE] * 3)


@pytest.mark.parametrize("number", [1, 2, 5, 8])
def test_n_alike_have_one_nth_of_the_allan_variance(number: int) -> None:
    board = Board.alike(FLICKER, number, RATE)
    expected = FLICKER.allan_variance(TAU, RATE) / number
    for weights in (equal(number), best_constant(board, 10.0), ByFrequency(board)):
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
    by_frequency = fused_allan(board, ByFrequency(board), TAU)
    assert by_frequency.variance == pytest.approx(found.variance, rel=1e-7)
    assert by_frequency.common == pytest.approx(floor, rel=1e-7)


def test_opposite_sensitivities_cancel_what_is_common() -> None:
    board = Board([SMOOTH, SMOOTH], [RATE] * 2, [Shared(NoiseModel(K=1.0), [1e-4, -1e-4])])
    assert fused_allan(board, equal(2), TAU).common == pytest.approx(np.zeros(6), abs=1e-25)


def test_white_and_walking_sensors_by_frequency_have_the_known_integral() -> None:
    # 1 / (1/N^2 + 1/S_K) with S_K = K^2/(2 pi f)^2: a walk seen through white noise at high f.
    N, K = 1e-3, 1e-3
    board = Board([NoiseModel(N=N), NoiseModel(K=K)], [1e4, 1e4])
    (found,) = fused_allan(board, ByFrequency(board), [1.0]).variance

    def integrand(x: float) -> float:
        f = x / np.pi
        walk = K**2 / (2 * np.pi * f) ** 2
        return float(N**2 * walk / (N**2 + walk) * np.sin(x) ** 4 / x**2)

    parts = [quad(integrand, k * np.pi, (k + 1) * np.pi)[0] for k in range(200)]
    assert found == pytest.approx(4.0 / np.pi * sum(parts), rel=1e-5)


def test_no_weights_beat_those_by_frequency() -> None:
    board = Board(BOARD.models, BOARD.rates, [TEMPERATURE])
    least = fused_allan(board, ByFrequency(board), TAU).variance
    others = [equal(3), KalmanFusion(board), *(best_constant(board, tau) for tau in TAU)]
    for weights in others:
        assert np.all(least <= fused_allan(board, weights, TAU).variance * (1 + 1e-9))


def test_the_density_is_that_of_the_weighed_sum() -> None:
    f = np.array([1e-4, 0.01, 1.0, 30.0])
    density, common = fused_psd(Board.alike(SMOOTH, 4, RATE, {"N": 0.5}), equal(4), f)
    one = SMOOTH.sampled_spectrum(2 * np.pi * f / RATE, RATE) / RATE
    assert common == pytest.approx(np.full(4, SMOOTH.N**2 / 2))
    assert density == pytest.approx((one - SMOOTH.N**2 / 2) / 4 + SMOOTH.N**2 / 2)


def test_ramps_and_lines_pass_with_the_weights_at_their_frequency() -> None:
    line = Sinusoid(1e-4, 0.3)
    models = [
        NoiseModel(N=1e-4, R=1e-8, sinusoids=[line]),
        NoiseModel(N=2e-4, R=-3e-8),
    ]
    board = Board(models, [RATE] * 2)
    weights = Constant(np.array([0.8, 0.2]))
    assert best_constant(board).values == pytest.approx(weights.values)
    expected = fused_allan(board, weights, TAU).variance
    assert fused_allan(board, ByFrequency(board), TAU).variance == pytest.approx(expected)
    assert fused_allan(board, KalmanFusion(board), TAU).variance == pytest.approx(expected)


def test_the_line_of_a_faster_sensor_is_weakened_by_the_mean_of_its_blocks() -> None:
    # Constant weights know the Allan variance of each sensor at its own rate; as a response they
    # must come to the same.
    class Response:
        def response(self, omega: np.ndarray) -> np.ndarray:
            return np.full((len(omega), 2), 0.5)

    line = Sinusoid(1e-3, 30.0)
    models = [NoiseModel(N=1e-5, R=1e-6, sinusoids=[line]), NoiseModel(N=1e-5, R=-2e-6)]
    shared = Shared(NoiseModel(R=1e-6, sinusoids=[Sinusoid(1e-3, 7.0)]), [1.0, 3.0])
    board = Board(models, [500.0, RATE], [shared])
    expected = fused_allan(board, equal(2), TAU)
    found = fused_allan(board, Response(), TAU)
    assert found.variance == pytest.approx(expected.variance, rel=1e-6)
    assert found.common == pytest.approx(expected.common, rel=1e-6)


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
    for how in (equal(board.sensors), best_constant(board, 10.0), KalmanFusion(board)):
        curve = allan_variance(fuse(board, how, given), board.rate, cluster_sizes=sizes)
        predicted = fused_allan(board, how, curve.tau).deviation
        lower, upper = deviation_limits(curve.deviation, curve.edf, 0.9999)
        assert np.all((lower < predicted) & (predicted < upper)), how
        lower, upper = curve.limits(0.95)
        assert np.mean((lower < predicted) & (predicted < upper)) >= 6 / 9


@pytest.mark.parametrize(("logs_made", "least"), few([(25, 0.89)], [(100, 0.92)]))
def test_the_limits_of_the_curve_hold_the_prediction_as_often_as_they_say(
    logs_made: int, least: float
) -> None:
    board = Board([SMOOTH, FLICKER], [10.0, 10.0])
    fusion = KalmanFusion(board)
    sizes = np.array([1, 10, 100, 400])
    predicted = fused_allan(board, fusion, sizes / 10.0).deviation
    inside = []
    for seed in range(logs_made):
        curve = allan_variance(
            fuse(board, fusion, logs(board, 8_000, seed)), 10.0, cluster_sizes=sizes
        )
        lower, upper = curve.limits(0.95)
        inside.append((lower < predicted) & (predicted < upper))
    assert least <= np.mean(inside) <= 2.0 * 0.95 - least


def test_a_smoother_by_frequency_has_the_predicted_variance() -> None:
    # The weights applied to the Fourier transform of logs: an independent way to fuse.
    board = Board(
        [NoiseModel(N=1.0, B=2.0, T_B=3.0), NoiseModel(N=3.0, B=0.5, T_B=30.0)], [10.0] * 2
    )
    length = 1 << 16
    given = np.fft.rfft(np.column_stack(logs(board, length, 4)), axis=0)
    omega = 2 * np.pi * np.arange(1, length // 2 + 1) / length
    weights = ByFrequency(board).response(omega)
    given[1:] *= weights
    given[0] *= weights[0]
    curve = allan_variance(
        np.fft.irfft(given.sum(axis=1), length), 10.0, cluster_sizes=np.array([1, 10, 100, 1000])
    )
    predicted = fused_allan(board, ByFrequency(board), curve.tau).deviation
    lower, upper = deviation_limits(curve.deviation, curve.edf, 0.999)
    assert np.all((lower < predicted) & (predicted < upper))


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
