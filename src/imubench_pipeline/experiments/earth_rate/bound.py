"""The least standard deviation of the Earth's rate that data allow, and blocks that lose none.

The bound is that of generalised least squares over the covariance of the block means (Cramér and
Rao; for Gaussian noise it is reached): with h what the blocks see of the rate, 1 what they see of
the fixed bias and C their covariance,

    information of the rate = h^T C^-1 h - (h^T C^-1 1)^2 / (1^T C^-1 1 + 1 / bias variance).

It uses nothing of the filter. White noise alone gives N / sqrt(T) / cos(latitude) for T seconds in
dwells, where the bias is known; all else only adds to it.

Block means are made independent in a time that grows with their number and not with its cube
(`whiten`). What `covariance.of_means` and a Cholesky root do for any blocks, the innovations of a
Kalman filter do for those whose noise has states: divided by their standard deviations they are
L^-1 y, L the root of the same covariance (R. E. Kalman 1960). The covariance is closed form against
states; they are checked against each other.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from imubench_pipeline.experiments.earth_rate.covariance import of_means
from imubench_pipeline.experiments.earth_rate.experiment import Blocks, Experiment
from imubench_pipeline.experiments.earth_rate.states import block_states
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_TOLERANCE = 1e-3
"""Relative loss of the standard deviation by longer blocks that is nothing."""

_TRIED = 4
"""Dwells on which a block length is tried."""

MOST_BLOCKS = 2048
"""Blocks whose covariance is still formed."""


def whiten(model: NoiseModel, blocks: Blocks, columns: Array) -> Array:
    """Return L^-1 columns, shape (b, c), L L^T the covariance of the block means of a noise model.

    The model has some noise in every sample.

    Raises
    ------
    ValueError
        If a mean has no noise, given those before it.
    """
    states = block_states(model, blocks, turn_on_bias=0.0)
    innovations = _innovations(
        np.stack([step.transition for step in states.steps]),
        np.stack([step.factor @ step.factor.T for step in states.steps]),
        states.which,
        states.initial @ states.initial.T,
        states.white**2,
        np.ascontiguousarray(columns),
    )
    if not np.isfinite(innovations).all():
        raise ValueError(f"the noise model {model.name} leaves a mean without noise")
    return innovations


@njit(cache=True, nogil=True)
def _innovations(
    transitions: Array,
    noises: Array,
    which: NDArray[np.int64],
    covariance: Array,
    white: Array,
    columns: Array,
) -> Array:
    """Return innovations over their deviations; the last row of a transition gives the mean."""
    # Plain loops: products of arrays take eight times as long to compile.
    m, width = covariance.shape[0], columns.shape[1]
    covariance = covariance.copy()
    filtered = np.zeros((m, width))
    through, predicted = np.zeros((m + 1, m)), np.zeros((m + 1, m + 1))
    states = np.zeros((m + 1, width))
    innovations = np.zeros(columns.shape)
    for k in range(len(which)):
        transition, noise = transitions[which[k]], noises[which[k]]
        for i in range(m + 1):
            for j in range(m):
                through[i, j] = 0.0
                for r in range(m):
                    through[i, j] += transition[i, r] * covariance[r, j]
            for j in range(m + 1):
                predicted[i, j] = noise[i, j]
                for r in range(m):
                    predicted[i, j] += through[i, r] * transition[j, r]
            for j in range(width):
                states[i, j] = 0.0
                for r in range(m):
                    states[i, j] += transition[i, r] * filtered[r, j]
        variance = predicted[m, m] + white[k]
        if not variance > 0.0:
            innovations[k, 0] = np.nan
            return innovations
        for j in range(width):
            missed = columns[k, j] - states[m, j]
            innovations[k, j] = missed / math.sqrt(variance)
            for i in range(m):
                filtered[i, j] = states[i, j] + predicted[i, m] / variance * missed
        for i in range(m):
            for j in range(m):
                covariance[i, j] = predicted[i, j] - predicted[i, m] * predicted[j, m] / variance
    return innovations


def cramer_rao(blocks: Blocks, model: NoiseModel, turn_on_bias: float = math.inf) -> Array:
    """Return the least standard deviation of the rate that the data up to each block allow.

    In rad/s, shape (b,); infinite where the rate cannot be told from the bias, whose own, rad/s, is
    by default not known. The model has some noise in every sample: N, or a process that has one.

    Raises
    ------
    ValueError
        If the turn-on bias is negative, or NaN.
    """
    return sigma_of(information(blocks, model, turn_on_bias))


def information(blocks: Blocks, model: NoiseModel, turn_on_bias: float = math.inf) -> Array:
    """Return the Fisher information of the rate in the data up to each block, (rad/s)^-2, (b,).

    The parameters, and what is raised, are those of `cramer_rao`.
    """
    # Leading blocks have the leading part of the root.
    root = cholesky(of_means(model, blocks), lower=True, overwrite_a=True)
    return _of_rate(solve_triangular(root, _seen(blocks), lower=True), turn_on_bias)


def information_by_states(blocks: Blocks, model: NoiseModel, turn_on_bias: float) -> Array:
    """Return what `information` does, of many blocks faster."""
    return _of_rate(whiten(model, blocks, _seen(blocks)), turn_on_bias)


def _seen(blocks: Blocks) -> Array:
    """Return what the means see of the rate, and of a fixed bias."""
    return np.column_stack([blocks.seen, np.ones(len(blocks))])


def _of_rate(white: Array, turn_on_bias: float) -> Array:
    if not turn_on_bias >= 0:
        raise ValueError(f"turn_on_bias is {turn_on_bias}, expected a number from 0, or infinity")
    rate = np.cumsum(white[:, 0] ** 2)
    if turn_on_bias == 0:
        return rate
    cross = np.cumsum(white[:, 0] * white[:, 1])
    bias = np.cumsum(white[:, 1] ** 2) + 1.0 / turn_on_bias**2
    left = rate - cross**2 / bias
    return np.asarray(np.where(left > 1e-9 * rate, left, 0.0))


def bound(blocks: Blocks, model: NoiseModel, turn_on_bias: float = math.inf) -> float:
    """Return what `cramer_rao` does at the end of a run, of many blocks faster, rad/s."""
    return float(sigma_of(information_by_states(blocks, model, turn_on_bias))[-1])


def block_length(experiment: Experiment, model: NoiseModel) -> int:
    """Return the longest block, in samples, whose means tell as much of the rate as the samples.

    Blocks are shortened, by halves, until a fourth of their length would lower the bound by less
    than 0.1 %; tried on the first four dwells, with 2,048 blocks at most, none longer than the
    longest dwell.
    """
    tried = Experiment(experiment.dwells[:_TRIED], experiment.rate, experiment.latitude)
    length = max(dwell.stop - dwell.start for dwell in experiment.dwells)
    if len({dwell.sense for dwell in tried.dwells}) < 2:
        return length  # nothing can be told of the rate, from samples either
    sigmas: dict[int, float] = {}

    def sigma(longest: int) -> float:
        if longest not in sigmas:
            sigmas[longest] = float(
                sigma_of(information_by_states(tried.blocks(longest), model, math.inf))[-1]
            )
        return sigmas[longest]

    while length > 4 and len(tried.blocks(length // 4)) <= MOST_BLOCKS:
        if sigma(length // 4) > (1.0 - _TOLERANCE) * sigma(length):
            break
        length //= 2
    return length


def sigma_of(fisher: Array) -> Array:
    """Return the standard deviations, rad/s, of information, 1/(rad/s)², both of shape (n,).

    They are infinite where there is none.
    """
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / np.sqrt(fisher))
