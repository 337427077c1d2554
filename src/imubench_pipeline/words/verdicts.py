"""Verdicts on sensors in words: requirements, conditions, evidence, doubts and next steps."""

import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from decimal import ROUND_DOWN, Decimal
from typing import get_args

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.model import comparisons, verdicts
from imubench_pipeline.model.estimates import ErrorGrowthRow
from imubench_pipeline.model.states import Action, Cause, Origin, SourceCode, SpreadOf, Verdict
from imubench_pipeline.settings.printed import SENSORS
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.validation import Strict
from imubench_pipeline.units import convert_from_si
from imubench_pipeline.words.findings import FINDINGS
from imubench_pipeline.words.findings.base import channels_text
from imubench_pipeline.words.numbers import (
    counted,
    duration_text,
    join_first,
    join_names,
    number_text,
    percent_text,
)

_TEXTS: Mapping[str, str] = {
    "simulated_beside_measured": "it is simulated, and other recordings are measured",
    "not_sold": "this sensor is not sold",
    "not_explained": "no model explains the spectrum of {channels}",
    "doubtful": "the decisive parameter is doubtful",
}
"""Doubts that are no findings."""


def doubt_text(code: str, channels: Sequence[str] = ()) -> str:
    """Return a doubt in words: ``the unit of gyro z looks wrong``."""
    where = channels_text(channels)
    text = _TEXTS.get(code) or FINDINGS[code].doubt
    return text.format(channels=where or "the data", are="is" if len(channels) == 1 else "are")


VERDICT_WORDS: Mapping[Verdict, str] = {
    "meets": "meets the limits",
    "likely_meets": "likely meets the limits",
    "meets_if": "meets the limits",
    "not_enough_data": "not enough data",
    "likely_fails": "likely fails",
    "fails": "fails",
    "cannot_meet": "cannot meet the limits",
    "excluded": "excluded",
}
"""Verdict on a sensor, the best first; the conditions of ``meets_if`` follow it."""

SHORT_VERDICTS: Mapping[Verdict, str] = {
    **VERDICT_WORDS,
    "meets": "meets",
    "likely_meets": "likely meets",
    "meets_if": "meets if …",
    "cannot_meet": "cannot meet",
}
"""Verdict in a table cell."""

VERDICT_MEANINGS: Mapping[Verdict, str] = {
    "meets": "probability of 97.5 % or more",
    "likely_meets": "50 to 97.5 %",
    "meets_if": "an unknown figure decides: it counts as the worst of its class",
    "not_enough_data": "the logs cannot answer",
    "likely_fails": "2.5 to 50 %",
    "fails": "2.5 % or less",
    "cannot_meet": "fails with the best figures of its class",
    "excluded": "lacks a required property",
}


def source_name(source: SourceCode) -> str:
    """Return the name of a source of errors: ``scale factor``."""
    return _SOURCES.get(source, source)


_SOURCES: Mapping[SourceCode, str] = {
    "turn_on_bias": "turn-on bias",
    "temperature_squared": "temperature squared",
    "scale_factor": "scale factor",
    "scale_factor_temperature": "scale factor over temperature",
    "g_sensitivity": "g-sensitivity",
    "vibration_rectification": "vibration rectification",
    "initial_tilt": "initial tilt",
    "initial_heading": "initial heading",
}
"""Sources of errors whose code is not their name."""

_NOUNS: Mapping[SourceCode, tuple[str, str, str]] = {
    "turn_on_bias": ("turn-on bias", "deg/s", "mg"),
    "temperature": ("temperature coefficient", "deg/s/K", "mg/K"),
    "scale_factor": ("scale factor error", "ppm", "ppm"),
    "scale_factor_temperature": ("scale factor over temperature", "ppm/K", "ppm/K"),
    "nonlinearity": ("nonlinearity", "ppm", "ppm"),
    "misalignment": ("misalignment", "mrad", "mrad"),
    "g_sensitivity": ("g-sensitivity", "deg/s/g", ""),
    "vibration_rectification": ("vibration rectification", "deg/s/g^2", "mg/g^2"),
}
"""Name of each figure, and its unit for a gyro and an accelerometer."""

_DIMENSIONS = {
    "deg/s": "angular_rate",
    "mg": "acceleration",
    "deg/s/K": "gyro_temperature_coefficient",
    "mg/K": "accel_temperature_coefficient",
    "ppm": "ratio",
    "ppm/K": "ratio_temperature_coefficient",
    "mrad": "angle",
    "deg/s/g": "gyro_acceleration_coefficient",
    "deg/s/g^2": "gyro_vibration_coefficient",
    "mg/g^2": "accel_vibration_coefficient",
}

