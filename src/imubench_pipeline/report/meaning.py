"""Rankings and error budgets as the pages and the terminal show them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from imubench_pipeline.model.comparisons import ErrorBudgetRow, RankingRow
from imubench_pipeline.navigation.suitability.conditions import shares_of
from imubench_pipeline.report.backtest import standing_text
from imubench_pipeline.report.practical import System, unit_of
from imubench_pipeline.report.sourced import (
    SourcedInterval,
    SourcedNumber,
    margin,
    of_budget,
    of_ranking,
)
from imubench_pipeline.settings.requirements import DIMENSIONS, Requirement
from imubench_pipeline.words.numbers import NO_VALUE, Unit, duration_text, interval_text
from imubench_pipeline.words.verdicts import (
    VERDICT_WORDS,
    corrected_text,
    evidence_text,
    share_text,
    stated_verdict,
    used_doubts_text,
)

Simulated = Mapping[tuple[str, str], bool]

_NAMES = {
    "attitude": "attitude (tilt)",
    "heading": "heading",
    "velocity": "velocity, one axis",
    "position": "position, one axis",
    "north": "north, found at rest",
}
_ERRORS = tuple(_NAMES)
_QUARTER_TURN = math.pi / 2.0


@dataclass(frozen=True)
class LimitLine:
    """A limit of a requirement, and the error of a sensor, as texts."""

    limit: str
    allowed: SourcedNumber
    sigma: str
    interval: str
    margin: str
    margins: str
    chance: str
    source: str
    parts: Sequence[str]
    reached: str
    decides: bool
    reason: str
    backtest: str


@dataclass(frozen=True)
class Group:
    """The lines of a sensor in the ranking for a requirement."""

    row: RankingRow  # of the deciding limit
    simulated: bool
    rank: str
    verdict: str
    stated: str  # verdict with its conditions, or shortfalls
    weak: str  # reasons for weak evidence
    doubts: str
    corrected: str  # verdict with a corrected unit, or with recordings that are not used
    limits: Sequence[LimitLine]

    @property
    def sensor(self) -> str:
        """Name of its file."""
        return self.row.sensor


@dataclass(frozen=True)
class Ranking:
    """The sensors in their order for a requirement."""

    name: str
    requirement: Requirement
    groups: Sequence[Group]


def rankings(
    rows: Sequence[RankingRow],
    requirements: Mapping[str, Any],
    simulated: Simulated,
    system: System,
) -> Iterator[Ranking]:
    """Yield the ranking for each requirement.

    Parameters
    ----------
    rows : sequence of RankingRow
    requirements : mapping of str to mapping
        As the plan wrote them.
    simulated : mapping of (str, str) to bool
        Whether a recording is simulated.
    system : {'practical', 'si'}
    """
    for name, declared in requirements.items():
        own = [row for row in rows if row.requirement == name]
        sensors = sorted(dict.fromkeys(row.sensor for row in own), key=_order(own))
        groups = [
            _group([row for row in own if row.sensor == sensor], simulated, system)
            for sensor in sensors
        ]
        yield Ranking(name, Requirement.model_validate(declared), groups)


def _group(limits: Sequence[RankingRow], simulated: Simulated, system: System) -> Group:
    row = next(row for row in limits if row.decides)
    used = {limit.recording for limit in limits}
    return Group(
        row,
        simulated=all(
            recording is not None and simulated.get((row.sensor, recording), False)
            for recording in used
        ),
        rank=str(row.rank or NO_VALUE),
        verdict=VERDICT_WORDS[row.verdict],
        stated=stated_verdict(row),
        weak=evidence_text(row) if row.rank else "",
        doubts=used_doubts_text(row) if row.rank else "",
        corrected=corrected_text(row),
        limits=[_limit(limit, system) for limit in limits],
    )


def _order(rows: Sequence[RankingRow]) -> Any:
    """Return a key that sorts by rank, and equal ranks by conditions and margin.

    A sensor with unknown figures has a large margin, and conditions.
    """
    places: dict[str, tuple[int, int, float]] = {}
    for row in rows:
        if row.decides:
            rank, margin = row.rank or 10**6, row.margin or 0.0
            meets = row.verdict in ("meets", "likely_meets")
            place = (1 if row.conditions else 0) if meets else 2
            places[row.sensor] = (rank, place, -margin)
    return places.__getitem__


def _limit(row: RankingRow, system: System) -> LimitLine:
    size = margin(row)
    chance = "–" if row.sigma is None else of_ranking(row, "chance", _percent(row.chance), "%")
    return LimitLine(
        limit=limit_words(row),
        allowed=_allowed(row, system),
        sigma=_expected(row, system),
        interval=_interval(row, system),
        margin=size[0] if size else NO_VALUE,
        margins=SourcedInterval(size[1], size[2]) if size else "",
        chance=chance,
        source=f"{row.source} ({_percent(row.share)})" if row.source else NO_VALUE,
        parts=[share_text(share) for share in row.parts] or [NO_VALUE],
        reached=duration_text(row.reached_after),
        decides=row.decides,
        reason=row.reason or "",
        backtest=standing_text(row),
    )


def _allowed(row: RankingRow, system: System) -> SourcedNumber:
    unit = unit_of(DIMENSIONS[row.error], system, row.limit)
    return of_ranking(row, "limit", f"{unit.text(row.limit, 3)} {unit.sign}", unit.sign)


ErrorRow = RankingRow | ErrorBudgetRow
"""A row of an error after a time."""


def _place(row: ErrorRow, column: str, text: str, unit: str) -> SourcedNumber:
    """Return a number of a row with its place in the tables."""
    if isinstance(row, RankingRow):
        return of_ranking(row, column, text, unit)
    return of_budget(row, column, text, unit)


def _expected(row: ErrorRow, system: System) -> str:
    """Return the error of a row; a dash where it is not known."""
    if row.sigma is None:
        return NO_VALUE
    unit = unit_of(DIMENSIONS[row.error], system, row.sigma)
    text = _shown(row, row.sigma, unit)
    return _place(row, "sigma", text, unit.sign) if _sensible(row, row.sigma) else text


def _interval(row: ErrorRow, system: System) -> str:
    """Return the limits of the error of a row, in the unit of the error."""
    if row.sigma is None or row.lower is None or row.upper is None:
        return NO_VALUE
    if not _sensible(row, row.sigma):
        return NO_VALUE
    unit = unit_of(DIMENSIONS[row.error], system, row.sigma)
    digits = unit.digits(row.sigma, row.lower, row.upper)
    lower, upper = (
        _place(row, name, unit.text(value, digits), unit.sign)
        for name, value in (("lower", row.lower), ("upper", row.upper))
    )
    return SourcedInterval(lower, upper)


def error_of_recording(total: ErrorBudgetRow, system: System) -> tuple[str, str]:
    """Return the error of a recording and its limits, of a total of ``error_budget``."""
    if total.sigma is None:
        return "–", ""
    return _expected(total, system), _interval(total, system)


def limit_words(row: RankingRow) -> str:
    """Return the error and the time of a limit, of a row of ``ranking``."""
    drive = f" without GNSS ({row.trajectory})" if row.trajectory else ""
    return f"{_NAMES[row.error]}, {duration_text(row.time)}{drive}"


def budget_tables(
    rows: Sequence[ErrorBudgetRow], simulated: Simulated, system: System
) -> Iterator[dict[str, Any]]:
    """Yield the error budget of each recording: a line an error and axis, a column a time.

    Of the table ``error_budget``, less what requirements ask for, and which recordings are
    simulated.
    """
    own = [row for row in rows if row.requirement is None]
    for key in dict.fromkeys((row.sensor, row.recording) for row in own):
        parts = [row for row in own if (row.sensor, row.recording) == key]
        times = list(dict.fromkeys(row.time for row in parts))
        lines: dict[tuple[str, tuple[float | None, ...]], dict[str, Any]] = {}
        missing: dict[str, None] = {}
        for error, axis in dict.fromkeys((row.error, row.axis) for row in parts):
            chosen = [row for row in parts if (row.error, row.axis) == (error, axis)]
            sigmas = tuple(row.sigma for row in chosen if row.source == "total")
            if not any(sigmas):
                missing[f"{_NAMES[error]}: {chosen[0].reason or 'not known'}"] = None
            elif (error, sigmas) in lines:
                # One channel is the worst and the median.
                lines[error, sigmas]["axis"] += f", {axis}"
            else:
                cells = [_cell([r for r in chosen if r.time == t], system) for t in times]
                lines[error, sigmas] = {"error": _NAMES[error], "axis": axis, "cells": cells}
        yield {
            "sensor": key[0],
            "recording": key[1],
            "simulated": simulated.get(key, False),
            "times": [duration_text(time) for time in times],
            "lines": list(lines.values()),
            "missing": "; ".join(missing),
            "notes": list(_notes(lines.values())),
        }


def budget_bars(rows: Sequence[ErrorBudgetRow], system: System) -> list[dict[str, Any]]:
    """Return a bar for each error and time of the worst axes: the parts of its variance.

    Of the rows of the table ``error_budget`` of one recording.
    """
    own = [row for row in rows if row.requirement is None]
    worst = [row for row in own if row.axis == own[0].axis]
    groups: dict[tuple[str, float], list[ErrorBudgetRow]] = {}
    for row in worst:
        groups.setdefault((row.error, row.time), []).append(row)
    bars = []
    for (error, time), parts in sorted(
        groups.items(), key=lambda group: _ERRORS.index(group[0][0])
    ):
        total = _total(parts)
        sigma = total.sigma if total else None
        if not total or not sigma:
            continue
        size = _shown(total, sigma, unit_of(DIMENSIONS[error], system, sigma))
        bars.append(
            {
                "label": f"{error} {duration_text(time)}: {size}",
                "shares": [
                    [row.source, float(f"{(row.sigma / sigma) ** 2:.3g}")]
                    for row in parts
                    if row.source != "total" and row.sigma
                ],
            }
        )
    return bars


def _total(rows: Iterable[ErrorBudgetRow]) -> ErrorBudgetRow | None:
    """Return the row of the total among the rows of an error and a time."""
    return next((row for row in rows if row.source == "total"), None)


def _notes(lines: Iterable[Mapping[str, Any]]) -> Iterator[str]:
    """Yield what is said of the cells of a budget, each thing once, with the errors it is about."""
    by_note: dict[str, dict[str, None]] = {}
    for line in lines:
        for cell in line["cells"]:
            if cell["note"]:
                by_note.setdefault(cell["note"], {})[line["error"].split(" (")[0]] = None
    for note, errors in by_note.items():
        yield f"{', '.join(errors).capitalize()}: {note}"


def _cell(rows: Sequence[ErrorBudgetRow], system: System) -> dict[str, Any]:
    """Return an error with its interval, and what it comes of."""
    total = _total(rows)
    if total is None or total.sigma is None:
        reason = total.reason if total else None
        return {"lines": [NO_VALUE], "note": reason or "", "class": "number none"}
    unit = unit_of(DIMENSIONS[total.error], system, total.sigma)
    lines = [_shown(total, total.sigma, unit)]
    if _sensible(total, total.sigma):
        digits = unit.digits(total.sigma, total.lower, total.upper)
        lines.append(interval_text(total.lower, total.upper, unit, digits))
    sources = [row for row in rows if row.source != "total"]
    if total.sigma > 0.0:
        lines += [share_text(share) for share in shares_of(total.sigma, sources)] or [""]
    return {"lines": lines, "note": total.reason or "", "class": "number"}


def _sensible(row: ErrorRow, sigma: float) -> bool:
    """Tell whether an error is below a quarter turn, beyond which an angle means nothing."""
    return DIMENSIONS[row.error] != "angle" or sigma <= _QUARTER_TURN


def _shown(row: ErrorRow, sigma: float, unit: Unit) -> str:
    """Return the error of a row with its unit, with the digits that its limits leave."""
    if not _sensible(row, sigma):
        north = row.error == "north"
        return "not to be found" if north else f"over {unit.text(_QUARTER_TURN, 3)} {unit.sign}"
    digits = unit.digits(sigma, row.lower, row.upper)
    return f"{unit.text(sigma, digits)} {unit.sign}"


def _percent(share: float | None) -> str:
    return NO_VALUE if share is None else f"{100 * share:.0f} %"


def budget_words(settings: Mapping[str, Any]) -> str:
    """Return what the errors of a budget mean, by the section ``error_budget`` of the settings."""
    return (
        "Errors that the noise causes in dead reckoning, with 95 % intervals and the parts of the "
        f"variance of 1 % or more. Biases and tilt are taken over {settings['static_window']} at "
        "rest right before; a tilt keeps the turn-on bias of the accelerometers, which is marked "
        "as it is from the datasheet. North is found at rest at a latitude of "
        f"{settings['latitude']}, by a gyro whose bias is known."
    )
