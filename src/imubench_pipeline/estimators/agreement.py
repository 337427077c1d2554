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


def agreeing(estimate: Estimate, reference: Estimate) -> Estimate:
    """Return an estimate with its values doubtful that the likelihood rules out.

    Parameters
    ----------
    estimate : Estimate
        By another method.
    reference : Estimate
        By the likelihood, of the same channel.
    """

    def of(given: Mapping[str, Parameter], known: Mapping[str, Parameter]) -> dict[str, Parameter]:
        return {name: _doubted(name, one, known.get(name)) for name, one in given.items()}

    known = dict(reference.parameters)
    if reference.further and "B_curve" in reference.curve:
        # Of several terms each has its own B; one alone stands for all of them.
        known["B"] = reference.curve["B_curve"]
    return replace(
        estimate,
        parameters=of(estimate.parameters, known),
        curve=of(estimate.curve, reference.curve),
    )


def _doubted(name: str, one: Parameter, known: Parameter | None) -> Parameter:
    if one.value is None or one.status not in ("ok", "at_bound") or known is None:
        return one
    reason = _contradiction(name, one, known)
    if reason is None:
        return one
    return replace(one, status="doubtful", reason=reason)


def _contradiction(name: str, one: Parameter, known: Parameter) -> str | None:
    """Return how the likelihood contradicts a value; None where it does not."""
    value = one.value or 0.0
    if known.value is None:
        return f"the likelihood gives no {name}: {known.reason or known.status}"
    lower, upper = known.lower, known.upper
    if lower is None or upper is None:
        return None
    between = f"the likelihood has {name} between {lower:.3g} and {upper:.3g} (SI)"
    if one.lower is None or one.upper is None:
        apart = value < lower / _READ or value > upper * _READ
    else:
        apart = one.upper < lower or one.lower > upper
        apart |= value < lower / _TWICE or value > upper * _TWICE
    apart |= not 1.0 / _TWICE < value / known.value < _TWICE
    return between if apart else None


def disagreements(channel: str, estimates: Mapping[str, Estimate]) -> Iterator[Finding]:
    """Yield a finding where the fit of the curve and the likelihood disagree on N.

    Parameters
    ----------
    channel : str
    estimates : mapping of str to Estimate
        By method, as they were found.
    """
    if not {"weighted", "likelihood"} <= estimates.keys():
        return
    one, known = (estimates[method].parameters["N"] for method in ("weighted", "likelihood"))
    if one.value is None or known.value is None or one.lower is None or one.upper is None:
        return
    if known.lower is None or known.upper is None:
        return
    if one.upper < known.lower or one.lower > known.upper:
        ratio = one.value / known.value
        detail = (
            f"{channel}: the fit of the Allan variance gives an N {ratio:.3g} times that of the "
            "likelihood, beyond the intervals of both; a low-pass, lines or quantization noise "
            "bend the curve at short tau, and the likelihood takes them out"
        )
        yield Finding("N_differs", "note", detail, ratio, channel)
