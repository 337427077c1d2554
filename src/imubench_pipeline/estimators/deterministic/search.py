"""The search for what is no noise: forward selection by likelihood ratios, then elimination.

Noise and regressors compete: a step fitted by noise alone makes its random walk larger, and noise
that is fitted to a course hides it. So courses are looked for above the noise as fitted, and slow
ones above the noise as carried on from higher frequencies too. A candidate that stands out is
judged by the likelihood with it, the noise fitted anew, over that without. What a random walk hides
wholly is seen where it takes the place of the walk. What is not told apart from the walk by that is
not taken, but is its rival.

So it is judged whether a course explains a log better than its random walk does, or about as well.
A walk and a course are two models of the same rise towards low frequencies. They are compared as
such: the noise without a walk and the course in its stead, over the noise with the walk. A course
that leaves a walk needed beside it says nothing against the walk. What the course gains has the
choice of its kind, place, time constant or period in it, and so must come near the threshold that
counts them; the walk's own parameter, one and never looked for, counts for nothing.

A sensor that began anew at the pauses of a log has another bias after each. Their places are known
beforehand, and their number is what counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from imubench_pipeline.estimators.deterministic.ordinates import NOISE, Fit, Ordinates
from imubench_pipeline.estimators.deterministic.regressors import Kind, Regressor
from imubench_pipeline.estimators.deterministic.scores import (
    FALSE_ALARM,
    FEWEST_CYCLES,
    Gain,
    Score,
    best_scores,
)
from imubench_pipeline.estimators.whittle import Terms
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

_NEAR = 4.0
"""Below its threshold by so much, in twice the log likelihood, a course is about as good."""

_FITTED_ANEW = 8.0
"""What the noise may add to a gain as it is fitted anew: what is below by more is not tried."""

_AS_GOOD = 0.5
"""AIC by which steps at known places may be worse and still be as good."""

_WITHOUT_WALK = Terms("NF", NOISE.gauss_markov)

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


def find_candidates(ordinates: Ordinates, fit: Fit) -> list[tuple[Score, Array]]:
    """Return what may pass beside a fit, each with the density of the noise it stands out of."""
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

    ``density``, shape (k,), is that of the noise that it stood out of, SI²/Hz.
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
    """Move the place, time constant or frequency of one regressor to where it fits best.

    ``density``, shape (k,), is that of the noise, SI²/Hz.
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


@dataclass(frozen=True)
class Rival:
    """What explains a log without a random walk, by one course more or by steps at its pauses."""

    fit: Fit
    courses: tuple[Regressor, ...]  # the course, or the steps
    beyond: float
    """Twice the log likelihood over that of the noise with the walk, less what the search for the
    course makes of noise alone."""
    near: float = _NEAR  # below 0 by so much, the course is about as good

    @property
    def better(self) -> bool:
        """Whether the course is to be taken, and the walk seen beside it anew."""
        return self.beyond > 0.0

    @property
    def as_good(self) -> bool:
        """Whether the log does not tell the walk from the course."""
        return self.beyond > -self.near


def rival_of_walk(ordinates: Ordinates, fit: Fit) -> Rival | None:
    """Return the course that explains a log best in the place of a random walk.

    Steps, also at all pauses together, warm-ups and periodic drift are tried, beside what was found
    so far. A ramp is a term of the noise models, whose choice weighs it against a walk itself. None
    where there is no walk, or no course that may be as good.
    """
    if fit.noise.parameter("K") == 0.0:
        return None
    bare = ordinates.fit(fit.regressors, fit.density, _WITHOUT_WALK)
    walk = 2.0 * (fit.log_likelihood - bare.log_likelihood)
    best = anew_at_pauses(ordinates, bare, walk)
    for score, density in find_candidates(ordinates, bare):
        wanted = walk + score.threshold * SAFETY[score.regressor.kind]
        hopeless = score.gain < wanted - _NEAR - _FITTED_ANEW
        if hopeless or score.regressor.kind in ("ramp", "pulse"):
            continue
        tried, gain = with_candidate(ordinates, bare, score, density)
        beyond = gain - wanted
        if best is None or beyond + _NEAR > best.beyond + best.near:
            best = Rival(tried, tried.regressors[-1:], beyond)
    return best


