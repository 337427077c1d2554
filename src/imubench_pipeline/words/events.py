"""Sentences about a recording and its events, for the screen of one log."""

import json
from collections.abc import Collection, Mapping, Sequence

from imubench_pipeline.model.recordings import FindingRow, RecordingRow
from imubench_pipeline.model.states import Fitness
from imubench_pipeline.words.findings import FINDINGS, FindingData
from imubench_pipeline.words.findings.base import System, channels_text, unit_of, units_of
from imubench_pipeline.words.findings.changes import removal_text
from imubench_pipeline.words.numbers import counted, duration_text, join_names, number_text
from imubench_pipeline.words.verdicts import doubts_text

FITNESS_WORDS: Mapping[Fitness | None, str] = {
    "fit": "usable",
    "fit with doubts": "usable, with doubts",
    "unfit": "not used",
}
"""Fitness of a recording as people read it."""

_MAX_SPANS = 4
Span = tuple[float, float]


def state_text(
    row: RecordingRow, length: str, events: Sequence[int] = (), moved: bool = False
) -> str:
    """Return the state of a recording in a line: ``log: at rest; usable; 2 h at 100 Hz``.

    ``length`` ends the line; ``events`` are the numbers of the events that cast doubt.
    """
    if row.status != "ok":
        return f"{row.recording}: {row.status}: {row.reason or 'no reason is known'}"
    state = FITNESS_WORDS.get(row.fitness, "not judged")
    if row.fitness == "fit with doubts" and events:
        state += f" ({', '.join(map(str, events))})"
    rest = "" if moved or row.kind != "static" else "at rest; "
    return f"{row.recording}: {rest}{state}; {length}".removesuffix("; ")


def reason_text(row: RecordingRow) -> str:
    """Return why a recording is not used; empty if it is used."""
    return doubts_text(row.doubts, most=2) if row.fitness == "unfit" else ""


def motion_text(channels: Sequence[str], moved: Sequence[Span], still: Sequence[Span]) -> str:
    """Return when the sensor moved and when it was at rest, s, and how to use its rests."""
    where = f"the sensor was moved ({channels_text(channels)}) at {_spans_text(moved)}"
    if not still:
        return (
            f"Not at rest: {where}, all of the log. Record it again, with the sensor on a heavy "
            "table"
        )
    return (
        f"Not at rest: {where}. At rest: {_spans_text(still)}. Analyse the longest rest with "
        "--at-rest"
    )


def _spans_text(spans: Sequence[Span]) -> str:
    shown = [f"{number_text(a)} to {number_text(b)} s" for a, b in spans[:_MAX_SPANS]]
    more = len(spans) - len(shown)
    return join_names([*shown, f"{more} more"] if more else shown)


def missing_axes_texts(analysed: Collection[str], named: Collection[str]) -> list[str]:
    """Return sentences on axes that are not analysed; ``named``: channels that findings name."""
    texts = []
    for quantity, name in (("gyro", "Gyroscope"), ("accel", "Accelerometer")):
        axes = [axis for axis in "xyz" if f"{quantity}_{axis}" not in analysed]
        rejected = [axis for axis in axes if f"{quantity}_{axis}" in named]
        absent = [axis for axis in axes if axis not in rejected]
        for some, why in ((absent, "not in the log"), (rejected, "not analysed; see the findings")):
            if some:
                which = "" if len(some) == 3 else f" {join_names(some)}"
                texts.append(f"{name}{which}: {why}.")
    return texts


def longer_log_text(times: Mapping[str, tuple[float, float]]) -> str:
    """Return the length of log that parameters need; ``times``: least and most, s, by symbol."""
    parts = []
    for symbol, (least, most) in times.items():
        low, high = duration_text(least, 1), duration_text(most, 1)
        parts.append(f"{symbol} {low}" + f" to {high}" * (low != high))
    return f"Data needed: {join_names(parts)}, or more"


def read_data(row: FindingRow) -> FindingData | None:
    """Return the data of a finding; None if it has none."""
    return FINDINGS[row.finding](**json.loads(row.data)) if row.data else None


def finding_text(row: FindingRow, system: System) -> str:
    """Return a finding in sentences, in practical or SI units."""
    if system == "practical" or (data := read_data(row)) is None:
        return row.detail
    with units_of(system):
        return data.text(row.channel or "")


def events_text(
    findings: Sequence[FindingRow],
    system: System = "practical",
    factors: Mapping[str, float] | None = None,
) -> str:
    """Return one event in sentences; ``factors``: of parameters, if it is not removed."""
    first = max(findings, key=lambda row: abs(row.value or 0.0))
    if len(findings) == 1:
        return finding_text(first, system)
    names = list(dict.fromkeys(row.channel for row in findings if row.channel))
    if first.finding != "bias_step":
        where = channels_text(names)
        text = finding_text(first, system)
        if not where:
            return text
        begin = text[:1].lower() if text[1:2].islower() else text[:1]  # not of a symbol
        return f"{where[:1].upper()}{where[1:]}, for example: {begin}{text[1:]}"
    starts = [row.start for row in findings if row.start is not None]
    ends = [row.end for row in findings if row.end is not None]
    when = f"{min(starts):.0f} s"
    if max(ends, default=min(starts)) - min(starts) > 1.0:
        when = f"{min(starts):.0f} to {max(ends):.0f} s"
    sizes = []
    for quantity in dict.fromkeys((row.channel or "").partition("_")[0] for row in findings):
        with units_of(system):
            unit = unit_of(quantity, "level")
        own = [
            abs(row.value)
            for row in findings
            if row.value is not None and (row.channel or "").startswith(quantity)
        ]
        low, high = unit.text(min(own), 2), unit.text(max(own), 2)
        sizes.append(f"{low} to {high} {unit.sign}" if low != high else f"{low} {unit.sign}")
    by_channel: dict[str | None, list[float]] = {}
    for row in findings:
        by_channel.setdefault(row.channel, []).append(row.value or 0.0)
    # The steps of each channel add up to less than half of the largest.
    returned = ", which return" * all(
        len(steps) > 1 and abs(sum(steps)) < 0.5 * max(map(abs, steps))
        for steps in by_channel.values()
    )
    return (
        f"Disturbed at {when}: {counted(len(findings), 'bias step')} of {join_names(sizes)} "
        f"({channels_text(names)}){returned}. They are removed from "
        f"the noise{removal_text(factors)}. Look for a touched table, a supply that changes, or a "
        "loose connection"
    )