_PROPERTIES: Mapping[verdicts.Property, tuple[str, str, str]] = {
    "price_class": ("price class", "", ""),
    "quantity": ("{subject}", "", ""),
    "axis": ("{subject} axis", "", ""),
    "full_scale": ("{subject} full scale", "", ""),
    "bandwidth": ("{subject} bandwidth", "Hz", "frequency"),
    "rate": ("sampling rate", "Hz", "frequency"),
    "temperature": ("temperature range", "degC", "temperature"),
    "mass": ("mass", "g", "mass"),
    "power": ("power", "W", "power"),
}
"""Name, unit and dimension of each property."""

_FULL_SCALES = {"gyro": ("deg/s", "angular_rate"), "accel": ("g", "acceleration")}

_UNIT_MISTAKES: Mapping[str, Sequence[tuple[float, str]]] = {
    "gyro": (
        (math.radians(1.0), "°/s, not as rad/s"),
        (math.degrees(1.0), "rad/s, not as °/s"),
        (1e-3 * math.degrees(1.0), "mrad/s, not as °/s"),
        (1e3 * math.radians(1.0), "°/s, not as mrad/s"),
    ),
    "accel": (
        (STANDARD_GRAVITY, "g, not as m/s²"),
        (1.0 / STANDARD_GRAVITY, "m/s², not as g"),
        (1e-3, "mg, not as g"),
        (1e3, "g, not as mg"),
    ),
}
"""Likely unit mistake for each factor that corrects the data."""

_SPREAD_OF: Mapping[SpreadOf, str] = {
    "specimens": "between specimens",
    "recordings": "between recordings of one unit",
    "other sensors": "between specimens of other sensors",
}


def verdict_text(verdict: Verdict, conditions: Sequence[verdicts.Condition] = ()) -> str:
    """Return a verdict with its conditions, such as ``meets the limits if its gyro ... is ...``."""
    text = VERDICT_WORDS[verdict]
    return f"{text} if {join_names(list(map(condition_text, conditions)))}" if conditions else text


def stated_verdict(row: comparisons.RankingRow) -> str:
    """Return the verdict of a row of ``ranking``, with conditions, or with the shortfalls."""
    if row.verdict == "excluded":
        return f"excluded: {'; '.join(map(shortfall_text, row.shortfalls))}"
    return verdict_text(row.verdict, row.conditions)


def condition_text(condition: verdicts.Condition) -> str:
    """Return a condition: ``its gyro g-sensitivity is below 0.1 deg/s/g (1σ)``."""
    if condition.figure is None:
        name = subject_text(condition)
        owned = condition.property in ("quantity", "axis")
        return f"it has a {name}" if owned else f"its {name} meets the requirement"
    size = figure_text(condition.subject, condition.figure, condition.largest or 0.0)
    text = f"its {subject_text(condition)} is below {size}"
    if condition.printing is None:
        return f"{text} (1σ)"
    printing = counted(condition.printing, "datasheet that prints it", "datasheets that print it")
    return f"{text} (1σ; met by {condition.within} of {printing})"


def figure_text(quantity: str, cause: SourceCode, size: float) -> str:
    """Return a figure, SI, in its practical unit, rounded down to three digits."""
    unit = _NOUNS[cause][1 + (quantity == "accel")]
    largest = float(convert_from_si(size, unit, _DIMENSIONS[unit]))
    if largest:  # rounded down, to stay within a limit
        step = Decimal(1).scaleb(Decimal(largest).adjusted() - 2)
        largest = float(Decimal(largest).quantize(step, rounding=ROUND_DOWN))
    return f"{largest:g} {unit}"


def worse_than_class_text(quantity: str, cause: Cause, size: float) -> str:
    """Return that a sensor prints a figure, SI, that is worse than its class."""
    figure = figure_text(quantity, cause, size)
    return f"its {SENSORS[quantity]} {_NOUNS[cause][0]}, {figure}, is worse than its class prints"


def class_limit_text(quantity: str, source: SourceCode, size: float | None) -> str:
    """Return the worst figure of a class, assumed if none is printed; ``size``: None for noise."""
    figure = ""
    if size is None:
        name = {"N": "white noise", "flicker": "bias instability"}.get(source, source)
    else:
        name = _NOUNS[source][0]
        figure = f" ({figure_text(quantity, source, size)})"
    return f"{SENSORS[quantity]} {name}: not printed, worst of its class{figure}"


