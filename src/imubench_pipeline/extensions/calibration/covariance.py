"""The covariance of the means of blocks of a log, in closed form.

It is the covariance of the samples, as `noise.simulate` draws them, summed over the blocks. The
fixed bias and the Earth's rate are left out. It is independent of the filter, so that bounds and
standard errors computed with it check the filter.
"""

from __future__ import annotations

import numpy as np

from imubench_pipeline.extensions.calibration.experiment import Blocks
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array


def block_mean_covariance(model: NoiseModel, blocks: Blocks) -> Array:
    """Return the covariance of the means of b blocks, (rad/s)^2, shape (b, b).

    The random walk counts from the first sample of the first block; flicker noise is its bank of
    Gauss-Markov processes, up to the duration of the blocks.
    """
    total = np.zeros((len(blocks), len(blocks)))
    for term in model.realised(1.0 / blocks.rate, longest_tau(blocks)):
        total += term.mean_covariance(blocks)
    return total


def longest_tau(blocks: Blocks) -> float:
    """Return the longest tau of flicker noise, s: the duration, and at least 2 samples."""
    return max(blocks.duration, 2.0 / blocks.rate)
