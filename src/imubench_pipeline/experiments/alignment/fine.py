"""Fine alignment: a Kalman filter of attitude and sensor errors at rest.

The body stands on the Earth, so its attitude is constant, or is turned by known angles between
positions. What an attitude C~ = (I - [psi x]) C leaves of the block means is linear in psi,

    y - T^T C~^T v = T^T C~^T [v x] psi + mean error + white noise,

v the Earth's rate or the specific force, T the turn since the first position. The errors of the six
axes are states as their noise models have them (`earth_rate.states`), with the fixed biases: the
filter estimates psi and all of them, and its discretisation is exact. In one position it cannot
tell the biases of the level accelerometers from tilt, nor that of the east gyro from the heading;
its covariance says so:

    sigma(roll, pitch) -> accelerometer bias / g,   sigma(heading) -> gyro bias / (w_ie cos(L)).

Left out are the errors of the turns, scale factors and misalignments, and what moves the body.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.experiments.alignment.attitude import (
    correct,
    cross_matrix,
    of_euler_angles,
)
from imubench_pipeline.experiments.alignment.coarse import coarse_alignment, mean_vectors
from imubench_pipeline.experiments.alignment.triad import Positions, Site, Triad
from imubench_pipeline.experiments.calibration.least_squares import (
    NotObservable,
    NotObservableError,
)
from imubench_pipeline.experiments.earth_rate.block_filter import BlockFilter
from imubench_pipeline.experiments.earth_rate.states import block_states
from imubench_pipeline.typing import Array

UNKNOWN = 10.0
"""Standard deviation of each small angle at the start, rad: so much that it adds nothing."""

OPEN = math.pi / math.sqrt(3.0)
"""Standard deviation of a heading of which nothing is known, rad."""

_SETTLED = 1e-7
"""Last correction of an attitude that has settled, rad."""

_MOST = 20


@dataclass(frozen=True)
class Aligned:
    """Attitudes of runs of one design."""

    # shape (runs, 3, 3); from body to navigation frame, in the first position, from all the data
    attitude: Array
    # shape (runs, b, 3); what the filter held for the error of the attitude that it was given,
    # after each block, rad
    psi: Array
    # shape (runs, b, 6); mean of each axis' error over each block, its bias included, as known
    # then, rad/s and m/s^2
    drift: Array
    # shape (runs, b); normalised innovation squared: chi-squared of six degrees of freedom
    nis: Array


class FineAlignment:
    """The filter of one design, about an attitude; it aligns any number of runs at once.

    Parameters
    ----------
    triad : Triad
    positions : Positions
    site : Site
    attitude : ndarray, shape (3, 3)
        From body to navigation frame in the first position; that of a coarse alignment.

    Raises
    ------
    ValueError
        If the x axis is vertical.
    """

    def __init__(self, triad: Triad, positions: Positions, site: Site, attitude: Array) -> None:
        self.positions, self.site, self.attitude = positions, site, attitude
        axes = [block_states(model, positions.blocks, bias) for model, bias in triad.axes]
        to_body = np.swapaxes(attitude @ positions.of_blocks, 1, 2)
        self._to_body = to_body
        seen = np.concatenate(
            [to_body @ cross_matrix(site.earth_rate), to_body @ cross_matrix(site.specific_force)],
            axis=1,
        )
        self._filter = BlockFilter(axes, seen, np.eye(3) * UNKNOWN)
        self._euler = of_euler_angles(attitude)

    @property
    def time(self) -> Array:
        """End of each block, s, shape (b,)."""
        return self.positions.blocks.end

    @property
    def psi_covariance(self) -> Array:
        """Covariance of the error of the attitude after each block, rad^2, shape (b, 3, 3)."""
        roots = self._filter.roots[:, :3]
        return np.asarray(roots @ np.swapaxes(roots, 1, 2))

    @property
    def sigma(self) -> Array:
        """Standard deviations of roll, pitch and heading after each block, rad, shape (b, 3)."""
        return np.asarray(np.linalg.norm(self._euler @ self._filter.roots[:, :3], axis=2))

    @property
    def drift_sigma(self) -> Array:
        """Standard deviations of each axis' error over each block, as known then, shape (b, 6)."""
        return np.asarray(np.linalg.norm(self._filter.roots[:, -6:], axis=2))

    @property
    def not_observable(self) -> tuple[NotObservable, ...]:
        """The heading, where the data tell no more of it than none at all."""
        if self.sigma[-1, 2] < OPEN:
            return ()
        reason = (
            "what is not known of the east gyro's bias is more than the horizontal part of the "
            "Earth's rate: turn the triad about the vertical, or state its bias better"
        )
        return (NotObservable("heading", reason),)

    def run(self, means: Array, attitude: Array | None = None) -> Aligned:
        """Align runs.

        Parameters
        ----------
        means : ndarray, shape (runs, b, 6)
            Block means of gyros and accelerometers x, y, z, rad/s and m/s^2.
        attitude : ndarray, shape (runs, 3, 3), optional
            Attitude of each run that is corrected, near to that of the filter; by default that.

        Raises
        ------
        ValueError
            If there are not six finite means a block.
        """
        if means.ndim != 3 or means.shape[1:] != (len(self.positions.blocks), 6):
            raise ValueError(
                f"the means have the shape {means.shape}, expected (runs, "
                f"{len(self.positions.blocks)}, 6)"
            )
        if not np.isfinite(means).all():
            raise ValueError("a block mean is not finite; leave its block out")
        attitudes = np.broadcast_to(
            self.attitude if attitude is None else attitude, (len(means), 3, 3)
        )
        to_navigation = np.einsum("rij,bjk->rbik", attitudes, self.positions.of_blocks)
        left = np.empty_like(means)
        for part, true in ((slice(0, 3), self.site.earth_rate), (slice(3, 6), self._force)):
            missed = np.einsum("rbij,rbj->rbi", to_navigation, means[:, :, part]) - true
            left[:, :, part] = np.einsum("bij,rbj->rbi", self._to_body, missed)
        states, innovations = self._filter.run(left)
        psi = states[:, :, :3]
        white = np.linalg.solve(self._filter.innovation_roots, innovations[..., None])[..., 0]
        return Aligned(
            correct(attitudes, psi[:, -1]), psi, states[:, :, -6:], np.sum(white**2, axis=2)
        )

    @property
    def _force(self) -> Array:
        return self.site.specific_force


