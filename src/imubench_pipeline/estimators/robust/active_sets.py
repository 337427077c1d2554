"""Non-negative least squares over all sets of noise terms and correlation times, of many curves.

The Allan variance is linear in N², B², K² and R². For a few terms all sets of them are solved in
closed form, and the best set whose squares are positive is the non-negative solution. The inverse
matrices depend on the weights only, so that hundreds of curves drawn around a measured one cost
little more than one.
"""

from copy import copy
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.noise import GaussMarkov, NoiseModel
from imubench_pipeline.typing import Array

WHITE, FLICKER, PROCESS, WALK, RAMP = range(5)
"""Columns: N, B of flicker noise, B of a Gauss-Markov process, K and R."""

TERMS = 5

_GAIN_OF_PROCESS = 4.0  # Decrease of the cost (chi-squared) that a correlation time must bring
_GAIN_OF_BOTH = 8.0  # The same for flicker noise and a process together
_MAX_PROFILE_LOSS = 3.84  # Increase of chi-squared at 95 % limits
_RIDGE = 1e-12  # Relative, for collinear columns


@dataclass(frozen=True)
class Solutions:
    """Squared parameters fitted to q Allan variances, shape (q, 5), in the order of the columns."""

    squares: Array
    times: Array  # (q,): T_B, s; NaN without a process
    cost: Array  # (q,): chi-squared, with the gains that the chosen terms must bring

    def model(self, number: int = 0) -> NoiseModel:
        """Return the noise model that was fitted to one of the curves, counted from 0."""
        N, F, G, K, R = np.sqrt(self.squares[number]).tolist()
        T_B = float(self.times[number])
        if F > 0.0 and G > 0.0:
            return NoiseModel(N=N, B=F, K=K, R=R, further=[GaussMarkov(G, T_B)])
        return NoiseModel(N=N, B=F or G, T_B=T_B if G > 0.0 else None, K=K, R=R)


class TermSearch:
    """Searches for the best set of noise terms of Allan variances at ``tau``, s, shape (m,).

    ``averaged``, (m,), are samples per cluster; ``times``, (t,), the T_B to try, s; rate in Hz.
    """

    def __init__(self, tau: Array, rate: float, averaged: Array, times: Array) -> None:
        self.times = times
        self._columns = np.empty((len(times), len(tau), TERMS))
        self._columns[:, :, WHITE] = rate / averaged
        units = {FLICKER: NoiseModel(B=1.0), WALK: NoiseModel(K=1.0), RAMP: NoiseModel(R=1.0)}
        for term, unit in units.items():
            self._columns[:, :, term] = unit.allan_variance(tau, rate)
        for i, T_B in enumerate(times.tolist()):
            self._columns[i, :, PROCESS] = NoiseModel(B=1.0, T_B=T_B).allan_variance(tau, rate)
        sets = [s for size in range(1, TERMS + 1) for s in combinations(range(TERMS), size)]
        self._sets = [np.array(s) for s in sets]
        self._masks = np.array([[term in s for term in range(TERMS)] for s in sets])
        # The decrease of chi-squared that a set of terms must bring beside the simplest
        of_process = np.where(self._masks[:, FLICKER], _GAIN_OF_BOTH, _GAIN_OF_PROCESS)
        self._gains = np.where(self._masks[:, PROCESS], of_process, 0.0)

    def design(self, T_B: float) -> Array:
        """Return the Allan variances of unit terms, (m, 5), with the tried T_B nearest to this."""
        if not np.isfinite(T_B):
            return self._columns[0]
        return self._columns[int(np.argmin(np.abs(np.log(self.times / T_B))))]

    def exclude(self, term: int) -> "TermSearch":
        """Return the same search, limited to sets of terms without this one."""
        search = copy(self)
        search._gains = np.where(self._masks[:, term], np.inf, self._gains)
        return search

    def find_limits(
        self, term: int, grid: Array, variance: Array, whitening: Array
    ) -> tuple[float, float]:
        """Return 95 % limits of a term's squared parameter in ``grid``, by profile likelihood."""
        curves = variance - grid[:, None] * self._columns[0, :, term]
        cost = self.exclude(term).solve(curves, whitening).cost
        likely = grid[cost <= cost.min() + _MAX_PROFILE_LOSS]
        return float(likely[0]), float(likely[-1])

    def solve(self, variances: Array, whitening: Array) -> Solutions:
        """Fit terms to Allan variances (q, m); ``whitening``, (r, m), makes errors independent."""
        target = variances @ whitening.T
        columns = whitening @ self._columns
        size = np.linalg.norm(columns, axis=1)
        columns /= size[:, None]
        gram = np.swapaxes(columns, 1, 2) @ columns
        inverses = np.zeros((len(self.times), len(self._sets), TERMS, TERMS))
        for i, chosen in enumerate(self._sets):
            part = gram[:, chosen[:, None], chosen] + _RIDGE * np.eye(len(chosen))
            inverses[:, i, chosen[:, None], chosen] = np.linalg.inv(part)
        products = target @ columns
        squares, cost = np.zeros((len(variances), TERMS)), (target**2).sum(axis=1)
        index = np.full(len(variances), -1)
        _solve_all(inverses, products, self._masks, self._gains, squares, index, cost)
        times = np.where(index >= 0, self.times[index], np.nan)
        return Solutions(squares / size[np.maximum(index, 0)], times, cost)


@njit(cache=True)
def _solve_all(
    inverses: Array,
    products: Array,
    masks: NDArray[np.bool_],
    gains: Array,
    squares: Array,
    index: NDArray[np.int64],
    cost: Array,
) -> None:
    """Set squares, index of the time (-1: no process) and cost of each curve.

    They begin with 0, -1 and the cost without any term. Arrays are made and copied outside, where
    numba need not compile it.
    """
    times, curves, terms = products.shape
    trial = np.empty(TERMS)
    for q in range(curves):
        total = cost[q]
        for s in range(len(masks)):
            mask = masks[s]
            for t in range(times if mask[PROCESS] else 1):
                explained, positive = 0.0, True
                for i in range(terms):
                    trial[i] = 0.0
                    if mask[i]:
                        for j in range(terms):
                            if mask[j]:
                                trial[i] += inverses[t, s, i, j] * products[t, q, j]
                        if trial[i] <= 0.0:
                            positive = False
                            break
                        explained += trial[i] * products[t, q, i]
                if positive and total - explained + gains[s] < cost[q]:
                    cost[q] = total - explained + gains[s]
                    index[q] = t if mask[PROCESS] else -1
                    for i in range(terms):
                        squares[q, i] = trial[i]
