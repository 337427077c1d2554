"""Derive the strength of the evidence for a verdict, and the reasons why it is weak.

The evidence depends on the logs: their length, the number of specimens and axes, and doubts about
the parameter that contributes most to the error.
"""

from collections import Counter
from typing import Literal, get_args

from imubench_pipeline.estimators.estimate import CURVE
from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.navigation.verdicts.basis import Basis
from imubench_pipeline.navigation.verdicts.standing import Standing
from imubench_pipeline.noise import TERMS
from imubench_pipeline.noise.terms.base import Role
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.units import parse_quantity

PARAMETERS_OF_SOURCE: dict[str, frozenset[str]] = {}
"""Noise parameters by the code of a source (`Term.word`). Bias instability determines the lowest
part of the curve, so its terms include the parameters of the curve."""

for _kind in TERMS:
    _symbols = frozenset(parameter.symbol for parameter in _kind.parameters)
    if "B" in _symbols or _kind.role is Role.GAUSS_MARKOV:
        _symbols |= frozenset(CURVE)
    PARAMETERS_OF_SOURCE[_kind.word] = _symbols

Reason = Literal["one_specimen", "short_log", "wide_interval", "few_axes"]
"""Reasons for weak evidence, in addition to the codes of doubts."""

WEAKNESS_REASONS: tuple[str, ...] = get_args(Reason)

MAX_TIME_SHARE = 1 / 9
"""Maximum time of an error as a fraction of the log. There, the Allan deviation of white noise has
8 differences of adjacent clusters, and a relative error of about a quarter."""

_AXIS_COUNT = 3


def list_weaknesses(standing: Standing, requirement: Requirement, basis: Basis) -> list[str]:
    """Return the reasons for weak evidence on a limit that has a figure; empty if it is strong.

    They are `WEAKNESS_REASONS` and codes of the table ``doubts``. Axes and doubts count if at least
    half of the recordings have them.
    """
    reasons = []
    if standing.expected.specimens == 1:
        reasons.append("one_specimen")
    longest = basis.longest(standing.totals)
    asked = find_longest_time(standing.total, requirement)
    if longest is not None and asked > MAX_TIME_SHARE * longest:
        reasons.append("short_log")
    if standing.wide:
        reasons.append("wide_interval")
    of_logs = Counter[str]()
    for total in standing.totals:
        key = total.sensor, total.recording
        own: list[str] = []
        answering = {"gyro": total.gyro, "accel": total.accel}
        for quantity, channel in answering.items():
            axes = basis.axes(key, quantity) if channel else None
            if requirement.axis == "worst" and axes is not None and axes < _AXIS_COUNT:
                own.append("few_axes")
        if standing.source is not None:
            behind = PARAMETERS_OF_SOURCE.get(standing.source.source, frozenset())
            channel = answering[standing.source.quantity or "gyro"]
            for doubt in basis.doubts.get(key, ()):
                affected = behind.intersection(doubt.parameters) if doubt.parameters else behind
                if doubt.channel in (None, channel) and affected:
                    own.append(doubt.code)
        of_logs.update(dict.fromkeys(own, 1))
    half = len(standing.totals) / 2.0
    order = [*WEAKNESS_REASONS, *of_logs]
    reasons += [reason for reason, count in of_logs.items() if count >= half]
    return sorted(reasons, key=order.index)


def find_longest_time(total: ErrorBudgetRow, requirement: Requirement) -> float:
    """Return the longest time in a limit, s: its own, or its static window."""
    window = requirement.static_window
    # North-finding has no static window before it.
    before = parse_quantity(window, "time") if window and total.error != "north" else 0.0
    return max(total.time, before)
