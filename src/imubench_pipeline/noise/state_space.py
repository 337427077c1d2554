"""The discrete state space of a noise process: what simulates it, and what a filter loads."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numba import njit

from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class StateSpace:
    """A discrete model x' = transition x + w, z = output x + v (000 eq. 18-23, exact).

    Attributes
    ----------
    transition : ndarray, shape (m, m)
        Phi.
    process_noise : ndarray, shape (m, m)
        Q_d, covariance of w.
    output : ndarray, shape (m,)
        H.
    measurement_noise : float
        R_d, variance of v.
    initial_mean : ndarray, shape (m,)
        Mean of the first x.
    initial_variance : ndarray, shape (m, m)
        Its covariance: the stationary one, 0 for a random walk.
    """

    transition: Array
    process_noise: Array
    output: Array
    measurement_noise: float
    initial_mean: Array
    initial_variance: Array

    @classmethod
    def scalar(cls, transition: float, process_noise: float, initial_variance: float) -> StateSpace:
        """Return a model of one state that is seen as it is."""
        return cls(
            np.array([[transition]]),
            np.array([[process_noise]]),
            np.ones(1),
            0.0,
            np.zeros(1),
            np.array([[initial_variance]]),
        )

    @classmethod
    def without_states(cls, measurement_noise: float) -> StateSpace:
        """Return a model of white noise alone."""
        none = np.zeros((0, 0))
        return cls(none, none, np.zeros(0), measurement_noise, np.zeros(0), none)

    @classmethod
    def together(cls, spaces: Sequence[StateSpace]) -> StateSpace:
        """Return the model of the sum of independent ones, their states in order."""
        return cls(
            _block_diagonal([space.transition for space in spaces]),
            _block_diagonal([space.process_noise for space in spaces]),
            np.concatenate([space.output for space in spaces]),
            sum(space.measurement_noise for space in spaces),
            np.concatenate([space.initial_mean for space in spaces]),
            _block_diagonal([space.initial_variance for space in spaces]),
        )

    def of_either_sign(self) -> StateSpace:
        """Return the model whose first state has no mean, and its square in the variance."""
        squares = np.diag([mean**2 for mean in self.initial_mean.tolist()])
        return replace(
            self,
            initial_mean=np.zeros_like(self.initial_mean),
            initial_variance=self.initial_variance + squares,
        )


@dataclass(frozen=True)
class ContinuousSpace:
    """A continuous model x' = F x + w, z = H x.

    Attributes
    ----------
    transition : ndarray, shape (m, m)
        F, 1/s.
    density : ndarray, shape (m, m)
        Q of w.
    output : ndarray, shape (m,)
        H.
    """

    transition: Array
    density: Array
    output: Array

    @classmethod
    def without_states(cls) -> ContinuousSpace:
        """Return a model of nothing but its measurement noise."""
        none = np.zeros((0, 0))
        return cls(none, none, np.zeros(0))


def _block_diagonal(parts: Sequence[Array]) -> Array:
    """Return square matrices along a diagonal; scipy's takes long."""
    ends = np.cumsum([len(part) for part in parts])
    whole = np.zeros((ends[-1], ends[-1]))
    for part, end in zip(parts, ends, strict=True):
        whole[end - len(part) : end, end - len(part) : end] = part
    return whole


def root_of(covariance: Array) -> Array:
    """Return the lower triangular root of a covariance, shape (m, m).

    What does not vary has a row of zeros.
    """
    if len(covariance) == 1:  # of most terms, and asked for by each log of an ensemble
        return np.sqrt(covariance)
    varying = np.flatnonzero(np.diag(covariance))
    root, own = np.zeros_like(covariance), np.ix_(varying, varying)
    root[own] = np.linalg.cholesky(covariance[own])
    return root


def repeat_step(transition: Array, noise: Array, times: int) -> tuple[Array, Array]:
    """Return what a step does when it is done several times, from 0, by powers of two.

    ``noise`` is the covariance that a step adds, both shape (m, m). Returned are Phi^times, and the
    sum of Phi^i noise (Phi^i)^T over i from 0 to times - 1.
    """
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
    """Draw the sums over blocks of samples, exactly, shape (blocks,).

    The sum over a block and the state after it are jointly Gaussian, given the state before. The
    space has one state, seen as it is, without measurement noise; ``start``, shape (1,), is the
    first; a block has ``width`` samples.
    """
    step = _over_block(float(space.transition[0, 0]), float(space.process_noise[0, 0]), width)
    normal = rng.standard_normal((2, blocks))
    sums = np.empty(blocks)
    _add_up(sums, float(start[0]), normal[0], normal[1], *step)
    return sums


@lru_cache(maxsize=64)  # an ensemble asks some hundred times for the same
def _over_block(p: float, drive: float, width: int) -> tuple[float, float, float, float, float]:
    """Return what a state does in a block.

    Decay and reach of the state before; the noise in the state after, that of the sum with it, and
    that of the sum alone.
    """
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
def _add_up(
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
