"""Uncertainty in words, and verdicts in sentences."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.navigation.suitability.conditions import EXCLUDED, in_words
from imubench_pipeline.report.practical import PageUnit, interval_text, symbol_text
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.validation import Strict
from imubench_pipeline.words.numbers import counted, duration_text, percent_text

_ROUGH = 0.3
"""Half of an interval over its value from which a percentage would hide its asymmetry."""

_VERDICTS = (
    "passes",
    "probably passes",
    "passes if",
    "probably passes if",
    "probably fails",
    "surely fails",
    "not enough data",
    EXCLUDED,
)


def untold(row: ParameterRow, unit: PageUnit, duration: float | None) -> str:
    """Return in a sentence why a parameter has no plain value, or what it is of; may be empty.

    Of a row of ``parameters``, and the length of the recording, s.
    """
    symbol, status = symbol_text(row.parameter), row.status
    if status == "ok":
        return f"{symbol}: {row.reason.rstrip('.')}." if row.reason else ""
    if status == "absent":
        below = ""
        if row.upper is not None:
            below = f": it is below {unit.text(row.upper, 2)} {unit.sign}"
        return f"The data do not ask for {symbol}{below}."
    if status == "not_identified":
        of = f" from {duration_text(duration)} of data" if duration else ""
        between = ""
        if row.lower is not None and row.upper is not None:
            ends = f"{unit.text(row.lower, 2)} and {unit.text(row.upper, 2)} {unit.sign}"
            between = f" (it lies between {ends})"
        return f"{symbol} cannot be told{of}{between}{_enough(row, duration)}."
    reason = (row.reason or status.replace("_", " ")).rstrip(".")
    return f"{symbol}: {reason}{_enough(row, duration)}."


def _enough(row: ParameterRow, duration: float | None) -> str:
    needed = row.duration_needed
    if needed is None or (duration is not None and needed <= duration):
        return ""
    return f"; {duration_text(needed)} would do for 10 %"


def precision(row: ParameterRow, unit: PageUnit) -> str:
    """Return how well a value is known: ``± 4 %``, or its interval; empty where not known."""
    if row.value is None or row.lower is None or row.upper is None or not row.value:
        return ""
    half = (row.upper - row.lower) / 2.0 / abs(row.value)
    if half > _ROUGH:
        return interval_text(row.lower, row.upper, unit, 2)
    return f"± {percent_text(half, 2)}"


def verdict_words(row: RankingRow) -> str:
    """Return a verdict, a row of ``ranking`` that decides, with what makes its evidence weak."""
    weak = evidence_words(row)
    return f"{row.verdict}, on weak evidence ({weak})" if weak else row.verdict


def evidence_words(row: RankingRow) -> str:
    """Return what makes the evidence of a verdict weak; empty where it is strong or not known."""
    if row.evidence != "weak":
        return ""
    reasons = (row.evidence_reasons or "reason not stated").split(", ")
    return "; ".join(_weakness(code, row) for code in reasons)


def _weakness(code: str, row: RankingRow) -> str:
    match code:
        case "one_specimen":
            borrowed = row.spread_of == "other sensors"
            return "one specimen" + ", with the spread of other sensors" * borrowed
        case "short_log":
            length = duration_text(row.longest_log)
            return f"one log of {length}" if row.recordings == 1 else f"no log beyond {length}"
        case "wide_interval" if row.spread_of == "specimens":
            return f"wide interval from {row.specimens} specimens"
        case "few_axes":
            return "fewer than three axes"
        case "not_explained":
            return "spectrum not explained"
        case "doubtful":
            return "the parameter that decides is doubtful"
    return code.replace("_", " ")


def spread_words(row: RankingRow) -> str:
    """Return how much specimens differ, of a row of ``ranking`` that says so."""
    return ", ".join(filter(None, (percent_text(row.spread, 2), _SPREAD_OF[row.spread_of])))


_SPREAD_OF: Mapping[str | None, str] = {
    None: "",
    "specimens": "from specimen to specimen",
    "recordings": "from recording to recording of one specimen",
    "other sensors": "taken from other sensors with several specimens",
}


def requirement_verdict(
    groups: Sequence[Mapping[str, Any]], names: Mapping[str, str], basis: Mapping[str, str]
) -> list[str]:
    """Return which sensor fulfils a requirement best, and how the others stand, in sentences.

    The answer, and what is to be known beside it, a line each: of groups as `meaning.rankings`
    gives them, the best first, and on which data each sensor is judged, in words.
    """
    if not groups:
        return ["No recording answers it."]
    ranked = [group for group in groups if group["rank"] != "–"]
    turned = [
        f"{names[group['sensor']]}: {group['unless']}." for group in groups if group["unless"]
    ]
    if not ranked:
        return ["No sensor can be ranked for it.", *_others(groups, names), *turned]
    best = ranked[0]
    decides = next(limit for limit in best["limits"] if limit["decides"])
    best_name = names[best["sensor"]] + (" (simulated)" if best["simulated"] else "")
    verdict, conditions = in_words(best["verdict"], best["conditions"]), []
    if (best["conditions"] or "").count("; ") and best["verdict"].endswith(" if"):
        conditions = best["conditions"].split("; ")
        verdict = f"{best['verdict'].removesuffix(' if')} on {len(conditions)} conditions"
    first = _first(best_name, verdict, len(ranked), len(groups))
    if best["weak"]:
        first += f", on weak evidence ({best['weak']})"
    figures = Markup("The limit that decides is {}: {} expected ({}), {} allowed (1σ).").format(
        *(decides[name] for name in ("limit", "sigma", "interval", "allowed"))
    )
    if decides["reason"]:
        figures += f" Not counted: {decides['reason']}."
    lines = [f"{first}.", figures + f" {basis[best['sensor']]}"]
    if conditions:
        lines.append(f"Conditions: {'; '.join(conditions)}.")
    if best["tied_with"]:
        tied = ", ".join(names.get(name, name) for name in listed_names(best["tied_with"], names))
        lines.append(f"It cannot be told apart from {tied}.")
    return [*lines, *_others([g for g in groups if g is not best], names), *turned]


def _first(sensor: str, verdict: str, judged: int, asked: int) -> str:
    """Return how the sensor with the largest margin stands: one that fails is not the best."""
    of = f"{judged} that could be judged" if judged < asked else f"{judged}"
    if judged == 1:
        alone = f"the only one of {asked} that could be judged" if asked > 1 else "the only one"
        surely = "" if verdict == "passes" else "No sensor surely passes. "
        return f"{surely}{sensor}, {alone}, {verdict}"
    if verdict == "passes":
        return f"{sensor} is the best of {of} and passes"
    if verdict == "probably passes":
        return f"No sensor surely passes. The best of {of}, {sensor}, probably passes"
    if " if " in verdict or verdict.endswith(" conditions"):
        return f"No sensor passes without a condition. The best of {of}, {sensor}, {verdict}"
    return f"No sensor passes. Of {of} the nearest is {sensor}, which {verdict}"


def listed_names(text: str, names: Mapping[str, str]) -> list[str]:
    """Return the names of a list, of which each may contain commas itself."""
    parts = text.split(", ")
    for count in range(len(parts), 0, -1):
        if (name := ", ".join(parts[:count])) in names:
            rest = ", ".join(parts[count:])
            return [name, *(listed_names(rest, names) if rest else [])]
    return [text]


def _others(groups: Sequence[Mapping[str, Any]], names: Mapping[str, str]) -> list[str]:
    """Return how many sensors have each verdict, and which where they are few."""
    parts = []
    by_verdict: dict[str, list[str]] = {}
    for verdict in _VERDICTS:
        by_verdict[_CAPITALS[verdict]] = []
    for group in groups:
        heading = _CAPITALS.get(group["verdict"], group["verdict"].capitalize())
        reason = next((limit["reason"] for limit in group["limits"] if limit["decides"]), "")
        if group["verdict"] == "not enough data" and reason:
            heading = f"{heading} ({reason})"
        why = f" ({group['conditions']})" * (group["verdict"] == EXCLUDED)
        by_verdict.setdefault(heading, []).append(names[group["sensor"]] + why)
    for heading, own in by_verdict.items():
        if own:
            listed = ", ".join(own) if len(own) <= _FEW else f"{len(own)} sensors"
            parts.append(f"{heading}: {listed}.")
    return parts


_FEW = 4
_CAPITALS = {
    "passes": "Pass too",
    "probably passes": "Probably pass",
    "passes if": "Pass on conditions",
    "probably passes if": "Probably pass on conditions",
    "probably fails": "Probably fail",
    "surely fails": "Surely fail",
    "not enough data": "Cannot be judged",
    EXCLUDED: "Excluded",
}


def requirement_words(requirement: Requirement) -> str:
    """Return what a requirement asks for, in sentences."""
    limits = "; ".join(limit.text for limit in requirement.limits)
    if requirement.static_window:
        begin = f"biases and tilt from {requirement.static_window} at rest right before"
    elif requirement.turn_on:
        stated = (requirement.turn_on.gyro, requirement.turn_on.accel)
        biases = " and ".join(bias or "the datasheet" for bias in stated)
        begin = f"turn-on biases of {biases} that nothing has taken off"
    else:
        begin = ""
    parts = [
        "An example, made up." if requirement.example else "",
        f"Asked: {limits}, in {100 * requirement.confidence:g} % of runs, by the "
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


def model_text(name: str) -> str:
    """Return the terms of a model, its lines counted: ``N+F + 3 lines``."""
    terms = name.split("+")
    lines = terms.count("S")
    rest = "+".join(term for term in terms if term != "S")
    return f"{rest} + {counted(lines, 'line')}" if lines else rest


def sentence(text: str | None) -> str:
    """Return a text as a sentence: a capital first, a full stop at the end; empty if none."""
    return text[:1].upper() + text[1:].rstrip(".") + "." if text else ""


def started_text(started: str | None) -> str:
    """Return date and time as they are read easily, without a fraction of zero."""
    return _ISO.sub(r"\1 \2", started or "")


_ISO = re.compile(r"^(\d{4}-\d\d-\d\d)T(\d\d:\d\d(?::\d\d)?)(?:\.0+(?!\d))?")
