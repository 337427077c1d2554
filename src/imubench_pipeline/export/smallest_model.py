"""The smallest noise model of a family that lies above limits: linear programs over its densities.

All is linear in the densities N^2, S_B and K^2 at a given T_B: programs inside a search over T_B.
Smallest is the model with the least mean, over log tau, of the logarithm of its Allan variance over
the limit. (Its mean ratio, one program, lets the largest ratios rule: where a random walk must be
far above the curve at long tau, white noise would be raised to make room.)
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
    bias_instability,
)
from imubench_pipeline.typing import Array

Family = Literal["N+K", "N+GM", "N+GM+K"]

FAMILIES: Sequence[Family] = get_args(Family)

_TIMES_A_DECADE = 6
"""Correlation times tried before the best is sought between its neighbours."""

_MOST_PROGRAMS = 12
_SAME = 1e-6
"""The programs have come to an end where the mean logarithm falls by less."""

_ABOVE = 1e-9
"""The model is larger by this, so that no rounding puts it below a limit."""


@dataclass(frozen=True)
class Limits:
    """What a model must lie above.

    Attributes
    ----------
    kind : str
        In words.
    x, value : ndarray, shape (m,)
        Tau or time in s, or frequency in Hz, and the least value there.
    of_term : callable
        Term -> what is bounded, of this term, at ``x``.
    """

    kind: str
    x: Array
    value: Array
    of_term: Callable[[Term], Array]

    def ratio(self, model: NoiseModel) -> Array:
        """Return how many times the limit a model has, shape (m,)."""
        return np.asarray(np.sum([self.of_term(term) for term in model.terms], axis=0) / self.value)


def smallest(limits: Sequence[Limits], family: Family, times: tuple[float, float]) -> NoiseModel:
    """Return the smallest model of a family that lies above limits.

    The first of the `limits` are those of the Allan variance: there the model is kept close.
    `times`: shortest and longest T_B to try, s.

    Raises
    ------
    ValueError
        If the family is not known, or no model of it lies above.
    """
    if family not in FAMILIES:
        raise ValueError(f"family {family!r} is not known, expected one of {', '.join(FAMILIES)}")
    walks = family.endswith("K")
    fixed: list[Term] = [WhiteNoise(1.0)] + [RandomWalk(1.0)] * walks
    if "GM" not in family:
        cost, powers = _program(limits, fixed)
        T_B = None
    else:
        tried = np.log(np.geomspace(*times, count_of_points(*times, _TIMES_A_DECADE)))

        def solved(log_time: float) -> tuple[float, Array]:
            time = math.exp(log_time)
            return _program(limits, [*fixed, GaussMarkov(bias_instability(1.0, time), time)])

        costs = [solved(float(x))[0] for x in tried]
        best = int(np.argmin(costs))
        around = tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)]
        finer = minimize_scalar(lambda x: solved(x)[0], bounds=around, method="bounded")
        place = float(finer.x) if finer.fun < costs[best] else float(tried[best])
        cost, powers = solved(place)
        T_B = math.exp(place)
    if not math.isfinite(cost):
        raise ValueError(f"no model {family} lies above the limits")
    powers = powers * (1.0 + _ABOVE)
    B = bias_instability(float(powers[-1]), T_B) if T_B else 0.0
    return NoiseModel(
        N=math.sqrt(powers[0]),
        B=B,
        T_B=T_B if B > 0.0 else None,
        K=math.sqrt(powers[1]) if walks else 0.0,
    )


def _program(limits: Sequence[Limits], terms: Sequence[Term]) -> tuple[float, Array]:
    """Return the mean log ratio of the Allan variance to its limit, and the powers of the terms.

    The logarithm is concave: each program lies on its tangent at the last answer, so that the mean
    falls from program to program.
    """
    parts = [
        np.column_stack([limit.of_term(term) for term in terms]) / limit.value[:, None]
        for limit in limits
    ]
    rows = np.concatenate(parts)
    scale = rows.max(axis=0)
    curve, rows = parts[0] / scale, rows / scale
    weights = _log_weights(limits[0].x)
    cost, powers, ratio = math.inf, np.zeros(len(terms)), np.ones(len(curve))
    for _ in range(_MOST_PROGRAMS):
        answer = linprog(
            (weights / ratio) @ curve, A_ub=-rows, b_ub=-np.ones(len(rows)), method="highs"
        )
        if answer.status != 0 or answer.x is None:
            break
        # What the solver's tolerance leaves below a limit is made up for.
        solution = np.maximum(answer.x, 0.0)
        solution /= min(float(np.min(rows @ solution)), 1.0)
        ratio = curve @ solution
        lower = float(weights @ np.log(ratio))
        if lower > cost - _SAME:
            break
        cost, powers = lower, solution
    return cost, np.asarray(powers / scale)


def _log_weights(x: Array) -> Array:
    """Return weights of a mean over log x."""
    if len(x) == 1:
        return np.ones(1)
    edges = np.log(np.concatenate((x[:1], np.sqrt(x[1:] * x[:-1]), x[-1:])))
    return np.asarray(np.diff(edges) / (edges[-1] - edges[0]))


def count_of_points(start: float, stop: float, a_decade: int) -> int:
    """Return how many points an interval takes, so many a decade."""
    return 2 + math.ceil(a_decade * math.log10(stop / start))
