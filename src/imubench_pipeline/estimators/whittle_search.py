"""Search for the correlation times that fit a spectrum best.

The search calls one compiled kernel some hundred times. It is not compiled itself: numba inlines
all that a kernel calls, and would compile each level of the search for seconds at first use.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.optimize import minimize_scalar

from imubench_pipeline.estimators.whittle_kernels import Problem, cost_at
from imubench_pipeline.typing import Array

_SCAN_STEP = 4
_PAIR_STEP = 12
_MIN_TIME_RATIO = 2.5  # Minimum ratio of two correlation times of one model
_SCAN_TOLERANCE = 1e-2  # Tolerance of the cost when correlation times are only compared
_POLISH_TOLERANCE = 1e-6
_LOG_TIME_TOLERANCE = 5e-4  # Tolerance of the logarithm of a correlation time
_MAX_TURNS = 8


def _polish(
    places: Array, which: int, low: float, high: float, problem: Problem
) -> tuple[float, float]:
    """Minimise the cost over one correlation time between limits (Brent's method)."""
    tried = places.copy()

    def cost(place: float) -> float:
        tried[which] = place
        return cost_at(tried, problem, _POLISH_TOLERANCE)

    best = minimize_scalar(
        cost, bounds=(low, high), method="bounded", options={"xatol": _LOG_TIME_TOLERANCE}
    )
    return float(best.x), float(best.fun)


def _scan(
    places: Array, which: int, low: float, high: float, problem: Problem
) -> tuple[float, float]:
    """Return the best of one correlation time on a grid between limits, and its cost."""
    tried, table = places.copy(), problem.table
    best, lowest = places[which], np.inf
    for i in range(0, table.logarithms.shape[0], _SCAN_STEP):
        tried[which] = table.first + i * table.step
        if low <= tried[which] <= high:
            cost = cost_at(tried, problem, _SCAN_TOLERANCE)
            if cost < lowest:
                best, lowest = tried[which], cost
    return best, lowest


def one_process(problem: Problem) -> Array:
    """Scan the correlation time, then polish the best."""
    first, step, logarithms = problem.table
    last = first + step * (logarithms.shape[0] - 1)
    place = np.array([first])
    best, lowest = _scan(place, 0, first, last, problem)
    reach = _SCAN_STEP * step
    place[0] = best
    low, high = max(first, best - reach), min(last, best + reach)
    polished, cost = _polish(place, 0, low, high, problem)
    place[0] = polished if cost < lowest else best
    return place


def two_processes(problem: Problem) -> Array:
    """Polish the best pair of a coarse grid and the best single process with another beside it.

    A strong process has a sharp correlation time, beside which no pair of a coarse grid shows that
    it needs another. A first turn tells which of them leads lowest.
    """
    begun = [_descend(pair, cost, problem, turns=1) for pair, cost in _pairs(problem)]
    pair, cost = min(begun, key=lambda one: one[1])
    return _descend(pair, cost, problem, turns=_MAX_TURNS)[0]


def _pairs(problem: Problem) -> Iterator[tuple[Array, float]]:
    """Yield pairs of correlation times to begin with, and their costs."""
    first, step, logarithms = problem.table
    last = first + step * (logarithms.shape[0] - 1)
    apart = np.log(_MIN_TIME_RATIO)
    lowest = np.inf
    pair = np.array([first, last])
    places = np.empty(2)
    for i in range(0, logarithms.shape[0], _PAIR_STEP):
        for j in range(i + _PAIR_STEP, logarithms.shape[0], _PAIR_STEP):
            places[0], places[1] = first + i * step, first + j * step
            if places[1] - places[0] < apart:
                continue
            cost = cost_at(places, problem, _SCAN_TOLERANCE)
            if cost < lowest:
                lowest = cost
                pair = places.copy()
    yield pair, lowest
    single = one_process(problem)[0]
    for which in (1, 0):
        beside = np.array([single, single])
        low, high = (single + apart, last) if which == 1 else (first, single - apart)
        if high <= low:
            continue
        beside[which], cost = _scan(beside, which, low, high, problem)
        if cost < np.inf:
            yield beside, cost


def _descend(pair: Array, lowest: float, problem: Problem, *, turns: int) -> tuple[Array, float]:
    """Polish each of two correlation times in turn."""
    first, step, logarithms = problem.table
    last = first + step * (logarithms.shape[0] - 1)
    apart = np.log(_MIN_TIME_RATIO)
    best = pair.copy()
    reach = _PAIR_STEP * step
    for _ in range(turns):
        before = lowest
        for g in range(2):
            low, high = max(first, best[g] - reach), min(last, best[g] + reach)
            if g == 0:
                high = min(high, best[1] - apart)
            else:
                low = max(low, best[0] + apart)
            if high <= low:
                continue
            polished, cost = _polish(best, g, low, high, problem)
            if cost < lowest:
                lowest = cost
                best[g] = polished
        reach = max(0.7 * reach, 0.1 * step)
        if before - lowest < 1e-4:
            break
    return best, lowest
