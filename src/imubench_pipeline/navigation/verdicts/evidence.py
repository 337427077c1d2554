"""How strong the evidence of a verdict is: all that makes it weak is derived here.

A verdict says how sure a figure is if its log is what it seems. Evidence says how far the logs
carry: how long they are, of how many specimens and axes, and what is doubted of the parameter that
makes most of the error (`imubench_pipeline.recordings.fitness` says what is doubted of a log).

What a contribution to an error comes of, quantity and noise parameter, is told by its name.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Literal, get_args

from imubench_pipeline.estimators.estimate import CURVE
from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.navigation.verdicts.basis import Basis
from imubench_pipeline.navigation.verdicts.standing import Standing
from imubench_pipeline.noise import TERMS, Term
from imubench_pipeline.noise.terms.traits import Role
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.units import quantity_to_si


def _list_parameters(kind: type[Term]) -> frozenset[str]:
    symbols = frozenset(parameter.symbol for parameter in kind.parameters)
    raises_the_curve = "B" in symbols or kind.role is Role.GAUSS_MARKOV
    return symbols | frozenset(CURVE) if raises_the_curve else symbols


_PARAMETERS_OF_SOURCE = {kind.word: _list_parameters(kind) for kind in TERMS}
"""Parameters behind the first word of a term's name (`Term.source`); the lowest part of the curve
is what its bias instability makes of it."""


Reason = Literal["one_specimen", "short_log", "wide_interval", "few_axes"]
"""What makes evidence weak; beside these, the codes of doubts."""

WEAKNESS_REASONS: tuple[str, ...] = get_args(Reason)

MAX_TIME_SHARE = 1 / 9
"""Part of a log that tells an error of that length: there the Allan deviation of white noise has
8 differences of clusters end to end, and is known to about a quarter."""

_AXIS_COUNT = 3


def quantity_behind(source: str) -> str | None:
    """Return gyro or accel where a source is noise of one that the log tells; else None.

    A source is such as ``gyro N`` or ``initial tilt by accel GM 89.5 s`` of the table
    ``error_budget``. A turn-on bias is stated, and not of the log.
    """
    words = source.removeprefix("initial tilt by ").split()
    noise = len(words) > 1 and words[0] in ("gyro", "accel") and words[1] in _PARAMETERS_OF_SOURCE
    return words[0] if noise else None


def parameters_behind(source: str) -> frozenset[str]:
    """Return the noise parameters that a source comes of; none where it is no noise of the log."""
    if quantity_behind(source) is None:
        return frozenset()
    return _PARAMETERS_OF_SOURCE[source.removeprefix("initial tilt by ").split()[1]]


def weaknesses(standing: Standing, requirement: Requirement, basis: Basis) -> list[str]:
    """Return what makes the evidence of a limit weak; nothing where it is strong.

    They are `WEAKNESS_REASONS` and codes of the table ``doubts``. Axes and doubts count if at least
    half of the recordings have them; the longest recording gives the length. The standing must have
    a figure.
    """
    reasons = []
    if standing.expected.specimens == 1:
        reasons.append("one_specimen")
    longest = basis.longest(standing.totals)
    asked = longest_asked(standing.total, requirement)
    if longest is not None and asked > MAX_TIME_SHARE * longest:
        reasons.append("short_log")
    if standing.wide:
        reasons.append("wide_interval")
    of_logs = Counter(
        reason
        for total in standing.totals
        for reason in dict.fromkeys(_list_log_weaknesses(total, standing, requirement, basis))
    )
    half = len(standing.totals) / 2.0
    order = [*WEAKNESS_REASONS, *of_logs]
    reasons += [reason for reason, count in of_logs.items() if count >= half]
    return sorted(reasons, key=order.index)


def _list_log_weaknesses(
    total: ErrorBudgetRow, standing: Standing, requirement: Requirement, basis: Basis
) -> Iterator[str]:
    key = total.sensor, total.recording
    answering = {"gyro": total.gyro, "accel": total.accel}
    for quantity, channel in answering.items():
        axes = basis.axes(key, quantity) if channel else None
        if requirement.axis == "worst" and axes is not None and axes < _AXIS_COUNT:
            yield "few_axes"
    if standing.source is None:
        return
    behind = parameters_behind(standing.source)
    channel = answering[quantity_behind(standing.source) or "gyro"]
    for doubt in basis.doubts.get(key, ()):
        named = set((doubt.parameters or "").split(", ")) - {""}
        if doubt.channel in (None, channel) and behind and (not named or named & behind):
            yield doubt.code


def longest_asked(total: ErrorBudgetRow, requirement: Requirement) -> float:
    """Return the longest time that a limit is about, s: its own, or the window at rest before."""
    window = requirement.static_window
    # The heading found at rest has no window before it.
    before = quantity_to_si(window, "time") if window and total.error != "north" else 0.0
    return max(total.time, before)
