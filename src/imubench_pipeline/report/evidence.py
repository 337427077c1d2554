"""Trace each verdict on a sensor to its numbers and recordings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from imubench_pipeline.model.comparisons import ErrorBudgetRow, RankingRow
from imubench_pipeline.report.decisions import explain_missing_rank
from imubench_pipeline.report.meaning import describe_limit, format_rankings, format_recording_error
from imubench_pipeline.report.practical import format_temperature
from imubench_pipeline.report.site import Site
from imubench_pipeline.report.sourced import source_number
from imubench_pipeline.report.view import RecordingView
from imubench_pipeline.words.numbers import counted, number_text
from imubench_pipeline.words.requirements import requirement_text
from imubench_pipeline.words.verdicts import (
    SHORT_VERDICTS,
    condition_text,
    doubts_text,
    spread_text,
    stated_verdict,
    verdict_text,
)


def trace_verdicts(
    site: Site, sensor: str, own: Sequence[RecordingView]
) -> Iterator[Mapping[str, object]]:
    """Yield each requirement with the verdict on a sensor, its numbers and its recordings.

    ``own`` are the recordings of the sensor. Requirements without a verdict are included.
    """
    rows = site.rows(RankingRow)
    own_rows = [row for row in rows if row.sensor == sensor]
    totals = [
        (view, [row for row in view.rows(ErrorBudgetRow) if row.source == "total"])
        for view in own
        if view.static
    ]
    simulated = {view.full_name: view.simulated for view in own}
    requirements = site.settings["requirements"] if rows else {}
    for ranking in format_rankings(own_rows, requirements, simulated, site.system):
        name, requirement = ranking.name, ranking.requirement
        about = {"name": name, "title": requirement.title, "asked": requirement_text(requirement)}
        if not ranking.groups:
            word, why = SHORT_VERDICTS["not_enough_data"], explain_missing_rank(own)
            yield {**about, "row": None, "verdict": "not_enough_data", "word": word, "why": why}
            continue
        (group,) = ranking.groups
        row = group.row
        judged = sum(r.rank is not None and r.decides for r in rows if r.requirement == name)
        window = "turn-on biases, not calibrated" if requirement.turn_on else ""
        if requirement.static_window:
            window = f"{requirement.static_window} at rest right before"
        alternatives = (
            ("As logged", "logged_margin", row.logged_margin, row.logged_verdict),
            (
                "With the unit corrected",
                "corrected_margin",
                row.corrected_margin,
                row.corrected_verdict,
            ),
        )
        yield about | {
            "row": row,
            "verdict": row.verdict,
            "word": SHORT_VERDICTS[row.verdict],
            "stated": verdict_text(row.verdict) if row.conditions else stated_verdict(row),
            "group": group,
            "place": f"rank {row.rank} of {judged}" if row.rank else "",
            "conditions": [condition_text(each) for each in row.conditions],
            "spread": spread_text(row),
            "left_out": doubts_text(row.left_out, named=True),
            "alternatives": [
                (
                    words,
                    verdict_text(verdict) if verdict else "",
                    source_number(row, column, number_text(size, 3)),
                )
                for words, column, size, verdict in alternatives
                if size is not None
            ],
            "window": window,
            "limits": [
                describe_limit(each)
                for each in own_rows
                if each.requirement == name and each.trajectory is None
            ],
            "recordings": [
                {
                    "view": view,
                    "axes": counted(len(view.recommended()), "axis", "axes"),
                    "temperature": format_temperature(view.row),
                    "errors": [
                        format_recording_error(total, site.system)
                        for total in of_view
                        if total.requirement == name
                    ],
                }
                for view, of_view in totals
            ],
        }
