"""Block means made independent, in a time that grows with their number and not with its cube.

What `covariance.of_means` and a Cholesky root do for any blocks, the innovations of a Kalman filter
do for those whose noise has states: divided by their standard deviations they are L^-1 y, L the
root of the same covariance (R. E. Kalman 1960). The covariance is closed form against states; they
are checked against each other.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.experiments.earth_rate.experiment import Blocks
from imubench_pipeline.experiments.earth_rate.states import block_states
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array


def whitened(model: NoiseModel, blocks: Blocks, columns: Array) -> Array:
    """Return L^-1 columns, L L^T the covariance of the block means of a noise model.

    Parameters
    ----------
    model : NoiseModel
        With some noise in every sample.
    blocks : Blocks
    columns : ndarray, shape (b, c)

    Returns
    -------
    ndarray, shape (b, c)

    Raises
    ------
    ValueError
        If a mean has no noise, given those before it.
    """
    known = block_states(model, blocks, turn_on_bias=0.0)
    found = _innovations(
        np.stack([step.transition for step in known.steps]),
        np.stack([step.factor @ step.factor.T for step in known.steps]),
        known.which,
        known.initial @ known.initial.T,
        known.white**2,
        np.ascontiguousarray(columns),
    )
    if not np.isfinite(found).all():
        raise ValueError(f"the noise model {model.name} leaves a mean without noise")
    return found


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
    m = covariance.shape[0]
    held = np.zeros((m, columns.shape[1]))
    found = np.zeros_like(columns)
    for k in range(len(which)):
        transition = transitions[which[k]]
        predicted = transition @ covariance @ transition.T + noises[which[k]]
        states = transition @ held
        variance = predicted[m, m] + white[k]
        missed = columns[k] - states[m]
        if not variance > 0.0:
            found[k] = np.nan
            return found
        found[k] = missed / np.sqrt(variance)
        gain = predicted[:m, m] / variance
        covariance = predicted[:m, :m] - np.outer(gain, gain) * variance
        held = states[:m] + np.outer(gain, missed)
    return found
