import numpy as np
import pytest

from imubench_pipeline.extensions.fusion.board import Board, Shared
from imubench_pipeline.extensions.fusion.kalman import KalmanFusion
from imubench_pipeline.extensions.fusion.samples import at_fused_rate, fuse
from imubench_pipeline.extensions.fusion.weights import ByFrequency, best_constant, equal
from imubench_pipeline.noise import NoiseModel
from tests.fusion.boards import FLICKER, ROUGH, SMOOTH, logs

MIXED = Board([SMOOTH, FLICKER, ROUGH], [100.0, 200.0, 100.0])
OMEGA = np.geomspace(1e-8, np.pi, 60)


def reference(
    board: Board, models: list[NoiseModel], samples: np.ndarray, steps: int
) -> np.ndarray:
    """Return what a plain Kalman filter of the differences to the first sensor fuses."""
    spaces = [model.state_space(board.rate) for model in models]
    sizes = [len(space.output) for space in spaces]
    m, n = sum(sizes), len(models)
    phi, q, p, h = (np.zeros(shape) for shape in ((m, m), (m, m), (m, m), (n, m)))
    at = 0
    for i, (space, size) in enumerate(zip(spaces, sizes, strict=True)):
        own = slice(at, at + size)
        phi[own, own], q[own, own] = space.transition, space.process_noise
        p[own, own], h[i, own] = space.initial_variance, space.output
        at += size
    r = np.diag([space.measurement_noise for space in spaces])
    d = np.hstack([-np.ones((n - 1, 1)), np.eye(n - 1)])
    x = np.zeros(m)
    fused = np.empty(steps)
    for k in range(steps):
        # The signal is what is left of each sensor, weighed by the joint prediction error.
        s = h @ p @ h.T + r
        a = np.linalg.solve(s, np.ones(n))
        fused[k] = a @ (samples[k] - h @ x) / a.sum()
        gain = p @ h.T @ d.T @ np.linalg.inv(d @ s @ d.T)
        x = x + gain @ d @ (samples[k] - h @ x)
        p = p - gain @ d @ h @ p
        x, p = phi @ x, phi @ p @ phi.T + q
    return fused


@pytest.mark.release
def test_it_is_the_kalman_filter_of_the_differences_once_that_has_settled() -> None:
    models = [
        NoiseModel(N=1.0, B=3.0, T_B=2.0),
        NoiseModel(N=2.0, B=1.0, T_B=0.5),
        NoiseModel(N=1.5, Q=0.02, B=2.0, T_B=1.0),
    ]
    board = Board(models, [10.0] * 3)
    samples = np.column_stack(logs(board, 4000, 5))
    plain = reference(board, models, samples, 4000)
    (steady,) = KalmanFusion(board).fuse([samples])
    assert steady[2000:] == pytest.approx(plain[2000:], abs=1e-9)


@pytest.mark.parametrize(
    "board",
    [MIXED, Board(MIXED.models, MIXED.rates, [Shared(NoiseModel(K=1e-3), [1e-3, 2e-3, 0])])],
)
def test_the_signal_passes_unchanged_and_without_delay(board: Board) -> None:
    fusion = KalmanFusion(board)
    assert fusion.response(OMEGA).sum(axis=1) == pytest.approx(np.ones(60), abs=1e-8)
    noise = logs(board, 3000, 1)
    signal = 9.81 + np.sin(np.arange(3000) ** 1.5 / 50.0)
    moved = [log + np.repeat(signal, size) for log, size in zip(noise, board.blocks, strict=True)]
    difference = fuse(board, fusion, moved) - fuse(board, fusion, noise)
    assert difference == pytest.approx(signal, abs=1e-12)


def test_the_response_is_that_of_the_samples() -> None:
    fusion = KalmanFusion(MIXED)
    for sensor in range(3):
        impulse = np.zeros((1 << 15, 3))
        impulse[0, sensor] = 1.0
        (answer,) = fusion.fuse([impulse])
        omega = 2.0 * np.pi * np.array([300, 3000, 16000]) / len(answer)
        turned = np.exp(-1j * np.outer(omega, np.arange(len(answer))))
        # A slow tail is cut off: what is left of it bounds the difference.
        assert turned @ answer == pytest.approx(fusion.response(omega)[:, sensor], abs=2e-4)


def test_like_sensors_have_equal_weights_at_every_frequency() -> None:
    board = Board([FLICKER] * 4, [50.0] * 4)
    assert np.abs(KalmanFusion(board).response(OMEGA) - 0.25).max() < 1e-7


def test_at_high_and_low_frequencies_the_weights_are_the_best_ones() -> None:
    board = Board([SMOOTH, NoiseModel(N=3e-4, B=1e-5, T_B=20.0, K=1e-7)], [100.0] * 2)
    ends = np.array([1e-8, 3.0])
    best = ByFrequency(board).response(ends)
    assert best[0] == pytest.approx([0.015, 0.985], abs=1e-3)  # K^-2: 1 to 67
    assert KalmanFusion(board).response(ends) == pytest.approx(best, abs=2e-3)


def test_the_size_of_the_blocks_does_not_matter() -> None:
    board, samples = MIXED, at_fused_rate(MIXED, logs(MIXED, 1000, 2))
    fusion = KalmanFusion(board)
    (whole,) = fusion.fuse([samples])
    parts = np.concatenate(list(fusion.fuse([samples[:1], samples[1:700], samples[700:]])))
    assert np.array_equal(whole, parts)


def test_a_missing_sample_is_missing_and_leaves_the_rest() -> None:
    samples = at_fused_rate(MIXED, logs(MIXED, 1000, 2))
    fusion = KalmanFusion(MIXED)
    (whole,) = fusion.fuse([samples])
    samples[100, 1] = np.nan
    (holed,) = fusion.fuse([samples])
    assert np.isnan(holed[100]) and np.isfinite(np.delete(holed, 100)).all()
    assert np.array_equal(holed[:100], whole[:100])
    assert holed[101:] == pytest.approx(whole[101:], abs=1e-5)


def test_constant_weights_fuse_means_of_blocks() -> None:
    board = Board([SMOOTH, SMOOTH], [1.0, 2.0])
    given = [np.array([1.0, 2.0, 3.0]), np.array([0.0, 2.0, 4.0, 8.0, 9.0])]
    assert fuse(board, equal(2), given) == pytest.approx([1.0, 4.0])
    assert fuse(board, equal(2), [given[0][:0], given[1]]).shape == (0,)
    with pytest.raises(ValueError, match="found samples of 1"):
        at_fused_rate(board, given[:1])


def test_sensors_of_white_noise_alone_need_no_states() -> None:
    board = Board([NoiseModel(N=1.0), NoiseModel(N=2.0)], [1.0, 1.0])
    fusion = KalmanFusion(board)
    assert fusion.states == 0
    assert fusion.weights == pytest.approx(best_constant(board).values)
    assert fusion.response(OMEGA)[5] == pytest.approx([0.8, 0.2])


def test_what_cannot_be_filtered_is_refused() -> None:
    with pytest.raises(ValueError, match="needs white noise"):
        KalmanFusion(Board([SMOOTH, NoiseModel(K=1.0)], [1.0, 1.0]))
    with pytest.raises(ValueError, match="expected 3 columns"):
        list(KalmanFusion(MIXED).fuse([np.zeros((5, 2))]))
