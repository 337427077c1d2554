"""How sure a budget is, when the parameters of the noise model are estimates."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import ndtr

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.navigation.error_budget.parts import Budget
from imubench_pipeline.navigation.error_budget.printed_errors import SIGMAS
from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid


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
    if len({(budget.quantity, budget.time) for budget in budgets}) != 1:
        raise ValueError("expected budgets of one quantity at one time")
    if not 0 < level < 1:
        raise ValueError(f"level is {level}, expected one between 0 and 1")
    tail = (1.0 - level) / 2.0
    lower, upper = np.quantile([budget.total for budget in budgets], [tail, 1.0 - tail])
    return float(lower), float(upper)


def chance_within(limit: float, budgets: Sequence[Budget]) -> float:
    """Return the chance that a total is within a limit, over budgets of drawn noise models.

    The share of the draws, each smeared by the width of a normal kernel in log total (Silverman),
    so that it does not go in steps and falls off beyond the outermost draws.

    Parameters
    ----------
    limit : float
        rad, m/s or m; above 0.
    budgets : sequence of Budget
        As `interval` takes them.

    References
    ----------
    B. W. Silverman, "Density estimation for statistics and data analysis", 1986, eq. 3.31.
    """
    totals = np.log(np.maximum([budget.total for budget in budgets], 1e-300))
    quarter = np.subtract(*np.quantile(totals, [0.75, 0.25])) / 1.349
    width = 0.9 * min(float(np.std(totals)), float(quarter)) * len(totals) ** -0.2
    left = math.log(limit) - totals
    if width < 1e-12:
        return float(np.mean(left >= -1e-12))
    return float(np.mean(ndtr(left / width)))


def draw_models(estimate: Estimate, draws: int, rng: np.random.Generator) -> list[NoiseModel]:
    """Return as many noise models as ``draws`` that the log of an estimate allows.

    Where the estimate has draws of its posterior they are taken, all parameters of a model
    together: evenly where fewer are asked for than there are, the same ones again where more are,
    in random order, so that those of two channels meet by chance. Lines, which no noise parameter
    depends on, are drawn beside them.

    An estimate without draws (of the curve, or by least squares) has its parameters drawn from
    their limits **independently**, which they are not: what is computed from several of them then
    has an interval that is too wide, 1.0 to 3.5 times. Each is log-normal about its value, with a
    spread of its own on either side, so that the limits are the 2.5 % and 97.5 % points of the
    draws. A lower limit of 0 is reached linearly. What is absent, with an upper limit, is
    half-normal from 0 with that as its 95 % point. A ramp, which has a sign, is normal on either
    side. What has no limits stays as it is.
    """
    if estimate.draws is None:
        return [_draw_model(estimate, rng) for _ in range(draws)]
    available, places = len(estimate.draws), np.arange(draws)
    rows = places % available if draws > available else places * available // draws
    return [
        estimate.draws.model(int(row), _draw_lines(estimate, rng)) for row in rng.permutation(rows)
    ]


def drawn_jointly(estimate: Estimate) -> bool:
    """Tell whether `draw_models` draws the parameters of an estimate together."""
    return estimate.draws is not None


def _draw_lines(estimate: Estimate, rng: np.random.Generator) -> list[Sinusoid]:
    lines = [_draw_values(group, rng) for group in estimate.lines]
    return [Sinusoid(line["amplitude"], line["frequency"]) for line in lines]


def _draw_model(estimate: Estimate, rng: np.random.Generator) -> NoiseModel:
    first = _draw_values(estimate.parameters, rng)
    further = [_draw_values(group, rng) for group in estimate.further]
    return NoiseModel(
        Q=first.get("Q", 0.0),
        N=first.get("N", 0.0),
        B=first.get("B", 0.0),
        T_B=first.get("T_B") or None,
        K=first.get("K", 0.0),
        R=first.get("R", 0.0),
        further=[
            GaussMarkov(process["B"], process["T_B"])
            for process in further
            if process["B"] and process["T_B"]
        ],
        sinusoids=_draw_lines(estimate, rng),
    )


def _draw_values(parameters: Mapping[str, Parameter], rng: np.random.Generator) -> dict[str, float]:
    """Return a draw of each parameter; 0 for what is not there."""
    # Every parameter takes its number, so that one more or less does not change the others.
    normal = {name: float(rng.standard_normal()) for name in parameters}
    return {
        name: _draw_value(name, parameter, normal[name]) for name, parameter in parameters.items()
    }


def _draw_value(name: str, parameter: Parameter, normal: float) -> float:
    value = parameter.in_model
    lower, upper = parameter.lower, parameter.upper
    if value is None or value == 0.0:
        return 0.0 if name in ("R", "T_B") or upper is None else abs(normal) * upper / SIGMAS
    limit = lower if normal < 0 else upper
    if limit is None:
        return value
    share = abs(normal) / SIGMAS
    if name == "R":
        return value + (limit - value) * share
    if limit <= 0.0:
        return max(value * (1.0 - share), 0.0)
    return value * math.exp(math.log(limit / value) * share)
