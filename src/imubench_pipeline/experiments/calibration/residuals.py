"""What the line leaves of each steady rate of a table, and how much of that is noise.

    r = A (m - X b),   cov(r) = A (C + D - X (X^T (C + D)^-1 X)^-1 X^T) A^T,

m the block means, X and b the regressors and estimates of the line by generalised least squares, A
the mean over the blocks of a steady rate, C the covariance of the noise model and D that of the
true rates about the stated ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.experiments.calibration.rate_table import Calibration
from imubench_pipeline.experiments.earth_rate.covariance import of_means
from imubench_pipeline.experiments.earth_rate.experiment import Measured
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class Residuals:
    """Steady rates and what the line leaves of them.

    Attributes
    ----------
    dwell : ndarray of int, shape (k,)
        Number of each among those of the schedule, from 0; one without samples is left out.
    mean : ndarray, shape (k,)
        Mean reading, rad/s.
    line : ndarray, shape (k,)
        What the line has there, rad/s.
    sigma : ndarray, shape (k,)
        Standard deviation of mean less line, rad/s.
    """

    dwell: NDArray[np.int64]
    mean: Array
    line: Array
    sigma: Array

    @property
    def value(self) -> Array:
        """Mean less line, rad/s, shape (k,)."""
        return self.mean - self.line


def residuals(
    found: Calibration,
    measured: Measured,
    rates: Array,
    model: NoiseModel,
    setting_sigma: float = 0.0,
) -> Residuals:
    """Return what the line leaves of each steady rate.

    Parameters
    ----------
    found : Calibration
        Of one run.
    measured : Measured
        Its block means.
    rates : ndarray, shape (b,)
        Rate that each block sensed, table and Earth, rad/s.
    model : NoiseModel
    setting_sigma : float
        Standard deviation of the table's true rate about the stated one, rad/s.
    """
    blocks = measured.blocks
    dwell, place = np.unique(blocks.dwell, return_inverse=True)
    mean_of = np.zeros((len(dwell), len(blocks)))
    mean_of[place, np.arange(len(blocks))] = blocks.count
    mean_of /= mean_of.sum(axis=1, keepdims=True)
    regressors = np.column_stack([np.ones(len(blocks)), rates])
    covariance = of_means(model, blocks)
    covariance = covariance + setting_sigma**2 * np.equal.outer(blocks.dwell, blocks.dwell)
    covariance -= regressors @ found.line.covariance @ regressors.T
    variance = np.einsum("ki,ij,kj->k", mean_of, covariance, mean_of)
    return Residuals(
        dwell.astype(np.int64),
        mean_of @ measured.means[0],
        mean_of @ (regressors @ found.line.value[0]),
        np.sqrt(np.maximum(variance, 0.0)),
    )
