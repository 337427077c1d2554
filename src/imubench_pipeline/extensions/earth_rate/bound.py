"""The Cramér-Rao bound of the Earth's rate, and a block length that loses no information.

It is the variance of generalised least squares over the covariance C of the block means. With h the
sensitivity of the block means to the rate, and 1 to the fixed bias,

    information of the rate = h^T C^-1 h - (h^T C^-1 1)^2 / (1^T C^-1 1 + 1 / bias variance).

`whiten` decorrelates block means: the innovations of a Kalman filter over their standard deviations
are L^-1 y, with L the Cholesky root of the covariance (R. E. Kalman 1960).
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.extensions.calibration.experiment import Blocks, Experiment
from imubench_pipeline.extensions.calibration.least_squares import halve_block_length
from imubench_pipeline.extensions.calibration.states import discretise_blocks
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_TESTED_DWELLS = 4  # dwells on which a block length is tested
MAX_BLOCKS = 2048  # largest number of blocks in the test of a block length, and in a prediction


def whiten(model: NoiseModel, blocks: Blocks, columns: Array) -> Array:
    """Decorrelate ``columns`` of block means, shape (b, c): return L^-1 columns, same shape.

    L L^T is the covariance of the block means by the model. Raises ValueError if a mean follows
    exactly from the means before it: the model needs noise in every sample.
    """
    states = discretise_blocks(model, blocks, turn_on_bias=0.0)
    innovations = _compute_innovations(
        np.stack([step.transition for step in states.steps]),
        np.stack([step.factor @ step.factor.T for step in states.steps]),
        states.which,
        states.initial @ states.initial.T,
        states.white**2,
        np.ascontiguousarray(columns),
    )
    if not np.isfinite(innovations).all():
        raise ValueError(f"the noise model {model.name} leaves a mean without noise; add N to it")
    return innovations


@njit(cache=True, nogil=True)
def _compute_innovations(
    transitions: Array,
    noises: Array,
    which: NDArray[np.int64],
    covariance: Array,
    white: Array,
    columns: Array,
) -> Array:
    """Return innovations over their sigmas; the last row of a transition gives the mean."""
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
            innovation = columns[k, j] - states[m, j]
            innovations[k, j] = innovation / math.sqrt(variance)
            for i in range(m):
                filtered[i, j] = states[i, j] + predicted[i, m] / variance * innovation
        for i in range(m):
            for j in range(m):
                covariance[i, j] = predicted[i, j] - predicted[i, m] * predicted[j, m] / variance
    return innovations


def compute_cramer_rao_bounds(
    blocks: Blocks, model: NoiseModel, turn_on_bias: float = math.inf
) -> Array:
    """Return the least standard deviation of the rate that the data up to each block allow.

    In rad/s, shape (b,); infinite where the rate and the bias are not separable. ``turn_on_bias``
    is the standard deviation of the fixed bias, rad/s; infinity: unknown. The model must have noise
    in every sample. Raises ValueError if the turn-on bias is negative, or NaN.
    """
    return convert_to_sigma(compute_information(blocks, model, turn_on_bias))


def compute_information(blocks: Blocks, model: NoiseModel, turn_on_bias: float = math.inf) -> Array:
    """Return the Fisher information of the rate, (rad/s)^-2, up to each block, shape (b,)."""
    if not turn_on_bias >= 0:
        raise ValueError(f"turn_on_bias is {turn_on_bias}, expected 0 or more, or infinity")
    white = whiten(model, blocks, np.column_stack([blocks.seen, np.ones(len(blocks))]))
    rate = np.cumsum(white[:, 0] ** 2)
    if turn_on_bias == 0:
        return rate
    cross = np.cumsum(white[:, 0] * white[:, 1])
    bias = np.cumsum(white[:, 1] ** 2) + 1.0 / turn_on_bias**2
    left = rate - cross**2 / bias
    return np.asarray(np.where(left > 1e-9 * rate, left, 0.0))


def compute_final_bound(blocks: Blocks, model: NoiseModel, turn_on_bias: float = math.inf) -> float:
    """Return the Cramér-Rao bound of the rate at the end of a run, rad/s."""
    return float(compute_cramer_rao_bounds(blocks, model, turn_on_bias)[-1])


def choose_block_length(experiment: Experiment, model: NoiseModel) -> int:
    """Return the longest block, in samples, whose means keep the information of the samples.

    It is tested on the bound in the first four dwells (see `halve_block_length`), with 2,048 blocks
    at most, none longer than the longest dwell.
    """
    tried = Experiment(experiment.dwells[:_TESTED_DWELLS], experiment.rate, experiment.latitude)
    length = max(dwell.stop - dwell.start for dwell in experiment.dwells)
    if len({dwell.sense for dwell in tried.dwells}) < 2:
        return length  # the rate is not observable, from samples either
    return halve_block_length(
        length, tried, lambda blocks: compute_final_bound(blocks, model), MAX_BLOCKS
    )


def convert_to_sigma(fisher: Array) -> Array:
    """Return standard deviations, rad/s, from information, (rad/s)^-2, shape (n,); inf for 0."""
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / np.sqrt(fisher))
