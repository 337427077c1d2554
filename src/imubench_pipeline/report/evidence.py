"""Trace each verdict on a sensor to its numbers and recordings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from imubench_pipeline.model.comparisons import ErrorBudgetRow, RankingRow
from imubench_pipeline.report.decisions import unranked
from imubench_pipeline.report.meaning import error_of_recording, limit_words, rankings
from imubench_pipeline.report.site import Site
from imubench_pipeline.report.sourced import of_row
from imubench_pipeline.report.view import RecordingView
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.words.numbers import counted, duration_text, number_text
from imubench_pipeline.words.requirements import requirement_text
from imubench_pipeline.words.verdicts import (
    SHORT_VERDICTS,
    condition_text,
    doubts_text,
    spread_text,
    stated_verdict,
    verdict_text,
)


def evidence(site: Site, sensor: str, own: Sequence[RecordingView]) -> Iterator[dict[str, Any]]:
    """Yield each requirement with the verdict on a sensor, its numbers and its recordings.

    ``own`` are the recordings of the sensor. Requirements without a verdict are included.
    """
    rows = site.rows(RankingRow)
    own_rows = [row for row in rows if row.sensor == sensor]
    totals = {view.name: list(_totals(view)) for view in own if view.static}
    simulated = {view.full_name: view.simulated for view in own}
    requirements = site.settings["requirements"] if rows else {}
    for ranking in rankings(own_rows, requirements, simulated, site.system):
        name, requirement = ranking.name, ranking.requirement
        about = {"name": name, "title": requirement.title, "asked": requirement_text(requirement)}
        stands = next((r for r in own_rows if r.requirement == name and r.decides), None)
        if stands is None:
            yield about | {
                "row": None,
                "verdict": "not_enough_data",
                "word": SHORT_VERDICTS["not_enough_data"],
                "why": unranked(own),
            }
            continue
        (group,) = ranking.groups
        judged = sum(
            row.rank is not None and row.decides and row.requirement == name for row in rows
        )
        yield about | {
            "row": stands,
            "verdict": stands.verdict,
            "word": SHORT_VERDICTS[stands.verdict],
            "stated": verdict_text(stands.verdict) if stands.conditions else stated_verdict(stands),
            "group": group,
            "place": f"rank {stands.rank} of {judged}" if stands.rank else "",
            "conditions": [condition_text(each) for each in stands.conditions],
            "spread": spread_text(stands),
            "left_out": doubts_text(stands.left_out, named=True),
            "alternatives": list(_alternatives(stands)),
            "window": _window(requirement),
            "limits": [
                limit_words(row)
                for row in own_rows
                if row.requirement == name and row.trajectory is None
            ],
            "recordings": [
                _recording(site, view, [t for t in totals[view.name] if t.requirement == name])
                for view in own
                if view.static
            ],
        }


def _alternatives(row: RankingRow) -> Iterator[tuple[str, str, str]]:
    """Yield alternative verdicts: the case, the verdict and its margin."""
    for words, name, size, verdict in (
        ("As logged", "logged_margin", row.logged_margin, row.logged_verdict),
        (
            "With the unit corrected",
            "corrected_margin",
            row.corrected_margin,
            row.corrected_verdict,
        ),
    ):
        if size is not None:
            yield (
                words,
                verdict_text(verdict) if verdict else "",
                of_row(row, name, number_text(size, 3)),
            )


def _window(requirement: Requirement) -> str:
    """Return the origin of the biases of all errors of the requirement."""
    if requirement.static_window:
        return f"{requirement.static_window} at rest right before"
    return "turn-on biases, not calibrated" if requirement.turn_on else ""


def _totals(view: RecordingView) -> Iterator[ErrorBudgetRow]:
    for row in view.rows(ErrorBudgetRow):
        if row.requirement is not None and row.source == "total":
            yield row


def _recording(site: Site, view: RecordingView, totals: Sequence[ErrorBudgetRow]) -> dict[str, Any]:
    axes = counted(len(view.recommended()), "axis", "axes")
    temperature = ""
    if view.row.temperature_min is not None:
        limits = (view.row.temperature_min, view.row.temperature_max)
        ends = (number_text(limit, 3) for limit in limits)
        temperature = " to ".join(ends) + " °C"
    return {
        "view": view,
        "device": view.row.device,
        "length": f"{duration_text(view.row.duration)}, {axes}",
        "temperature": temperature,
        "decides": view.row.decides is not False,
        "doubts": doubts_text(view.row.doubts),
        "errors": [error_of_recording(total, site.system) for total in totals],
    }
