"""Exact state space of the means of blocks of samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from imubench_pipeline.noise.state_space import StateSpace, repeat_step


def of_block_means(space: StateSpace, size: int) -> StateSpace:
    """Return the state space of the means of adjacent blocks of ``size`` samples.

    The mean of a block is an additional state, which is output after the end of the block, when the
    states of the process already belong to the next block. (There is none if ``size`` is 1 or the
    space has no states.) It starts one block before the samples: its initial state precedes the
    first block.
    """
    m = len(space.output)
    if size == 1 or m == 0:
        return replace(space, measurement_noise=space.measurement_noise / size)
    # One sample: the output is added to the sum, and the state advances.
    step = np.zeros((m + 1, m + 1))
    step[:m, :m] = space.transition
    step[m, :m] = space.output / size
    step[m, m] = 1.0
    noise = np.zeros((m + 1, m + 1))
    noise[:m, :m] = space.process_noise
    transition, process_noise = repeat_step(step, noise, size)
    transition[:, m] = 0.0  # each sum starts from 0
    mean, variance = np.zeros(m + 1), np.zeros((m + 1, m + 1))
    mean[:m], variance[:m, :m] = space.initial_mean, space.initial_variance
    output = np.zeros(m + 1)
    output[m] = 1.0
    return StateSpace(
        transition, process_noise, output, space.measurement_noise / size, mean, variance
    )
