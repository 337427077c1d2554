"""Search for deterministic signals: forward selection by likelihood ratios, then elimination.

Noise fitted to a signal hides it: slow signals are also searched above the noise as extrapolated
from higher frequencies. A candidate above its threshold is tested by the likelihood ratio of the
models with and without it, the noise refitted. A signal that a random walk hides completely is
compared with the walk; if it is not significantly better, it is reported as the walk's rival.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtri

from imubench_pipeline.estimators.deterministic.ordinates import NOISE_TERMS, Fit, Ordinates
from imubench_pipeline.estimators.deterministic.regressors import Kind, Regressor
from imubench_pipeline.estimators.deterministic.scores import (
    FALSE_ALARM_PROBABILITY,
    MIN_CYCLES,
    Gain,
    Score,
    find_best_scores,
)
from imubench_pipeline.estimators.whittle import Terms
from imubench_pipeline.typing import Array

_HELD_OUT_ORDINATES = 16  # lowest ordinates to which the noise is extrapolated instead of fitted
_MAX_PAUSE_DISTANCE = 2.0  # distance, in blocks, from a pause within which a step may belong to it
_REFIT_MARGIN = 6.0  # below the threshold; better candidates are tested with refitted noise
_SLOW_KINDS: tuple[Kind, ...] = ("exponential", "sinusoid")
_MIN_SLOW_GAIN = 6.0  # of a slow signal to be tested: noise fitted without it hides most of it
_NEIGHBOUR_ORDINATES = (3, 16)  # distances of ordinates that measure the noise beside a sinusoid
THRESHOLD_FACTOR: dict[Kind, float] = {
    "step": 1.0,
    "restart": 1.0,
    "exponential": 1.15,
    "sinusoid": 1.15,
    "ramp": 1.15,
    "pulse": 1.0,
}
"""Factor on the threshold, because the noise at few ordinates is poorly known."""

_RIVAL_MARGIN = 4.0  # twice the log likelihood; a signal this near its threshold is as good
_MAX_REFIT_GAIN = 8.0  # candidates further below their threshold are not refitted
_DELTA_AIC_STEPS = 0.5  # up to which steps at known places are as good as a walk
_TERMS_WITHOUT_WALK = Terms("NF", NOISE_TERMS.gauss_markov)

MAX_REGRESSORS = 16  # maximum number of regressors; a log with more steps has telegraph noise
_MIN_KEPT_GAIN: dict[Kind, float] = {
    "step": 16.0,
    "restart": 4.0,  # its place is known
    "exponential": 12.0,
    "sinusoid": 18.0,
    "ramp": 8.0,
    "pulse": 12.0,
}
"""Minimum gain of a regressor in the final fit, given the regressors found later."""

_CERTAIN_GAIN_FACTOR = 3.0  # on the minimum gain; above it the noise is not refitted


def find_candidates(ordinates: Ordinates, fit: Fit) -> list[tuple[Score, Array]]:
    """Return candidates for a fit, each with the noise density used for its detection."""
    scores: dict[Regressor, tuple[Score, Array]] = {}
    pauses = [x for x in list_restarts(ordinates) if x not in fit.regressors]
    for score in find_best_scores(ordinates, fit, fit.density):
        if score.regressor.kind == "step":
            # A step in a pause is a restart there: the means across the pause are interpolated.
            restarts = (x for x in pauses if is_at_pause(score.regressor, x))
            score = replace(score, regressor=next(restarts, score.regressor))
        slow = score.regressor.kind in _SLOW_KINDS
        if score.gain > (_MIN_SLOW_GAIN if slow else score.threshold - _REFIT_MARGIN):
            scores[score.regressor] = score, fit.density
    carried_on = ordinates.extrapolate_density(fit, _HELD_OUT_ORDINATES)
    for score in find_best_scores(ordinates, fit, carried_on, smooth=True):
        if score.gain > score.threshold:
            scores[score.regressor] = score, carried_on
    return list(scores.values())


def list_restarts(ordinates: Ordinates) -> tuple[Regressor, ...]:
    """Return a step at each pause of a log."""
    return tuple(
        Regressor("restart", number, middle, length)
        for number, part in enumerate(ordinates.means.parts)
        for middle, length in part.pauses
    )


def is_at_pause(regressor: Regressor, pause: Regressor) -> bool:
    """Return whether a step lies in a pause, or near enough to belong to it."""
    near = abs(regressor.where - pause.where) <= 0.5 * pause.length + _MAX_PAUSE_DISTANCE
    return regressor.part == pause.part and near


def fit_with_candidate(
    ordinates: Ordinates, fit: Fit, score: Score, density: Array
) -> tuple[Fit, float]:
    """Return the fit with an additional regressor, and twice the log likelihood that it adds.

    ``density``, shape (k,), is the noise density that it was detected in, SI²/Hz.
    """
    regressors = (*fit.regressors, score.regressor)
    if density is not fit.density:
        # A strong signal with a slightly wrong frequency leaves a large residual.
        regressors = polish(ordinates, regressors, len(regressors) - 1, density)
    tried = ordinates.fit(regressors, fit.density, fit.noise.terms)
    gain = 2.0 * (tried.log_likelihood - fit.log_likelihood)
    if score.regressor.kind == "sinusoid":
        # An oscillating noise process is a broad peak of the spectrum, not a sinusoid: divide by
        # the mean power of the neighbouring ordinates over that of the model, if above 1.
        sinusoid = regressors[-1]
        of_part = ordinates.part(sinusoid.part)
        ratio = tried.residual[of_part] ** 2 * ordinates.weights(tried.density)[of_part]
        centre = 2.0 * sinusoid.where * ordinates.sizes[sinusoid.part]
        away = np.abs(np.arange(1, len(ratio) + 1) - centre)
        beside = ratio[(away >= _NEIGHBOUR_ORDINATES[0]) & (away <= _NEIGHBOUR_ORDINATES[1])]
        if len(beside):
            # Allow for two standard errors of the mean of so many chi-squared ordinates.
            error = float(np.sqrt(2.0 / len(beside)))
            gain /= max(float(beside.mean()) - 2.0 * error, 1.0)
    return tried, gain


def polish(
    ordinates: Ordinates, regressors: Sequence[Regressor], which: int, density: Array
) -> tuple[Regressor, ...]:
    """Optimise the place, time constant or frequency of one regressor, in given noise."""
    best = regressors[which]
    if best.kind in ("ramp", "pulse", "restart"):
        return tuple(regressors)
    n = ordinates.sizes[best.part]
    step = {"step": 0.5, "exponential": 0.12 * best.where, "sinusoid": 0.125 / n}[best.kind]
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


@dataclass(frozen=True)
class Rival:
    """A model without a random walk, with one more signal or with steps at the pauses instead."""

    fit: Fit
    signals: tuple[Regressor, ...]  # the signal, or the steps
    beyond: float
    """Twice the log likelihood relative to the noise with the walk, less the threshold of the
    search."""
    near: float = _RIVAL_MARGIN  # the signal is about as good if ``beyond`` is above minus this

    @property
    def better(self) -> bool:
        """Whether the signal is added, and the walk refitted."""
        return self.beyond > 0.0

    @property
    def as_good(self) -> bool:
        """Whether walk and signal are not significantly different."""
        return self.beyond > -self.near


def find_walk_rival(ordinates: Ordinates, fit: Fit) -> Rival | None:
    """Return the signal that fits a log best in place of a random walk, or None.

    Steps, also at all pauses together, warm-ups and periodic drift are tried; a ramp is in the
    noise models.
    """
    if fit.noise.parameter("K") == 0.0:
        return None
    bare = ordinates.fit(fit.regressors, fit.density, _TERMS_WITHOUT_WALK)
    walk = 2.0 * (fit.log_likelihood - bare.log_likelihood)
    best = fit_steps_at_pauses(ordinates, bare, walk)
    for score, density in find_candidates(ordinates, bare):
        wanted = walk + score.threshold * THRESHOLD_FACTOR[score.regressor.kind]
        hopeless = score.gain < wanted - _RIVAL_MARGIN - _MAX_REFIT_GAIN
        if hopeless or score.regressor.kind in ("ramp", "pulse"):
            continue
        tried, gain = fit_with_candidate(ordinates, bare, score, density)
        beyond = gain - wanted
        if best is None or beyond + _RIVAL_MARGIN > best.beyond + best.near:
            best = Rival(tried, tried.regressors[-1:], beyond)
    return best


def fit_steps_at_pauses(ordinates: Ordinates, fit: Fit, walk: float = 0.0) -> Rival | None:
    """Return a fit with a step at each pause that has none, or None where there are none.

    ``walk`` is twice the log likelihood that a random walk gains. Steps with its AIC are as good.
    """
    steps_before = [x for x in fit.regressors if x.kind in ("step", "restart")]
    steps = tuple(
        x
        for x in list_restarts(ordinates)
        if not any(is_at_pause(step, x) for step in steps_before)
    )
    if not steps:
        return None
    tried = ordinates.fit((*fit.regressors, *steps), fit.density, fit.noise.terms)
    gain = 2.0 * (tried.log_likelihood - fit.log_likelihood)
    threshold = float(chdtri(len(steps), FALSE_ALARM_PROBABILITY["restart"]))
    as_many = 2.0 * (len(steps) - 1)
    return Rival(tried, steps, gain - walk - threshold, threshold - as_many + _DELTA_AIC_STEPS)


@dataclass(frozen=True)
class SearchResult:
    """Result of a search."""

    fit: Fit  # noise and regressors; pulses and ramps among them
    without: Fit  # noise alone
    gains: tuple[float, ...]  # twice the log likelihood that is lost without each regressor
    many: bool  # there are `MAX_REGRESSORS` or more
    rival: Rival | None = None  # fits the log about as well without a random walk


def search_signals(ordinates: Ordinates) -> SearchResult:
    """Find the deterministic signals that noise does not explain."""
    fit = without = ordinates.fit(())
    rival: Rival | None = None
    while len(fit.regressors) < MAX_REGRESSORS:
        extended = _extend_fit(ordinates, fit)
        if extended is None:
            # Small steps at the pauses, which a slow process can hide, tested together.
            together = fit_steps_at_pauses(ordinates, fit)
            if together is not None and together.better:
                extended = together.fit
        if extended is None:
            rival = find_walk_rival(ordinates, fit)
            if rival is None or not rival.better:
                break
            extended = ordinates.fit(rival.fit.regressors, rival.fit.density)
        fit = extended
    if len(fit.regressors) >= MAX_REGRESSORS:
        return SearchResult(fit, without, (), True)
    if len(fit.regressors) > 1:
        moved = fit.regressors
        for which in range(len(moved)):
            moved = polish(ordinates, moved, which, fit.density)
        fit = ordinates.fit(moved, fit.density)
    fit, gains = _eliminate(ordinates, fit)
    alike = rival if rival is not None and rival.as_good else None
    return SearchResult(fit, without, gains, False, alike)


def move_regressors(
    ordinates: Ordinates, searched: SearchResult, regressors: Sequence[Regressor]
) -> SearchResult:
    """Return a result with moved regressors, without unnecessary ones."""
    fit, gains = _eliminate(ordinates, ordinates.fit(regressors, searched.fit.density))
    return replace(searched, fit=fit, gains=gains)


def _extend_fit(ordinates: Ordinates, fit: Fit) -> Fit | None:
    """Return the fit with the best additional regressor, or None if none is significant."""
    best: Fit | None = None
    most = 0.0
    for score, density in find_candidates(ordinates, fit):
        tried, gain = fit_with_candidate(ordinates, fit, score, density)
        beyond = gain - score.threshold * THRESHOLD_FACTOR[score.regressor.kind]
        if beyond > most:
            best, most = tried, beyond
    if best is None:
        return None
    moved = polish(ordinates, best.regressors, len(best.regressors) - 1, best.density)
    return ordinates.fit(moved, best.density)


def _eliminate(ordinates: Ordinates, fit: Fit) -> tuple[Fit, tuple[float, ...]]:
    """Remove regressors that others made unnecessary; return the gain of each of the rest."""
    while True:
        gains, margins = [], []
        for which, regressor in enumerate(fit.regressors):
            others, least = leave_out(fit.regressors, which), _MIN_KEPT_GAIN[regressor.kind]
            gain = Gain(ordinates, others, fit.density, regressor.part).of(regressor)
            if len(others) <= 2 or gain <= _CERTAIN_GAIN_FACTOR * least:
                without = ordinates.fit(others, fit.density)
                gain = 2.0 * (fit.log_likelihood - without.log_likelihood)
            gains.append(gain)
            margins.append(gain - least)
        if not margins or min(margins) > 0.0:
            return fit, tuple(gains)
        fit = ordinates.fit(leave_out(fit.regressors, int(np.argmin(margins))), fit.density)
