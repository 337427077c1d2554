"""Predicted Allan deviation of a virtual sensor, with limits."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.extensions.fusion.board import Board
from imubench_pipeline.navigation.error_budget.uncertainty import draw_models
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array


@dataclass(frozen=True)
class FusedCurve:
    """The predicted Allan variance of a virtual sensor."""

    variance: Array  # shape (m,); (rad/s)^2 or (m/s^2)^2
    common: Array  # shape (m,); the part from shared processes

    @property
    def deviation(self) -> Array:
        """Allan deviation, rad/s or m/s^2, shape (m,)."""
        return np.sqrt(self.variance)

    @property
    def common_share(self) -> Array:
        """Fraction of the variance that does not average out, 0 to 1, shape (m,)."""
        return np.divide(
            self.common, self.variance, out=np.zeros_like(self.common), where=self.variance > 0
        )


def fused_allan(board: Board, weights: Array, tau: ArrayLike) -> FusedCurve:
    """Return the Allan variance of a virtual sensor.

    It has two parts: the sum of w_i^2 AV_i over the sensors, and the sum of (w^T g)^2 AV over the
    shared processes. Here w are the weights, AV Allan variances, and g the sensitivities to a
    process. ``tau``, s, shape (m,), is rounded to whole fused samples. Raises ValueError unless the
    weights have the shape (n,) and the sum 1.
    """
    board.check_weights(weights)
    alone, common = board.allan_parts(tau).of_sum(weights)
    return FusedCurve(alone + common, common)


def prediction_limits(
    board: Board,
    estimates: Sequence[Estimate],
    weights: Array,
    tau: ArrayLike,
    *,
    draws: int,
    rng: np.random.Generator,
    level: float = 0.95,
) -> tuple[Array, Array]:
    """Return limits, (m,) each, of the predicted Allan deviation due to uncertain parameters.

    `draw_models` draws ``draws`` models from the estimate of each sensor; sensors that share an
    estimate share its draws. Weights and shared parts are fixed. ``tau`` is in s, shape (m,);
    ``level`` is the fraction of the drawn boards between the limits.
    """
    drawn: dict[int, list[NoiseModel]] = {}
    for estimate, stream in zip(estimates, rng.spawn(len(estimates)), strict=True):
        if id(estimate) not in drawn:
            drawn[id(estimate)] = draw_models(estimate, draws, stream)
    deviations = []
    for i in range(draws):
        models = [drawn[id(estimate)][i] for estimate in estimates]
        deviations.append(fused_allan(replace(board, models=models), weights, tau).deviation)
    tail = (1.0 - level) / 2.0
    lower, upper = np.quantile(deviations, [tail, 1.0 - tail], axis=0)
    return lower, upper
