"""Search for deterministic signals: forward selection by likelihood ratios, then elimination.

Noise fitted to a signal hides it: slow signals are also searched above the noise as extrapolated
from higher frequencies. A candidate is tested by the likelihood ratio of the models with and
without it, the noise refitted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from imubench_pipeline.estimators.deterministic.ordinates import Fit, Ordinates
from imubench_pipeline.estimators.deterministic.regressors import Regressor
from imubench_pipeline.estimators.deterministic.scores import (
    FALSE_ALARM_PROBABILITY,
    MIN_CYCLES,
    Gain,
    find_best_scores,
    list_restarts,
)
from imubench_pipeline.typing import Array

MAX_REGRESSORS = 16  # besides restarts; a log with more of them has telegraph noise
_HELD_OUT_ORDINATES = 16  # lowest ordinates to which the noise is extrapolated instead of fitted
_MIN_SCORE = 0.5  # of the threshold; weaker candidates are not tested with refitted noise
_MIN_KEPT_GAIN = 12.0  # of a regressor in the final fit, given the regressors found later


@dataclass(frozen=True)
class SearchResult:
    """Result of a search."""

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
        last = len(better.regressors) - 1
        moved = polish(ordinates, better.regressors, last, better.density)
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
    """Optimise the place, time constant or frequency of one regressor, in given noise."""
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
