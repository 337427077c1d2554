"""What is wrong with a fit, and which of its values may be wrong for that.

What looks like a random walk may be a drift with temperature or time (`instead_of_walk`). A drift
that turns a few times over a log has its power in the lowest cosines of the transform, where a weak
random walk has most of its own; beyond them, it falls as f^-4 and a walk as f^-2. So a walk is
believed that is still needed without the lowest cosines, and whose spectrum is not steeper.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace

import numpy as np

from imubench_pipeline.estimators.estimate import CURVE, Estimate, Parameter
from imubench_pipeline.estimators.frame import FitSelection
from imubench_pipeline.estimators.model_choice import Candidate
from imubench_pipeline.estimators.whittle import Maximum, Whittle

_WORSE = 6.0
"""BIC by which the papers' model must be the worse for the data to be against it."""

_CLEARLY = 2.5
"""AIC by which a model without a random walk must be the better for K to be doubted: so it is for
three quarters of the walks that are processes of a twentieth of the log, and for 2 % of those that
are walks."""

_LITTLE = 0.25
"""Part of K that is left beside a ramp below which the ramp may stand for the walk: so it does, and
AIC clearly prefers it, for 1 % of the walks that are walks."""

_HARDLY = 9.0
"""BIC up to which a model with fewer terms may be the true one: up to so much, flicker noise beside
a process stands for chance in one log of a few hundred."""

_NEEDLESS = 8.0
"""BIC up to which quantization noise or a ramp may be chance, or part of a walk."""

_OTHERWISE = 4.0
"""AIC by which a model with other terms of bias instability must be better than processes alone
for B and T_B to be doubted."""

_AS_GOOD = 4.0
"""BIC up to which a model without bias instability is about as good as one with it."""

_OF_DRIFT = 5
"""Lowest cosines of a log, half a period to two and a half, that a drift is granted."""

_NEEDED = 3.0
"""Gain, twice the log likelihood, from which a walk is needed beyond them: so it is for 97 % of the
walks that are known to 14 to 20 %, and for one in seven of the smooth drifts that pass for one."""

_STEEPER = 8.0
"""The same by which a spectrum of f^-4 must be the better: so it is for 1 % of the walks, and for
some of the drifts with sharp bends."""

_WITHOUT = (0, 4)
"""Lowest cosines without which the slope is looked at: chance in a few of them hides it."""


def add_doubts(
    estimate: Estimate,
    papers: Estimate,
    frame: FitSelection,
    candidates: Sequence[Candidate],
    papers_candidate: Candidate,
    drift: str | None = None,
) -> tuple[Estimate, Estimate]:
    """Return the two estimates of a likelihood with their doubts.

    They are by the model that the data favour, the first of the candidates, and by the papers'
    model, which is among them; ``drift`` says why the random walk may be a smooth drift.
    """
    chosen = candidates[0]
    if frame.cut:
        estimate, papers = (
            _flag_excluded_band(each, frame.band.highest) for each in (estimate, papers)
        )
    rival = drift or _without_a_walk(chosen, candidates) or _beside_a_ramp(chosen, candidates)
    if rival is not None:
        estimate, papers = (cast_doubt(each, ("K",), rival) for each in (estimate, papers))
    other = _with_fewer_terms(chosen, candidates) or _with_other_terms(chosen, candidates)
    if other is not None:
        estimate = cast_doubt(estimate, ("B", "T_B"), other, of_curve=False)
    for name in ("Q", "R"):
        needless = _hardly_needed(name, chosen, candidates)
        if needless is not None:
            estimate = cast_doubt(estimate, (name,), needless)
    estimate = _with_one_bias(estimate)
    against = papers_candidate.bic - chosen.bic
    if against > _WORSE:
        reason = (
            f"the data favour {chosen.terms.name} over "
            f"{papers_candidate.terms.name} by {against:.1f} in BIC"
        )
        papers = cast_doubt(papers, ("B", "T_B", "K"), reason)
    return estimate, papers


