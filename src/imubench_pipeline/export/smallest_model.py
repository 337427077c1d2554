"""Find the smallest noise model of a family above limits, by linear programs over its densities.

For a given T_B all limits are linear in the densities N^2, S_B and K^2. Linear programs are
therefore solved inside a one-dimensional search over T_B. The smallest model is the model with the
least mean, over log tau, of the logarithm of the ratio of its Allan variance to the limit. (The
mean ratio would need one program only, but the largest ratios would dominate it: where a random
walk must be far above the curve at long tau, the program would raise the white noise instead.)
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from scipy.optimize import linprog, minimize_scalar

from imubench_pipeline.noise import (
    GaussMarkov,
    NoiseModel,
    RandomWalk,
    Term,
    WhiteNoise,
    compute_bias_instability,
)
from imubench_pipeline.typing import Array

Family = Literal["N+K", "N+GM", "N+GM+K"]

FAMILIES: Sequence[Family] = get_args(Family)

_TIMES_PER_DECADE = 6  # correlation times of the grid search, which a bounded search refines
_MAX_PROGRAMS = 12  # max. number of successive linear programs for one T_B
_CONVERGED_DECREASE = 1e-6  # converged where the mean logarithm decreases by less
_ROUNDING_MARGIN = 1e-9
"""Relative increase of the densities, so that rounding does not put the model below a limit."""


@dataclass(frozen=True)
class Limits:
    """Lower limits of a model."""

    kind: str  # name of the limited quantity, for texts
    x: Array  # shape (m,); tau or time, s, or frequency, Hz
    value: Array  # shape (m,); lower limit there
    of_term: Callable[[Term], Array]  # contribution of a term to the limited quantity at `x`

    def ratio(self, model: NoiseModel) -> Array:
        """Return the ratio of a model to its limit, shape (m,)."""
        return np.asarray(np.sum([self.of_term(term) for term in model.terms], axis=0) / self.value)


def find_smallest(
    limits: Sequence[Limits], family: Family, times: tuple[float, float]
) -> NoiseModel:
    """Return the smallest model of a family that lies above limits.

    The first of the `limits` must be on the Allan variance: the model is minimised there.
    `times`: shortest and longest T_B of the search, s.

    Raises ValueError if the family is not known, or no model of it lies above.
    """
    if family not in FAMILIES:
        raise ValueError(f"family {family!r} is not known, expected one of {', '.join(FAMILIES)}")
    walks = family.endswith("K")
    fixed: list[Term] = [WhiteNoise(1.0)] + [RandomWalk(1.0)] * walks
    if "GM" not in family:
        cost, powers = _minimise_mean_log_ratio(limits, fixed)
        T_B = None
    else:
        tried = np.log(np.geomspace(*times, count_points(*times, _TIMES_PER_DECADE)))

        def solved(log_time: float) -> tuple[float, Array]:
            time = math.exp(log_time)
            return _minimise_mean_log_ratio(
                limits, [*fixed, GaussMarkov(compute_bias_instability(1.0, time), time)]
            )

        costs = [solved(float(x))[0] for x in tried]
        best = int(np.argmin(costs))
        around = tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)]
        finer = minimize_scalar(lambda x: solved(x)[0], bounds=around, method="bounded")
        place = float(finer.x) if finer.fun < costs[best] else float(tried[best])
        cost, powers = solved(place)
        T_B = math.exp(place)
    if not math.isfinite(cost):
        raise ValueError(f"no model {family} lies above the limits")
    powers = powers * (1.0 + _ROUNDING_MARGIN)
    B = compute_bias_instability(float(powers[-1]), T_B) if T_B else 0.0
    K = math.sqrt(powers[1]) if walks else 0.0
    return NoiseModel(N=math.sqrt(powers[0]), B=B, T_B=T_B if B > 0.0 else None, K=K)


def _minimise_mean_log_ratio(
    limits: Sequence[Limits], terms: Sequence[Term]
) -> tuple[float, Array]:
    """Minimise the mean log ratio of Allan variance to limit; return it, and the densities.

    The objective is a sum of logarithms, which are concave. Each program minimises their tangent at
    the last solution, an upper bound (majorise-minimise), so that the mean decreases monotonically.
    """
    parts = [
        np.column_stack([limit.of_term(term) for term in terms]) / limit.value[:, None]
        for limit in limits
    ]
    rows = np.concatenate(parts)
    scale = rows.max(axis=0)
    curve, rows = parts[0] / scale, rows / scale
    # Weights of a mean over log tau.
    x = limits[0].x
    edges = np.log(np.concatenate((x[:1], np.sqrt(x[1:] * x[:-1]), x[-1:])))
    weights = np.diff(edges) / (edges[-1] - edges[0]) if len(x) > 1 else np.ones(1)
    cost, powers, ratio = math.inf, np.zeros(len(terms)), np.ones(len(curve))
    for _ in range(_MAX_PROGRAMS):
        answer = linprog(
            (weights / ratio) @ curve, A_ub=-rows, b_ub=-np.ones(len(rows)), method="highs"
        )
        if answer.status != 0 or answer.x is None:
            break
        # Scale up, since the tolerance of the solver allows values slightly below a limit.
        solution = np.maximum(answer.x, 0.0)
        solution /= min(float(np.min(rows @ solution)), 1.0)
        ratio = curve @ solution
        lower = float(weights @ np.log(ratio))
        if lower > cost - _CONVERGED_DECREASE:
            break
        cost, powers = lower, solution
    return cost, np.asarray(powers / scale)


def count_points(start: float, stop: float, a_decade: int) -> int:
    """Return the number of log-spaced points in an interval, for a number per decade."""
    return 2 + math.ceil(a_decade * math.log10(stop / start))
