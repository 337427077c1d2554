"""The states of a gyro's error from block to block, discretised exactly.

The states belong to a sample. The mean of a block and the states at the sample after it are jointly
Gaussian, given the states before the block. They are discretised at the samples of the log, not as
a continuous process, so that the means agree with a simulated log.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.extensions.calibration.experiment import Blocks, longest_tau
from imubench_pipeline.noise import NoiseModel, Role
from imubench_pipeline.noise.state_space import (
    StateSpace,
    factor_covariance,
    of_block_means,
    repeat_step,
)
from imubench_pipeline.typing import Array

UNINFORMATIVE_SIGMA = 1.0  # of a prior, rad/s: 14,000 times the Earth's rate


@dataclass(frozen=True)
class Step:
    """Transition to the states after the next block, and to the mean of that block."""

    transition: Array  # shape (m + 1, m); the last row gives the mean of the block
    factor: Array  # shape (m + 1, m + 1); a root of the covariance of the noise


@dataclass(frozen=True)
class BlockStates:
    """The states over the blocks of an experiment."""

    # shape (m, m); a root of the covariance of the states at the first sample; the last state is
    # the random walk with the fixed bias
    initial: Array
    steps: tuple[Step, ...]  # without repetitions
    which: NDArray[np.int64]  # shape (b,); index into ``steps`` for each block
    white: Array  # shape (b,); standard deviation of the white noise of each mean, rad/s


def discretise_blocks(
    model: NoiseModel, blocks: Blocks, turn_on_bias: float = UNINFORMATIVE_SIGMA
) -> BlockStates:
    """Return the states of a noise model, discretised exactly over blocks.

    Gauss-Markov processes start in their stationary distribution; a ramp has a slope of variance
    R^2, of either sign; a line's phase is not known; z_K starts with the standard deviation of the
    fixed bias, rad/s. Raises ValueError if the turn-on bias is negative or not finite.
    """
    if not (math.isfinite(turn_on_bias) and turn_on_bias >= 0):
        raise ValueError(f"turn_on_bias is {turn_on_bias}, expected a finite number, 0 or more")
    interval = 1.0 / blocks.rate
    spaces: list[StateSpace] = []
    white = drive = 0.0
    for term in model.realised(interval, longest_tau(blocks)):
        space = term.state_space(interval).of_either_sign()
        if term.role is Role.RANDOM_WALK:
            drive += float(space.process_noise[0, 0])
            continue
        white += space.measurement_noise
        spaces.append(space)
    spaces.append(StateSpace.scalar(1.0, drive, turn_on_bias**2))
    whole = StateSpace.together(spaces)
    gaps = np.diff(blocks.start, prepend=blocks.start[0])
    gaps[1:] -= (blocks.stop - blocks.start)[:-1]
    kinds, which = np.unique(
        np.stack([gaps, blocks.stop - blocks.start]), axis=1, return_inverse=True
    )
    return BlockStates(
        factor_covariance(whole.initial_variance),
        tuple(_build_step(whole, int(gap), int(size)) for gap, size in kinds.T),
        which.ravel(),
        np.sqrt(white / blocks.count),
    )


def _build_step(space: StateSpace, gap: int, size: int) -> Step:
    m = len(space.output)
    transition, noise = np.zeros((m + 1, m)), np.zeros((m + 1, m + 1))
    if size == 1:
        transition[:m], transition[m] = space.transition, space.output
        noise[:m, :m] = space.process_noise
    else:
        means = of_block_means(space, size)
        transition[:], noise[:] = means.transition[:, :m], means.process_noise
    over, added = repeat_step(space.transition, space.process_noise, gap)
    # A root of the covariance, which may be singular, scaled by its standard deviations.
    covariance = noise + transition @ added @ transition.T
    scale = np.sqrt(np.diag(covariance))
    unit = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    factor = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return Step(transition @ over, factor)


class BlockFilter:
    """A Kalman filter of the block means of several axes, for any number of runs at once.

    ``seen``, shape (b, a, p), is the sensitivity of the block means (b blocks, a axes) to p
    constants. ``start``, shape (p, p), is a root of the prior covariance of the constants.
    The roots of the covariances have the shapes (b, n, n) for states and (b, a, a) for innovations;
    the gains have the shape (b, n, a).
    """

    def __init__(self, axes: Sequence[BlockStates], seen: Array, start: Array) -> None:
        b, a, p = seen.shape
        sizes = [len(axis.initial) for axis in axes]
        self._which = axes[0].which
        edges = p + np.concatenate(([0], np.cumsum(sizes)))
        self._slices = [slice(int(first), int(last)) for first, last in pairwise(edges)]
        n = p + sum(sizes) + a
        self._matrices = []
        for kind in range(len(axes[0].steps)):
            transition, noise = np.zeros((n, n)), np.zeros((n, n - p))
            transition[:p, :p] = np.eye(p)
            for i, (axis, place) in enumerate(zip(axes, self._slices, strict=True)):
                step, mean = axis.steps[kind], n - a + i
                transition[place, place] = step.transition[:-1]
                transition[mean, place] = step.transition[-1]
                driven = np.r_[place.start - p : place.stop - p, mean - p]
                noise[place, driven] = step.factor[:-1]
                noise[mean, driven] = step.factor[-1]
            self._matrices.append((transition, noise))
        self._seen = np.zeros((b, a, n))
        self._seen[:, :, :p] = seen
        self._seen[:, np.arange(a), n - a + np.arange(a)] = 1.0
        root = np.zeros((n, n))
        root[:p, :p] = start
        for axis, place in zip(axes, self._slices, strict=True):
            root[place, place] = axis.initial
        self.roots = np.empty((b, n, n))
        self.gains = np.empty((b, n, a))
        self.innovation_roots = np.empty((b, a, a))
        for k in range(b):
            transition, noise = self.matrices(k)
            predicted = np.concatenate([transition @ root, noise], axis=1)
            before = np.zeros((n + a, predicted.shape[1] + a))
            before[:a, :a] = np.diag([axis.white[k] for axis in axes])
            before[:a, a:] = self._seen[k] @ predicted
            before[a:, a:] = predicted
            after = triangularise(before)
            self.innovation_roots[k] = after[:a, :a]
            self.gains[k] = np.linalg.solve(after[:a, :a].T, after[a:, :a].T).T
            root = self.roots[k] = after[a:, a:]

    def matrices(self, block: int) -> tuple[Array, Array]:
        """Return the transition into a block, (n, n), and a root of the noise covariance (n, r)."""
        return self._matrices[self._which[block]]

    def run(self, means: Array) -> tuple[Array, Array]:
        """Return states, (runs, b, n), and innovations, (runs, b, a), of means (runs, b, a)."""
        b, _, n = self._seen.shape
        states = np.empty((len(means), b, n))
        innovations = np.empty_like(means)
        state = np.zeros((len(means), n))
        for k in range(b):
            state = state @ self.matrices(k)[0].T
            innovations[:, k] = means[:, k] - state @ self._seen[k].T
            state = state + innovations[:, k] @ self.gains[k].T
            states[:, k] = state
        return states, innovations


def triangularise(root: Array) -> Array:
    """Return a lower triangular root, shape (n, n), of a covariance with a root (n, r)."""
    return np.asarray(np.linalg.qr(root.T, mode="r")).T


def compute_deviation(roots: Array, state: int) -> Array:
    """Return the standard deviation of a state, shape (...), from roots of shape (..., n, n)."""
    return np.asarray(np.linalg.norm(roots[..., state, :], axis=-1))