def subject_text(condition: verdicts.Condition) -> str:
    """Return the name of the figure or property of a condition, such as ``gyro g-sensitivity``."""
    if condition.figure is not None:
        return f"{SENSORS[condition.subject]} {_NOUNS[condition.figure][0]}"
    assert condition.property is not None  # one of the two
    return _name_property(condition.property, condition.subject)


def _name_property(of: verdicts.Property, subject: str) -> str:
    return _PROPERTIES[of][0].format(subject=SENSORS.get(subject, subject.replace("_", " ")))


def shortfall_text(shortfall: verdicts.Shortfall) -> str:
    """Return a missing property: ``gyro full scale 250 deg/s, required 300 deg/s``."""
    if shortfall.property == "price_class":
        stated = shortfall.subject or "not stated"
        return f"price class {stated}, required: a class with the word {shortfall.asked}"
    name = _name_property(shortfall.property, shortfall.subject)
    _, unit, dimension = _PROPERTIES[shortfall.property]
    if shortfall.property == "full_scale":
        unit, dimension = _FULL_SCALES[shortfall.subject]
    if not shortfall.has:
        return f"the sensor has no {name}"
    own = " to ".join(f"{convert_from_si(value, unit, dimension):.4g}" for value in shortfall.has)
    return f"{name} {own} {unit}, required {shortfall.asked}"


def share_text(share: verdicts.Share) -> str:
    """Return a source of an error with its share: ``gyro N 40 %``."""
    stated = share.is_noise or share.origin in (None, "requirement")
    origin = "" if stated else f" ({_ORIGIN_WORDS[share.origin or 'measured']} value)"
    return f"{source_text(share)}{origin} {100.0 * share.share:.0f} %"


def origins_text(shares: Iterable[verdicts.Share]) -> str:
    """Return the parts of the variance by origin: ``40 % noise, 10 % rest``."""
    parts: dict[str, float] = {}
    for share in shares:
        noise = share.is_noise and share.origin != "class limit"
        name = "noise" if noise else _ORIGINS_OF_FIGURES[share.origin or "measured"]
        parts[name] = parts.get(name, 0.0) + share.share
    largest_first = sorted(parts.items(), key=lambda part: -part[1])
    shown = [(name, round(100.0 * part)) for name, part in largest_first if part >= 0.005]
    if shown and (rest := 100 - sum(percent for _, percent in shown)) > 0:
        shown.append(("rest", rest))
    return ", ".join(f"{percent} % {name}" for name, percent in shown)


_ORIGINS_OF_FIGURES: Mapping[Origin, str] = {
    "measured": "measured figures except noise",
    "datasheet": "datasheet figures except noise",
    "class limit": "unknown figures (assumed worst)",
    "requirement": "stated figures",
}
_ORIGIN_WORDS: Mapping[Origin, str] = {
    "measured": "measured",
    "datasheet": "datasheet",
    "class limit": "assumed worst",
    "requirement": "stated",
}
"""Origin of a figure in words."""


def source_text(
    source: verdicts.ErrorSource | comparisons.ErrorBudgetRow | ErrorGrowthRow,
    *,
    sized: bool = True,
) -> str:
    """Return the name of an error source, such as ``gyro N``; ``sized``: with T_B or frequency."""
    size = f" {source.T_B:.4g} s" if sized and source.T_B is not None else ""
    size += f" {source.frequency:.4g} Hz" if sized and source.frequency is not None else ""
    sensor = f"{source.quantity} " if source.quantity else ""
    name = f"{sensor}{source_name(source.source)}{size}"
    if source.through in _PATHS:
        return f"{name} {_PATHS[source.through]}"
    return f"initial tilt from {name}" if source.through == "initial_tilt" else name


_PATHS = {"static_window": "in the static window", "turn": "in the turn"}


def evidence_text(row: comparisons.RankingRow) -> str:
    """Return why the evidence of a verdict is weak; empty if it is strong or there is none."""
    if row.evidence != "weak":
        return ""
    return "; ".join(_describe_weakness(code, row) for code in row.evidence_reasons)


