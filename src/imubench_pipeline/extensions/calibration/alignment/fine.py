"""Fine alignment: a Kalman filter of attitude and sensor errors at rest.

The body is at rest on the Earth, so its attitude is constant, or is turned by known angles between
positions. The residual of the block means for an attitude C~ = (I - [psi x]) C is linear in psi,

    y - T^T C~^T v = T^T C~^T [v x] psi + mean error + white noise,

v the Earth's rate or the specific force, T the turn since the first position. The errors of the six
axes are states of their noise models (`calibration.states`), with the fixed biases. In one position
the filter cannot separate the biases of the level accelerometers from tilt, nor the bias of the
east gyro from the heading:

    sigma(roll, pitch) -> accelerometer bias / g,   sigma(heading) -> gyro bias / (w_ie cos(L)).
"""

import math
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.extensions.calibration.alignment.attitude import (
    cross_matrix,
    euler_jacobian,
    rotation,
)
from imubench_pipeline.extensions.calibration.alignment.coarse import coarse_alignment, mean_vectors
from imubench_pipeline.extensions.calibration.alignment.triad import Positions, Site, Triad
from imubench_pipeline.extensions.calibration.least_squares import NotObservable, NotObservableError
from imubench_pipeline.extensions.calibration.states import BlockFilter, discretise_blocks
from imubench_pipeline.typing import Array

INITIAL_ANGLE_SIGMA = 10.0  # of each small angle, rad: an uninformative prior
UNIFORM_HEADING_SIGMA = math.pi / math.sqrt(3.0)  # rad; the limit for an unknown heading
_MAX_LAST_CORRECTION = 1e-7  # largest last correction, rad, of an attitude that has converged
_MAX_ITERATIONS = 20


@dataclass(frozen=True)
class Aligned:
    """Attitudes from fine alignment, one for each run, with the estimated errors of the axes."""

    attitude: Array  # shape (runs, 3, 3); body to navigation, first position, all the data
    psi: Array  # shape (runs, b, 3); estimated error of the given attitude, rad
    drift: Array  # shape (runs, b, 6); estimated error of each axis then, SI
    nis: Array  # shape (runs, b); normalised innovation squared: chi^2(6)


class FineAlignment:
    """A filter that aligns runs with the same blocks, linearised about an attitude.

    ``attitude``: body to navigation frame in the first position, shape (3, 3).
    """

    def __init__(self, triad: Triad, positions: Positions, site: Site, attitude: Array) -> None:
        self.positions, self.site, self.attitude = positions, site, attitude
        axes = [discretise_blocks(model, positions.blocks, bias) for model, bias in triad.axes]
        to_body = np.swapaxes(attitude @ positions.of_blocks, 1, 2)
        self._to_body = to_body
        seen = np.concatenate(
            [to_body @ cross_matrix(site.earth_rate), to_body @ cross_matrix(site.specific_force)],
            axis=1,
        )
        self._filter = BlockFilter(axes, seen, np.eye(3) * INITIAL_ANGLE_SIGMA)
        self._euler = euler_jacobian(attitude)

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
        """Standard deviations of the ``drift`` of `Aligned`, shape (b, 6)."""
        return np.asarray(np.linalg.norm(self._filter.roots[:, -6:], axis=2))

    @property
    def not_observable(self) -> tuple[NotObservable, ...]:
        """The heading, if its standard deviation is as large as for an unknown heading; or none."""
        if self.sigma[-1, 2] < UNIFORM_HEADING_SIGMA:
            return ()
        reason = (
            "the uncertainty of the east gyro's bias exceeds the horizontal part of the Earth's "
            "rate: turn the triad about the vertical, or state the bias more precisely"
        )
        return (NotObservable("heading", reason),)

    def run(self, means: Array, attitude: Array | None = None) -> Aligned:
        """Align runs from block means, (runs, b, 6), about attitudes of shape (runs, 3, 3)."""
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
        residual = np.empty_like(means)
        for part, true in (
            (slice(0, 3), self.site.earth_rate),
            (slice(3, 6), self.site.specific_force),
        ):
            error = np.einsum("rbij,rbj->rbi", to_navigation, means[:, :, part]) - true
            residual[:, :, part] = np.einsum("bij,rbj->rbi", self._to_body, error)
        states, innovations = self._filter.run(residual)
        psi = states[:, :, :3]
        white = np.linalg.solve(self._filter.innovation_roots, innovations[..., None])[..., 0]
        return Aligned(
            rotation(psi[:, -1]) @ attitudes, psi, states[:, :, -6:], np.sum(white**2, axis=2)
        )


def align(
    means: Array, triad: Triad, positions: Positions, site: Site
) -> tuple[Aligned, FineAlignment]:
    """Align one run: coarsely, then by filters about the last attitude until it converges.

    This is the Gauss-Newton method. The block means are of gyros and accelerometers x, y, z, rad/s
    and m/s^2, shape (b, 6). Returned are the alignment of the run and the last filter, which has
    the standard deviations. Raises NotObservableError if the heading is not observable, ValueError
    if the attitude does not converge.
    """
    attitude = coarse_alignment(*mean_vectors(means, positions), site)
    for _ in range(_MAX_ITERATIONS):
        fine = FineAlignment(triad, positions, site, attitude)
        if fine.not_observable:
            raise NotObservableError(f"heading: {fine.not_observable[0].reason}")
        aligned = fine.run(means[None])
        attitude = aligned.attitude[0]
        step = float(np.abs(aligned.psi[0, -1]).max())
        if step < _MAX_LAST_CORRECTION:
            return aligned, fine
    raise ValueError(
        f"the attitude does not converge; the last correction was {step:.2g} rad, the standard "
        f"deviation of the heading is {fine.sigma[-1, 2]:.2g} rad"
    )
