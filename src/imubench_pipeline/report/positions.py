"""The page of a recording of a triad that stood in several positions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from imubench_pipeline.report.practical import limit_digits, number_text
from imubench_pipeline.report.recording import about_of, summary_words
from imubench_pipeline.report.site import Site
from imubench_pipeline.report.view import RecordingView
from imubench_pipeline.report.words import noise_words, sentence
from imubench_pipeline.typing import Row

_BEYOND = 3.0
"""Standard deviations from the truth of a simulation that are worth a word."""


def context(site: Site, view: RecordingView, folder: Path) -> dict[str, Any]:
    """Return what the template needs; ``folder`` is the recording's."""
    rows = view.rows("calibration")
    number = rows[0]["rates"] if rows else None
    return {
        **about_of(site, view, [], folder),
        "summary": summary_words(view, [] if number is None else [f"{number} positions"]),
        "lines": list(lines(rows)),
        "noise": noise_words(rows),
        "findings": view.findings,
        "command": site.again(view, "calibration"),
        "page": {"looks": {}, "channels": [], "findings": []},
    }


def lines(rows: Sequence[Row]) -> Iterator[dict[str, Any]]:
    """Yield roll, pitch and heading in degrees, of rows of ``calibration`` of one recording."""
    for row in rows:
        value, lower, upper, truth = (
            None if row[name] is None else math.degrees(row[name])
            for name in ("value", "lower", "upper", "truth")
        )
        digits = limit_digits(lower, upper, 3)
        off = None
        if value is not None and truth is not None:
            off = math.remainder(value - truth, 360.0) / math.degrees(row["sigma"])
        yield {
            "words": row["parameter"],
            "value": "–" if value is None else f"{number_text(value, digits)}°",
            "limits": ""
            if lower is None or upper is None
            else f"{number_text(lower, digits)}° to {number_text(upper, digits)}°",
            "truth": "–" if truth is None else f"{number_text(truth, digits)}°",
            "off": "–" if off is None else f"{number_text(off, 2)} σ",
            "far": off is not None and abs(off) > _BEYOND,
            "why": sentence(row["reason"] or ""),
        }
