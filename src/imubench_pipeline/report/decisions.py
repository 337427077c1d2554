"""The decision matrix: verdict and margin of each sensor for each requirement.

It shows the deciding rows of the table ``ranking``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.model.states import Verdict
from imubench_pipeline.report.site import Site
from imubench_pipeline.report.sourced import SourcedNumber, margin, margin_limits, of_ranking
from imubench_pipeline.report.view import RecordingView
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.words.numbers import counted, duration_text, number_text
from imubench_pipeline.words.verdicts import (
    SHORT_VERDICTS,
    VERDICT_MEANINGS,
    answer_text,
    doubts_text,
    evidence_text,
    shortfall_text,
    used_doubts_text,
)

_VERDICTS: tuple[Verdict, ...] = get_args(Verdict)

_MAX_ORDER_DECADES = 4.0
"""Maximum decades from 1 by which margins are sorted."""

_MAX_BAR_DECADES = 2.0
"""Maximum decades from 1 that a bar shows."""


@dataclass(frozen=True)
class Scale:
    """The logarithmic scale on which all margins of a matrix are drawn."""

    low: float  # decades, of the left end
    high: float

    @classmethod
    def of(cls, margins: Iterable[float]) -> Scale:
        """Return the scale that shows margins, half and twice the limit at least."""
        logs = [math.log10(value) for value in margins if 0.0 < value < math.inf]
        low, high = min([*logs, math.log10(0.5)]), max([*logs, math.log10(2.0)])
        return cls(max(low, -_MAX_BAR_DECADES) - 0.08, min(high, _MAX_BAR_DECADES) + 0.08)

    def place(self, value: float) -> float:
        """Return where a margin is drawn, % of the width; at an end what lies beyond it."""
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
    word: str  # verdict in words
    conditions: int  # unknown figures on which the verdict depends
    margin: tuple[SourcedNumber, SourcedNumber, SourcedNumber] | None  # with its 95 % limits
    bar: tuple[float, float, float] | None  # of these, the places
    weak: str  # reasons for weak evidence
    doubts: str  # doubts about the recordings
    reason: str  # why it is not judged
    alternatives: Sequence[tuple[str, SourcedNumber, float]]  # margins as logged and corrected
    order: float  # larger is better

    @property
    def judged(self) -> bool:
        """Whether it has a margin."""
        return self.margin is not None

    @property
    def hatched(self) -> bool:
        """Whether the evidence is weak, or the recordings are in doubt."""
        return bool(self.weak or self.doubts)


@dataclass(frozen=True)
class Column:
    """A requirement."""

    name: str
    title: str
    short: str
    limits: Sequence[str]
    answer: str


@dataclass(frozen=True)
class Matrix:
    """All sensors and requirements."""

    columns: Sequence[Column]
    lines: Sequence[tuple[str, Sequence[Cell]]]  # by sensor, the best first
    apart: Mapping[str, str]  # sensors that are not compared, and why
    scale: Scale
    legend: Sequence[tuple[Verdict, str, str]]  # verdict, its word and meaning


def matrix(site: Site) -> Matrix | None:
    """Return the matrix of a report; None where nothing is asked of its sensors."""
    requirements = site.settings["requirements"]
    rows = {(row.requirement, row.sensor): row for row in site.rows(RankingRow) if row.decides}
    if not rows:
        return None
    scale = Scale.of(value for row in rows.values() for value in _drawn(row))
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
    order = sorted(lines, key=lambda sensor: (_merit(lines[sensor]), site.names[sensor]))
    columns = []
    for place, (name, declared) in enumerate(requirements.items()):
        cells = [cells[place] for cells in lines.values()]
        judged = sorted((cell for cell in cells if cell.judged), key=lambda cell: -cell.order)
        best = [rows[name, cell.sensor] for cell in judged]
        excluded = sum(cell.verdict == "excluded" for cell in cells)
        answer = answer_text(best, site.names, len(cells), excluded)
        columns.append(_column(name, declared, answer))
    return Matrix(
        columns,
        [(sensor, lines[sensor]) for sensor in order],
        apart,
        scale,
        [(verdict, SHORT_VERDICTS[verdict], VERDICT_MEANINGS[verdict]) for verdict in _VERDICTS],
    )


def _merit(cells: Sequence[Cell]) -> tuple[float, ...]:
    """Return a key that puts first the sensor with the most met limits, and so on."""
    counts = [
        -sum(cell.judged and cell.verdict == verdict for cell in cells) for verdict in _VERDICTS
    ]
    return (*counts, -sum(cell.order for cell in cells))


def _column(name: str, declared: Mapping[str, Any], answer: str) -> Column:
    requirement = Requirement.model_validate(declared)
    short = name.replace("_", " ").capitalize()
    limits = [
        f"{x.error} {x.at_most} in {x.after or f'{x.outage} without GNSS'}"
        for x in requirement.limits
    ]
    return Column(name, requirement.title, short, limits, answer)


def _drawn(row: RankingRow) -> list[float]:
    """Return the margins of a row that are drawn."""
    known = [size for size in (row.logged_margin, row.corrected_margin) if size is not None]
    if row.margin is None:
        return known
    return [row.margin, *(limit for limit in margin_limits(row) if limit is not None)]


def unranked(own: Iterable[RecordingView]) -> str:
    """Return why a sensor is in no ranking, from its recordings."""
    at_rest = [view for view in own if view.static]
    if not at_rest:
        return "no recording at rest"
    return doubts_text(doubt for view in at_rest for doubt in view.row.doubts)


def _empty(site: Site, requirement: str, sensor: str) -> Cell:
    """Return the cell of a sensor that is in no ranking."""
    reason = unranked(view for view in site.views if view.sensor == sensor)
    word = SHORT_VERDICTS["not_enough_data"]
    return Cell(
        requirement, sensor, "not_enough_data", word, 0, None, None, "", "", reason, (), -math.inf
    )


def _cell(row: RankingRow, scale: Scale) -> Cell:
    judged = row.margin is not None and row.verdict != "excluded"
    low, high = margin_limits(row) if judged else (None, None)
    bar = None
    if row.margin is not None and low is not None and high is not None:
        bar = (scale.place(row.margin), scale.place(low), scale.place(high))
    place = len(_VERDICTS) - _VERDICTS.index(row.verdict)
    return Cell(
        row.requirement,
        row.sensor,
        row.verdict,
        SHORT_VERDICTS[row.verdict],
        len(row.conditions) if judged else 0,
        margin(row) if judged else None,
        bar,
        evidence_text(row) if judged else "",
        used_doubts_text(row),
        "" if judged else _explain(row),
        [] if judged else _alternatives(row, scale),
        _order(place, row.margin) if judged else -math.inf,
    )


def _order(place: int, size: float | None) -> float:
    log = math.log10(size) if size else -_MAX_ORDER_DECADES
    return round(10.0 * place + min(max(log, -_MAX_ORDER_DECADES), _MAX_ORDER_DECADES), 4)


def _explain(row: RankingRow) -> str:
    """Return why a sensor is not judged."""
    if row.verdict == "excluded":
        return "; ".join(map(shortfall_text, row.shortfalls))
    if row.left_out:
        return doubts_text(row.left_out[:1])
    return row.reason or "too little is known"


def _alternatives(row: RankingRow, scale: Scale) -> list[tuple[str, SourcedNumber, float]]:
    """Return the margins with the recordings that are not used, and with corrected units."""
    named = (
        ("as logged", "logged_margin", row.logged_margin),
        ("if corrected", "corrected_margin", row.corrected_margin),
    )
    return [
        (words, of_ranking(row, name, number_text(size, 2)), scale.place(size))
        for words, name, size in named
        if size is not None
    ]


def strip(site: Site) -> list[dict[str, Any]]:
    """Return what the report is of, in numbers: each with its words, and where it leads."""
    views = site.views
    rejected = sum(view.rejected for view in views)
    failed = sum(view.left_out for view in views) - rejected
    seconds = sum(view.row.duration or 0.0 for view in views)
    doubted = sum(bool(view.warnings) for view in views)
    parts = [
        (len(site.sensors), counted(len(site.sensors), "sensor"), "#sensors"),
        (len(views), counted(len(views), "recording"), "recordings.html"),
        (seconds, f"{duration_text(seconds)} of data", "recordings.html"),
        (rejected, f"{rejected} rejected", "#rejected" if rejected else "recordings.html"),
        (doubted, f"{doubted} in doubt", "#warnings" if doubted else "recordings.html"),
    ]
    if failed:
        parts.append((failed, f"{failed} failed", "#failed"))
    return [
        {"number": text.split(" ")[0], "words": text.split(" ", 1)[1], "to": to, "bad": bad}
        for bad, (_, text, to) in zip((0, 0, 0, rejected, doubted, failed), parts, strict=False)
    ]
