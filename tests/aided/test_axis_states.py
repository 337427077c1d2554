"""The sums over steps of several samples, against closed forms of each term."""

from dataclasses import dataclass

import numpy as np
import pytest

from imubench_pipeline.extensions.aided.axis_states import make_axis_states, stack_axes
from imubench_pipeline.extensions.aided.runs import Drive
from imubench_pipeline.extensions.aided.trajectories import simulate_trajectory
from imubench_pipeline.noise import NoiseModel

RATE, WIDTH, STEPS = 50.0, 5, 10


@dataclass(frozen=True)
class Blocks:
    """Steps of a log, as the terms take them."""

    rate: float
    start: np.ndarray
    stop: np.ndarray

    @property
    def count(self) -> np.ndarray:
        return self.stop - self.start

    @property
    def middle(self) -> np.ndarray:
        return (self.start + self.stop - 1) / 2.0 / self.rate


def sums(model: NoiseModel, steps: int) -> np.ndarray:
    """Covariance of the sums over steps of a filter that sees none of them, from its matrices."""
    axis = make_axis_states(model, RATE, turn_on=0.0, shortest=1.0, longest=100.0)
    one = stack_axes([axis] * 6, RATE, WIDTH, steps)
    own = slice(one.first[2], one.first[3])
    powers = [np.linalg.matrix_power(one.step[own, own], k) for k in range(steps)]
    start, covariance = one.start[own, own], np.empty((steps, steps))
    for i in range(steps):
        covariance[i, i] = (
            one.sum_observation[i, own] @ start @ one.sum_observation[i, own]
            + one.sum_variance[i, 2]
        )
        # The state after step i and the sum of it: what later sums have in common with it.
        shared = (
            one.sum_state_covariance[i, own]
            + powers[1] @ powers[i] @ start @ one.sum_observation[i, own]
        )
        for j in range(i + 1, steps):
            covariance[i, j] = covariance[j, i] = (
                one.first_observation[own] @ powers[j - i - 1] @ shared
            )
    return covariance


@pytest.mark.parametrize(
    "model",
    [
        NoiseModel(N=2e-3),
        NoiseModel(B=3e-4, T_B=0.7),
        NoiseModel(K=5e-4),
        NoiseModel(Q=1e-4),
        NoiseModel(N=2e-3, B=3e-4, T_B=0.7, K=5e-4, Q=1e-4),
    ],
    ids=lambda model: model.name,
)
def test_sums_over_steps_have_the_covariance_of_the_terms(model: NoiseModel) -> None:
    edges = np.arange(STEPS + 1) * WIDTH
    blocks = Blocks(RATE, edges[:-1], edges[1:])
    true = sum(term.mean_covariance(blocks) for term in model.terms) * (WIDTH / RATE) ** 2
    np.testing.assert_allclose(sums(model, STEPS), true, rtol=1e-9, atol=1e-9 * true.max())


def test_the_bias_at_switch_on_is_the_start_of_a_walk_or_a_state() -> None:
    plain, walk = (
        make_axis_states(model, RATE, turn_on=0.1, shortest=1.0, longest=100.0).space
        for model in (NoiseModel(N=1e-3), NoiseModel(N=1e-3, K=1e-4))
    )
    for space in (plain, walk):
        assert space.transition.tolist() == [[1.0]]
        assert space.initial_variance[0, 0] == pytest.approx(0.01)
    assert plain.process_noise[0, 0] == 0.0
    assert walk.process_noise[0, 0] == pytest.approx(1e-8 / RATE)


@pytest.mark.parametrize(
    ("rate", "width", "steps"), [(100.0, 10, 10), (32.0, 4, 8), (7.0, 1, 7), (51.0, 3, 17)]
)
def test_steps_divide_the_time_between_fixes(rate: float, width: int, steps: int) -> None:
    drive = Drive(simulate_trajectory("rest", 2.0, rate), [])
    assert (drive.width, drive.steps) == (width, steps)
