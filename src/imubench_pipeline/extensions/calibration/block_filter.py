"""A square-root Kalman filter for constants observed with the errors of one or several axes.

The state contains the unknown constants c (the Earth's rate, small angles of attitude), the states
of the error of each axis, and the mean of this error over the last block:

    x = [c, states of axis 1, 2 ..., means of axis 1, 2 ...],    y_i = seen_i c + mean_i + v_i.

The mean is a state, so that its correlation with the process noise of the block is exact
(`states`). Covariances do not depend on the data: they are computed once, as triangular roots that
are updated by QR (P. Park and T. Kailath, IEEE Trans. Autom. Control 40(5), 1995). From an
uninformative start a root keeps its precision, while a covariance would lose it.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from imubench_pipeline.extensions.calibration.states import BlockStates
from imubench_pipeline.typing import Array


class BlockFilter:
    """The filter of one design; it filters any number of runs at once.

    The a axes are over the same b blocks; ``seen``, shape (b, a, p), is the sensitivity of the mean
    of each axis over each block to the p constants; ``start``, shape (p, p), a root of their prior
    covariance about 0. ``roots``, shape (b, n, n), ``gains``, shape (b, n, a), and
    ``innovation_roots``, shape (b, a, a), are the lower triangular roots of the covariances after
    each block, the Kalman gains, and the roots of the covariances of the innovations.
    """

    def __init__(self, axes: Sequence[BlockStates], seen: Array, start: Array) -> None:
        b, a, p = seen.shape
        sizes = [len(axis.names) for axis in axes]
        self._which = axes[0].which
        edges = p + np.concatenate(([0], np.cumsum(sizes)))
        self._slices = [slice(int(first), int(last)) for first, last in pairwise(edges)]
        n = p + sum(sizes) + a
        self._matrices = [
            self._build_matrix(axes, kind, n, p) for kind in range(len(axes[0].steps))
        ]
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
        """Return the transition into a block, (n, n), and a root of its noise, (n, r)."""
        return self._matrices[self._which[block]]

    def run(self, means: Array) -> tuple[Array, Array]:
        """Filter runs of one design, from means of shape (runs, b, a).

        Returned are the states after each block, shape (runs, b, n), and the innovations
        (measurement less prediction), shape (runs, b, a).
        """
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

    def _build_matrix(
        self, axes: Sequence[BlockStates], kind: int, n: int, p: int
    ) -> tuple[Array, Array]:
        a = len(axes)
        transition, noise = np.zeros((n, n)), np.zeros((n, n - p))
        transition[:p, :p] = np.eye(p)
        for i, (axis, place) in enumerate(zip(axes, self._slices, strict=True)):
            step, mean = axis.steps[kind], n - a + i
            transition[place, place] = step.transition[:-1]
            transition[mean, place] = step.transition[-1]
            driven = np.r_[place.start - p : place.stop - p, mean - p]
            noise[place, driven] = step.factor[:-1]
            noise[mean, driven] = step.factor[-1]
        return transition, noise


def triangularise(root: Array) -> Array:
    """Return a lower triangular root, shape (n, n), of a covariance with a root (n, r)."""
    return np.asarray(np.linalg.qr(root.T, mode="r")).T


def compute_deviation(roots: Array, state: int) -> Array:
    """Return the standard deviation of a state, shape (...), from roots of shape (..., n, n)."""
    return np.asarray(np.linalg.norm(roots[..., state, :], axis=-1))
