"""Sentences about a recording and its events, for the screen of one log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from imubench_pipeline.model.recordings import FindingRow, RecordingRow
from imubench_pipeline.model.states import Fitness
from imubench_pipeline.words.findings.base import channel_name, unit_of
from imubench_pipeline.words.numbers import counted, join_names
from imubench_pipeline.words.verdicts import doubts_text

_STATES: Mapping[Fitness | None, str] = {
    "fit": "usable",
    "fit with doubts": "usable, with doubts",
    "unfit": "not usable",
}


def state_text(row: RecordingRow, length: str) -> str:
    """Return the state of a recording in a line; ``length`` has duration, rate and channels."""
    if row.status != "ok":
        return f"{row.recording}: {row.status}: {row.reason or 'no reason is known'}"
    state = _STATES.get(row.fitness, "not judged")
    if row.fitness == "unfit":
        state += f": {doubts_text(row.doubts)}"
    return f"{row.recording}: {state}; {length}".removesuffix("; ")


def events_text(findings: Sequence[FindingRow]) -> str:
    """Return an event in sentences: a single finding as it is, several in one sentence."""
    first = findings[0]
    if len(findings) == 1:
        return first.detail
    names = list(dict.fromkeys(channel_name(row.channel) for row in findings if row.channel))
    if first.finding != "bias_step":
        kind = first.finding.replace("_", " ").capitalize()
        return f"{kind} on {join_names(names)}. {first.detail}"
    starts = [row.start for row in findings if row.start is not None]
    ends = [row.end for row in findings if row.end is not None]
    when = f"{min(starts):.0f} s"
    if max(ends, default=min(starts)) - min(starts) > 1.0:
        when = f"{min(starts):.0f} to {max(ends):.0f} s"
    sizes = []
    for quantity in dict.fromkeys((row.channel or "").partition("_")[0] for row in findings):
        unit = unit_of(quantity, "level")
        own = [
            abs(row.value)
            for row in findings
            if row.value is not None and (row.channel or "").startswith(quantity)
        ]
        low, high = unit.text(min(own), 2), unit.text(max(own), 2)
        sizes.append(f"{low} to {high} {unit.sign}" if low != high else f"{low} {unit.sign}")
    return (
        f"Disturbed at {when}: {counted(len(findings), 'bias step')} of {join_names(sizes)} "
        f"({join_names(names)}). They are removed from the noise. Look for a touched table, a "
        "supply that changes, or a loose connection"
    )