def _without_a_walk(chosen: Candidate, candidates: Sequence[Candidate]) -> str | None:
    """Say so where AIC clearly prefers a model without the random walk of the chosen one.

    A slow process passes for a walk: BIC with what is asked of such a process takes the walk.
    """
    if "K" not in chosen.terms.linear:
        return None
    without = [
        candidate
        for candidate in candidates
        if "K" not in candidate.terms.linear and not candidate.terms.ramp
    ]
    best = min(without, key=lambda candidate: candidate.aic, default=chosen)
    if best.aic > chosen.aic - _CLEARLY:
        return None
    return (
        f"{best.terms.name}, which has no random walk, is better by "
        f"{chosen.aic - best.aic:.1f} in AIC: a process as slow as the log passes for a random walk"
    )


def _beside_a_ramp(chosen: Candidate, candidates: Sequence[Candidate]) -> str | None:
    """Say so where AIC prefers a ramp beside the random walk, which leaves little of the walk."""
    terms = chosen.terms
    if "K" not in terms.linear or terms.ramp:
        return None
    beside = replace(terms, ramp=True)
    best = next((candidate for candidate in candidates if candidate.terms == beside), None)
    if best is None or best.aic > chosen.aic - _CLEARLY:
        return None
    K, least = chosen.maximum.parameter("K"), best.maximum.parameter("K")
    if least > _LITTLE * K:
        return None
    return (
        f"{beside.name} is better by {chosen.aic - best.aic:.1f} in AIC, and the ramp leaves "
        f"{least / K:.2g} of K"
    )


def _with_fewer_terms(chosen: Candidate, candidates: Sequence[Candidate]) -> str | None:
    """Say so where two terms of bias instability are hardly better than one, or one than none."""
    terms, biases = chosen.terms, sum(chosen.terms.biases)
    if biases == 0:
        return None
    fewer = [candidate for candidate in candidates if sum(candidate.terms.biases) < min(biases, 2)]
    best = min(fewer, key=lambda candidate: candidate.bic, default=None)
    if best is None or best.bic > chosen.bic + (_HARDLY if biases > 1 else _AS_GOOD):
        return None
    worse = f"{best.terms.name} is hardly worse than {terms.name}, by "
    worse += f"{best.bic - chosen.bic:.1f} in BIC, and has "
    return worse + ("another B; B_curve is that of both" if biases > 1 else "no B")


def _with_other_terms(chosen: Candidate, candidates: Sequence[Candidate]) -> str | None:
    """Say so where AIC clearly prefers other terms of bias instability to processes without a walk.

    BIC asks more of processes that are as slow as a walk, and may so join one to another process.
    """
    best = min(candidates, key=lambda candidate: candidate.aic)
    terms = chosen.terms
    if terms.gauss_markov == 0 or "K" in terms.linear:
        return None
    if best.terms.biases == terms.biases:
        return None
    better = chosen.aic - best.aic
    if better < _OTHERWISE:
        return None
    name = best.terms.name
    return f"{name}, with other terms of bias instability, is better by {better:.1f} in AIC"


def _hardly_needed(name: str, chosen: Candidate, candidates: Sequence[Candidate]) -> str | None:
    """Say so where a model without its quantization noise (Q) or ramp (R) is hardly worse."""
    terms = chosen.terms
    without = replace(terms, linear=terms.linear.replace(name, ""), ramp=terms.ramp and name != "R")
    other = next((candidate for candidate in candidates if candidate.terms == without), None)
    if without == terms or other is None or other.bic > chosen.bic + _NEEDLESS:
        return None
    worse = f"{other.bic - chosen.bic:.1f} in BIC"
    return f"{without.name}, which has none, is hardly worse than {terms.name}, by {worse}"


