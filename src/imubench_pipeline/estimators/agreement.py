"""Where the methods of a channel contradict the likelihood, whose intervals hold.

A curve that is read, or fitted with the weights of its own variances, knows no low-pass and no
model but the papers': what it gives is doubtful where the likelihood, which tries the others, rules
it out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.tables.findings import Finding

_READ = 1.25
"""Factor beyond the limits of the likelihood that a value without limits may lie."""

_TWICE = 1.8
"""Ratio of two values beyond which they are not the same, whatever their limits."""


def doubt_contradicted(estimate: Estimate, reference: Estimate) -> Estimate:
    """Return an estimate with its values doubtful that the likelihood rules out.

    ``reference`` is that by the likelihood, of the same channel.
    """
    references = dict(reference.parameters)
    if reference.further and "B_curve" in reference.curve:
        # Of several terms each has its own B; one alone stands for all of them.
        references["B"] = reference.curve["B_curve"]
    return replace(
        estimate,
        parameters=_judged(estimate.parameters, references),
        curve=_judged(estimate.curve, reference.curve),
    )


def _judged(
    parameters: Mapping[str, Parameter], references: Mapping[str, Parameter]
) -> dict[str, Parameter]:
    judged = dict(parameters)
    for name, parameter in parameters.items():
        reference = references.get(name)
        if parameter.value is None or parameter.status not in ("ok", "at_bound") or not reference:
            continue
        reason = _contradiction(name, parameter, reference)
        if reason is not None:
            judged[name] = replace(parameter, status="doubtful", reason=reason)
    return judged


def _contradiction(name: str, parameter: Parameter, reference: Parameter) -> str | None:
    """Return how the likelihood contradicts a value; None where it does not."""
    value = parameter.value or 0.0
    if reference.value is None:
        return f"the likelihood gives no {name}: {reference.reason or reference.status}"
    lower, upper = reference.lower, reference.upper
    if lower is None or upper is None:
        return None
    between = f"the likelihood has {name} between {lower:.3g} and {upper:.3g} (SI)"
    if parameter.lower is None or parameter.upper is None:
        apart = value < lower / _READ or value > upper * _READ
    else:
        apart = parameter.upper < lower or parameter.lower > upper
        apart |= value < lower / _TWICE or value > upper * _TWICE
    apart |= not 1.0 / _TWICE < value / reference.value < _TWICE
    return between if apart else None


def disagreements(channel: str, estimates: Mapping[str, Estimate]) -> Iterator[Finding]:
    """Yield a finding where the fit of the curve and the likelihood, by method, disagree on N."""
    if not {"weighted", "likelihood"} <= estimates.keys():
        return
    weighted, likelihood = (
        estimates[method].parameters["N"] for method in ("weighted", "likelihood")
    )
    if weighted.value is None or weighted.lower is None or weighted.upper is None:
        return
    if likelihood.value is None or likelihood.lower is None or likelihood.upper is None:
        return
    if weighted.upper < likelihood.lower or weighted.lower > likelihood.upper:
        ratio = weighted.value / likelihood.value
        detail = (
            f"{channel}: the fit of the Allan variance gives an N {ratio:.3g} times that of the "
            "likelihood, beyond the intervals of both; a low-pass, lines or quantization noise "
            "bend the curve at short tau, and the likelihood takes them out"
        )
        yield Finding("N_differs", "note", detail, ratio, channel)
