"""Requirements in sentences."""

from __future__ import annotations

from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.validation import Strict


def requirement_text(requirement: Requirement) -> str:
    """Return the demands of a requirement in sentences."""
    limits = "; ".join(limit.text for limit in requirement.limits)
    if requirement.static_window:
        begin = (
            f"biases and tilt estimated over {requirement.static_window} at rest immediately before"
        )
    elif requirement.turn_on:
        stated = (requirement.turn_on.gyro, requirement.turn_on.accel)
        biases = " and ".join(bias or "the datasheet" for bias in stated)
        begin = f"turn-on biases of {biases}, not calibrated"
    else:
        begin = ""
    parts = [
        "Invented example." if requirement.example else "",
        f"Limits: {limits}, in {100 * requirement.confidence:g} % of runs, for the "
        f"{requirement.axis} axis{begin and f'; {begin}'}.",
        _stated("In use", requirement.environment),
        _stated("A sensor must have", requirement.must),
        f"{requirement.note.rstrip('.')}." if requirement.note else "",
    ]
    return " ".join(part for part in parts if part)


def _stated(lead: str, group: Strict) -> str:
    """Return what a group of a requirement states, in a sentence; empty if it states nothing."""
    stated: list[str] = []
    for name, value in group:
        if isinstance(value, Strict):
            inner = ", ".join(f"{key} {item}" for key, item in value if item is not None)
            value = inner or None
        elif isinstance(value, tuple):
            value = (" to " if name == "temperature" else ", ").join(value) or None
        if value is not None:
            stated.append(f"{name.replace('_', ' ')} {value}")
    return f"{lead}: {'; '.join(stated)}." if stated else ""
