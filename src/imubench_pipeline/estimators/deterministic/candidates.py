"""What may be in a log beside its noise: candidates, and what each adds with the noise fitted anew.

Noise that is fitted to a course hides it. So courses are looked for above the noise as fitted, and
slow ones above the noise as carried on from higher frequencies too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from imubench_pipeline.estimators.deterministic.ordinates import Fit, Ordinates
from imubench_pipeline.estimators.deterministic.regressors import Kind, Regressor
from imubench_pipeline.estimators.deterministic.scores import (
    FEWEST_CYCLES,
    Gain,
    Score,
    best_scores,
)
from imubench_pipeline.typing import Array

_HELD_OUT = 16
"""Lowest ordinates that a noise is carried on to, not fitted to."""

_NEAR_A_PAUSE = 2.0
"""Blocks from the end of a pause to a step that may be in it."""

_NEARLY = 6.0
"""Below the threshold by so much, a candidate is still judged by the noise fitted anew."""

_SLOW: tuple[Kind, ...] = ("exponential", "sinusoid")
_SEEN = 6.0
"""Gain from which a slow course is judged: noise fitted without it hides the most of it."""

_BESIDE = (3, 16)
"""Ordinates on either side of a sinusoid that tell how far the noise is from its model there."""

SAFETY: dict[Kind, float] = {
    "step": 1.0,
    "restart": 1.0,
    "exponential": 1.15,
    "sinusoid": 1.15,
    "ramp": 1.15,
    "pulse": 1.0,
}
"""Times the threshold for known noise: that of few ordinates is known badly itself."""


def find_candidates(ordinates: Ordinates, fit: Fit) -> list[tuple[Score, Array]]:
    """Return the candidates that may pass, each with the density of the noise it stands out of.

    Parameters
    ----------
    ordinates : Ordinates
    fit : Fit
        What is there already.
    """
    scores: dict[Regressor, tuple[Score, Array]] = {}
    pauses = restarts(ordinates)
    for seen in best_scores(ordinates, fit, fit.density):
        score = _at_its_pause(seen, pauses, fit)
        slow = score.regressor.kind in _SLOW
        if score.gain > (_SEEN if slow else score.threshold - _NEARLY):
            scores[score.regressor] = score, fit.density
    carried_on = ordinates.carried_on(fit, _HELD_OUT)
    for score in best_scores(ordinates, fit, carried_on, smooth=True):
        if score.gain > score.threshold:
            scores[score.regressor] = score, carried_on
    return list(scores.values())


def restarts(ordinates: Ordinates) -> tuple[Regressor, ...]:
    """Return a step at each pause of a log."""
    return tuple(
        Regressor("restart", number, middle, length)
        for number, part in enumerate(ordinates.means.parts)
        for middle, length in part.pauses
    )


def lies_at_pause(regressor: Regressor, pause: Regressor) -> bool:
    """Return whether a step lies in a pause, or so near that it may be one in it."""
    near = abs(regressor.where - pause.where) <= 0.5 * pause.length + _NEAR_A_PAUSE
    return regressor.part == pause.part and near


def _at_its_pause(score: Score, pauses: Sequence[Regressor], fit: Fit) -> Score:
    """Put a step that lies in a pause at the pause, over which the means are no step."""
    if score.regressor.kind == "step":
        for pause in pauses:
            if pause not in fit.regressors and lies_at_pause(score.regressor, pause):
                return replace(score, regressor=pause)
    return score


def with_candidate(
    ordinates: Ordinates, fit: Fit, score: Score, density: Array
) -> tuple[Fit, float]:
    """Return the fit with a further regressor, and twice the log likelihood that it adds.

    Parameters
    ----------
    ordinates : Ordinates
    fit : Fit
    score : Score
        The regressor.
    density : ndarray, shape (k,)
        Of the noise that it stood out of, SI²/Hz.
    """
    regressors = (*fit.regressors, score.regressor)
    if density is not fit.density:
        # Far above the noise, what a frequency beside the right one leaves is much.
        regressors = polish(ordinates, regressors, len(regressors) - 1, density)
    tried = ordinates.fit(regressors, fit.density, fit.noise.terms)
    gain = 2.0 * (tried.log_likelihood - fit.log_likelihood)
    if score.regressor.kind == "sinusoid":
        gain /= _level_beside(ordinates, tried, regressors[-1])
    return tried, gain


def polish(
    ordinates: Ordinates, regressors: Sequence[Regressor], which: int, density: Array
) -> tuple[Regressor, ...]:
    """Move the place, time constant or frequency of a regressor to where it fits best.

    Parameters
    ----------
    ordinates : Ordinates
    regressors : sequence of Regressor
    which : int
        Of them, the one that is moved.
    density : ndarray, shape (k,)
        Of the noise, SI²/Hz.
    """
    best = regressors[which]
    if best.kind in ("ramp", "pulse", "restart"):
        return tuple(regressors)
    n = ordinates.sizes[best.part]
    step = {"step": 0.5, "exponential": 0.12 * best.where, "sinusoid": 0.125 / n}[best.kind]
    least = FEWEST_CYCLES / n if best.kind == "sinusoid" else 0.0
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


def _level_beside(ordinates: Ordinates, fit: Fit, sinusoid: Regressor) -> float:
    """Return the mean power of the ordinates beside a sinusoid over that of the model, at least 1.

    A process that swings is a broad hump of the spectrum, and no sinusoid.
    """
    of_part = ordinates.part(sinusoid.part)
    ratio = fit.residual[of_part] ** 2 * ordinates.weights(fit.density)[of_part]
    centre = 2.0 * sinusoid.where * ordinates.sizes[sinusoid.part]
    away = np.abs(np.arange(1, len(ratio) + 1) - centre)
    beside = ratio[(away >= _BESIDE[0]) & (away <= _BESIDE[1])]
    if not len(beside):
        return 1.0
    # Two standard errors of the mean of as many chi-squared ordinates are chance.
    return max(float(beside.mean()) - 2.0 * float(np.sqrt(2.0 / len(beside))), 1.0)