def evidence_summary_text(rows: Iterable[comparisons.RankingRow]) -> str:
    """Return how many verdicts have weak evidence, and the most common reason; empty if none."""
    judged = [row for row in rows if row.evidence is not None and row.verdict != "excluded"]
    reasons = [
        _describe_weakness(code, row)
        for row in judged
        if row.evidence == "weak"
        for code in row.evidence_reasons[:1]
    ]
    if not reasons:
        return ""
    reason, _ = Counter(reasons).most_common(1)[0]
    of = counted(len(judged), "verdict")
    return f"The evidence for {len(reasons)} of {of} is weak: {reason}."


def _describe_weakness(code: str, row: comparisons.RankingRow) -> str:
    match code:
        case "one_specimen":
            borrowed = row.spread_of == "other sensors"
            return "only one specimen" + ", spread taken from other sensors" * borrowed
        case "short_log":
            length = duration_text(row.longest_log)
            return f"one log of {length}" if row.recordings == 1 else f"no log longer than {length}"
        case "wide_interval" if row.spread_of == "specimens":
            return f"wide interval from {row.specimens} specimens"
        case "wide_interval":
            return "wide interval"
        case "few_axes":
            return "fewer than three axes"
    marks = (doubt for doubt in row.doubts if doubt.code == code)
    return doubt_text(code, list(dict.fromkeys(name for mark in marks for name in mark.channels)))


def doubts_text(doubts: Iterable[verdicts.DoubtMark], *, named: bool = False, most: int = 3) -> str:
    """Return the first ``most`` doubts about recordings; ``named``: with recordings' names."""
    texts = list(
        dict.fromkeys(
            f"{doubt.recording}: " * named + doubt_text(doubt.code, doubt.channels)
            for doubt in doubts
        )
    )
    return join_first(texts, most)


def used_doubts_text(row: comparisons.RankingRow) -> str:
    """Return doubts about the recordings of a row of ``ranking``, by name if there are several."""
    return doubts_text(row.doubts, named=(row.recordings or 0) > 1)


def other_margins_text(row: comparisons.RankingRow | comparisons.ShortlistRow) -> str:
    """Return the further margins of a row: ``noise-only margin 4.2, likely margin 0.9``."""
    parts = []
    if row.noise_margin is not None:
        parts.append(f"noise-only margin {number_text(row.noise_margin, 3)}")
    likely = number_text(row.likely_margin, 3)
    if row.likely_margin is not None and likely != number_text(row.margin, 3):
        parts.append(f"likely margin {likely}")
    return ", ".join(parts)


_ANSWERS: Mapping[Verdict, str] = {
    "meets": "Meets the limits: {}.",
    "likely_meets": "Likely meets the limits: {}.",
    "meets_if": "Meets the limits if unknown figures are as required: {}.",
    "not_enough_data": "Not enough data: {}.",
    "likely_fails": "Likely fails the limits: {}.",
    "fails": "Fails the limits: {}.",
    "cannot_meet": "Cannot meet the limits: {}.",
    "excluded": "Excluded: {}.",
}


def sensor_answer_text(judged: Iterable[tuple[str, Verdict]]) -> str:
    """Return a sentence per verdict with its requirements; ``judged``: title and verdict."""
    titles: dict[Verdict, list[str]] = {}
    for title, verdict in judged:
        titles.setdefault(verdict, []).append(title)
    parts = [
        _ANSWERS[verdict].format(join_names(titles[verdict]))
        for verdict in SHORT_VERDICTS
        if verdict in titles
    ]
    return " ".join(parts) or "No requirement is stated."


def spread_text(row: comparisons.RankingRow) -> str:
    """Return the spread between specimens, of a row of ``ranking``; empty if it is not known."""
    if row.spread is None or row.spread_of is None:
        return ""
    return f"{percent_text(row.spread, 2)} {_SPREAD_OF[row.spread_of]}"


def corrected_text(row: comparisons.RankingRow) -> str:
    """Return the verdicts that unused recordings give, as logged and with corrected units."""
    parts = []
    if row.logged_verdict is not None:
        parts.append(f"{_describe_outcome(row.logged_verdict, row.logged_margin)} as logged")
    if row.corrected_verdict is not None:
        outcome = _describe_outcome(row.corrected_verdict, row.corrected_margin)
        why = f" ({'; '.join(row.corrected_reasons)})" * bool(row.corrected_reasons)
        named = []
        for each in row.corrected_units:
            name, factor = SENSORS[each.quantity], each.factor
            for size, units in _UNIT_MISTAKES[each.quantity]:
                if math.isclose(factor, size, rel_tol=1e-6):
                    named.append(f"the {name} data read as {units}")
                    break
            else:
                times, done = (1.0 / factor, "divided") if factor < 1.0 else (factor, "multiplied")
                named.append(f"the {name} data {done} by {number_text(times, 3)}")
        also = "also " * (row.logged_verdict == row.corrected_verdict)
        parts.append(f"{also}{outcome} with {', and '.join(named)}{why}")
    return "; ".join(parts)


