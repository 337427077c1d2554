"""The search for what is no noise: forward selection by likelihood ratios, then elimination.

Noise and regressors compete: a step fitted by noise alone makes its random walk larger. So a
candidate that stands out of the noise as fitted, or as carried on from higher frequencies, is
judged by the likelihood with it, the noise fitted anew, over that without. What a random walk hides
wholly is seen where it takes the place of the walk. What is not told apart from the walk by that is
not taken, but is its rival.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from imubench_pipeline.estimators.deterministic.candidates import (
    SAFETY,
    but,
    candidates,
    polished,
    with_candidate,
)
from imubench_pipeline.estimators.deterministic.contest import Rival, anew_at_pauses, rival_of_walk
from imubench_pipeline.estimators.deterministic.ordinates import Fit, Ordinates
from imubench_pipeline.estimators.deterministic.regressors import Kind, Regressor
from imubench_pipeline.estimators.deterministic.scores import Gain

MOST = 16
"""Regressors that are taken; a log with more steps is one of telegraph noise."""

_KEPT: dict[Kind, float] = {
    "step": 16.0,
    "restart": 4.0,  # its place is known
    "exponential": 12.0,
    "sinusoid": 18.0,
    "ramp": 8.0,
    "pulse": 12.0,
}
"""Gain that a regressor keeps at least, beside those that were found after it."""

_SURE = 3.0
"""Times that: the noise need not be fitted anew to know it."""


@dataclass(frozen=True)
class Searched:
    """What a search found.

    Attributes
    ----------
    fit : Fit
        Noise and regressors; pulses and ramps among them.
    without : Fit
        Noise alone.
    gains : tuple of float
        For each regressor, twice the log likelihood that is lost without it.
    many : bool
        There are `MOST` or more.
    rival : Rival or None
        Explains the log about as well without a random walk.
    """

    fit: Fit
    without: Fit
    gains: tuple[float, ...]
    many: bool
    rival: Rival | None = None


def search(ordinates: Ordinates) -> Searched:
    """Find the regressors that noise does not explain."""
    without = ordinates.fit(())
    fit = without
    rival: Rival | None = None
    while len(fit.regressors) < MOST:
        taken = _next(ordinates, fit)
        if taken is None:
            # Steps at the pauses that hide in a slow process together, none being large.
            together = anew_at_pauses(ordinates, fit)
            if together is not None and together.better:
                taken = together.fit
        if taken is None:
            rival = rival_of_walk(ordinates, fit)
            if rival is None or not rival.better:
                break
            taken = ordinates.fit(rival.fit.regressors, rival.fit.density)
        fit = taken
    if len(fit.regressors) >= MOST:
        return Searched(fit, without, (), True)
    if len(fit.regressors) > 1:
        fit = _all_polished(ordinates, fit)
    fit, gains = _eliminated(ordinates, fit)
    alike = rival if rival is not None and rival.as_good else None
    return Searched(fit, without, gains, False, alike)


def again(ordinates: Ordinates, searched: Searched, regressors: Sequence[Regressor]) -> Searched:
    """Return a search with its regressors moved, those left out that are needless then."""
    fit, gains = _eliminated(ordinates, ordinates.fit(regressors, searched.fit.density))
    return replace(searched, fit=fit, gains=gains)


def _next(ordinates: Ordinates, fit: Fit) -> Fit | None:
    """Return the fit with the best further regressor, or None where none is to be taken."""
    best: Fit | None = None
    most = 0.0
    for score, density in candidates(ordinates, fit):
        tried, gain = with_candidate(ordinates, fit, score, density)
        beyond = gain - score.threshold * SAFETY[score.regressor.kind]
        if beyond > most:
            best, most = tried, beyond
    if best is None:
        return None
    moved = polished(ordinates, best.regressors, len(best.regressors) - 1, best.density)
    return ordinates.fit(moved, best.density)


def _all_polished(ordinates: Ordinates, fit: Fit) -> Fit:
    """Polish each regressor in turn beside all others."""
    moved = fit.regressors
    for which in range(len(moved)):
        moved = polished(ordinates, moved, which, fit.density)
    return ordinates.fit(moved, fit.density)


def _eliminated(ordinates: Ordinates, fit: Fit) -> tuple[Fit, tuple[float, ...]]:
    """Leave out regressors that the others made needless; return what each of the rest gains."""
    while True:
        gains = [_lost_without(ordinates, fit, i) for i in range(len(fit.regressors))]
        margins = [gain - _KEPT[x.kind] for x, gain in zip(fit.regressors, gains, strict=True)]
        if not margins or min(margins) > 0.0:
            return fit, tuple(gains)
        fit = ordinates.fit(but(fit.regressors, int(np.argmin(margins))), fit.density)


def _lost_without(ordinates: Ordinates, fit: Fit, which: int) -> float:
    """Return twice the log likelihood that is lost without a regressor."""
    regressor = fit.regressors[which]
    others = but(fit.regressors, which)
    for_this_noise = Gain(ordinates, others, fit.density, regressor.part).of(regressor)
    if len(others) > 2 and for_this_noise > _SURE * _KEPT[regressor.kind]:
        return for_this_noise
    without = ordinates.fit(others, fit.density)
    return 2.0 * (fit.log_likelihood - without.log_likelihood)
