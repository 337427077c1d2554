"""The steady state of a Kalman filter, by doubling."""

from __future__ import annotations

import numpy as np

from imubench_pipeline.typing import Array

_MOST_DOUBLINGS = 80
_CONVERGED = 1e-13
"""Relative change of the covariance in a doubling that ends the search."""


def steady_covariance(transition: Array, process_noise: Array, information: Array) -> Array:
    """Return the steady covariance of the prediction of a Kalman filter.

    The solution of the discrete algebraic Riccati equation

        P = Phi P (I + G P)^-1 Phi^T + Q,    G = H^T R^-1 H,

    by the structure-preserving doubling algorithm: k doublings are 2^k steps of the filter from
    a known state. It takes the information G of one sample, not H and R, so that measurements of
    which a combination says nothing (G singular) need no choice of differences; and it does not
    suffer from eigenvalues near 1, of which slow Gauss-Markov processes have many.

    Parameters
    ----------
    transition, process_noise, information : ndarray, shape (m, m)
        Phi, Q_d and G. Processes that are not seen must be stable.

    Returns
    -------
    ndarray, shape (m, m)
        P, before the measurement of a sample.

    Raises
    ------
    ValueError
        If it does not converge.

    References
    ----------
    B. D. O. Anderson, "Second-order convergent algorithms for the steady-state Riccati
    equation", International Journal of Control 28(2), 1978; E. K.-W. Chu et al., "A
    structure-preserving doubling algorithm for periodic discrete-time algebraic Riccati
    equations", International Journal of Control 77(8), 2004.
    """
    scale = np.sqrt(np.max(np.diag(process_noise), initial=0.0)) or 1.0
    a = transition
    g = information * scale**2
    p = process_noise / scale**2
    one = np.eye(len(transition))
    for _ in range(_MOST_DOUBLINGS):
        inner = np.linalg.solve((one + p @ g).T, np.column_stack((a.T, g))).T
        # a (I + P G)^-1 and g (I + P G)^-1
        through, seen = inner[: len(a)], inner[len(a) :]
        grown = p + through @ p @ a.T
        g = g + a.T @ seen @ a
        a = through @ a
        grown, g = (grown + grown.T) / 2.0, (g + g.T) / 2.0
        change = np.max(np.abs(grown - p), initial=0.0) / np.max(np.abs(grown), initial=1e-300)
        p = grown
        if change < _CONVERGED:
            return np.asarray(p * scale**2)
    raise ValueError("the filter has no steady state: a process that grows is not seen")
