import math

import numpy as np
import pytest

from imubench_pipeline.navigation.backtest.windows import (
    Errors,
    Window,
    WindowCovariance,
    choose_window,
    compute_window_errors,
)
from imubench_pipeline.navigation.error_budget.budget import of_sensor
from imubench_pipeline.noise import GaussMarkov, NoiseModel, RandomWalk, Sinusoid
from imubench_pipeline.noise.growth import Calibrated


def test_white_noise_has_its_closed_form() -> None:
    N, rest, time = 2e-4, 30.0, 600.0
    cut = choose_window(rest, time, 100.0)
    assert cut is not None
    heading = WindowCovariance(cut, 0).of(NoiseModel(N=N))
    assert math.sqrt(heading[0]) == pytest.approx(N * math.sqrt(time + time**2 / rest), rel=1e-9)
    # Windows that do not overlap are independent of each other.
    assert np.abs(heading[cut.blocks :]).max() < 1e-12 * heading[0]
    position = WindowCovariance(cut, 1).of(NoiseModel(N=N))
    exact = N * math.sqrt(time**3 / 3.0 + time**4 / 4.0 / rest)
    assert math.sqrt(position[0]) == pytest.approx(exact, rel=1e-3)


MODELS = {
    "F": NoiseModel(B=1e-4),
    "GM": NoiseModel(B=1e-4, T_B=20.0),
    "slow GM": NoiseModel(B=1e-4, T_B=1e5),
    "K": NoiseModel(K=1e-5),
    "R": NoiseModel(R=-1e-6),
    "line": NoiseModel(sinusoids=[Sinusoid(1e-3, 0.03)]),
    "all": NoiseModel(Q=1e-6, N=1e-4, B=1e-4, K=1e-5, further=[GaussMarkov(1e-4, 5.0)]),
}


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("name", MODELS)
def test_the_mean_square_is_that_of_the_error_budget(name: str, order: int) -> None:
    model = MODELS[name]
    for rest, time in ((30.0, 600.0), (5.0, 10.0), (60.0, 10.0)):
        cut = choose_window(rest, time, 100.0)
        assert cut is not None
        spread = WindowCovariance(cut, order).spread(model, _one(cut))
        parts = of_sensor("", model, order, time, Calibrated(rest))
        budget = math.hypot(*(part.sigma for part in parts))
        # Weights are level over a block, of which there are 8 or more: 0.5 % at most.
        assert math.sqrt(spread.mean) == pytest.approx(budget, rel=1e-6 if order == 0 else 6e-3)


def _one(cut: Window) -> Errors:
    return Errors(1.0, 1, np.eye(1, 4 * cut.blocks)[0])


def test_the_covariance_of_blocks_is_that_of_their_means() -> None:
    """Double integrals by the midpoint rule, of the covariance functions themselves."""
    block, fine = 3.0, 600
    places = (np.arange(fine) + 0.5) / fine * block
    process, walk = GaussMarkov(2.0, 7.0), RandomWalk(0.5)
    v = process.density * process.T_B / 2.0
    for lag in (0, 1, 4):
        apart = np.abs(places[:, None] - places[None, :] - lag * block)
        found = process.block_covariance(np.array([float(lag)]), block)[0]
        assert found == pytest.approx(v * np.exp(-apart / 7.0).mean(), rel=1e-5)
        found = walk.block_covariance(np.array([float(lag)]), block)[0]
        assert found == pytest.approx(-(0.5**2) / 2.0 * apart.mean(), rel=1e-5)


@pytest.mark.release
def test_the_scatter_of_the_mean_square_is_what_simulated_logs_show() -> None:
    rng, logs, blocks = np.random.default_rng(4), 400, 600
    cut = Window(block=5.0, resting=8, moving=16)
    covariance = WindowCovariance(cut, 0)
    white = rng.standard_normal((logs, blocks)) / math.sqrt(cut.block)
    phase = rng.uniform(0.0, 2.0 * math.pi, (logs, 1))
    turn = 2.0 * math.pi * 0.01 * cut.block
    wave = np.sinc(0.01 * cut.block) * np.sin(turn * np.arange(blocks) + phase)
    # A walk in 20 steps a block.
    steps = rng.standard_normal((logs, blocks, 20)) * math.sqrt(cut.block / 20.0)
    walk = np.cumsum(steps.reshape(logs, -1), axis=1).reshape(steps.shape).mean(axis=2)
    for model, made in (
        (NoiseModel(N=1.0, K=0.05), white + 0.05 * walk),
        (NoiseModel(N=1.0, sinusoids=[Sinusoid(0.5, 0.01)]), white + 0.5 * wave),
    ):
        found = [
            compute_window_errors([means], covariance.weights, covariance.lags) for means in made
        ]
        spread = covariance.spread(model, found[0])
        squares = np.array([one.mean_square for one in found])
        # Standard errors of mean and standard deviation of 400: about 1.5 and 5 %.
        assert squares.mean() == pytest.approx(spread.mean, rel=0.05)
        assert squares.std() == pytest.approx(math.sqrt(spread.variance), rel=0.15)
        assert 5.0 < spread.degrees < found[0].count
