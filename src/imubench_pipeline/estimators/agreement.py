"""Comparison of the methods of a channel: doubts about simple ones, and the second opinion.

Reading the Allan deviation, or fitting the papers' model, ignores filters and other terms. Values
are doubtful where the recommended method, which compares several models, excludes them.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.tables.findings import Finding, find
from imubench_pipeline.words.findings.spectrum import MethodsDiffer
from imubench_pipeline.words.reasons import estimates as texts

_MAX_FACTOR_BEYOND_LIMITS = 1.25  # From a value without limits to the limits of the reference
_MAX_VALUE_RATIO = 1.8  # Ratio of two values above which they differ, whatever their limits
_MIN_STATED_RATIO = 1.1  # Smaller differences of two estimates change no decision


def doubt_contradicted(estimate: Estimate, reference: Estimate) -> Estimate:
    """Return an estimate; each of its values that the reference excludes becomes doubtful."""
    references = dict(reference.parameters)
    if reference.further and "B_curve" in reference.curve:
        # With several terms, each has its own B: compare with the B of the curve.
        references["B"] = reference.curve["B_curve"]
    return replace(
        estimate,
        parameters=_doubt_group(estimate.parameters, references),
        curve=_doubt_group(estimate.curve, reference.curve),
    )


def _doubt_group(
    parameters: Mapping[str, Parameter], references: Mapping[str, Parameter]
) -> dict[str, Parameter]:
    """Return parameters in which the values that their references exclude are doubtful."""
    judged = dict(parameters)
    for name, parameter in parameters.items():
        reference, value = references.get(name), parameter.value
        if value is None or parameter.status not in ("ok", "at_bound") or not reference:
            continue
        if reference.value is None:
            reason = texts.no_reference(name, reference.status, reference.reason)
            judged[name] = replace(parameter, status="doubtful", reason=reason)
            continue
        lower, upper = reference.lower, reference.upper
        if lower is None or upper is None:
            continue
        ratio = _MAX_VALUE_RATIO
        apart = not 1.0 / ratio < value / reference.value < ratio
        if parameter.lower is None or parameter.upper is None:
            ratio = _MAX_FACTOR_BEYOND_LIMITS
        else:
            apart |= parameter.upper < lower or parameter.lower > upper
        if apart or value < lower / ratio or value > upper * ratio:
            reason = texts.excluded_by_reference(name, lower / value, upper / value)
            judged[name] = replace(parameter, status="doubtful", reason=reason)
    return judged


def yield_disagreements(channel: str, estimates: Mapping[str, Estimate]) -> Iterator[Finding]:
    """Yield a finding for each parameter whose robust and likelihood estimates disagree."""
    if not {"robust", "likelihood"} <= estimates.keys():
        return
    for symbol in ("N", "B_curve", "K"):
        robust, likelihood = (
            {**estimates[method].parameters, **estimates[method].curve}.get(symbol)
            for method in ("robust", "likelihood")
        )
        if robust is None or likelihood is None or {robust.status, likelihood.status} != {"ok"}:
            continue
        if not (robust.value and robust.lower and robust.upper):
            continue
        if not (likelihood.value and likelihood.lower and likelihood.upper):
            continue
        ratio = likelihood.value / robust.value
        apart = robust.upper < likelihood.lower or robust.lower > likelihood.upper
        if apart and not 1.0 / _MIN_STATED_RATIO < ratio < _MIN_STATED_RATIO:
            yield find(MethodsDiffer(symbol, ratio), "note", ratio, channel)
