"""Alignment of sensors at rest, on the page of the Earth's rate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from imubench_pipeline.extensions.earth_rate.tables import AlignmentRow
from imubench_pipeline.report.payload import Arrays
from imubench_pipeline.report.practical import page_unit
from imubench_pipeline.report.site import Site
from imubench_pipeline.words.numbers import degrees_text, duration_text, number_text, sentence

_TABLE_TIMES = (60.0, 600.0, 3600.0)
"""Times at rest that the table shows, s; the figure has more."""

_POSITION_TEXTS = {1: "one position", 2: "two opposite positions"}


def alignments(site: Site, arrays: Arrays) -> list[dict[str, Any]]:
    """Return the section of each sensor with gyros and accelerometers; ``arrays`` gets its data."""
    entries = []
    for view in site.views:
        rows = view.rows(AlignmentRow)
        if rows:
            about = rows[0]
            unit, fine = page_unit("gyro", "adev", site.system), page_unit("accel", "adev", "si")
            entries.append(
                {
                    "view": view,
                    "latitude": degrees_text(about.latitude),
                    "biases": (
                        f"Fixed biases of {unit.text(about.gyro_bias, 3)} {unit.sign} "
                        f"({about.gyro_bias_from}) and "
                        f"{fine.text(about.accelerometer_bias, 3)} {fine.sign} "
                        f"({about.accelerometer_bias_from})."
                    ),
                    "axes": _describe_missing_axes(about),
                    "lines": [_format_line(row) for row in rows if row.time in _TABLE_TIMES],
                    "none": list(dict.fromkeys(sentence(row.reason) for row in rows if row.reason)),
                    "check": _describe_check(rows),
                    "drawn": _pack_curves(rows, arrays),
                }
            )
    return entries


def _describe_missing_axes(row: AlignmentRow) -> str:
    """Return which axes are missing in the log and replaced by others, in a sentence."""
    lent_axes = []
    for channels, words in ((row.gyros, "gyro"), (row.accelerometers, "accelerometer")):
        pairs = [entry.split(": ") for entry in channels.split(", ")]
        lent = [axis for axis, channel in pairs if not channel.endswith(f"_{axis}")]
        if lent:
            lent_axes.append(f"{words} {' and '.join(lent)}")
    if not lent_axes:
        return ""
    return f"The log has no {', '.join(lent_axes)}; the other axes replace them."


def _format_line(row: AlignmentRow) -> dict[str, Any]:
    return {
        "position": _POSITION_TEXTS[row.positions],
        "method": row.method,
        "time": duration_text(row.time),
        "roll": _format_angle(row.roll),
        "pitch": _format_angle(row.pitch),
        "heading": _format_angle(row.heading),
    }


def _format_angle(value: float | None) -> str:
    return "not determined" if value is None else degrees_text(value, 3)


def _describe_check(rows: Sequence[AlignmentRow]) -> str:
    """Return the check of the standard deviations by simulated triads, in a sentence."""
    comparisons = []
    for row in rows:
        if row.simulated is None:
            continue
        ratios = (
            ("roll", row.error_roll),
            ("pitch", row.error_pitch),
            ("heading", row.error_heading),
        )
        ratio_words = ", ".join(
            f"{name} {number_text(ratio, 3)}" for name, ratio in ratios if ratio is not None
        )
        comparisons.append(f"in {_POSITION_TEXTS[row.positions]} {ratio_words}")
    if not comparisons:
        return ""
    number = next(row.simulated for row in rows if row.simulated is not None)
    last = duration_text(max(row.time for row in rows))
    return (
        f"Check: {number} simulated triads with this noise, aligned for {last} by the filter. "
        f"Rms error / predicted σ: {'; '.join(comparisons)}."
    )


def _pack_curves(rows: Sequence[AlignmentRow], arrays: Arrays) -> list[dict[str, Any]]:
    """Return the curves of the figure; ``level`` is the larger of roll and pitch."""
    courses = []
    for positions in _POSITION_TEXTS:
        for method in ("coarse", "fine"):
            own = [r for r in rows if r.positions == positions and r.method == method]
            values = {
                "heading": [r.heading for r in own],
                "level": [_find_largest(r.roll, r.pitch) for r in own],
            }
            for angle, sigma in values.items():
                points = [(r.time, s) for r, s in zip(own, sigma, strict=True) if s]
                if points:
                    courses.append(
                        {
                            "positions": positions,
                            "method": method,
                            "angle": angle,
                            "time": arrays.exact([time for time, _ in points]),
                            "sigma": arrays.exact(np.degrees([s for _, s in points]).tolist()),
                        }
                    )
    return courses


def _find_largest(*angles: float | None) -> float | None:
    """Return the largest angle; None if one is unknown."""
    return None if None in angles else max(angle for angle in angles if angle is not None)
