"""The decision matrix: verdict and margin of each sensor for each requirement.

It shows the deciding rows of the table ``ranking``.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import get_args

from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.model.states import Verdict
from imubench_pipeline.report.meaning import (
    SourcedNumber,
    compute_margin_limits,
    format_margin,
    source_number,
)
from imubench_pipeline.report.site import Site
from imubench_pipeline.report.view import RecordingView
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.words import verdicts
from imubench_pipeline.words.numbers import counted, duration_text, number_text

_VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
_MAX_ORDER_DECADES = 4.0  # maximum decades from 1 by which margins are sorted
_MAX_BAR_DECADES = 2.0  # maximum decades from 1 that a bar shows


@dataclass(frozen=True)
class Scale:
    """The logarithmic scale on which all margins of a matrix are drawn."""

    low: float  # decades, of the left end
    high: float

    @classmethod
    def of(cls, margins: Iterable[float]) -> Scale:
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
        """Decades with their places."""
        powers = range(math.ceil(self.low), math.floor(self.high) + 1)
        return [(number_text(10.0**power), self.place(10.0**power)) for power in powers]


@dataclass(frozen=True)
class Cell:
    """A sensor and a requirement."""

    requirement: str
    sensor: str
    verdict: Verdict
    conditions: int  # unknown figures on which the verdict depends
    margin: tuple[SourcedNumber, SourcedNumber, SourcedNumber] | None  # with its 95 % limits
    bar: tuple[float, float, float] | None  # of these, the places
    weak: str  # reasons for weak evidence
    doubts: str  # doubts about the recordings
    reason: str  # why it is not judged
    alternatives: Sequence[tuple[str, SourcedNumber, float]]  # margins as logged and corrected
    order: float  # larger is better

    @property
    def word(self) -> str:
        """The verdict in words."""
        return verdicts.SHORT_VERDICTS[self.verdict]

    @property
    def hatched(self) -> bool:
        """Whether the evidence is weak, or the recordings are in doubt."""
        return bool(self.weak or self.doubts)


@dataclass(frozen=True)
class Column:
    """A requirement."""

    name: str
    title: str
    limits: Sequence[str]
    answer: str

    @property
    def short(self) -> str:
        """The name in words."""
        return self.name.replace("_", " ").capitalize()


@dataclass(frozen=True)
class Matrix:
    """All sensors and requirements."""

    columns: Sequence[Column]
    lines: Sequence[tuple[str, Sequence[Cell]]]  # by sensor, the best first
    apart: Mapping[str, str]  # sensors that are not compared, and why
    scale: Scale
    legend: Sequence[tuple[Verdict, str, str]]  # verdict, its word and meaning


def make_decision_matrix(site: Site) -> Matrix | None:
    """Return the matrix of a report; None if there are no requirements."""
    requirements = site.settings["requirements"]
    rows = {(row.requirement, row.sensor): row for row in site.rows(RankingRow) if row.decides}
    if not rows:
        return None
    drawn: list[float | None] = []
    for deciding in rows.values():
        drawn += [deciding.logged_margin, deciding.corrected_margin, deciding.margin]
        drawn += compute_margin_limits(deciding) if deciding.margin is not None else ()
    scale = Scale.of(value for value in drawn if value is not None)
    # A sensor that cannot be bought is not compared with others.
    apart = {sensor: "not sold" for sensor in site.sensors if not site.is_sold(sensor)}
    lines = {
        sensor: [
            _cell(row, scale) if (row := rows.get((name, sensor))) else _empty(site, name, sensor)
            for name in requirements
        ]
        for sensor in site.sensors
        if sensor not in apart
    }

    def order(sensor: str) -> tuple[object, ...]:
        """Return the sort key: sensors that meet the most limits come first."""
        met = Counter(cell.verdict for cell in lines[sensor] if cell.margin)
        counts = [-met[verdict] for verdict in _VERDICTS]
        return (*counts, -sum(cell.order for cell in lines[sensor]), site.names[sensor])

    columns = []
    for place, (name, declared) in enumerate(requirements.items()):
        cells = [cells[place] for cells in lines.values()]
        judged = sorted((cell for cell in cells if cell.margin), key=lambda cell: -cell.order)
        best = [rows[name, cell.sensor] for cell in judged]
        excluded = sum(cell.verdict == "excluded" for cell in cells)
        answer = verdicts.answer_text(best, site.names, len(cells), excluded)
        requirement = Requirement.model_validate(declared)
        limits = [
            f"{x.error} {x.at_most} in {x.after or f'{x.outage} without GNSS'}"
            for x in requirement.limits
        ]
        columns.append(Column(name, requirement.title, limits, answer))
    return Matrix(
        columns,
        sorted(lines.items(), key=lambda line: order(line[0])),
        apart,
        scale,
        [
            (verdict, verdicts.SHORT_VERDICTS[verdict], verdicts.VERDICT_MEANINGS[verdict])
            for verdict in _VERDICTS
        ],
    )


def explain_missing_rank(own: Iterable[RecordingView]) -> str:
    """Return the reason why a sensor is not ranked, from its recordings."""
    at_rest = [view for view in own if view.static]
    if not at_rest:
        return "no recording at rest"
    return verdicts.doubts_text(doubt for view in at_rest for doubt in view.row.doubts)


def _empty(site: Site, requirement: str, sensor: str) -> Cell:
    """Return the cell of a sensor that is not ranked."""
    reason = explain_missing_rank(view for view in site.views if view.sensor == sensor)
    verdict: Verdict = "not_enough_data"
    return Cell(requirement, sensor, verdict, 0, None, None, "", "", reason, (), -math.inf)


def _cell(row: RankingRow, scale: Scale) -> Cell:
    judged = row.margin is not None and row.verdict != "excluded"
    low, high = compute_margin_limits(row) if judged else (None, None)
    bar, order = None, -math.inf
    if row.margin is not None and low is not None and high is not None:
        bar = (scale.place(row.margin), scale.place(low), scale.place(high))
    if judged:
        log = math.log10(row.margin) if row.margin else -_MAX_ORDER_DECADES
        place = len(_VERDICTS) - _VERDICTS.index(row.verdict)
        log = min(max(log, -_MAX_ORDER_DECADES), _MAX_ORDER_DECADES)
        order = round(10.0 * place + log, 4)
        reason = ""
    elif row.verdict == "excluded":
        reason = "; ".join(map(verdicts.shortfall_text, row.shortfalls))
    elif row.left_out:
        reason = verdicts.doubts_text(row.left_out[:1])
    else:
        reason = "; ".join(row.reasons) or "too little is known"
    # Margins with the recordings that are not used, and with corrected units.
    alternatives = [
        (words, source_number(row, name, number_text(size, 2)), scale.place(size))
        for words, name, size in (
            ("as logged", "logged_margin", row.logged_margin),
            ("if corrected", "corrected_margin", row.corrected_margin),
        )
        if size is not None and not judged
    ]
    return Cell(
        row.requirement,
        row.sensor,
        row.verdict,
        len(row.conditions) if judged else 0,
        format_margin(row) if judged else None,
        bar,
        verdicts.evidence_text(row) if judged else "",
        verdicts.used_doubts_text(row),
        reason,
        alternatives,
        order,
    )


def summarise_counts(site: Site) -> list[dict[str, object]]:
    """Return the counts of the report, each with its noun and link."""
    views = site.views
    rejected = sum(view.rejected for view in views)
    failed = sum(view.left_out for view in views) - rejected
    seconds = sum(view.row.duration or 0.0 for view in views)
    doubted = sum(bool(view.warnings) for view in views)
    parts = [
        (counted(len(site.sensors), "sensor"), "#sensors", 0),
        (counted(len(views), "recording"), "recordings.html", 0),
        (f"{duration_text(seconds)} of data", "recordings.html", 0),
        (f"{rejected} rejected", "#rejected" if rejected else "recordings.html", rejected),
        (f"{doubted} in doubt", "#warnings" if doubted else "recordings.html", doubted),
        *([(f"{failed} failed", "#failed", failed)] if failed else []),
    ]
    return [
        {"number": number, "words": words, "to": to, "bad": bad}
        for text, to, bad in parts
        for number, words in [text.split(" ", 1)]
    ]
