"""The states of a gyro's error from block to block, discretised exactly.

The states belong to a sample. The mean of a block and the states at the sample after it are jointly
Gaussian, given the states before the block. They are discretised at the samples of the log, not as
a continuous process, so that the means agree with a simulated log.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

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

# Standard deviation of an uninformative prior, rad/s: 14,000 times the Earth's rate
UNINFORMATIVE_SIGMA = 1.0


@dataclass(frozen=True)
class Step:
    """Transition from the states after one block to the states after the next, and its mean."""

    transition: Array  # shape (m + 1, m); the last row gives the mean of the block
    # shape (m + 1, m + 1); a root of the noise, whose covariance is ``factor @ factor.T``
    factor: Array


@dataclass(frozen=True)
class BlockStates:
    """The states over the blocks of an experiment."""

    # one per state: ``z_G`` and a number for each Gauss-Markov process, including the members of a
    # flicker bank; ``z_Q``, ``z_R``, ``z_S`` in pairs for quantization, a ramp (level, slope) and
    # lines; ``z_K``, the last, is the random walk with the fixed bias
    names: tuple[str, ...]
    # shape (m, m); a root of the covariance of the states at the first sample of the first block
    initial: Array
    steps: tuple[Step, ...]  # without repetitions
    which: NDArray[np.int64]  # shape (b,); index into ``steps`` for each block
    white: Array  # shape (b,); standard deviation of the white noise of each mean, rad/s


def discretise_blocks(
    model: NoiseModel, blocks: Blocks, turn_on_bias: float = UNINFORMATIVE_SIGMA
) -> BlockStates:
    """Return the states of a noise model over blocks.

    Gauss-Markov processes start in their stationary distribution; flicker noise is its bank up to
    the duration of the blocks; a ramp has a slope of variance R^2, of either sign; a line's phase
    is not known; z_K starts with the standard deviation of the fixed bias, rad/s. Raises ValueError
    if the turn-on bias is negative or not finite.
    """
    if not (math.isfinite(turn_on_bias) and turn_on_bias >= 0):
        raise ValueError(f"turn_on_bias is {turn_on_bias}, expected a number from 0")
    interval = 1.0 / blocks.rate
    names: list[str] = []
    spaces: list[StateSpace] = []
    white = drive = 0.0
    for term in model.realised(interval, longest_tau(blocks)):
        space = term.state_space(interval).of_either_sign()
        if term.role is Role.RANDOM_WALK:
            drive += float(space.process_noise[0, 0])
            continue
        white += space.measurement_noise
        spaces.append(space)
        if len(term.states) == 1:  # a single state gets a number
            (name,) = term.states
            names.append(f"{name}{sum(other.startswith(name) for other in names) + 1}")
        else:
            names += term.states
    spaces.append(StateSpace.scalar(1.0, drive, turn_on_bias**2))
    names.append("z_K")
    whole = StateSpace.together(spaces)
    gaps = np.diff(blocks.start, prepend=blocks.start[0])
    gaps[1:] -= (blocks.stop - blocks.start)[:-1]
    kinds, which = np.unique(
        np.stack([gaps, blocks.stop - blocks.start]), axis=1, return_inverse=True
    )
    steps = tuple(_build_step(whole, int(gap), int(size)) for gap, size in kinds.T)
    return BlockStates(
        tuple(names),
        factor_covariance(whole.initial_variance),
        steps,
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
    return Step(transition @ over, _compute_root(noise + transition @ added @ transition.T))


def _compute_root(covariance: Array) -> Array:
    """Return a root of a covariance that may be singular, scaled by its standard deviations."""
    scale = np.sqrt(np.diag(covariance))
    unit = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))
