"""Tests for ambiguous models; parameters that another model would change become doubtful.

An apparent random walk may be a drift with temperature or time, whose power is in the lowest
cosines of the transform and falls as f^-4 above them. A walk is accepted if the model needs it
without these cosines too, and if the spectrum is not steeper than f^-2.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from imubench_pipeline.estimators.estimate import CURVE, Estimate, Parameter
from imubench_pipeline.estimators.frame import FitSelection
from imubench_pipeline.estimators.model_choice import Candidate
from imubench_pipeline.estimators.whittle import Maximum, Whittle
from imubench_pipeline.words.reasons import estimates as texts

_DELTA_BIC_AGAINST_PAPERS = 6.0  # Above it, values of the papers' model are doubtful
_DELTA_AIC_WITHOUT_WALK = 2.5  # 2 % of true random walks exceed it, and 3/4 of slow processes
_MIN_WALK_BESIDE_RAMP = 0.25  # K with a ramp over K without it; 1 % of true walks are below
_DELTA_BIC_EXTRA_TERM = 9.0  # Up to it, a model with fewer terms may be the true one
_DELTA_BIC_RARE_TERM = 8.0  # Up to it, quantization noise or a ramp may be chance
_DELTA_AIC_OTHER_BIAS_TERMS = 4.0  # Above it, other terms make B and T_B doubtful
_DELTA_BIC_WITHOUT_BIAS = 4.0  # Up to it, a model without bias instability is as good
_DRIFT_COSINES = 5  # Lowest cosines that a drift may explain: 0.5 to 2.5 periods per log
_MIN_WALK_GAIN = 3.0  # Twice the gain in log L by a walk above them; 97 % of true walks reach it
_DELTA_AIC_SMOOTH_DRIFT = 8.0  # Of f^-4 over f^-2; 1 % of true walks exceed it
_EXCLUDED_COSINES = (0, 4)  # Numbers of lowest cosines that are excluded from the slope test


def add_doubts(
    estimate: Estimate,
    papers: Estimate,
    frame: FitSelection,
    candidates: Sequence[Candidate],
    papers_candidate: Candidate,
    drift: str | None = None,
) -> tuple[Estimate, Estimate]:
    """Return the two estimates of a likelihood with doubtful parameters marked.

    ``estimate`` is by the best model, the first of the candidates, and ``papers`` by the papers'
    model, which is among them. ``drift`` is the reason why the random walk may be a smooth drift.
    """
    chosen = candidates[0]
    if frame.cut:
        estimate, papers = (
            _flag_excluded_band(each, frame.band.highest) for each in (estimate, papers)
        )
    rival = drift or _doubt_walk(chosen, candidates)
    if rival is not None:
        estimate, papers = (cast_doubt(each, ("K",), rival) for each in (estimate, papers))
    other = _doubt_bias(chosen, candidates)
    if other is not None:
        estimate = cast_doubt(estimate, ("B", "T_B"), other, of_curve=False)
    for name in ("Q", "R"):
        # The model without it may be hardly worse.
        terms = chosen.terms
        linear, ramp = terms.linear.replace(name, ""), terms.ramp and name != "R"
        without = replace(terms, linear=linear, ramp=ramp)
        plain = next((c for c in candidates if c.terms == without), None)
        if (
            without != terms
            and plain is not None
            and plain.bic <= chosen.bic + _DELTA_BIC_RARE_TERM
        ):
            worse = plain.bic - chosen.bic
            reason = texts.hardly_worse_without(name, without.name, terms.name, worse)
            estimate = cast_doubt(estimate, (name,), reason)
    estimate = _equate_bias_statuses(estimate)
    against = papers_candidate.bic - chosen.bic
    if against > _DELTA_BIC_AGAINST_PAPERS:
        names = chosen.terms.name, papers_candidate.terms.name
        reason = texts.model_disfavoured(*names, against)
        papers = cast_doubt(papers, ("B", "T_B", "K"), reason)
    return estimate, papers


def _doubt_walk(chosen: Candidate, candidates: Sequence[Candidate]) -> str | None:
    """Return a reason if AIC, which permits slow processes, prefers little or no walk."""
    terms = chosen.terms
    if "K" not in terms.linear:
        return None
    without = [c for c in candidates if "K" not in c.terms.linear and not c.terms.ramp]
    best = min(without, key=lambda candidate: candidate.aic, default=chosen)
    better = chosen.aic - best.aic
    if best.aic <= chosen.aic - _DELTA_AIC_WITHOUT_WALK:
        return texts.slow_process(best.terms.name, better)
    beside = next((c for c in candidates if c.terms == replace(terms, ramp=True)), chosen)
    if beside.aic > chosen.aic - _DELTA_AIC_WITHOUT_WALK:
        return None
    K, least = chosen.maximum.parameter("K"), beside.maximum.parameter("K")
    if least > _MIN_WALK_BESIDE_RAMP * K:
        return None
    better = chosen.aic - beside.aic
    return texts.ramp_explains(beside.terms.name, better, least / K)


def _doubt_bias(chosen: Candidate, candidates: Sequence[Candidate]) -> str | None:
    """Return a reason if a model with fewer or other terms of bias instability may be right."""
    terms, biases = chosen.terms, sum(chosen.terms.biases)
    if biases == 0:
        return None
    fewer = [candidate for candidate in candidates if sum(candidate.terms.biases) < min(biases, 2)]
    best = min(fewer, key=lambda candidate: candidate.bic, default=None)
    most = _DELTA_BIC_EXTRA_TERM if biases > 1 else _DELTA_BIC_WITHOUT_BIAS
    if best is not None and best.bic <= chosen.bic + most:
        worse = best.bic - chosen.bic
        return texts.hardly_worse_bias(best.terms.name, terms.name, worse, several=biases > 1)
    other = min(candidates, key=lambda candidate: candidate.aic)
    better = chosen.aic - other.aic
    # BIC penalises a process as slow as a walk, and may therefore merge it with another process.
    if terms.gauss_markov == 0 or "K" in terms.linear or other.terms.biases == terms.biases:
        return None
    if better < _DELTA_AIC_OTHER_BIAS_TERMS:
        return None
    return texts.other_bias_terms(other.terms.name, better)


def _equate_bias_statuses(estimate: Estimate) -> Estimate:
    """Give B_curve and B the same status, where B is the only term of bias instability."""
    B, of_curve = estimate.parameters["B"], estimate.curve.get("B_curve")
    if estimate.further or of_curve is None:
        return estimate
    if of_curve.status == "not_identified":
        reason = texts.curve_bias_unknown(of_curve.reason)
        return cast_doubt(estimate, ("B", "T_B"), reason, of_curve=False)
    if of_curve.status != "ok" or B.status not in ("not_identified", "doubtful"):
        return estimate
    value = of_curve.value if B.status == "doubtful" else None
    unsure = replace(
        of_curve, value=value, status=B.status, reason=B.reason, fitted=of_curve.in_model
    )
    return replace(estimate, curve={**estimate.curve, "B_curve": unsure})


def cast_doubt(
    estimate: Estimate, names: Sequence[str], reason: str, *, of_curve: bool = True
) -> Estimate:
    """Make parameters of status ``ok`` doubtful; with B the figures of the curve too."""

    def doubt(group: Mapping[str, Parameter], names: Sequence[str]) -> dict[str, Parameter]:
        doubtful = {
            name: replace(parameter, status="doubtful", reason=reason)
            for name, parameter in group.items()
            if name in names and parameter.status == "ok"
        }
        return {**group, **doubtful}

    figures = CURVE if of_curve and "B" in names else ()
    return replace(
        estimate,
        parameters=doubt(estimate.parameters, names),
        further=[doubt(group, names) for group in estimate.further],
        curve=doubt(estimate.curve, figures),
    )


def _flag_excluded_band(estimate: Estimate, highest: float) -> Estimate:
    """Mark B as not identified where frequencies above ``highest``, Hz, were excluded."""
    B = estimate.parameters["B"]
    if B.status != "absent":
        return estimate
    reason = texts.band_excluded(highest)
    B = replace(B, status="not_identified", reason=reason, lower=None, upper=None)
    return replace(estimate, parameters={**estimate.parameters, "B": B})


def describe_drift_alternative(whittle: Whittle, chosen: Maximum) -> str | None:
    """Return a reason if a drift explains the spectrum about as well as the random walk does."""
    terms = chosen.terms
    if "K" not in terms.linear or chosen.parameter("K") == 0.0:
        return None
    beyond = _likelihood_without_lowest_cosines(whittle, _DRIFT_COSINES)
    bare = replace(terms, linear=terms.linear.replace("K", ""))
    if len(beyond.spectrum.density) <= terms.parameters:
        return texts.few_frequencies(_DRIFT_COSINES)
    if 2.0 * (beyond.maximum(bare).cost - beyond.maximum(terms).cost) < _MIN_WALK_GAIN:
        return texts.drift_or_walk(_DRIFT_COSINES, bare.name)
    first = float(whittle.spectrum.frequency[0])
    for number in _EXCLUDED_COSINES:
        rest = _likelihood_without_lowest_cosines(whittle, number)
        steep = (first / rest.spectrum.frequency) ** 2
        drift = rest.with_column("K", rest.column("K") * steep)
        better = 2.0 * (rest.maximum(terms).cost - drift.maximum(terms).cost)
        if better > _DELTA_AIC_SMOOTH_DRIFT:
            return texts.smooth_drift(bare.name, better)
    return None


def _likelihood_without_lowest_cosines(whittle: Whittle, number: int) -> Whittle:
    """Return the likelihood without the lowest cosines of each part of the log."""
    spectrum = whittle.spectrum
    beyond = 2.0 * spectrum.frequency * spectrum.length > number + 0.5
    return whittle if bool(np.all(beyond)) else whittle.select(spectrum, beyond)
