"""How sure a budget is, when the parameters of the noise model are estimates."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from imubench_pipeline.error_budget.budget import Budget
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid

_SIGMAS = 1.96
"""Half the width of a 95 % interval."""


def interval(budgets: Sequence[Budget], level: float = 0.95) -> tuple[float, float]:
    """Return the limits of the total over budgets of drawn noise models.

    Parameters
    ----------
    budgets : sequence of Budget
        Of one quantity at one time, one a draw: from the posterior of a fit, or `draw_models`.
    level : float
        Share of the totals between the limits.

    Returns
    -------
    (float, float)
        Lower and upper limit, rad, m/s or m.

    Raises
    ------
    ValueError
        If there is no budget, they differ in quantity or time, or the level is not within 0..1.
    """
    if len({(one.quantity, one.time) for one in budgets}) != 1:
        raise ValueError("expected budgets of one quantity at one time")
    if not 0 < level < 1:
        raise ValueError(f"level is {level}, expected one between 0 and 1")
    tail = (1.0 - level) / 2.0
    lower, upper = np.quantile([one.total for one in budgets], [tail, 1.0 - tail])
    return float(lower), float(upper)


def draw_models(estimate: Estimate, draws: int, rng: np.random.Generator) -> list[NoiseModel]:
    """Return noise models with parameters drawn from their 95 % limits.

    An approximation, for estimates that have limits but no draws from a posterior: the
    parameters are independent (B and T_B, or N and B of a short log, are not; with a negative
    correlation of B and K, for one, the interval of a budget comes out too wide), and each is
    log-normal about its value, with a spread of its own on either side, so that the limits are
    the 2.5 % and 97.5 % points of the draws. A lower limit of 0 is reached linearly. What is
    absent, with an upper limit, is half-normal from 0 with that as its 95 % point. A ramp, which
    has a sign, is normal on either side. What has no limits stays as it is.

    Parameters
    ----------
    estimate : Estimate
    draws : int
    rng : numpy.random.Generator

    Returns
    -------
    list of NoiseModel
        ``draws`` of them.
    """
    return [_drawn(estimate, rng) for _ in range(draws)]


def _drawn(estimate: Estimate, rng: np.random.Generator) -> NoiseModel:
    first = _values(estimate.parameters, rng)
    further = [_values(group, rng) for group in estimate.further]
    lines = [_values(group, rng) for group in estimate.lines]
    return NoiseModel(
        Q=first.get("Q", 0.0),
        N=first.get("N", 0.0),
        B=first.get("B", 0.0),
        T_B=first.get("T_B") or None,
        K=first.get("K", 0.0),
        R=first.get("R", 0.0),
        further=[GaussMarkov(one["B"], one["T_B"]) for one in further if one["B"] and one["T_B"]],
        sinusoids=[Sinusoid(one["amplitude"], one["frequency"]) for one in lines],
    )


def _values(parameters: Mapping[str, Parameter], rng: np.random.Generator) -> dict[str, float]:
    """Return a draw of each parameter; 0 for what is not there."""
    # Every parameter takes its number, so that one more or less does not change the others.
    normal = {name: float(rng.standard_normal()) for name in parameters}
    return {name: _value(name, one, normal[name]) for name, one in parameters.items()}


def _value(name: str, parameter: Parameter, normal: float) -> float:
    value = parameter.in_model
    lower, upper = parameter.lower, parameter.upper
    if value is None or value == 0.0:
        return 0.0 if name in ("R", "T_B") or upper is None else abs(normal) * upper / _SIGMAS
    limit = lower if normal < 0 else upper
    if limit is None:
        return value
    share = abs(normal) / _SIGMAS
    if name == "R":
        return value + (limit - value) * share
    if limit <= 0.0:
        return max(value * (1.0 - share), 0.0)
    return value * math.exp(math.log(limit / value) * share)
