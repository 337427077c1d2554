"""How well sizes of courses are known, where the random walk beside them is hardly known.

A step is a difference of two long means, and its error is that of the slowest noise. A walk that is
hardly to be seen is often fitted as none: with the noise as fitted, the size would seem surer than
it is. So errors are averaged over the walks that the log allows.
"""

from __future__ import annotations

import numpy as np

from imubench_pipeline.estimators.deterministic.ordinates import Fit, Ordinates
from imubench_pipeline.typing import Array

_WALKS = np.concatenate(([0.0], np.geomspace(0.03, 100.0, 18)))
"""K that are tried, as deviation at the lowest frequency over that of the other noise."""

_ABOUT_FITTED = np.geomspace(0.6, 1.6, 9)
"""K that are tried, over that of the fit."""

_LEAST_REST = 1e-3
"""Part of the density that is left to other noise, at least."""

_LEAST_ALONE = 1e-9
"""Part of the variance of an amplitude that it has alone, at least."""


def covariance_of_sizes(ordinates: Ordinates, fit: Fit) -> Array:
    """Return the covariance of the amplitudes of a fit, over the walks that the log allows.

    All K are as likely beforehand; each counts by its restricted likelihood, in which the
    amplitudes are integrated over. The other noise is held.

    Returns
    -------
    ndarray, shape (p, p)
    """
    if not fit.regressors:
        return fit.covariance
    walk = 1.0 / (2.0 * np.pi * ordinates.frequency) ** 2
    fitted = fit.noise.parameter("K") ** 2 * walk
    rest = np.maximum(fit.density - fitted, _LEAST_REST * fit.density)
    lowest = int(np.argmin(ordinates.frequency))
    unit = walk * rest[lowest] / walk[lowest]
    about = np.sqrt(fitted[lowest] / rest[lowest]) * _ABOUT_FITTED
    walks = np.unique(np.concatenate((_WALKS, about)))
    likelihoods, sizes, covariances = [], [], []
    for K in walks:
        density = rest + K**2 * unit
        size, covariance, residual, _ = ordinates.solved(fit.regressors, density)
        integrated = 0.5 * _log_determinant(covariance)
        likelihoods.append(ordinates.log_likelihood(residual, density) + integrated)
        sizes.append(size)
        covariances.append(covariance)
    weight = np.exp(np.array(likelihoods) - max(likelihoods)) * np.gradient(walks)
    weight /= weight.sum()
    away = np.array(sizes) - weight @ np.array(sizes)
    within = np.einsum("w,wij->ij", weight, np.array(covariances))
    return np.asarray(within + np.einsum("w,wi,wj->ij", weight, away, away))


def _log_determinant(covariance: Array) -> float:
    """Return that of a covariance, which two amplitudes that are one do not make infinite."""
    variance = np.maximum(np.diag(covariance), 1e-300)
    correlation = covariance / np.sqrt(np.outer(variance, variance))
    ridge = _LEAST_ALONE * np.eye(len(variance))
    return float(np.sum(np.log(variance)) + np.linalg.slogdet(correlation + ridge)[1])
