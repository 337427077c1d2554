"""Uncertainty of a standard deviation that is computed from an estimated noise model.

A filter, a bound or a standard error assumes that N, B, T_B and K are known. Its range is computed
from models that are drawn from the distribution of the parameters. The range has the stated
coverage if this distribution is correct.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.noise.model import NoiseModel
from imubench_pipeline.typing import Array

Sigma = Callable[[NoiseModel], ArrayLike]
"""A standard deviation, or several, from a noise model; the same shape for every model."""

_SCALABLE_PARAMETERS = ("Q", "N", "B", "T_B", "K")


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
    `error_budget.draw_models`, `drawn_from_covariance`, or a posterior; ``level`` is their share
    between the limits. Raises ValueError if there is no draw, or the level is not between 0 and 1.
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


def drawn_from_covariance(
    model: NoiseModel, names: Sequence[str], covariance: Array, draws: int, rng: np.random.Generator
) -> list[NoiseModel]:
    """Return noise models with jointly log-normal parameters, whose medians are those of a model.

    ``covariance``, shape (p, p), is the covariance of the natural logarithms of the parameters
    ``names``, of Q, N, B, T_B and K; the others are not changed. Raises ValueError if a name is
    unknown, the model has no such parameter, or the covariance has a wrong shape, is not symmetric
    or not positive semi-definite.
    """
    for name in names:
        if name not in _SCALABLE_PARAMETERS:
            raise ValueError(f"no parameter {name!r}; expected {', '.join(_SCALABLE_PARAMETERS)}")
        if not getattr(model, name):
            raise ValueError(f"the model {model.name} has no {name}")
    if covariance.shape != (len(names), len(names)) or not np.allclose(covariance, covariance.T):
        raise ValueError(f"expected a symmetric covariance of {len(names)} parameters")
    values, vectors = np.linalg.eigh(covariance)
    if values.size and values[0] < -1e-9 * max(float(values[-1]), 0.0):
        raise ValueError("the covariance has a negative eigenvalue")
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    logarithms = rng.standard_normal((draws, len(names))) @ root.T
    medians = [float(getattr(model, name)) for name in names]
    models = []
    for row in logarithms.tolist():
        changed: dict[str, Any] = {
            name: median * math.exp(change)
            for name, median, change in zip(names, medians, row, strict=True)
        }
        models.append(replace(model, **changed))
    return models