def anew_at_pauses(ordinates: Ordinates, fit: Fit, walk: float = 0.0) -> Rival | None:
    """Return a fit with a step at each pause that has none, or None where there are none.

    ``walk`` is what a random walk in their place gains over the fit, twice the log likelihood; as
    good as a walk is what has the same AIC.
    """
    steps_before = [x for x in fit.regressors if x.kind in ("step", "restart")]
    steps = tuple(
        x for x in restarts(ordinates) if not any(lies_at_pause(step, x) for step in steps_before)
    )
    if not steps:
        return None
    tried = ordinates.fit((*fit.regressors, *steps), fit.density, fit.noise.terms)
    gain = 2.0 * (tried.log_likelihood - fit.log_likelihood)
    threshold = float(chdtri(len(steps), FALSE_ALARM["restart"]))
    as_many = 2.0 * (len(steps) - 1)
    return Rival(tried, steps, gain - walk - threshold, threshold - as_many + _AS_GOOD)


@dataclass(frozen=True)
class Searched:
    """What a search found."""

    fit: Fit  # noise and regressors; pulses and ramps among them
    without: Fit  # noise alone
    gains: tuple[float, ...]  # for each regressor, twice the log likelihood that is lost without it
    many: bool  # there are `MOST` or more
    rival: Rival | None = None  # explains the log about as well without a random walk


def search(ordinates: Ordinates) -> Searched:
    """Find the regressors that noise does not explain."""
    without = ordinates.fit(())
    fit = without
    rival: Rival | None = None
    while len(fit.regressors) < MOST:
        extended = _next_fit(ordinates, fit)
        if extended is None:
            # Steps at the pauses that hide in a slow process together, none being large.
            together = anew_at_pauses(ordinates, fit)
            if together is not None and together.better:
                extended = together.fit
        if extended is None:
            rival = rival_of_walk(ordinates, fit)
            if rival is None or not rival.better:
                break
            extended = ordinates.fit(rival.fit.regressors, rival.fit.density)
        fit = extended
    if len(fit.regressors) >= MOST:
        return Searched(fit, without, (), True)
    if len(fit.regressors) > 1:
        fit = _polish_all(ordinates, fit)
    fit, gains = _eliminate(ordinates, fit)
    alike = rival if rival is not None and rival.as_good else None
    return Searched(fit, without, gains, False, alike)


def move_regressors(
    ordinates: Ordinates, searched: Searched, regressors: Sequence[Regressor]
) -> Searched:
    """Return a search with its regressors moved, those left out that are needless then."""
    fit, gains = _eliminate(ordinates, ordinates.fit(regressors, searched.fit.density))
    return replace(searched, fit=fit, gains=gains)


def _next_fit(ordinates: Ordinates, fit: Fit) -> Fit | None:
    """Return the fit with the best further regressor, or None where none is to be taken."""
    best: Fit | None = None
    most = 0.0
    for score, density in find_candidates(ordinates, fit):
        tried, gain = with_candidate(ordinates, fit, score, density)
        beyond = gain - score.threshold * SAFETY[score.regressor.kind]
        if beyond > most:
            best, most = tried, beyond
    if best is None:
        return None
    moved = polish(ordinates, best.regressors, len(best.regressors) - 1, best.density)
    return ordinates.fit(moved, best.density)


def _polish_all(ordinates: Ordinates, fit: Fit) -> Fit:
    """Polish each regressor in turn beside all others."""
    moved = fit.regressors
    for which in range(len(moved)):
        moved = polish(ordinates, moved, which, fit.density)
    return ordinates.fit(moved, fit.density)


def _eliminate(ordinates: Ordinates, fit: Fit) -> tuple[Fit, tuple[float, ...]]:
    """Leave out regressors that the others made needless; return what each of the rest gains."""
    while True:
        gains = [_lost_without(ordinates, fit, i) for i in range(len(fit.regressors))]
        margins = [gain - _KEPT[x.kind] for x, gain in zip(fit.regressors, gains, strict=True)]
        if not margins or min(margins) > 0.0:
            return fit, tuple(gains)
        fit = ordinates.fit(leave_out(fit.regressors, int(np.argmin(margins))), fit.density)


def _lost_without(ordinates: Ordinates, fit: Fit, which: int) -> float:
    """Return twice the log likelihood that is lost without a regressor."""
    regressor = fit.regressors[which]
    others = leave_out(fit.regressors, which)
    for_this_noise = Gain(ordinates, others, fit.density, regressor.part).of(regressor)
    if len(others) > 2 and for_this_noise > _SURE * _KEPT[regressor.kind]:
        return for_this_noise
    without = ordinates.fit(others, fit.density)
    return 2.0 * (fit.log_likelihood - without.log_likelihood)