def _describe_outcome(verdict: Verdict, margin: float | None) -> str:
    if verdict == "not_enough_data":
        return "cannot be judged"
    return f"{VERDICT_WORDS[verdict]} (margin {number_text(margin, 3)})"


def answer_text(
    rows: Sequence[comparisons.RankingRow], names: Mapping[str, str], asked: int, excluded: int = 0
) -> str:
    """Return the best sensor for a requirement, with verdict and evidence, in sentences.

    ``rows`` are the deciding rows of the judged sensors, the best first. ``asked`` is the number of
    all sensors; ``excluded`` is the number of sensors that lack a required property.
    """
    having = "the required properties and usable data" if excluded else "usable data"
    if not rows:
        return f"No sensor has {having}." if asked else "No recording answers it."
    best = rows[0]
    name = names[best.sensor]
    if best.verdict in ("meets", "likely_meets"):
        text = f"{name} {VERDICT_WORDS[best.verdict]}"
    elif best.verdict == "meets_if":
        text = f"No sensor is shown to meet the limits. {name} meets them if "
        if len(best.conditions) == 1:
            text += condition_text(best.conditions[0])
        else:
            text += f"{len(best.conditions)} unknown figures and properties are as required"
    elif best.verdict == "not_enough_data":
        text = "No sensor is shown to meet the limits. "
        text += f"{name} is closest, but there is not enough data"
    else:
        shown = "is shown to meet" if best.verdict == "likely_fails" else "meets"
        text = f"No sensor {shown} the limits. {name} is closest, but {VERDICT_WORDS[best.verdict]}"
    weak = evidence_text(best)
    if len(rows) == 1:
        rank = f"Only sensor with {having}"
    else:
        rank = f"Best of {len(rows)} sensors" + f" with {having}" * (len(rows) < asked)
    return f"{text}. {rank}{f' (weak evidence: {weak})' if weak else ''}."


def summary_text(
    best: Mapping[str, comparisons.RankingRow | None], names: Mapping[str, str]
) -> str:
    """Return the best sensor for each requirement, in sentences.

    ``best`` has, by title of the requirement, the deciding row of the best judged sensor; None if
    none is judged. ``names`` has the shown name of each sensor.
    """
    groups: dict[str, list[str]] = {}
    for requirement, row in best.items():
        name = names[row.sensor] if row else "No sensor"
        if row is None:
            text = "No sensor can be judged for {}."
        elif row.verdict in ("meets", "likely_meets"):
            text = f"Best for {{}}: {name} ({VERDICT_WORDS[row.verdict]})."
        elif row.verdict == "meets_if":
            number = len(row.conditions)
            end = f"if {counted(number, 'unknown figure')} {'is' if number == 1 else 'are'}"
            text = f"Best for {{}}: {name} (meets the limits {end} good enough)."
        elif row.verdict in ("fails", "cannot_meet"):
            text = "No sensor meets the limits of {}."
        else:
            text = "No sensor is shown to meet the limits of {}."
        groups.setdefault(text, []).append(requirement)
    return " ".join(
        text.format(join_names(which, "or" if text.startswith("No sensor") else "and"))
        for text, which in groups.items()
    )


_MAX_NAMES = 4  # maximum number of sensors that are named with one verdict


def list_others(rows: Iterable[comparisons.RankingRow], names: Mapping[str, str]) -> list[str]:
    """Return a line per verdict with its sensors, or their number, from the deciding rows."""
    by_heading: dict[str, list[str]] = {}
    listed = list(rows)
    for verdict in get_args(Verdict):
        for row in listed:
            if row.verdict == verdict:
                text = "also " * (verdict == "meets") + VERDICT_WORDS[verdict]
                heading = text[:1].upper() + text[1:] + " under conditions" * bool(row.conditions)
                why = [*map(shortfall_text, row.shortfalls)]
                why += row.reasons if verdict == "not_enough_data" else ()
                text = f"{names[row.sensor]} ({'; '.join(why)})" if why else names[row.sensor]
                by_heading.setdefault(heading, []).append(text)
    lines = []
    for heading, own in by_heading.items():
        named = ", ".join(own) if len(own) <= _MAX_NAMES else counted(len(own), "sensor")
        heading = _SINGULAR.sub(r"\1", heading) if len(own) > 1 else heading
        lines.append(f"{heading}: {named}.")
    return lines


