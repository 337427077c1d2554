"""The sums over adjacent blocks of a process of one state, drawn with the states between them."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from imubench_pipeline.noise.state_space import StateSpace
from imubench_pipeline.typing import Array


def of_scalar(
    space: StateSpace, start: Array, blocks: int, width: int, rng: np.random.Generator
) -> Array:
    """Draw the sums over blocks of samples, exactly.

    The sum over a block and the state after it are jointly Gaussian, given the state before.

    Parameters
    ----------
    space : StateSpace
        Of one state, seen as it is, without measurement noise.
    start : ndarray, shape (1,)
        The first state.
    blocks : int
    width : int
        Samples a block.
    rng : numpy.random.Generator

    Returns
    -------
    ndarray, shape (blocks,)
    """
    p, drive = float(space.transition[0, 0]), float(space.process_noise[0, 0])
    # The sample i of a block is p^i x + sum_{j<i} p^(i-1-j) w_j.
    powers = p ** np.arange(width + 1)
    reach = np.concatenate(([0.0], np.cumsum(powers)))
    in_sum = reach[width - 1 - np.arange(width)]
    in_state = powers[width - 1 - np.arange(width)]
    moments = drive * np.array(
        [[in_state @ in_state, in_state @ in_sum], [in_state @ in_sum, in_sum @ in_sum]]
    )
    to_state = math.sqrt(moments[0, 0])
    shared = moments[0, 1] / to_state
    own = math.sqrt(max(moments[1, 1] - shared**2, 0.0))
    normal = rng.standard_normal((2, blocks))
    sums = np.empty(blocks)
    _add_up(
        sums,
        float(start[0]),
        powers[width],
        reach[width],
        normal[0],
        normal[1],
        to_state,
        shared,
        own,
    )
    return sums


@njit(cache=True, nogil=True)
def _add_up(
    sums: Array,
    state: float,
    decay: float,
    gain: float,
    first: Array,
    second: Array,
    to_state: float,
    shared: float,
    own: float,
) -> None:
    for i in range(sums.size):
        sums[i] = gain * state + shared * first[i] + own * second[i]
        state = decay * state + to_state * first[i]
