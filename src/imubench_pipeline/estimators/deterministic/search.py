"""The search for what is no noise: forward selection by likelihood ratios, then elimination.

Noise and regressors compete: a step fitted by noise alone makes its random walk larger. So a
candidate that stands out of the noise as fitted, or as carried on from higher frequencies, is
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

from imubench_pipeline.estimators.deterministic.candidates import (
    SAFETY,
    find_candidates,
    leave_out,
    lies_at_pause,
    polish,
    restarts,
    with_candidate,
)
from imubench_pipeline.estimators.deterministic.ordinates import NOISE, Fit, Ordinates
from imubench_pipeline.estimators.deterministic.regressors import Kind, Regressor
from imubench_pipeline.estimators.deterministic.scores import FALSE_ALARM, Gain
from imubench_pipeline.estimators.whittle import Terms

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


@dataclass(frozen=True)
class Rival:
    """What explains a log without a random walk, by one course more or by steps at its pauses.

    Attributes
    ----------
    fit : Fit
    courses : tuple of Regressor
        The course, or the steps.
    beyond : float
        Twice the log likelihood over that of the noise with the walk, less what the search for
        the course makes of noise alone.
    near : float
        Below 0 by so much, the course is about as good.
    """

    fit: Fit
    courses: tuple[Regressor, ...]
    beyond: float
    near: float = _NEAR

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

    Steps, also at all pauses together, warm-ups and periodic drift are tried. A ramp is a term of
    the noise models, whose choice weighs it against a walk itself.

    Parameters
    ----------
    ordinates : Ordinates
    fit : Fit
        What was found so far.

    Returns
    -------
    Rival or None
        None where there is no walk, or no course that may be as good.
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

    Parameters
    ----------
    ordinates : Ordinates
    fit : Fit
    walk : float
        What a random walk in their place gains over the fit, twice the log likelihood.

    Returns
    -------
    Rival or None
        As good as a walk is what has the same AIC.
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
