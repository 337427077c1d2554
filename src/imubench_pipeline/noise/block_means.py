"""The state space of the means of blocks of samples, exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from imubench_pipeline.noise.state_space import StateSpace, repeat_step


def of_block_means(space: StateSpace, size: int) -> StateSpace:
    """Return the state space of the means of adjacent blocks of samples.

    The mean of a block is a state of its own, which is put out after the block has ended: the
    states of the process are then already those of the next one.

    Parameters
    ----------
    space : StateSpace
        Of the samples, with m states.
    size : int
        Samples in a block.

    Returns
    -------
    StateSpace
        With m + 1 states; with m where ``size`` is 1 or m is 0. It starts a block earlier than
        the samples do: its initial state stands before the first block.
    """
    m = len(space.output)
    if size == 1 or m == 0:
        return replace(space, measurement_noise=space.measurement_noise / size)
    # One sample: the sum takes in the state, and the state goes on.
    step = np.zeros((m + 1, m + 1))
    step[:m, :m] = space.transition
    step[m, :m] = space.output / size
    step[m, m] = 1.0
    noise = np.zeros((m + 1, m + 1))
    noise[:m, :m] = space.process_noise
    transition, process_noise = repeat_step(step, noise, size)
    transition[:, m] = 0.0  # each sum begins anew
    mean, variance = np.zeros(m + 1), np.zeros((m + 1, m + 1))
    mean[:m], variance[:m, :m] = space.initial_mean, space.initial_variance
    output = np.zeros(m + 1)
    output[m] = 1.0
    return StateSpace(
        transition, process_noise, output, space.measurement_noise / size, mean, variance
    )
