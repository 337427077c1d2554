"""The pages of recordings on a rate table, and in several positions."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from imubench_pipeline.extensions.calibration.figures import (
    answer,
    attitude_lines,
    earth_words,
    lines,
    noise_words,
    not_observable,
    scatter_words,
)
from imubench_pipeline.extensions.calibration.tables import CalibrationPointRow, CalibrationRow
from imubench_pipeline.report.payload import Arrays
from imubench_pipeline.report.recording import about_of, summary_words
from imubench_pipeline.report.site import RecordingPage, Site
from imubench_pipeline.report.view import RecordingView
from imubench_pipeline.words.numbers import counted, number_text


def _rate_table(site: Site, view: RecordingView, folder: Path) -> dict[str, Any]:
    """Return what the template needs; ``folder`` is the recording's."""
    rows = view.rows(CalibrationRow)
    points = view.rows(CalibrationPointRow)
    return {
        **about_of(site, view, [], folder),
        "summary": _summarise(view, points),
        "answer": answer(rows, site.system),
        "lines": list(lines(rows)),
        "open": not_observable(rows),
        "noise": noise_words(rows),
        "scatter": scatter_words(rows),
        "earth": earth_words(rows, site.system),
        "points": points,
        "findings": view.findings,
        "command": site.again(view, "calibration"),
        "page": {"looks": {}, "channels": [], "findings": [], **_pack_points(points)},
    }


RATE_TABLE = RecordingPage("rate_table.html.jinja", _rate_table, "rate table")
"""The page of a gyro on a rate table."""


def _pack_points(points: Sequence[CalibrationPointRow]) -> dict[str, Any]:
    arrays = Arrays()
    return {
        "table": {
            "table_rate": arrays.exact([row.table_rate for row in points]),
            "mean": arrays.exact([row.mean for row in points]),
            "line": arrays.exact([row.line for row in points]),
            "residual": arrays.exact([row.residual for row in points]),
            "sigma": arrays.exact([row.sigma for row in points]),
            "number": [row.number for row in points],
        },
        "arrays": arrays.texts,
    }


def _summarise(view: RecordingView, points: Sequence[CalibrationPointRow]) -> str:
    if not points:
        return summary_words(view, [])
    most = math.degrees(max(abs(point.table_rate) for point in points))
    rates = f"{counted(len(points), 'constant rate')} up to {number_text(most)} °/s"
    return summary_words(view, [rates])


def _positions(site: Site, view: RecordingView, folder: Path) -> dict[str, Any]:
    """Return what the template needs; ``folder`` is the recording's."""
    rows = view.rows(CalibrationRow)
    number = rows[0].rates if rows else None
    return {
        **about_of(site, view, [], folder),
        "summary": summary_words(view, [] if number is None else [f"{number} positions"]),
        "lines": list(attitude_lines(rows)),
        "noise": noise_words(rows),
        "findings": view.findings,
        "command": site.again(view, "calibration"),
        "page": {"looks": {}, "channels": [], "findings": []},
    }


POSITIONS = RecordingPage("positions.html.jinja", _positions, "several positions")
"""The page of a triad that stood in several positions."""
