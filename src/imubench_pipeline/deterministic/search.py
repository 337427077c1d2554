"""The search for what is no noise: forward selection by likelihood ratios, then elimination.

Noise and regressors compete: a step fitted by noise alone makes its random walk larger. So a
candidate that stands out of the noise as fitted, or as carried on from higher frequencies, is
judged by the likelihood with it, the noise fitted anew, over that without. What is not told apart
from a random walk by that is not taken.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.deterministic.ordinates import Fit, Ordinates
from imubench_pipeline.deterministic.regressors import Kind, Regressor
from imubench_pipeline.deterministic.scores import Gain, Score, best_scores

Array = NDArray[np.float64]

MOST = 16
"""Regressors that are taken; a log with more steps is one of telegraph noise."""

_HELD_OUT = 16
"""Lowest ordinates that a noise is carried on to, not fitted to."""

_NEARLY = 6.0
"""Below the threshold by so much, a candidate is still judged by the noise fitted anew."""

_SLOW: tuple[Kind, ...] = ("exponential", "sinusoid")
_SEEN = 6.0
"""Gain from which a slow course is judged: noise fitted without it hides the most of it."""

_UNDECIDED = 6.0
"""Below it by so much after that, it is not told from noise, nor noise from it."""

_BESIDE = (3, 16)
"""Ordinates on either side of a sinusoid that tell how far the noise is from its model there."""

_SAFETY: dict[Kind, float] = {
    "step": 1.0,
    "exponential": 1.15,
    "sinusoid": 1.15,
    "ramp": 1.15,
    "pulse": 1.0,
}
"""Times the threshold for known noise: that of few ordinates is known badly itself."""

_KEPT: dict[Kind, float] = {
    "step": 16.0,
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
    undecided : Fit or None
        With a further regressor that explains the log nearly as well as noise does.
    many : bool
        There are `MOST` or more.
    """

    fit: Fit
    without: Fit
    gains: tuple[float, ...]
    undecided: Fit | None
    many: bool


def search(ordinates: Ordinates) -> Searched:
    """Find the regressors that noise does not explain.

    Parameters
    ----------
    ordinates : Ordinates
    """
    without = ordinates.fit(())
    fit = without
    undecided: Fit | None = None
    while len(fit.regressors) < MOST:
        taken, undecided = _next(ordinates, fit)
        if taken is None:
            break
        fit = taken
    if len(fit.regressors) >= MOST:
        return Searched(fit, without, (), None, True)
    if len(fit.regressors) > 1:
        fit = _all_polished(ordinates, fit)
    fit, gains = _eliminated(ordinates, fit)
    return Searched(fit, without, gains, undecided, False)


def again(ordinates: Ordinates, searched: Searched, regressors: Sequence[Regressor]) -> Searched:
    """Return a search with its regressors moved, those left out that are needless then.

    Parameters
    ----------
    ordinates : Ordinates
    searched : Searched
    regressors : sequence of Regressor
    """
    fit, gains = _eliminated(ordinates, ordinates.fit(regressors, searched.fit.density))
    return replace(searched, fit=fit, gains=gains)


def _next(ordinates: Ordinates, fit: Fit) -> tuple[Fit | None, Fit | None]:
    """Return the fit with the best further regressor, or None and the best that was not taken."""
    best: Fit | None = None
    most = 0.0
    nearly: Fit | None = None
    for score in _candidates(ordinates, fit):
        wanted = score.threshold * _SAFETY[score.regressor.kind]
        tried = ordinates.fit((*fit.regressors, score.regressor), fit.density)
        gain = 2.0 * (tried.log_likelihood - fit.log_likelihood)
        if score.regressor.kind == "sinusoid":
            gain /= _level_beside(ordinates, tried, score.regressor)
        if gain - wanted > most:
            best, most = tried, gain - wanted
        elif gain > wanted - _UNDECIDED and score.regressor.kind != "pulse":
            nearly = tried
    if best is None:
        return None, nearly
    moved = _polished(ordinates, best.regressors, len(best.regressors) - 1, best.density)
    return ordinates.fit(moved, best.density), None


