"""The states of a filter for the error of each axis, from discrete matrices of a noise model.

An axis has x_(k+1) = Phi x_k + w_k, z_k = H x_k + v_k at its sampling rate, with the matrices of
`noise.NoiseModel.state_space` or of an exported file. A filter that combines the samples of a step
needs the sum of z T over the step (an angle or a velocity increment) and the states after it. Both
follow exactly from the matrices, by repeating

    [sum, x] -> [sum + T (H x + v), Phi x + w].
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.state_space import StateSpace, repeat_step
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class AxisStates:
    """Error model of one axis in a filter, at the sampling rate."""

    space: StateSpace  # noise and turn-on bias
    scale: float = 0.0  # SD of the relative scale-factor error; 0 if it is not a state


def make_axis_states(
    model: NoiseModel,
    sampling: float,
    *,
    turn_on: float,
    shortest: float,
    longest: float,
    scale: float = 0.0,
) -> AxisStates:
    """Return the states of a noise model at a sampling rate, Hz.

    ``turn_on`` and ``scale`` are standard deviations of turn-on bias, SI, and relative scale-factor
    error. Processes represent flicker noise from the tau ``shortest`` to ``longest``, s.
    """
    spaces = [term.state_space(1.0 / sampling) for term in model.realised(shortest, longest)]
    return AxisStates(add_turn_on_bias(StateSpace.together(spaces), turn_on), scale)


def add_turn_on_bias(space: StateSpace, turn_on: float) -> StateSpace:
    """Add a turn-on bias, standard deviation in SI, to the random walk, or as a new state."""
    space = space.of_either_sign() if np.any(space.initial_mean) else space
    for i in range(len(space.output)):
        alone = np.zeros(len(space.output))
        alone[i] = 1.0
        if space.output[i] == 1.0 and np.array_equal(space.transition[i], alone):
            start = space.initial_variance.copy()
            start[i, i] += turn_on**2
            return replace(space, initial_variance=start)
    return StateSpace.together([space, StateSpace.scalar(1.0, 0.0, turn_on**2)])


class StackedStates(NamedTuple):
    """The m states of all six axes over n steps between two fixes, for the compiled filter."""

    first: Array  # (7,); index of the first state of each axis, and m
    step: Array  # (m, m); transition matrix over one step
    epoch: Array  # (m, m); transition matrix over n steps
    noise: Array  # (m, m); process noise covariance over n steps
    sum_observation: Array  # (n, m); sensitivity of the sum to the state at the last fix
    sum_state_covariance: Array  # (n, m); of the sum with the state after step k, since the fix
    sum_variance: Array  # (n, 6); of the sum, from the noise since the last fix
    first_observation: Array  # (m,); `sum_observation` of the first step
    start: Array  # (m, m); covariance at switch-on
    mean: Array  # (m,); at switch-on
    scale: Array  # (6,); as in `AxisStates`; the states of scale factors come after the m
    output: Array  # (m,); output matrix H: sensitivity of z to each state

    @property
    def states(self) -> int:
        """Number of states of the filter, including position, velocity and attitude."""
        return 9 + int(self.first[-1]) + int(np.count_nonzero(self.scale))


def stack_axes(
    axes: Sequence[AxisStates], sampling: float, width: int, steps: int
) -> StackedStates:
    """Stack six axes over ``steps`` steps of ``width`` samples between fixes, at a rate in Hz."""
    T = 1.0 / sampling
    spaces = [axis.space for axis in axes]
    whole = StateSpace.together(spaces)
    first = np.cumsum([0, *(len(space.output) for space in spaces)])
    m = int(first[-1])
    step, noise_of_step, first_observation = np.zeros((m, m)), np.zeros((m, m)), np.zeros(m)
    step_state_covariance, step_variance = np.zeros(m), np.zeros(6)
    for a, space in enumerate(spaces):
        own = slice(first[a], first[a + 1])
        size = len(space.output)
        once, gained = np.eye(size + 1), np.zeros((size + 1, size + 1))
        once[0, 1:], once[1:, 1:] = T * space.output, space.transition
        gained[0, 0], gained[1:, 1:] = T**2 * space.measurement_noise, space.process_noise
        over, noise = repeat_step(once, gained, width)
        step[own, own], first_observation[own] = over[1:, 1:], over[0, 1:]
        noise_of_step[own, own] = noise[1:, 1:]
        step_state_covariance[own], step_variance[a] = noise[0, 1:], noise[0, 0]
    sum_observation, sum_state_covariance = np.empty((2, steps, m))
    sum_variance = np.empty((steps, 6))
    transition, noise = np.eye(m), np.zeros((m, m))
    for k in range(steps):
        sum_observation[k] = first_observation @ transition
        noise_observation = first_observation @ noise  # each axis is independent of the others
        for a in range(6):
            own = slice(first[a], first[a + 1])
            sum_variance[k, a] = noise_observation[own] @ first_observation[own] + step_variance[a]
        sum_state_covariance[k] = noise_observation @ step.T + step_state_covariance
        transition, noise = step @ transition, step @ noise @ step.T + noise_of_step
    return StackedStates(
        first=first.astype(np.int64),
        step=step,
        epoch=transition,
        noise=noise,
        sum_observation=sum_observation,
        sum_state_covariance=sum_state_covariance,
        sum_variance=sum_variance,
        first_observation=first_observation,
        start=whole.initial_variance,
        mean=whole.initial_mean,
        scale=np.array([axis.scale for axis in axes]),
        output=whole.output,
    )
