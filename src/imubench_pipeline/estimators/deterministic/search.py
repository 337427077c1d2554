"""Search for deterministic signals: forward selection by likelihood ratios, then elimination.

Noise fitted to a signal hides it: slow signals are also searched above the noise as extrapolated
from higher frequencies. A candidate is tested by the likelihood ratio of the models with and
without it, the noise refitted. Candidates are found by matched filters at all places at once: the
numerator of a step at place t is sum_k w_k r_k s_k(t) with s_k(t) = -sqrt(2 / n) sin(pi k t / n) /
(2 sin(pi k / 2 n)), a sine transform over k; the denominators are cosine transforms. The columns of
other regressors are projected out.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import scipy.fft
from scipy.special import chdtri

from imubench_pipeline.estimators.deterministic.means import Means
from imubench_pipeline.estimators.deterministic.ordinates import (
    Fit,
    Ordinates,
    Regressor,
    RegressorKind,
)
from imubench_pipeline.typing import Array

FALSE_ALARM_PROBABILITY = 0.001
"""Of a kind in a log of noise; `false_alarms` and `steps_and_drift` have their sum."""

MIN_CYCLES, _MAX_CYCLES, _CYCLE_STEP = 0.25, 64, 0.25
"""Periods in a part that are tried: from a day in a log of six hours. Fewer are a ramp."""

_EDGE_BLOCKS = 3  # blocks at the ends of a part in which no step is searched
_PAUSE_MARGIN = 2.0  # blocks from a pause, in which a step belongs to it
_TIME_CONSTANTS = np.geomspace(1 / 200, 1 / 2, 24)  # that are tried, over the part
_EXPONENTIAL_ORDINATES = 2048  # number of lowest ordinates in which exponentials are searched
_MIN_INDEPENDENT_POWER = 1e-3  # fraction of a regressor's power; less is rounding error


@dataclass(frozen=True)
class Score:
    """The best regressor of a kind, with its gain."""

    regressor: Regressor
    gain: float  # twice the log likelihood that it adds, for given noise
    threshold: float  # least gain that is not noise (`FALSE_ALARM_PROBABILITY`)


class Gain:
    """Computes twice the log likelihood that one more regressor adds.

    It is for one part of the log; the density of the noise is given.
    """

    def __init__(
        self, ordinates: Ordinates, regressors: Sequence[Regressor], density: Array, part: int
    ) -> None:
        of_part = ordinates.part(part)
        self._size = ordinates.sizes[part]
        self.weight = ordinates.weights(density)[of_part]
        others = [row for x in regressors if x.part == part for row in ordinates.columns(x)]
        # A basis of them that is orthonormal in the weighted product, shape (q, k).
        self.basis = np.empty((0, len(self.weight)))
        if others:
            root = np.sqrt(self.weight)
            rows = np.linalg.qr((np.array(others) * root).T)[0].T
            self.basis = rows / np.where(root > 0.0, root, 1.0)
        coefficient = ordinates.coefficient[of_part]
        self.residual = coefficient - (self.basis @ (self.weight * coefficient)) @ self.basis

    def of(self, regressor: Regressor) -> float:
        """Return twice the log likelihood that a regressor adds."""
        return float(self.of_columns(regressor.coefficients(self._size)[None])[0])

    def of_columns(self, columns: Array) -> Array:
        """Return the gain of each of c candidates; a candidate has q columns of k ordinates."""
        lowest = slice(columns.shape[2])
        weighted = columns * self.weight[lowest]
        whole = weighted @ np.swapaxes(columns, 1, 2)
        projected = weighted @ self.basis[:, lowest].T
        left = whole - projected @ np.swapaxes(projected, 1, 2)
        target = weighted @ self.residual[lowest]
        # 0 where the other regressors contain a candidate.
        good = np.linalg.det(left) > _MIN_INDEPENDENT_POWER * np.linalg.det(whole)
        left[~good] = np.eye(left.shape[1])
        solved = np.linalg.solve(left, target[:, :, None])[:, :, 0]
        return np.where(good, np.sum(target * solved, axis=1), 0.0)

    def of_steps(self) -> tuple[Array, float]:
        """Return the gains of steps before each of blocks 1 to n - 1; how many are independent."""
        n = self._size
        k = np.arange(1, n)
        slope = -math.sqrt(2.0 / n) / (2.0 * np.sin(np.pi * k / (2.0 * n)))
        # The sums of sin(pi k t / n) over k, for t = 1 ... n - 1, are half a DST-I.
        rows = slope * self.weight * np.concatenate((self.residual[None], self.basis))
        sums = 0.5 * scipy.fft.dst(rows, type=1, axis=1)
        power = slope**2 * self.weight
        turned = scipy.fft.fft(np.concatenate(([0.0], power))).real
        whole = 0.5 * (turned[0] - turned[1:])
        left = whole - np.sum(sums[1:] ** 2, axis=0)
        good = left > _MIN_INDEPENDENT_POWER * whole
        gains = np.where(good, sums[0] ** 2 / np.where(good, left, 1.0), 0.0)
        gains[: _EDGE_BLOCKS - 1] = gains[n - _EDGE_BLOCKS :] = 0.0
        # The correlation of neighbouring scores gives the number of independent places.
        alike = float(np.sum(power * np.cos(np.pi * k / n)) / np.sum(power))
        return gains, (n - 1) * math.sqrt(2.0 * max(1.0 - alike, 0.0)) / math.pi


def find_best_scores(
    ordinates: Ordinates, fit: Fit, density: Array, *, smooth: bool = False
) -> Iterator[Score]:
    """Yield the best additional regressor by kind and part; ``smooth`` excludes steps."""
    chance = FALSE_ALARM_PROBABILITY / len(ordinates.sizes)
    restarts = list_restarts(ordinates.means)
    for part, n in enumerate(ordinates.sizes):
        gain = Gain(ordinates, fit.regressors, density, part)
        if not smooth:
            gains, places = gain.of_steps()
            best = int(np.argmax(gains))
            step = Regressor("step", part, best + 1.0)
            for x in restarts:  # a step in or beside a pause belongs to it
                if x.part == part and abs(best + 1.0 - x.where) <= 0.5 * x.length + _PAUSE_MARGIN:
                    step = x
                    break
            yield Score(step, float(gains[best]), compute_threshold(chance, places))
        for kind, where, columns in _tabulate(n):
            gains = gain.of_columns(columns)
            best = int(np.argmax(gains))
            candidate = Regressor(kind, part, float(where[best]))
            # Half of the tried time constants and periods are independent.
            yield Score(candidate, float(gains[best]), compute_threshold(chance, 0.5 * len(where)))


def list_restarts(means: Means) -> list[Regressor]:
    """Return a step as regressor for each pause of the log."""
    return [
        Regressor("step", number, *pause)
        for number, part in enumerate(means.parts)
        for pause in part.pauses
    ]


def compute_threshold(chance: float, places: float) -> float:
    """Return the threshold that the largest gain of noise exceeds with probability ``chance``.

    ``places`` is the number of independent places. A Gaussian process crosses a level z upwards at
    the rate exp(-z^2 / 2), and the gain is z^2 (S. O. Rice, Bell Syst. Tech. J. 24, 1945).
    """
    return 2.0 * math.log(max(places, 1.0) / chance)


@lru_cache(maxsize=8)
def _tabulate(n: int) -> list[tuple[RegressorKind, Array, Array]]:
    """Return the slow signals that are tried: their places, and coefficients, (c, q, k)."""
    times = np.maximum(_TIME_CONSTANTS * n, 2.0)
    decays = [
        Regressor("exponential", 0, t).coefficients(n)[:, :_EXPONENTIAL_ORDINATES] for t in times
    ]
    most = min(_MAX_CYCLES, n // 8)
    cycles = np.arange(MIN_CYCLES, most + 1e-9, _CYCLE_STEP)
    # The low ordinates of a slow signal are the same for fewer, longer blocks.
    few = min(n, 8 * most)
    waves = [
        math.sqrt(n / few) * Regressor("sinusoid", 0, c / few).coefficients(few)[:, : 4 * most]
        for c in cycles
    ]
    return [
        ("exponential", times, np.array(decays)),
        ("sinusoid", cycles / n, np.array(waves)),
        ("ramp", np.zeros(1), Regressor("ramp", 0).coefficients(n)[None]),
    ]


MAX_REGRESSORS = 16  # besides restarts; a log with more of them has telegraph noise
_HELD_OUT_ORDINATES = 16  # lowest ordinates to which the noise is extrapolated instead of fitted
_MIN_SCORE = 0.5  # share of the threshold; weaker candidates are not tested with refitted noise
_MIN_KEPT_GAIN = 12.0  # least gain of a regressor in the final fit, given later regressors


@dataclass(frozen=True)
class SearchResult:
    """Result of the search for deterministic signals."""

    fit: Fit  # noise and regressors; ramps among them
    gains: tuple[float, ...]  # twice the log likelihood that is lost without each regressor
    many: bool  # there are `MAX_REGRESSORS` or more


def search_signals(ordinates: Ordinates) -> SearchResult:
    """Find the deterministic signals that noise does not explain."""
    fit = ordinates.fit(())
    while not _is_full(fit):
        better: Fit | None = None
        most = 0.0
        for signals, threshold, density in _find_candidates(ordinates, fit):
            regressors = (*fit.regressors, *signals)
            if density is not fit.density:
                # A strong signal with a slightly wrong frequency leaves a large residual.
                regressors = polish(ordinates, regressors, len(regressors) - 1, density)
            tried = ordinates.fit(regressors, fit.density)
            gain = 2.0 * (tried.log_likelihood - fit.log_likelihood)
            if gain - threshold > most:
                better, most = tried, gain - threshold
        if better is None:
            break
        moved = polish(ordinates, better.regressors, len(better.regressors) - 1, better.density)
        fit = ordinates.fit(moved, better.density)
    if _is_full(fit):
        return SearchResult(fit, (), True)
    if len(fit.regressors) > 1:
        moved = fit.regressors
        for which in range(len(moved)):
            moved = polish(ordinates, moved, which, fit.density)
        fit = ordinates.fit(moved, fit.density)
    while True:  # remove regressors that others made unnecessary
        rest = [leave_out(fit.regressors, which) for which in range(len(fit.regressors))]
        fits = [ordinates.fit(others, fit.density) for others in rest]
        gains = [2.0 * (fit.log_likelihood - without.log_likelihood) for without in fits]
        if min(gains, default=np.inf) > _MIN_KEPT_GAIN:
            return SearchResult(fit, tuple(gains), False)
        fit = fits[int(np.argmin(gains))]


def _is_full(fit: Fit) -> bool:
    return sum(not regressor.length for regressor in fit.regressors) >= MAX_REGRESSORS


def _find_candidates(
    ordinates: Ordinates, fit: Fit
) -> Iterator[tuple[tuple[Regressor, ...], float, Array]]:
    """Yield signals to add to a fit, their threshold, and the density that they were found in."""
    # A walk hides a new bias after each of several pauses, if they are tested one by one.
    pauses = tuple(x for x in list_restarts(ordinates.means) if x not in fit.regressors)
    if len(pauses) > 1:
        yield pauses, float(chdtri(len(pauses), FALSE_ALARM_PROBABILITY)), fit.density
    extrapolated = ordinates.extrapolate_density(fit, _HELD_OUT_ORDINATES)
    for density, smooth in ((fit.density, False), (extrapolated, True)):
        for score in find_best_scores(ordinates, fit, density, smooth=smooth):
            if score.gain > _MIN_SCORE * score.threshold:
                yield (score.regressor,), score.threshold, density


def polish(
    ordinates: Ordinates, regressors: Sequence[Regressor], which: int, density: Array
) -> tuple[Regressor, ...]:
    """Optimise place, time constant or frequency of regressor ``which``; return all regressors."""
    best = regressors[which]
    n = ordinates.sizes[best.part]
    steps = {"step": 0.5, "exponential": 0.12 * best.where, "sinusoid": 0.125 / n}
    if best.kind not in steps or best.length:
        return tuple(regressors)
    step = steps[best.kind]
    least = MIN_CYCLES / n if best.kind == "sinusoid" else 0.0
    gain = Gain(ordinates, leave_out(regressors, which), density, best.part)
    most = gain.of(best)
    for _ in range(5):
        for side in (-1.0, 1.0):
            moved = replace(best, where=max(best.where + side * step, least))
            moved_gain = gain.of(moved)
            if moved_gain > most:
                best, most = moved, moved_gain
        step *= 0.5
    return (*regressors[:which], best, *regressors[which + 1 :])


def leave_out(regressors: Sequence[Regressor], left_out: int) -> tuple[Regressor, ...]:
    """Return all regressors but one."""
    return tuple(x for i, x in enumerate(regressors) if i != left_out)
