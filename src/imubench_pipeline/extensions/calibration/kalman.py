"""The Earth's rate as an unknown constant, by Kalman filter and smoother.

The filter of Silva et al. (eq. 15, 16) needs the rate as an input; see `known_rate`. Here the rate
w is a state in addition to the error of the gyro, observed with the sign of the dwell:

    x = [w, z_G ..., z_K],    mean of a block = s cos(latitude) w + mean of (z_G + ... + z_K) + v.

The filter is a `BlockFilter` with one constant and one axis, in square-root form (P. Park and
T. Kailath, IEEE Trans. Autom. Control 40(5), and Int. J. Control 62(5), 1995; H. E. Rauch, F. Tung
and C. T. Striebel, AIAA Journal 3(8), 1965; NEES and NIS: Y. Bar-Shalom, X. R. Li and
T. Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, section 5.4).
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from imubench_pipeline.extensions.calibration.experiment import Blocks
from imubench_pipeline.extensions.calibration.states import (
    UNINFORMATIVE_SIGMA,
    BlockFilter,
    compute_deviation,
    discretise_blocks,
    triangularise,
)
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_SINGULAR_TOLERANCE = (
    1e-12  # relative singular value of a predicted root below which it is rounding
)


@dataclass(frozen=True)
class Filtered:
    """Filtered estimates after each block, from the data up to its end."""

    rate: Array  # shape (runs, b); estimated Earth's rate, rad/s
    rate_sigma: Array  # shape (b,); its standard deviation, rad/s
    drift: Array  # shape (runs, b); mean slow error of the gyro, bias included, rad/s
    drift_sigma: Array  # shape (b,); its standard deviation, rad/s
    innovation: Array  # shape (runs, b); each block mean less its prediction, rad/s
    innovation_sigma: Array  # shape (b,); its standard deviation, rad/s
    states: Array  # shape (runs, b, m + 2); rate, states after the block, and drift
    roots: Array  # shape (b, m + 2, m + 2); lower triangular roots of their covariances

    @property
    def nis(self) -> Array:
        """Normalised innovation squared, shape (runs, b): chi-squared of one degree."""
        return np.asarray((self.innovation / self.innovation_sigma) ** 2)

    def rate_nees(self, rate: float) -> Array:
        """Return the squared error of the rate divided by its variance, (runs, b): chi^2(1)."""
        return np.asarray(((self.rate - rate) / self.rate_sigma) ** 2)

    def nees(self, rate: float, states: Array) -> Array:
        """Return the NEES, (runs, b), chi^2(m + 1), from true rate and ``states``, (runs, b, m)."""
        error = self.states[:, :, :-1].copy()
        error[:, :, 0] -= rate
        error[:, :, 1:] -= states
        squares = np.empty(error.shape[:2])
        for k, root in enumerate(self.roots[:, :-1, :-1]):
            white = solve_triangular(root, error[:, k].T, lower=True)
            squares[:, k] = np.sum(white**2, axis=0)
        return squares


class RateFilter:
    """A Kalman filter for the Earth's rate, from block means of any number of runs at once.

    ``turn_on_bias`` is the standard deviation of the fixed bias, ``rate_sigma`` of the prior of the
    rate about 0, both in rad/s and by default uninformative. Raises ValueError if one of them is
    negative or not finite.
    """

    def __init__(
        self,
        blocks: Blocks,
        model: NoiseModel,
        *,
        turn_on_bias: float = UNINFORMATIVE_SIGMA,
        rate_sigma: float = UNINFORMATIVE_SIGMA,
    ) -> None:
        if not (math.isfinite(rate_sigma) and rate_sigma >= 0):
            raise ValueError(f"rate_sigma is {rate_sigma}, expected a finite number, 0 or more")
        self.blocks = blocks
        states = discretise_blocks(model, blocks, turn_on_bias)
        self._filter = BlockFilter((states,), blocks.seen[:, None, None], np.array([[rate_sigma]]))

    @property
    def rate_sigma(self) -> Array:
        """Standard deviation of the rate after each block, rad/s, shape (b,); needs no data."""
        return compute_deviation(self._filter.roots, 0)

    def run(self, means: Array) -> Filtered:
        """Filter runs from finite block means, rad/s, shape (runs, b)."""
        self.blocks.check_means(means)
        states, innovation = self._filter.run(means[:, :, None])
        roots = self._filter.roots
        return Filtered(
            states[:, :, 0],
            self.rate_sigma,
            states[:, :, -1],
            compute_deviation(roots, -1),
            innovation[:, :, 0],
            np.abs(self._filter.innovation_roots[:, 0, 0]),
            states,
            roots,
        )

    def smooth(self, filtered: Filtered) -> tuple[Array, Array]:
        """Smooth the drift in the result of `run` (Rauch, Tung and Striebel), with square roots.

        Returned are the drift of each block from all the data, rad/s, shape (runs, b), and its
        standard deviation, shape (b,). The smoothed rate is the last filtered one.
        """
        states, root = filtered.states.copy(), self._filter.roots[-1]
        sigma = np.empty(len(self.blocks))  # of the drift at each block
        sigma[-1] = compute_deviation(root, -1)
        n = len(root)
        for k in range(len(self.blocks) - 2, -1, -1):
            transition, noise = self._filter.matrices(k + 1)
            before = self._filter.roots[k]
            joint = np.zeros((2 * n, n + noise.shape[1]))
            joint[:n, :n], joint[:n, n:], joint[n:, :n] = transition @ before, noise, before
            after = triangularise(joint)
            predicted, shared, rest = after[:n, :n], after[n:, :n], after[n:, n:]
            # Without process noise the mean of a block depends on the states: no plain inverse.
            scale = np.linalg.norm(predicted, axis=1)
            unit = np.where(scale > 0.0, scale, 1.0)
            inverse = np.linalg.pinv(predicted / unit[:, None], rcond=_SINGULAR_TOLERANCE)
            gain = shared @ inverse / unit
            root = triangularise(np.concatenate([rest, gain @ root], axis=1))
            sigma[k] = compute_deviation(root, -1)
            forecast = filtered.states[:, k] @ transition.T
            states[:, k] += (states[:, k + 1] - forecast) @ gain.T
        return states[:, :, -1], sigma
