"""Uncertainty of a standard deviation that is computed from an estimated noise model.

A filter, a bound or a standard error assumes that N, B, T_B and K are known. Its range is computed
from models that are drawn from the distribution of the parameters. The range has the stated
coverage if this distribution is correct.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.noise.model import NoiseModel
from imubench_pipeline.typing import Array

Sigma = Callable[[NoiseModel], ArrayLike]
"""A standard deviation, or several, from a noise model; the same shape for every model."""


@dataclass(frozen=True)
class SigmaRange:
    """Standard deviations, and their range due to the uncertainty of the noise parameters.

    ``pooled`` is the root mean square over the drawn models: the standard deviation of an error
    with unknown noise model (law of total variance). Weights from a wrong model add to it in second
    order.
    """

    value: Array  # with the estimated parameters
    lower: Array
    upper: Array
    """Limits from the drawn models."""
    pooled: Array


def sigma_range(
    sigma: Sigma, model: NoiseModel, drawn: Sequence[NoiseModel], level: float = 0.95
) -> SigmaRange:
    """Return the range of a standard deviation over noise models.

    ``sigma`` is a function of a model, such as ``lambda model: RateFilter(blocks,
    model).rate_sigma[-1]``; ``model`` is the estimated one. ``drawn`` are from
    `error_budget.draw_models` or a posterior; ``level`` is their share between the limits. Raises
    ValueError if there is no draw, or the level is not between 0 and 1.
    """
    if not drawn:
        raise ValueError("expected noise models, and there is none")
    if not 0 < level < 1:
        raise ValueError(f"level is {level}, expected a number between 0 and 1")
    values = np.array([np.asarray(sigma(drawn_model), dtype=np.float64) for drawn_model in drawn])
    tail = (1.0 - level) / 2.0
    lower, upper = np.quantile(values, [tail, 1.0 - tail], axis=0)
    return SigmaRange(
        np.asarray(sigma(model), dtype=np.float64),
        np.asarray(lower),
        np.asarray(upper),
        np.sqrt(np.mean(values**2, axis=0)),
    )
