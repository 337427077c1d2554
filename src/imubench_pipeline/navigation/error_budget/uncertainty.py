"""Uncertainty of an error budget from the uncertainty of the noise model."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import ndtr

from imubench_pipeline.estimators.estimate import SIGMAS, Estimate, Parameter
from imubench_pipeline.noise import GaussMarkov, NoiseModel, Sinusoid
from imubench_pipeline.typing import Array


def compute_limits(
    drawn: Sequence[float] | Array, value: float, tail: float = 0.025
) -> tuple[float, float]:
    """Return 95 % limits of draws, extended to include ``value``, as drawn terms may exceed it."""
    lower, upper = np.quantile(drawn, [tail, 1.0 - tail]).tolist()
    return min(lower, value), max(upper, value)


def compute_chance_within(limit: float, drawn: Array) -> float:
    """Return the probability that a total is within a limit, from totals of drawn noise models.

    It is the integral of a kernel density estimate in log total, with a normal kernel (B. W.
    Silverman, "Density estimation for statistics and data analysis", 1986, eq. 3.31), so that it is
    not 0 or 1 beyond the outermost draws. The limit, above 0, is in rad, m/s or m.
    """
    totals = np.log(np.maximum(drawn, 1e-300))
    quarter = np.subtract(*np.quantile(totals, [0.75, 0.25])) / 1.349
    width = 0.9 * min(float(np.std(totals)), float(quarter)) * len(totals) ** -0.2
    left = math.log(limit) - totals
    if width < 1e-12:
        return float(np.mean(left >= -1e-12))
    return float(np.mean(ndtr(left / width)))


def draw_models(estimate: Estimate, draws: int, rng: np.random.Generator) -> list[NoiseModel]:
    """Return ``draws`` noise models, drawn from the uncertainty of an estimate.

    Posterior draws are used with all parameters of a model together, thinned evenly or repeated, in
    random order. Lines are independent of the noise parameters, and drawn separately.

    If an estimate has no draws, its parameters are drawn from their limits **independently**. In
    fact they are correlated: intervals of functions of several parameters are 1.0 to 3.5 times too
    wide. Each is log-normal about its value, with a separate spread on either side (linear towards
    a lower limit of 0). An absent parameter with an upper limit is half-normal from 0. A ramp is
    normal.
    """
    if estimate.draws is None:
        models = []
        for _ in range(draws):
            first = _draw_values(estimate.parameters, rng)
            further = [_draw_values(group, rng) for group in estimate.further]
            processes = [
                GaussMarkov(process["B"], process["T_B"])
                for process in further
                if process["B"] and process["T_B"]
            ]
            model = NoiseModel(
                **{name: first.get(name, 0.0) for name in ("Q", "N", "B", "K", "R")},
                T_B=first.get("T_B") or None,
                further=processes,
                sinusoids=_draw_lines(estimate, rng),
            )
            models.append(model)
        return models
    available, places = len(estimate.draws), np.arange(draws)
    rows = places % available if draws > available else places * available // draws
    return [
        estimate.draws.model(int(row), _draw_lines(estimate, rng)) for row in rng.permutation(rows)
    ]


def _draw_lines(estimate: Estimate, rng: np.random.Generator) -> list[Sinusoid]:
    lines = [_draw_values(group, rng) for group in estimate.lines]
    return [Sinusoid(line["amplitude"], line["frequency"]) for line in lines]


def _draw_values(parameters: Mapping[str, Parameter], rng: np.random.Generator) -> dict[str, float]:
    """Return a draw of each parameter; 0 for absent ones."""
    drawn = {}
    for name, parameter in parameters.items():
        # Draw one number for each parameter, so that an extra one does not change the others.
        normal = float(rng.standard_normal())
        value, upper = parameter.in_model, parameter.upper
        limit = parameter.lower if normal < 0 else upper
        share = abs(normal) / SIGMAS
        if value is None or value == 0.0:
            drawn[name] = (
                0.0 if name in ("R", "T_B") or upper is None else abs(normal) * upper / SIGMAS
            )
        elif limit is None:
            drawn[name] = value
        elif name == "R":
            drawn[name] = value + (limit - value) * share
        elif limit <= 0.0:
            drawn[name] = max(value * (1.0 - share), 0.0)
        else:
            drawn[name] = value * math.exp(math.log(limit / value) * share)
    return drawn
