"""The overview pages: start page with the decision matrix, and all recordings."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import get_args

from markupsafe import Markup

from imubench_pipeline.model.comparisons import NextStepRow, RankingRow
from imubench_pipeline.model.recordings import FailureRow, FileRow, FindingRow
from imubench_pipeline.model.states import Verdict
from imubench_pipeline.navigation.suitability import PASSING_VERDICTS
from imubench_pipeline.registry import references
from imubench_pipeline.report.comparison import Comparison
from imubench_pipeline.report.meaning import (
    Group,
    SourcedNumber,
    compute_margin_limits,
    format_margin,
    format_rankings,
    source_number,
)
from imubench_pipeline.report.payload import FOREST, pack_styles
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.report.view import RecordingView
from imubench_pipeline.words import numbers, verdicts

_VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
_MAX_ORDER_DECADES = 4.0  # maximum decades from 1 by which margins are sorted
_MAX_BAR_DECADES = 2.0  # maximum decades from 1 that a bar shows


@dataclass(frozen=True)
class Scale:
    """The logarithmic scale on which all margins of a matrix are drawn."""

    low: float  # logarithm to base 10 of the margin at the left end
    high: float  # and at the right end

    @classmethod
    def of(cls, margins: Iterable[float]) -> "Scale":
        """Return a scale that shows all margins, at least from 0.5 to 2."""
        logs = [math.log10(value) for value in margins if 0.0 < value < math.inf]
        low, high = min([*logs, math.log10(0.5)]), max([*logs, math.log10(2.0)])
        return cls(max(low, -_MAX_BAR_DECADES) - 0.08, min(high, _MAX_BAR_DECADES) + 0.08)

    def place(self, value: float) -> float:
        """Return the position of a margin on the scale, % of the width."""
        log = math.log10(value) if value > 0.0 else -math.inf
        share = (min(max(log, self.low), self.high) - self.low) / (self.high - self.low)
        return round(100.0 * share, 2)

    @property
    def ticks(self) -> list[tuple[str, float]]:
        """The powers of ten on the scale, as text, with their positions, % of the width."""
        powers = range(math.ceil(self.low), math.floor(self.high) + 1)
        return [(numbers.number_text(10.0**power), self.place(10.0**power)) for power in powers]


@dataclass(frozen=True)
class Cell:
    """The verdict on a sensor for a requirement, with its margin and its reasons."""

    requirement: str
    sensor: str
    verdict: Verdict
    conditions: int = 0  # unknown figures on which the verdict depends
    # the margin with its 95 % limits
    margin: tuple[SourcedNumber, SourcedNumber, SourcedNumber] | None = None
    other_margins: str = ""  # margin of the noise without other errors, and likely margin
    bar: tuple[float, float, float] | None = None  # positions of the margin and its limits, %
    noise: float | None = None  # position of the margin of the noise without other errors, %
    likely: tuple[SourcedNumber, float] | None = None  # margin of a conditional verdict, position
    weak: str = ""  # reasons for weak evidence
    doubts: str = ""  # doubts about the recordings
    reason: str = ""  # why it is not judged
    alternatives: Sequence[tuple[str, SourcedNumber, float]] = ()  # margins as logged and corrected
    order: float = -math.inf  # larger is better

    @property
    def word(self) -> str:
        """The verdict in words."""
        return verdicts.SHORT_VERDICTS[self.verdict]

    @property
    def hatched(self) -> bool:
        """Whether the cell is hatched: the evidence is weak, or the recordings are in doubt."""
        return bool(self.weak or self.doubts)


def make_decision_matrix(site: Site) -> Mapping[str, object] | None:
    """Return the decision matrix, sensors by requirements; None if no sensor was ranked."""
    rows = {(row.requirement, row.sensor): row for row in site.rows(RankingRow) if row.decides}
    if not rows:
        return None
    drawn: list[float | None] = []
    for each in rows.values():
        drawn += [each.logged_margin, each.corrected_margin, each.margin, each.noise_margin]
        drawn += [each.likely_margin] if each.verdict == "meets_if" else []
        drawn += compute_margin_limits(each) if each.margin is not None else ()
    scale = Scale.of(value for value in drawn if value is not None)
    # A sensor that cannot be bought is not compared with others.
    apart = {sensor: "not sold" for sensor in site.sensors if not site.is_sold(sensor)}
    unranked = {
        sensor: explain_missing_rank(view for view in site.views if view.sensor == sensor)
        for sensor in site.sensors
    }
    lines = {
        sensor: [
            _cell(row, scale)
            if (row := rows.get((name, sensor)))
            else Cell(name, sensor, "not_enough_data", reason=unranked[sensor])
            for name in site.requirements
        ]
        for sensor in site.sensors
        if sensor not in apart
    }

    def order(sensor: str) -> tuple[object, ...]:
        """Return the sort key: sensors that meet the most limits come first."""
        met = Counter(cell.verdict for cell in lines[sensor] if cell.margin)
        counts = [-met[verdict] for verdict in _VERDICTS]
        return (*counts, -sum(cell.order for cell in lines[sensor]), site.names[sensor])

    columns, best = [], {}
    for place, (name, requirement) in enumerate(site.requirements.items()):
        cells = [cells[place] for cells in lines.values()]
        judged = [cell for cell in cells if cell.margin]
        first = max(judged, key=lambda cell: cell.order, default=None)
        limits = [
            f"{x.error.replace('_', ' ')} {x.at_most} in {x.after or f'{x.outage} without GNSS'}"
            for x in requirement.limits
        ]
        short = name.replace("_", " ").capitalize()
        columns.append({"name": name, "title": requirement.title, "short": short, "limits": limits})
        best[short] = rows[name, first.sensor] if first else None
    compared = (row for (_, sensor), row in rows.items() if sensor not in apart)
    return {
        "answer": verdicts.summary_text(best, site.names),
        "evidence": verdicts.evidence_summary_text(compared),
        "columns": columns,
        "lines": sorted(lines.items(), key=lambda line: order(line[0])),
        "apart": apart,
        "scale": scale,
        "legend": [
            (verdict, verdicts.SHORT_VERDICTS[verdict], verdicts.VERDICT_MEANINGS[verdict])
            for verdict in _VERDICTS
        ],
    }


def explain_missing_rank(own: Iterable[RecordingView]) -> str:
    """Return the reason why a sensor is not ranked, from its recordings."""
    at_rest = [view for view in own if view.static]
    if not at_rest:
        return "no recording at rest"
    return verdicts.doubts_text(doubt for view in at_rest for doubt in view.row.doubts)


def _cell(row: RankingRow, scale: Scale) -> Cell:
    if row.margin is None or row.verdict == "excluded":
        return _make_unjudged_cell(row, scale)
    low, high = compute_margin_limits(row)
    log = math.log10(row.margin) if row.margin else -_MAX_ORDER_DECADES
    log = min(max(log, -_MAX_ORDER_DECADES), _MAX_ORDER_DECADES)
    bar, likely = None, None
    if low is not None and high is not None:
        bar = (scale.place(row.margin), scale.place(low), scale.place(high))
    if row.verdict == "meets_if" and row.likely_margin is not None:
        likely = _place_margin(row, "likely_margin", row.likely_margin, scale)
    return Cell(
        row.requirement,
        row.sensor,
        row.verdict,
        conditions=len(row.conditions),
        margin=format_margin(row),
        other_margins=verdicts.other_margins_text(row),
        bar=bar,
        noise=None if row.noise_margin is None else scale.place(row.noise_margin),
        likely=likely,
        weak=verdicts.evidence_text(row),
        doubts=verdicts.used_doubts_text(row),
        order=round(10.0 * (row.verdict in PASSING_VERDICTS) + log, 4),
    )


def _make_unjudged_cell(row: RankingRow, scale: Scale) -> Cell:
    if row.verdict == "excluded":
        reason = "; ".join(map(verdicts.shortfall_text, row.shortfalls))
    elif row.left_out:
        reason = f"no usable recording: {verdicts.doubts_text(row.left_out)}"
    else:
        reason = "; ".join(row.reasons) or "too little is known"
    # Margins with the recordings that are not used, and with corrected units.
    alternatives = [
        (words, *_place_margin(row, name, size, scale))
        for words, name, size in (
            ("as logged", "logged_margin", row.logged_margin),
            ("with the unit corrected", "corrected_margin", row.corrected_margin),
        )
        if size is not None
    ]
    names = row.requirement, row.sensor
    return Cell(*names, row.verdict, reason=reason, alternatives=alternatives)


def _place_margin(
    row: RankingRow, name: str, size: float, scale: Scale
) -> tuple[SourcedNumber, float]:
    return source_number(row, name, numbers.number_text(size, 2)), scale.place(size)


def summarise_counts(site: Site) -> list[dict[str, object]]:
    """Return counts for the start page, such as ``3 sensors``, each with its link."""
    views = site.views
    rejected = sum(view.rejected for view in views)
    failed = sum(view.left_out for view in views) - rejected
    seconds = sum(view.row.duration or 0.0 for view in views)
    doubted = sum(bool(view.warnings) for view in views)
    parts = [
        (numbers.counted(len(site.sensors), "sensor"), "#sensors", 0),
        (numbers.counted(len(views), "recording"), "recordings.html", 0),
        (f"{numbers.duration_text(seconds)} of data", "recordings.html", 0),
        (f"{rejected} rejected", "#rejected" if rejected else "recordings.html", rejected),
        (f"{doubted} in doubt", "#warnings" if doubted else "recordings.html", doubted),
        *([(f"{failed} failed", "#failed", failed)] if failed else []),
    ]
    return [
        {"number": number, "words": words, "to": to, "bad": bad}
        for text, to, bad in parts
        for number, words in [text.split(" ", 1)]
    ]


_STEPS = 3  # next steps on the start page; the table has all
_LINE = 100  # characters of a reason that fit on one line


def _start(site: Site) -> Mapping[str, object]:
    views = site.views
    compared = site.select_compared(views)
    together = Comparison(site.compared(compared), site.names)
    warned = [view for view in views if view.warnings]
    found = Counter(
        name for view in warned for name in dict.fromkeys(row.finding for row in view.warnings)
    )
    by_name = {view.full_name: view for view in views}
    # Of the recordings in doubt, those with a warning that nobody expects.
    unexpected = sum(
        any(row.finding not in site.on_purpose(view) for row in view.warnings) for view in warned
    )
    in_doubt = f"{numbers.counted(len(warned), 'recording')} in doubt"
    if unexpected < len(warned):
        in_doubt += f", all{f' but {unexpected}' if unexpected else ''} simulated with these faults"
    return {
        "strip": summarise_counts(site),
        "about": " ".join(filter(None, (describe_dates(views), describe_simulated(views)))),
        "matrix": make_decision_matrix(site),
        "interactive": "models" in site.settings,
        "failures": [
            {**row.columns(), "view": by_name.get((row.sensor, row.recording or ""))}
            for row in site.rows(FailureRow)
        ],
        "rejected": [
            {"view": view, "reason": fold_reason(view.row.reason)}
            for view in views
            if view.rejected
        ],
        "skipped": [row for row in site.rows(FileRow) if row.status == "skipped"],
        "warned": [
            {
                "view": view,
                "findings": _group_findings(view.warnings),
                "on_purpose": list(dict.fromkeys(site.on_purpose(view).values())),
            }
            for view in warned
        ],
        "in_doubt": in_doubt,
        "found": [name for name, _ in found.most_common(2)],
        "changed": site.changed_devices(),
        "rankings": list(_list_rankings(site)),
        "next_steps": list(_list_next_steps(site)),
        "forest": FOREST,
        "twins": [
            (name, name.replace("_", " ")) for name in site.channel_names if references("drawings")
        ],
        "parameter_tables": list(together.tables()),
        "latest": len(compared) < len(views),
        "sensors": {name: _describe_sensor(site, name) for name in site.sensors},
        "page": {
            "grouped": "sensor",
            "looks": pack_styles(site.looks),
            "names": site.names,
            **together.page,
        },
    }


def summarise_recordings(views: Sequence[RecordingView], several: bool = True) -> str:
    """Return number, length, dates and states of recordings, of ``several`` sensors or one."""
    sensors = {view.sensor for view in views}
    rejected = sum(view.rejected for view in views)
    failed = sum(view.left_out for view in views) - rejected
    among = f" of {numbers.counted(len(sensors), 'sensor')}" if several else ""
    parts = [numbers.counted(len(views), "recording") + among]
    lasting = sum(view.row.duration or 0.0 for view in views)
    parts += [f"{numbers.duration_text(lasting)} of data" if lasting else "", describe_dates(views)]
    unused = sum(view.row.decides is False for view in views) - rejected - failed
    states = {"rejected": rejected, "failed": failed, "not used in comparisons": max(unused, 0)}
    parts += [f"{count} {state}" for state, count in states.items() if count]
    return f"{', '.join(filter(None, parts))}. {describe_simulated(views)}".rstrip()


def describe_dates(views: Sequence[RecordingView]) -> str:
    """Return the dates of recordings; empty if none is known."""
    started = sorted(view.row.started[:10] for view in views if view.row.started)
    if not started:
        return ""
    same = started[0] == started[-1]
    text = f"recorded on {started[0]}" if same else f"recorded from {started[0]} to {started[-1]}"
    if any(not view.row.started and not view.left_out for view in views):
        text += f" ({len(started)} of {len(views)} say when)"
    return text


def describe_simulated(views: Sequence[RecordingView]) -> str:
    """Return the number of simulated recordings in a sentence; empty if there are none."""
    number = sum(view.simulated for view in views)
    if not number:
        return ""
    if number == len(views):
        return f"{'All recordings are' if number > 1 else 'It is'} simulated, not measured."
    return f"{number} of them {'is' if number == 1 else 'are'} simulated, not measured."


def fold_reason(reason: str | None) -> tuple[str, str]:
    """Return the beginning of a reason that fits on a line, and the full text if it is longer."""
    if reason is None or len(reason) <= _LINE:
        return reason or "", ""
    begin = reason[: _LINE - 1]
    return f"{begin[: begin.rfind(' ')].rstrip(',;:')} …", reason


def _group_findings(rows: Sequence[FindingRow]) -> list[tuple[str, str]]:
    grouped: dict[str, dict[str, None]] = {}
    for row in rows:
        channels = grouped.setdefault(row.finding, {})
        if row.channel:
            channels[row.channel.replace("_", " ")] = None
    return [(name, ", ".join(channels)) for name, channels in grouped.items()]


def _list_rankings(site: Site) -> Iterator[Mapping[str, object]]:
    simulated = {view.full_name: view.simulated for view in site.views}
    rows = site.rows(RankingRow)
    for name, groups in format_rankings(rows, site.requirements, simulated, site.system):
        ranked = [group for group in groups if group.row.rank]
        yield {
            "name": name,
            "requirement": site.requirements[name],
            "groups": groups,
            "asked": verdicts.requirement_text(site.requirements[name]),
            "answer": _answer(site, groups, ranked),
            "details": list(_details(site, groups, ranked)),
            "tied": {group.sensor: _name_tied(site, group) for group in groups},
        }


def _name_tied(site: Site, group: Group) -> list[str]:
    return [site.names.get(name, name) for name in group.row.tied_with]


def _answer(site: Site, groups: Sequence[Group], ranked: Sequence[Group]) -> str:
    marked = {g.sensor: f"{site.names[g.sensor]} (simulated)" for g in ranked if g.simulated}
    excluded = sum(group.row.verdict == "excluded" for group in groups)
    rows = [group.row for group in ranked]
    return verdicts.answer_text(rows, {**site.names, **marked}, len(groups), excluded)


def _details(site: Site, groups: Sequence[Group], ranked: Sequence[Group]) -> Iterator[str]:
    """Yield the deciding limit of the best sensor, its data, and the verdicts on the others."""
    for group in ranked[:1]:
        decides = next(limit for limit in group.limits if limit.decides)
        differ = len(set(decides.interval.split(" to "))) > 1  # as printed
        interval = Markup(" ({})").format(decides.interval) if differ else ""
        text = Markup(
            "Deciding limit: {}. Expected error (1σ) {}{}; the limit allows {} (1σ)."
        ).format(decides.limit, decides.sigma, interval, decides.allowed)
        if decides.reason:
            text += f" The error may be larger: {decides.reason}."
        yield text + f" {_describe_data(site, group.row)}"  # still markup
        if conditions := group.row.conditions:
            yield f"Conditions: {'; '.join(map(verdicts.condition_text, conditions))}."
        if tied := _name_tied(site, group):
            others = numbers.join_names(tied)
            yield f"The difference from {others} is not statistically significant."
    yield from verdicts.list_others(
        (group.row for group in groups if group not in ranked[:1]), site.names
    )
    for group in groups:
        if group.corrected:
            yield f"With its recording in doubt, {site.names[group.sensor]} {group.corrected}."


def _list_next_steps(site: Site) -> Iterator[Mapping[str, object]]:
    for row in site.rows(NextStepRow)[:_STEPS]:
        yield {
            "sensor": row.sensor,
            "simulated": all(
                view.simulated
                for view in site.views
                if view.sensor == row.sensor and row.recording in (None, view.name)
            ),
            "text": numbers.sentence(row.text),
            "brief": numbers.sentence(verdicts.next_step_text(row, brief=True)),
            "about": "; ".join(site.requirements[name].title for name in row.requirements),
        }


def _describe_data(site: Site, row: RankingRow) -> str:
    own = [view for view in site.views if view.sensor == row.sensor and view.static]
    chosen = next((view for view in own if view.name == row.recording), None)
    left_out = (
        f" Not used: {verdicts.doubts_text(row.left_out, named=True)}." if row.left_out else ""
    )
    if chosen is None or not row.recordings:
        return left_out.strip()
    axes = numbers.counted(len(chosen.recommended()), "axis", "axes")
    log = f"{chosen.name} ({numbers.duration_text(chosen.row.duration)}, {axes})"
    if row.recordings == 1:
        text = f"Data: one recording, {log}; other specimens may differ."
    else:
        of = (
            f" of {numbers.counted(row.specimens, 'specimen')}" if row.specimens is not None else ""
        )
        text = f"Data: {row.recordings} recordings{of}; {log} is nearest to the prediction."
    if spread := verdicts.spread_text(row):
        text += f" Spread: {spread}."
    if row.doubts:
        text += f" Doubts: {verdicts.used_doubts_text(row)}."
    return text + left_out


def _describe_sensor(site: Site, name: str) -> Mapping[str, object]:
    own = [view for view in site.views if view.sensor == name]
    counts = [numbers.counted(len(own), "recording")]
    for status in ("rejected", "failed"):
        number = sum(view.row.status == status for view in own)
        counts += [f"{number} {status}"] * bool(number)
    simulated = all(view.simulated for view in own)
    return {
        "name": name,
        "price_class": site.settings["sensors"].get(name, {}).get("price_class"),
        "counts": ", ".join(counts + ["simulated"] * simulated),
        "simulated": simulated,
    }


def _recordings(site: Site) -> Mapping[str, object]:
    filters = {
        "status": list(dict.fromkeys(view.row.status for view in site.views)),
        "sensor": [site.names[sensor] for sensor in site.sensors],
    }
    return {"views": site.views, "summary": summarise_recordings(site.views), "filters": filters}


START = Entry(
    file="index.html",
    title="Comparison",
    context=_start,
    tables=("failures", "files", "pooled", "ranking", "next_steps", "drift", "coverage"),
    views=lambda site: site.views,
)

RECORDINGS = Entry(
    file="recordings.html",
    title="Recordings",
    about="every recording with its status, length, rate and warnings",
    context=_recordings,
    views=lambda site: site.views,
)