_SINGULAR = re.compile(r"\b([Mm]eet|[Ff]ail)s\b")


def next_step_text(step: comparisons.NextStepRow, *, brief: bool = False) -> str:
    """Return a next step: ``Record 3 more specimens: this could …``, or ``brief``."""
    parts = []
    if step.verdicts_turned:
        changed = counted(step.verdicts_turned, "verdict")
        parts.append(_EFFECTS[step.action].format(verdicts=changed))
    if step.verdicts_strengthened:
        parts.append(f"give {counted(step.verdicts_strengthened, 'verdict')} stronger evidence")
        if len(parts) == 1:
            parts[0] = f"this would {parts[0]}"
    return f"{_describe_action(step, brief=brief)}: {' and '.join(parts)}"


def _describe_action(step: comparisons.NextStepRow, *, brief: bool) -> str:
    recording = step.recording or "a recording"
    quantities = " and ".join(SENSORS[name] for name in step.quantities)
    match step.action:
        case "check_unit":
            units = f"{quantities} unit" + "s" * (len(step.quantities) > 1)
            return f"Check the {units.strip()} of {recording}"
        case "find_figures":
            names = join_names(list(map(subject_text, step.figures)))
            causes = {condition.figure for condition in step.figures} - {None}
            hints = [_MEASURING[cause] for cause in _MEASURING if cause in causes and not brief]
            verb = "Look up or measure" if causes else "Look up"
            return f"{verb} the {names}" + f" ({'; '.join(hints)})" * bool(hints)
        case "record_again":
            doubts = "; ".join(doubt_text(doubt.code, doubt.channels) for doubt in step.doubts)
            return f"Record {recording} again" + f" ({doubts})" * bool(doubts)
        case "add_channels":
            if quantities:
                return f"Record the {quantities} too ({recording} has none)"
            return f"Record all three axes ({recording} has fewer)"
        case "log_longer":
            assert step.duration is not None  # of every such step
            more = step.duration - (step.logged or 0.0)
            return f"Extend {recording} by {_round_up(more)} to {_round_up(step.duration)}"
        case "add_specimens":
            return f"Record {counted(step.specimens or 0, 'more specimen', 'more specimens')}"


_MEASURING: Mapping[SourceCode, str] = {
    "temperature": "a climate chamber over 20 K in 2 h is enough",
    "scale_factor": "turn the gyro by known angles, or the accelerometer against gravity",
    "misalignment": "turn the sensor about each edge of its case on a level plate",
    "turn_on_bias": "switch it on ten times at rest, the accelerometers in six positions",
    "g_sensitivity": "rest in six positions is enough",
    "vibration_rectification": "a shaker, or a log at rest with motors on",
}
"""How to measure a figure that decides."""

_EFFECTS: Mapping[Action, str] = {
    "check_unit": "this could change {verdicts}",
    "record_again": "this could allow {verdicts}",
    "add_channels": "this could allow {verdicts}",
    "log_longer": "this could settle {verdicts}",
    "add_specimens": "this could settle {verdicts}",
    "find_figures": "this decides {verdicts}",
}


def _round_up(seconds: float) -> str:
    """Return a duration in a suitable unit, to two digits, rounded up."""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= size:
            number = seconds / size
            return f"{math.ceil(number) if number >= 10 else math.ceil(10 * number) / 10:g} {unit}"
    return f"{math.ceil(seconds)} s"


def requirement_text(requirement: Requirement) -> str:
    """Return the demands of a requirement in sentences."""
    limits = "; ".join(limit.text for limit in requirement.limits)
    if requirement.static_window:
        begin = f"biases and tilt estimated over {requirement.static_window} at rest"
    elif requirement.turn_on:
        stated = (requirement.turn_on.gyro, requirement.turn_on.accel)
        biases = " and ".join(bias or "the datasheet" for bias in stated)
        begin = f"turn-on biases of {biases}, not calibrated"
    else:
        begin = ""
    parts = [
        "Invented example." if requirement.example else "",
        f"Limits ({100 * requirement.confidence:g} % of runs, {requirement.axis} axis): {limits}.",
        f"Start: {begin}." if begin else "",
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
