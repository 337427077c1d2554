"""The page of a recording of a triad in several positions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from imubench_pipeline.extensions.calibration.figures import attitude_lines, noise_words
from imubench_pipeline.extensions.calibration.tables import CalibrationRow
from imubench_pipeline.report.recording import about_of, summary_words
from imubench_pipeline.report.site import RecordingPage, Site
from imubench_pipeline.report.view import RecordingView


def context(site: Site, view: RecordingView, folder: Path) -> dict[str, Any]:
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


POSITIONS = RecordingPage("positions.html.jinja", context, "several positions")
"""The page of a triad that stood in several positions."""
