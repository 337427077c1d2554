"""Whether a course explains a log better than its random walk does, or about as well.

A walk and a course are two models of the same rise towards low frequencies. They are compared as
such: the noise without a walk and the course in its stead, over the noise with the walk. A course
that leaves a walk needed beside it says nothing against the walk. What the course gains has the
choice of its kind, place, time constant or period in it, and so must come near the threshold that
counts them; the walk's own parameter, one and never looked for, counts for nothing.

A sensor that began anew at the pauses of a log has another bias after each. Their places are known
beforehand, and their number is what counts.
"""

from __future__ import annotations

from dataclasses import dataclass

from scipy.special import chdtri

from imubench_pipeline.estimators.deterministic.candidates import (
    SAFETY,
    beside,
    candidates,
    restarts,
    with_candidate,
)
from imubench_pipeline.estimators.deterministic.ordinates import NOISE, Fit, Ordinates
from imubench_pipeline.estimators.deterministic.regressors import Regressor
from imubench_pipeline.estimators.deterministic.scores import FALSE_ALARM
from imubench_pipeline.estimators.whittle import Terms

_NEAR = 4.0
"""Below its threshold by so much, in twice the log likelihood, a course is about as good."""

_FITTED_ANEW = 8.0
"""What the noise may add to a gain as it is fitted anew: what is below by more is not tried."""

_AS_GOOD = 0.5
"""AIC by which steps at known places may be worse and still be as good."""

_WITHOUT_WALK = Terms("NF", NOISE.gauss_markov)


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
    for score, density in candidates(ordinates, bare):
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
    taken = [x for x in fit.regressors if x.kind in ("step", "restart")]
    steps = tuple(x for x in restarts(ordinates) if not any(beside(one, x) for one in taken))
    if not steps:
        return None
    tried = ordinates.fit((*fit.regressors, *steps), fit.density, fit.noise.terms)
    gain = 2.0 * (tried.log_likelihood - fit.log_likelihood)
    threshold = float(chdtri(len(steps), FALSE_ALARM["restart"]))
    as_many = 2.0 * (len(steps) - 1)
    return Rival(tried, steps, gain - walk - threshold, threshold - as_many + _AS_GOOD)
