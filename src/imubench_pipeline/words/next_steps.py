"""Next steps in words: what to do, and which verdicts it can change."""

from __future__ import annotations

import math
from collections.abc import Mapping

from imubench_pipeline.model.comparisons import NextStepRow
from imubench_pipeline.model.states import Action
from imubench_pipeline.settings.printed import SENSORS
from imubench_pipeline.words.doubts import doubt_text
from imubench_pipeline.words.numbers import counted, join_names
from imubench_pipeline.words.verdicts import subject_text


def next_step_text(step: NextStepRow) -> str:
    """Return a next step: ``Record 3 more units: this could settle 1 verdict``."""
    return f"{_describe_action(step)}: {_describe_effect(step)}"


def _describe_action(step: NextStepRow) -> str:
    quantities = " and ".join(SENSORS[name] for name in step.quantities)
    match step.action:
        case "check_unit":
            units = f"{quantities} unit" + "s" * (len(step.quantities) > 1)
            return f"Check the {units.strip()} of {step.recording}"
        case "find_figures":
            return f"Look up the {join_names(list(map(subject_text, step.figures)))}"
        case "record_again":
            doubts = "; ".join(map(doubt_text, step.doubts))
            return f"Record {step.recording} again" + f" ({doubts})" * bool(doubts)
        case "add_channels":
            if quantities:
                return f"Record the {quantities} too ({step.recording} has none)"
            return f"Record all three axes ({step.recording} has fewer)"
        case "log_longer":
            assert step.duration is not None  # of every such step
            more = step.duration - (step.logged or 0.0)
            return f"Extend {step.recording} by {_round_up(more)} to {_round_up(step.duration)}"
        case "add_specimens":
            return f"Record {counted(step.specimens or 0, 'more unit', 'more units')}"


_EFFECTS: Mapping[Action, str] = {
    "check_unit": "this could change {verdicts}",
    "record_again": "this could allow {verdicts}",
    "add_channels": "this could allow {verdicts}",
    "log_longer": "this could settle {verdicts}",
    "add_specimens": "this could settle {verdicts}",
    "find_figures": "this would remove a condition from {verdicts}",
}


def _describe_effect(step: NextStepRow) -> str:
    parts = []
    if step.action == "find_figures":
        parts.append(_EFFECTS[step.action].format(verdicts=_count(step.verdicts_strengthened)))
    elif step.verdicts_turned:
        parts.append(_EFFECTS[step.action].format(verdicts=_count(step.verdicts_turned)))
    if step.verdicts_strengthened and step.action != "find_figures":
        parts.append(f"give {_count(step.verdicts_strengthened)} stronger evidence")
        if len(parts) == 1:
            parts[0] = f"this would {parts[0]}"
    return " and ".join(parts)


def _count(number: int) -> str:
    return counted(number, "verdict")


def _round_up(seconds: float) -> str:
    """Return a duration in a suitable unit, to two digits, rounded up."""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= size:
            number = seconds / size
            return f"{math.ceil(number) if number >= 10 else math.ceil(10 * number) / 10:g} {unit}"
    return f"{math.ceil(seconds)} s"