def _with_one_bias(estimate: Estimate) -> Estimate:
    """Return an estimate whose bias of the curve is as sure as its only term, and the reverse."""
    B, of_curve = estimate.parameters["B"], estimate.curve.get("B_curve")
    if estimate.further or of_curve is None:
        return estimate
    if of_curve.status == "not_identified":
        reason = f"the bias instability of the curve is not told: {of_curve.reason}"
        return cast_doubt(estimate, ("B", "T_B"), reason, of_curve=False)
    if of_curve.status != "ok":
        return estimate
    if B.status not in ("not_identified", "doubtful"):
        return estimate
    value = of_curve.value if B.status == "doubtful" else None
    unsure = replace(
        of_curve, value=value, status=B.status, reason=B.reason, fitted=of_curve.in_model
    )
    return replace(estimate, curve={**estimate.curve, "B_curve": unsure})


def cast_doubt(
    estimate: Estimate, names: Sequence[str], reason: str, *, of_curve: bool = True
) -> Estimate:
    """Return an estimate whose values of some parameters are doubtful, where they are plain ones.

    With B go the figures of the curve, unless ``of_curve`` is False.
    """

    def doubted_in(
        group: Mapping[str, Parameter], doubted_names: Container[str]
    ) -> dict[str, Parameter]:
        return {
            name: replace(parameter, status="doubtful", reason=reason)
            if name in doubted_names and parameter.status == "ok"
            else parameter
            for name, parameter in group.items()
        }

    figures = CURVE if of_curve and "B" in names else ()
    return replace(
        estimate,
        parameters=doubted_in(estimate.parameters, names),
        further=[doubted_in(group, names) for group in estimate.further],
        curve=doubted_in(estimate.curve, figures),
    )


def _flag_excluded_band(estimate: Estimate, highest: float) -> Estimate:
    """Return an estimate from which frequencies, Hz, were left out: faster processes are unseen."""
    B = estimate.parameters["B"]
    if B.status != "absent":
        return estimate
    reason = (
        f"beyond {highest:.4g} Hz neither a process nor a low-pass explains the spectrum: a faster "
        "process would not be seen"
    )
    B = replace(B, status="not_identified", reason=reason, lower=None, upper=None)
    return replace(estimate, parameters={**estimate.parameters, "B": B})


def instead_of_walk(whittle: Whittle, chosen: Maximum) -> str | None:
    """Say so where a drift explains a spectrum about as well as its random walk does."""
    terms = chosen.terms
    if "K" not in terms.linear or chosen.parameter("K") == 0.0:
        return None
    beyond = _beyond(whittle, _OF_DRIFT)
    bare = replace(terms, linear=terms.linear.replace("K", ""))
    if len(beyond.spectrum.density) <= terms.parameters:
        return f"the log has too few frequencies beyond the {_OF_DRIFT} lowest, which drift has too"
    if 2.0 * (beyond.maximum(bare).cost - beyond.maximum(terms).cost) < _NEEDED:
        return (
            f"beyond the {_OF_DRIFT} lowest frequencies {bare.name} explains the log as well, and "
            "in these a drift with temperature or time passes for a random walk"
        )
    first = float(whittle.spectrum.frequency[0])
    for number in _WITHOUT:
        rest = _beyond(whittle, number)
        steep = (first / rest.spectrum.frequency) ** 2
        drift = rest.with_column("K", rest.column("K") * steep)
        better = 2.0 * (rest.maximum(terms).cost - drift.maximum(terms).cost)
        if better > _STEEPER:
            return (
                f"a smooth drift, whose spectrum falls as f^-4, and {bare.name} are better by "
                f"{better:.1f} in AIC: a drift with temperature or time passes for a random walk"
            )
    return None


def _beyond(whittle: Whittle, number: int) -> Whittle:
    """Return the likelihood without the lowest cosines of each part of the log."""
    spectrum = whittle.spectrum
    place = 2.0 * spectrum.frequency * spectrum.length
    beyond = place > number + 0.5
    return whittle if bool(np.all(beyond)) else whittle.select(spectrum, beyond)
