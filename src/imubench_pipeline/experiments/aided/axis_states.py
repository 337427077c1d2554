"""The states of a filter for the error of each axis, from discrete matrices of a noise model.

An axis has x_(k+1) = Phi x_k + w_k, z_k = H x_k + v_k at its sampling rate, as
`noise.NoiseModel.state_space` gives them, or a file that was exported. A filter that takes the
samples of a step together needs the sum of z T over a step, an angle or a velocity, and the states
after it. Both follow exactly from the matrices, by repeating

    [sum, x] -> [sum + T (H x + v), Phi x + w].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.state_space import StateSpace, repeat_step
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class AxisStates:
    """What a filter knows of the error of one axis, at the sampling rate.

    Attributes
    ----------
    space : StateSpace
        Its noise, and its bias at switch-on.
    scale : float
        Standard deviation of the relative error of its scale factor; 0: it has no state.
    """

    space: StateSpace
    scale: float = 0.0


def axis_states(
    model: NoiseModel,
    sampling: float,
    *,
    turn_on: float,
    shortest: float,
    longest: float,
    scale: float = 0.0,
) -> AxisStates:
    """Return the states of a noise model.

    Parameters
    ----------
    model : NoiseModel
    sampling : float
        Hz.
    turn_on : float
        Standard deviation of the bias at switch-on, rad/s or m/s^2.
    shortest, longest : float
        Tau between which flicker noise is followed by a bank of processes, s; below it is white.
    scale : float
        See `AxisStates`.
    """
    terms = model.realised(shortest, longest)
    spaces = [term.state_space(1.0 / sampling) for term in terms]
    whole = StateSpace.together([*spaces, StateSpace.without_states(0.0)])
    return AxisStates(with_turn_on(whole, turn_on), scale)


def with_turn_on(space: StateSpace, turn_on: float) -> StateSpace:
    """Return a space with a bias at switch-on of a standard deviation, in SI.

    A random walk begins with it; where there is none, it is a constant state of its own.
    """
    space = space.of_either_sign() if np.any(space.initial_mean) else space
    for i in range(len(space.output)):
        alone = np.zeros(len(space.output))
        alone[i] = 1.0
        if space.output[i] == 1.0 and np.array_equal(space.transition[i], alone):
            start = space.initial_variance.copy()
            start[i, i] += turn_on**2
            return replace(space, initial_variance=start)
    return StateSpace.together([space, StateSpace.scalar(1.0, 0.0, turn_on**2)])


@dataclass(frozen=True)
class Stacked:
    """The states of all six axes over steps of several samples, for the compiled filter.

    m states in all, gyros x, y, z before accelerometers; n steps from a fix of GNSS to the next.

    Attributes
    ----------
    first : ndarray, shape (7,)
        First state of each axis, and m.
    step, epoch : ndarray, shape (m, m)
        Transitions over a step and over n.
    noise : ndarray, shape (m, m)
        Covariance of what the states gain over n steps.
    seen : ndarray, shape (n, m)
        What the sum over step k of the axis of each state gains of a state at the beginning.
    mixed : ndarray, shape (n, m)
        Covariance of that sum with what the state has gained since, after the step.
    summed : ndarray, shape (n, 6)
        Variance that the sums gain from what is new since the beginning.
    now : ndarray, shape (m,)
        Of ``seen``, for the first step.
    start : ndarray, shape (m, m)
    mean : ndarray, shape (m,)
        Covariance and mean at switch-on.
    scale : ndarray, shape (6,)
        See `AxisStates`; such states come after the m.
    output : ndarray, shape (m,)
        What z gains of a state.
    """

    first: Array
    step: Array
    epoch: Array
    noise: Array
    seen: Array
    mixed: Array
    summed: Array
    now: Array
    start: Array
    mean: Array
    scale: Array
    output: Array

    @property
    def states(self) -> int:
        """How many the filter has, with position, velocity and attitude."""
        return 9 + int(self.first[-1]) + int(np.count_nonzero(self.scale))


def stack(axes: Sequence[AxisStates], sampling: float, width: int, steps: int) -> Stacked:
    """Return the states of six axes over ``steps`` steps of ``width`` samples, at a rate in Hz.

    What the sum over a step has in common with the states after it is a part of that.
    """
    T = 1.0 / sampling
    spaces = [axis.space for axis in axes]
    whole = StateSpace.together([*spaces, StateSpace.without_states(0.0)])
    first = np.cumsum([0, *(len(space.output) for space in spaces)])
    m = int(first[-1])
    step, noise_of_step, now = np.zeros((m, m)), np.zeros((m, m)), np.zeros(m)
    fresh_mixed, fresh_summed = np.zeros(m), np.zeros(6)
    for a, space in enumerate(spaces):
        own = slice(first[a], first[a + 1])
        size = len(space.output)
        once, gained = np.eye(size + 1), np.zeros((size + 1, size + 1))
        once[0, 1:], once[1:, 1:] = T * space.output, space.transition
        gained[0, 0], gained[1:, 1:] = T**2 * space.measurement_noise, space.process_noise
        over, noise = repeat_step(once, gained, width)
        step[own, own], now[own] = over[1:, 1:], over[0, 1:]
        noise_of_step[own, own] = noise[1:, 1:]
        fresh_mixed[own], fresh_summed[a] = noise[0, 1:], noise[0, 0]
    seen, mixed, summed = np.empty((steps, m)), np.empty((steps, m)), np.empty((steps, 6))
    transition, noise = np.eye(m), np.zeros((m, m))
    for k in range(steps):
        seen[k] = now @ transition
        of_now = now @ noise  # each axis is independent of the others
        for a in range(6):
            own = slice(first[a], first[a + 1])
            summed[k, a] = of_now[own] @ now[own] + fresh_summed[a]
        mixed[k] = of_now @ step.T + fresh_mixed
        transition, noise = step @ transition, step @ noise @ step.T + noise_of_step
    return Stacked(
        first=first.astype(np.int64),
        step=step,
        epoch=transition,
        noise=noise,
        seen=seen,
        mixed=mixed,
        summed=summed,
        now=now,
        start=whole.initial_variance,
        mean=whole.initial_mean,
        scale=np.array([axis.scale for axis in axes]),
        output=whole.output,
    )


def steps_of(samples: int, widest: int) -> tuple[int, int]:
    """Return the samples of a step and the steps between two fixes that are some samples apart.

    A step has ``widest`` samples at most, from 1.
    """
    width = next(width for width in range(min(widest, samples), 0, -1) if samples % width == 0)
    return width, samples // width