def align(
    means: Array, triad: Triad, positions: Positions, site: Site
) -> tuple[Aligned, FineAlignment]:
    """Align one run: coarsely, then by filters about the attitude last found until it settles.

    With the filter about a better attitude each time this is Gauss and Newton's method: what is not
    linear in a large error of the coarse heading goes. The means of blocks are of gyros and
    accelerometers x, y, z, rad/s and m/s^2, shape (b, 6). Beside the attitude of one run the last
    filter is returned, which has the standard deviations.

    Raises
    ------
    NotObservableError
        If the data tell no more of the heading than none at all; roll and pitch are those of the
        coarse alignment.
    ValueError
        If the attitude does not settle.
    """
    attitude = coarse_alignment(*mean_vectors(means, positions), site)
    for _ in range(_MOST):
        fine = FineAlignment(triad, positions, site, attitude)
        if fine.not_observable:
            raise NotObservableError(f"heading: {fine.not_observable[0].reason}")
        aligned = fine.run(means[None])
        attitude = aligned.attitude[0]
        step = float(np.abs(aligned.psi[0, -1]).max())
        if step < _SETTLED:
            return aligned, fine
    raise ValueError(
        f"the attitude does not settle; its last correction was {step:.2g} rad, the heading's "
        f"standard deviation {fine.sigma[-1, 2]:.2g} rad"
    )
