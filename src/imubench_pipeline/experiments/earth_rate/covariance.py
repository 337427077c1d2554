"""The covariance of the means of blocks of a log, in closed form.

It is that of the samples, as `noise.simulate` draws them, summed over the blocks. The
fixed bias and the Earth's rate are left out. Nothing here knows a filter: bounds and standard
errors that come of it check the filter.
"""

from __future__ import annotations

import math

import numpy as np

from imubench_pipeline.experiments.earth_rate.experiment import Blocks
from imubench_pipeline.noise import (
    GaussMarkov,
    NoiseModel,
    Quantization,
    Ramp,
    RandomWalk,
    Sinusoid,
    Term,
    WhiteNoise,
)
from imubench_pipeline.typing import Array


def of_means(model: NoiseModel, blocks: Blocks) -> Array:
    """Return the covariance of block means.

    Parameters
    ----------
    model : NoiseModel
        Flicker noise is its bank of Gauss-Markov processes, followed up to the duration of the
        blocks.
    blocks : Blocks
        b of them.

    Returns
    -------
    ndarray, shape (b, b)
        (rad/s)^2. The random walk counts from the first sample of the first block.
    """
    total = np.zeros((len(blocks), len(blocks)))
    for term in model.realised(1.0 / blocks.rate, longest(blocks)):
        total += of_term(term, blocks)
    return total


def longest(blocks: Blocks) -> float:
    """Return the tau in s to which flicker noise is followed: the duration, 2 samples at least."""
    return max(blocks.duration, 2.0 / blocks.rate)


def of_term(term: Term, blocks: Blocks) -> Array:
    """Return the covariance of the block means of one term.

    With T the sampling interval, n the samples of a block and p = e^(-T/T_B), v = S_B T_B / 2:

    - N: N^2 / (T count) on the diagonal, count the samples present;
    - Q: a block's mean is (q_stop - q_start) / (n T): 2 Q^2 / (n T)^2 on the diagonal,
      -Q^2 / (n m T^2) for blocks without a gap between them;
    - Gauss-Markov: v s_n s_m p^lag, with s_n = (1 - p^n) / (n (1 - p)) and lag from the last
      sample of one to the first of the other; on the diagonal
      v (n (1 + p) / (1 - p) - 2 p (1 - p^n) / (1 - p)^2) / n^2;
    - K: K^2 times the mean time of the earlier block; on the diagonal
      K^2 T (start + (n - 1) (2 n - 1) / (6 n));
    - R: a slope of variance R^2, of either sign: R^2 times the product of the mean times. The
      slope of another log says how large one may be, and no more;
    - a line: A^2 / 2 times the gains sin(n w T/2) / (n sin(w T/2)) of both, times the cosine of
      their phase difference; the phase at the start is not known.

    Returns
    -------
    ndarray, shape (b, b)

    Raises
    ------
    TypeError
        If the kind of term is not known, or is flicker noise, which has no covariance.
    """
    interval = 1.0 / blocks.rate
    n = (blocks.stop - blocks.start).astype(np.float64)
    match term:
        case WhiteNoise(N):
            return np.diag(N**2 / (interval * blocks.count))
        case Quantization(Q):
            touching = np.zeros((len(n), len(n)))
            i = np.flatnonzero(blocks.start[1:] == blocks.stop[:-1])
            touching[i, i + 1] = touching[i + 1, i] = -1.0 / (n[i] * n[i + 1])
            return (Q / interval) ** 2 * (touching + np.diag(2.0 / n**2))
        case GaussMarkov():
            return _of_gauss_markov(term, blocks, n)
        case RandomWalk(K):
            first = (blocks.start - blocks.start[0]).astype(np.float64)
            means = first + (n - 1.0) / 2.0
            covariance = np.minimum.outer(means, means)
            np.fill_diagonal(covariance, first + (n - 1.0) * (2.0 * n - 1.0) / (6.0 * n))
            covariance *= K**2 * interval
            return np.asarray(covariance)
        case Ramp(R):
            return np.asarray(R**2 * np.outer(blocks.middle, blocks.middle))
        case Sinusoid(amplitude, frequency):
            half = math.pi * frequency * interval
            gain = np.sin(n * half) / (n * math.sin(half))
            turned = 2.0 * math.pi * frequency * blocks.middle
            turns = np.cos(np.subtract.outer(turned, turned))
            return np.asarray(0.5 * amplitude**2 * np.outer(gain, gain) * turns)
    raise TypeError(f"the covariance of {term} is not known")


def _of_gauss_markov(term: GaussMarkov, blocks: Blocks, n: Array) -> Array:
    x = 1.0 / (blocks.rate * term.T_B)
    lost = -math.expm1(-x)
    decayed = -np.expm1(-n * x)
    gain = decayed / (n * lost)
    variance = 0.5 * term.density * term.T_B
    covariance = np.empty((len(n), len(n)))
    for later in range(len(n)):  # row by row: there may be thousands, and one matrix is enough
        lag = blocks.start[later] - blocks.stop[:later] + 1
        covariance[later, :later] = variance * gain[later] * gain[:later] * np.exp(-x * lag)
        covariance[:later, later] = covariance[later, :later]
    p = math.exp(-x)
    own = (n * (1.0 + p) / lost - 2.0 * p * decayed / lost**2) / n**2
    np.fill_diagonal(covariance, variance * own)
    return covariance