def _level_beside(ordinates: Ordinates, fit: Fit, sinusoid: Regressor) -> float:
    """Return the mean power of the ordinates beside a sinusoid over that of the model, at least 1.

    A process that swings is a broad hump of the spectrum, and no sinusoid.
    """
    here = ordinates.part(sinusoid.part)
    ratio = fit.residual[here] ** 2 * ordinates.weights(fit.density)[here]
    centre = 2.0 * sinusoid.where * ordinates.sizes[sinusoid.part]
    away = np.abs(np.arange(1, len(ratio) + 1) - centre)
    beside = ratio[(away >= _BESIDE[0]) & (away <= _BESIDE[1])]
    if not len(beside):
        return 1.0
    # Two standard errors of the mean of as many chi-squared ordinates are chance.
    return max(float(beside.mean()) - 2.0 * float(np.sqrt(2.0 / len(beside))), 1.0)


def _candidates(ordinates: Ordinates, fit: Fit) -> list[Score]:
    """Return the candidates that may pass: one of a kind and noise, none twice."""
    found: dict[Regressor, Score] = {}
    for score in best_scores(ordinates, fit, fit.density):
        slow = score.regressor.kind in _SLOW
        if score.gain > (_SEEN if slow else score.threshold - _NEARLY):
            found[score.regressor] = score
    carried_on = ordinates.carried_on(fit, _HELD_OUT)
    for score in best_scores(ordinates, fit, carried_on, smooth=True):
        if score.gain > score.threshold:
            found[score.regressor] = score
    return list(found.values())


def _polished(
    ordinates: Ordinates, regressors: Sequence[Regressor], which: int, density: Array
) -> tuple[Regressor, ...]:
    """Move the place, time constant or frequency of a regressor to where it fits best."""
    best = regressors[which]
    if best.kind in ("ramp", "pulse"):
        return tuple(regressors)
    n = ordinates.sizes[best.part]
    step = {"step": 0.5, "exponential": 0.12 * best.where, "sinusoid": 0.125 / n}[best.kind]
    gain = Gain(ordinates, _but(regressors, which), density, best.part)
    most = gain.of(best)
    for _ in range(5):
        for side in (-1.0, 1.0):
            moved = replace(best, where=best.where + side * step)
            there = gain.of(moved)
            if there > most:
                best, most = moved, there
        step *= 0.5
    return (*regressors[:which], best, *regressors[which + 1 :])


def _all_polished(ordinates: Ordinates, fit: Fit) -> Fit:
    """Polish each regressor in turn beside all others."""
    moved = fit.regressors
    for which in range(len(moved)):
        moved = _polished(ordinates, moved, which, fit.density)
    return ordinates.fit(moved, fit.density)


def _eliminated(ordinates: Ordinates, fit: Fit) -> tuple[Fit, tuple[float, ...]]:
    """Leave out regressors that the others made needless; return what each of the rest gains."""
    while True:
        gains = [_lost_without(ordinates, fit, i) for i in range(len(fit.regressors))]
        margins = [gain - _KEPT[x.kind] for x, gain in zip(fit.regressors, gains, strict=True)]
        if not margins or min(margins) > 0.0:
            return fit, tuple(gains)
        fit = ordinates.fit(_but(fit.regressors, int(np.argmin(margins))), fit.density)


def _lost_without(ordinates: Ordinates, fit: Fit, which: int) -> float:
    """Return twice the log likelihood that is lost without a regressor."""
    regressor = fit.regressors[which]
    others = _but(fit.regressors, which)
    for_this_noise = Gain(ordinates, others, fit.density, regressor.part).of(regressor)
    if len(others) > 2 and for_this_noise > _SURE * _KEPT[regressor.kind]:
        return for_this_noise
    without = ordinates.fit(others, fit.density)
    return 2.0 * (fit.log_likelihood - without.log_likelihood)


def _but(regressors: Sequence[Regressor], left_out: int) -> tuple[Regressor, ...]:
    return tuple(x for i, x in enumerate(regressors) if i != left_out)
