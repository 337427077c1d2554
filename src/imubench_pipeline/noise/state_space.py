"""Discrete state space of a noise process, for simulations and filters."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numba import njit

from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class StateSpace:
    """A discrete model x' = transition x + w, z = output x + v (Maia et al., eq. 18-23, exact)."""

    transition: Array  # Phi, (m, m)
    process_noise: Array  # Q_d, covariance of w, (m, m)
    output: Array  # H, (m,)
    measurement_noise: float  # R_d, variance of v
    initial_mean: Array  # of the first x, (m,)
    initial_variance: Array  # (m, m): the stationary covariance, or 0 for a random walk

    @classmethod
    @lru_cache(maxsize=256)  # an ensemble repeats the same call some hundred times
    def scalar(
        cls, transition: float, process_noise: float, initial_variance: float
    ) -> "StateSpace":
        """Return a model of one state, which is the output."""
        return cls(
            np.array([[transition]]),
            np.array([[process_noise]]),
            np.ones(1),
            0.0,
            np.zeros(1),
            np.array([[initial_variance]]),
        )

    @classmethod
    def without_states(cls, measurement_noise: float) -> "StateSpace":
        """Return a model of white noise only."""
        none = np.zeros((0, 0))
        return cls(none, none, np.zeros(0), measurement_noise, np.zeros(0), none)

    @classmethod
    def together(cls, spaces: "Sequence[StateSpace]") -> "StateSpace":
        """Return the model of the sum of independent models, with their states in order."""
        spaces = [*spaces, cls.without_states(0.0)]  # there may be none
        return cls(
            _build_block_diagonal([space.transition for space in spaces]),
            _build_block_diagonal([space.process_noise for space in spaces]),
            np.concatenate([space.output for space in spaces]),
            sum(space.measurement_noise for space in spaces),
            np.concatenate([space.initial_mean for space in spaces]),
            _build_block_diagonal([space.initial_variance for space in spaces]),
        )

    def of_either_sign(self) -> "StateSpace":
        """Return the model with initial mean 0; its squared mean is added to the variance."""
        squares = np.diag([mean**2 for mean in self.initial_mean.tolist()])
        mean, variance = np.zeros_like(self.initial_mean), self.initial_variance + squares
        return replace(self, initial_mean=mean, initial_variance=variance)


@dataclass(frozen=True)
class ContinuousSpace:
    """A continuous model x' = F x + w, z = H x."""

    transition: Array  # F, 1/s, (m, m)
    density: Array  # Q of w, (m, m)
    output: Array  # H, (m,)


def _build_block_diagonal(parts: Sequence[Array]) -> Array:
    """Return a block-diagonal matrix of square matrices; faster than scipy's function."""
    ends = np.cumsum([len(part) for part in parts])
    whole = np.zeros((ends[-1], ends[-1]))
    for part, end in zip(parts, ends, strict=True):
        whole[end - len(part) : end, end - len(part) : end] = part
    return whole


def factor_covariance(covariance: Array) -> Array:
    """Return the Cholesky factor of a covariance, (m, m); zeros for states without variance."""
    if len(covariance) == 1:  # frequent: most terms, for each log of an ensemble
        return np.sqrt(covariance)
    varying = np.flatnonzero(np.diag(covariance))
    root, own = np.zeros_like(covariance), np.ix_(varying, varying)
    root[own] = np.linalg.cholesky(covariance[own])
    return root


def repeat_step(transition: Array, noise: Array, times: int) -> tuple[Array, Array]:
    """Return Phi^times, and the sum of Phi^i noise (Phi^i)^T for i < times; Phi: transition."""
    whole, added = np.eye(len(transition)), np.zeros_like(noise)
    while times:
        if times & 1:
            whole, added = transition @ whole, transition @ added @ transition.T + noise
        noise = transition @ noise @ transition.T + noise
        transition = transition @ transition
        times >>= 1
    return whole, added


def draw_block_sums(
    space: StateSpace, start: Array, blocks: int, width: int, rng: np.random.Generator
) -> Array:
    """Draw the sums over blocks of ``width`` samples, exactly, shape (blocks,).

    The space has one state, which is the output, and no measurement noise; ``start`` is the
    first state, shape (1,).
    """
    step = _propagate_block(float(space.transition[0, 0]), float(space.process_noise[0, 0]), width)
    normal = rng.standard_normal((2, blocks))
    sums = np.empty(blocks)
    _accumulate_sums(sums, float(start[0]), normal[0], normal[1], *step)
    return sums


@lru_cache(maxsize=64)  # an ensemble repeats the same call some hundred times
def _propagate_block(
    p: float, drive: float, width: int
) -> tuple[float, float, float, float, float]:
    """Return the coefficients of the state after a block and of its sum (`_accumulate_sums`)."""
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
    return powers[width], reach[width], to_state, shared, own


@njit(cache=True, nogil=True)
def _accumulate_sums(
    sums: Array,
    state: float,
    first: Array,
    second: Array,
    decay: float,
    gain: float,
    to_state: float,
    shared: float,
    own: float,
) -> None:
    for i in range(sums.size):
        sums[i] = gain * state + shared * first[i] + own * second[i]
        state = decay * state + to_state * first[i]


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
