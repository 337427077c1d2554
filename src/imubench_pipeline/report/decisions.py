"""The decision matrix: every sensor and requirement, in a word, a margin and a bar.

All of it is of the rows of the table ``ranking`` that decide.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.navigation.suitability.conditions import EXCLUDED
from imubench_pipeline.report.site import Site
from imubench_pipeline.report.told import Told, margin, margin_limits, of_ranking
from imubench_pipeline.report.view import RecordingView
from imubench_pipeline.report.words import evidence_words
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.words.numbers import counted, duration_text, number_text

WORDS: Mapping[str, str] = {
    "passes": "chance of 97.5 % or more",
    "likely": "50 to 97.5 %",
    "open": "2.5 to 50 %, or known too badly",
    "fails": "below 2.5 %",
    "not judged": "no figure, or not admitted",
}
"""The words of the matrix, the best first, and what they mean."""

_WORD_OF = {
    "passes": "passes",
    "passes if": "passes",
    "probably passes": "likely",
    "probably passes if": "likely",
    "probably fails": "open",
    "surely fails": "fails",
}

_LOGS = 4.0
"""Decades to either side of 1 beyond which margins are sorted alike."""

_DECADES = 2.0
"""Decades to either side of 1 that a bar shows at most."""


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
        return cls(max(low, -_DECADES) - 0.08, min(high, _DECADES) + 0.08)

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
    word: str
    conditions: int  # figures that are not known, on which the word rests
    margin: tuple[Told, Told, Told] | None  # with its 95 % limits
    bar: tuple[float, float, float] | None  # of these, the places
    weak: str  # what makes the evidence weak, in words
    doubts: str  # what is doubted of the recordings
    reason: str  # why it is not judged
    otherwise: Sequence[tuple[str, Told, float]]  # as logged, and mended: margins and places
    order: float  # larger is better

    @property
    def hatched(self) -> bool:
        """Whether the evidence is weak or in doubt."""
        return bool(self.weak or self.doubts)


@dataclass(frozen=True)
class Column:
    """A requirement."""

    name: str
    title: str
    short: str
    limits: Sequence[str]
    answer: str


def matrix(site: Site) -> dict[str, Any] | None:
    """Return the matrix of a report; None where nothing is asked of its sensors."""
    requirements = site.settings["requirements"]
    rows = {(row.requirement, row.sensor): row for row in site.rows(RankingRow) if row.decides}
    if not rows:
        return None
    scale = Scale.of(value for row in rows.values() for value in _drawn(row))
    lines = {
        sensor: [
            _cell(row, scale) if (row := rows.get((name, sensor))) else _empty(site, name, sensor)
            for name in requirements
        ]
        for sensor in site.sensors
    }
    # What nobody can buy is no row among what can be bought.
    apart = {sensor: "not sold" for sensor in site.sensors if not site.is_sold(sensor)}
    lines = {sensor: cells for sensor, cells in lines.items() if sensor not in apart}
    order = sorted(lines, key=lambda sensor: (_merit(lines[sensor]), site.names[sensor]))
    return {
        "columns": [
            _column(name, declared, answer([cells[place] for cells in lines.values()], site.names))
            for place, (name, declared) in enumerate(requirements.items())
        ],
        "lines": [(sensor, lines[sensor]) for sensor in order],
        "apart": apart,
        "scale": scale,
        "words": WORDS,
    }


def _merit(cells: Sequence[Cell]) -> tuple[float, ...]:
    """Return a key that puts first what passes most, then what is likely to, and so on."""
    words = list(WORDS)
    counts = [-sum(cell.word == word for cell in cells) for word in words]
    return (*counts, -sum(cell.order for cell in cells))


def answer(cells: Sequence[Cell], names: Mapping[str, str]) -> str:
    """Return in a line which sensor to choose, of the cells of a requirement."""
    judged = [cell for cell in cells if cell.word != "not judged"]
    if not judged:
        return "no sensor could be judged."
    best = max(judged, key=lambda cell: cell.order)
    name = names[best.sensor]
    if best.word in ("passes", "likely"):
        verb = "passes" if best.word == "passes" else "is likely to pass"
        text = f"{name} {verb}"
        if best.conditions:
            text += f" if {counted(best.conditions, 'condition')} {_hold(best.conditions)}"
        text += f", the best of {len(judged)} judged" if len(judged) > 1 else ", alone judged"
    else:
        of = (
            f"none of {len(judged)} judged"
            if len(judged) > 1
            else "the one that is judged does not"
        )
        verb = "passes" if len(judged) > 1 else "pass"
        text = f"{of} {verb}; {name} is nearest"
    return f"{text}{', on weak evidence' * bool(best.weak)}."


def _hold(number: int) -> str:
    return "holds" if number == 1 else "hold"


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
    known = [size for size in (row.logged_margin, row.unless_margin) if size is not None]
    if row.margin is None:
        return known
    return [row.margin, *(limit for limit in margin_limits(row) if limit is not None)]


def word_of(row: RankingRow) -> str:
    """Return the word of a row of the table ``ranking`` that decides."""
    if row.verdict == "not enough data" and row.margin is not None:
        return "open"
    return _WORD_OF.get(row.verdict, "not judged")


def unranked(own: Iterable[RecordingView]) -> str:
    """Return in a few words why a sensor is in no ranking, of its recordings."""
    at_rest = [view for view in own if view.static]
    if not at_rest:
        return "no recording at rest"
    return "; ".join(dict.fromkeys(view.row.doubts for view in at_rest if view.row.doubts))


def _why(site: Site, sensor: str) -> str:
    """Return in a few words why a sensor would be in no ranking."""
    return unranked(view for view in site.views if view.sensor == sensor)


def _empty(site: Site, requirement: str, sensor: str) -> Cell:
    """Return the cell of a sensor that is in no ranking."""
    reason = _why(site, sensor)
    word = "not judged"
    return Cell(requirement, sensor, word, 0, None, None, "", "", reason, (), -math.inf)


def _cell(row: RankingRow, scale: Scale) -> Cell:
    word = word_of(row)
    judged = word != "not judged"
    shown = margin(row) if judged else None
    low, high = margin_limits(row) if shown else (None, None)
    bar = None
    if row.margin is not None and low is not None and high is not None:
        bar = (scale.place(row.margin), scale.place(low), scale.place(high))
    ranked = list(WORDS)
    return Cell(
        row.requirement,
        row.sensor,
        word,
        _conditions(row) if judged else 0,
        shown,
        bar,
        evidence_words(row) if judged else "",
        row.doubts or "",
        "" if judged else _reason(row),
        [] if judged else _otherwise(row, scale),
        _order(len(WORDS) - ranked.index(word), row.margin) if judged else -math.inf,
    )


def _order(place: int, size: float | None) -> float:
    log = math.log10(size) if size else -_LOGS
    return round(10.0 * place + min(max(log, -_LOGS), _LOGS), 4)


def _conditions(row: RankingRow) -> int:
    """Return on how many conditions a verdict rests."""
    return len((row.conditions or "").split("; ")) if row.verdict.endswith(" if") else 0


def _reason(row: RankingRow) -> str:
    """Return in a few words why a sensor is not judged."""
    if row.verdict == EXCLUDED:
        return str(row.conditions)
    if row.verdict != "not enough data":
        return str(row.verdict)
    if row.left_out:
        return "in doubt" if row.doubts else str(row.left_out)
    return str(row.reason or "too little is known")


def _otherwise(row: RankingRow, scale: Scale) -> list[tuple[str, Told, float]]:
    """Return the margins that a recording in doubt would have."""
    named = (
        ("as logged", "logged_margin", row.logged_margin),
        ("mended", "unless_margin", row.unless_margin),
    )
    return [
        (words, of_ranking(row, name, number_text(size, 3)), scale.place(size))
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
