"""The page of the Earth's rate: estimates by gyros, and recordings that they would need."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.pages import calibrated, of_all, without_result
from imubench_pipeline.extensions.earth_rate.page_turned import (
    ESTIMATES,
    answer,
    given_words,
    line,
    needs,
    prediction_payload,
    published_lines,
)
from imubench_pipeline.extensions.earth_rate.tables import (
    AlignmentRow,
    EarthRatePredictionRow,
    EarthRatePublishedRow,
    EarthRateRow,
)
from imubench_pipeline.report.payload import Arrays
from imubench_pipeline.report.practical import page_unit
from imubench_pipeline.report.site import Entry, Section, Site
from imubench_pipeline.report.view import RecordingView
from imubench_pipeline.words.numbers import (
    counted,
    degrees_text,
    duration_text,
    number_text,
    sentence,
)


def turned(site: Site) -> list[RecordingView]:
    """Return the recordings of gyros that were turned between north and south."""
    return [view for view in site.views if view.row.kind == "two_position"]


def predicted(site: Site) -> list[RecordingView]:
    """Return the static recordings with a prediction for the Earth's rate from their noise."""
    named = site.named_in(EarthRatePredictionRow)
    return [view for view in site.views if view.static and view.full_name in named]


def _make_context(site: Site) -> dict[str, Any]:
    arrays = Arrays()
    turned_gyros = turned(site)
    published = [row for view in turned_gyros for row in view.rows(EarthRatePublishedRow)]
    predicted = list(_list_predictions(site))
    aligned = alignments(site, arrays)
    return {
        "truth": EARTH_RATE,
        "runs": [_describe_run(site, view) for view in turned_gyros],
        "given": given_words([row for view in turned_gyros for row in view.rows(EarthRateRow)]),
        "rejected": [view for view in turned_gyros if view.left_out],
        "published": [
            {**line, "view": view}
            for view in turned_gyros
            for line in published_lines(view.rows(EarthRatePublishedRow))
        ],
        "verdict": published_words(published),
        "needs": predicted,
        "alignments": aligned,
        "calibrations": of_all(site),
        "not_calibrated": [view for view in calibrated(site) if view.left_out],
        "page": {
            "looks": {},
            "channels": [],
            "published": [
                {
                    "name": row.recording + ("" if row.part == "whole" else f", {row.part}"),
                    "published": row.published,
                    "truth": row.truth,
                    "sigma": row.sigma,
                    "simulated": row.simulated,
                }
                for row in published
            ],
            "predictions": {
                line["place"]: prediction_payload(line["rows"], arrays) for line in predicted
            },
            "alignments": {line["view"].sensor: line["drawn"] for line in aligned},
            "arrays": arrays.texts,
        },
    }


def _select_recordings(site: Site) -> list[RecordingView]:
    return [*turned(site), *calibrated(site), *predicted(site)]


EARTH_RATE_PAGE = Entry(
    file="earth_rate.html",
    title="Earth’s rate",
    context=_make_context,
    views=_select_recordings,
    exists=lambda site: bool(_select_recordings(site)),
    place=4,
)
"""The page of all experiments that estimate the Earth's rate."""

NOT_FOUND = Section(
    page="index.html",
    template="not_found.html.jinja",
    context=lambda site: (
        list(without_result(turned(site), lambda view: view.rows(EarthRateRow))) or None
    ),
)
"""The recordings without an estimate of the Earth's rate, on the start page."""


def _describe_run(site: Site, view: RecordingView) -> dict[str, Any]:
    rows = view.rows(EarthRateRow)
    whole = [row for row in rows if row.part == "whole"]
    shown = [row for row in rows if row.method in ESTIMATES]
    return {
        "view": view,
        "answer": view.row.reason if view.left_out else answer(whole, site.system),
        "parts": [
            {
                "part": part,
                "duration": next(row.duration for row in shown if row.part == part),
                "lines": {row.method: line(row) for row in shown if row.part == part},
            }
            for part in dict.fromkeys(row.part for row in shown)
        ],
    }


def _list_predictions(site: Site) -> Iterator[dict[str, Any]]:
    """Yield the recordings that each sensor would need, without duplicates."""
    yielded: list[tuple[str, Any]] = []
    for view in [*turned(site), *predicted(site)]:
        rows = view.rows(EarthRatePredictionRow)
        needed = needs(rows)
        if needed is None or (view.sensor, needed) in yielded:
            continue
        yielded.append((view.sensor, needed))
        place, latitude = f"{view.sensor}-{view.name}", degrees_text(rows[0].latitude)
        yield needed | {"view": view, "place": place, "rows": rows, "latitude": latitude}


def published_words(rows: Sequence[EarthRatePublishedRow]) -> str:
    """Return whether noise explains the errors of published estimates, in sentences."""
    if not rows:
        return ""
    beyond = [row for row in rows if row.verdict == "beyond the noise"]
    if not beyond:
        every = (
            "the error of the published estimate"
            if len(rows) == 1
            else f"the errors of all {len(rows)} published estimates"
        )
        return f"Noise explains {every}. {_describe_gain(rows)}"
    within = len(rows) - len(beyond)
    names = ", ".join(
        row.recording
        + ("" if row.part == "whole" else f" ({row.part})")
        + f" by {number_text(row.off_sigma, 3)} σ"
        for row in beyond
    )
    return (
        f"The noise that the source prints explains {counted(within, 'published estimate')}. "
        f"{len(beyond)} of {len(rows)} {'has' if len(beyond) == 1 else 'have'} a larger error: "
        f"{names}. A filter cannot remove it. Possible causes are a warm-up, miscounted turns, or "
        "samples of the turns in the means. " + _describe_gain(rows)
    )


def _describe_gain(rows: Sequence[EarthRatePublishedRow]) -> str:
    """Return the improvement of a filter over the mean of pairs, in a sentence."""
    gains = [
        1.0 - row.sigma_filter / row.sigma
        for row in rows
        if row.sigma_filter is not None and row.sigma
    ]
    if not gains:
        return ""
    ends = [number_text(100.0 * gain, 2) for gain in (min(gains), max(gains))]
    text = " to ".join(dict.fromkeys(ends))
    return (
        f"In these runs, σ of a filter that does not know the rate is {text} % smaller than that "
        "of the mean over pairs."
    )


_TABLE_TIMES = (60.0, 600.0, 3600.0)  # times at rest that the table shows, s; the figure has more

_POSITION_TEXTS = {1: "one position", 2: "two opposite positions"}


def alignments(site: Site, arrays: Arrays) -> list[dict[str, Any]]:
    """Return the section of each sensor with gyros and accelerometers; ``arrays`` gets its data."""
    entries = []
    unit, fine = page_unit("gyro", "adev", site.system), page_unit("accel", "adev", "si")
    for view in site.views:
        rows = view.rows(AlignmentRow)
        if rows:
            about = rows[0]
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
                    "lines": [
                        {
                            "position": _POSITION_TEXTS[row.positions],
                            "method": row.method,
                            "time": duration_text(row.time),
                            "roll": _format_angle(row.roll),
                            "pitch": _format_angle(row.pitch),
                            "heading": _format_angle(row.heading),
                        }
                        for row in rows
                        if row.time in _TABLE_TIMES
                    ],
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


def _format_angle(value: float | None) -> str:
    return "not determined" if value is None else degrees_text(value, 3)


def _describe_check(rows: Sequence[AlignmentRow]) -> str:
    """Return the check of the standard deviations by simulated triads, in a sentence."""
    comparisons = []
    for row in rows:
        if row.simulated is None:
            continue
        errors = {"roll": row.error_roll, "pitch": row.error_pitch, "heading": row.error_heading}
        ratios = (
            f"{name} {number_text(one, 3)}" for name, one in errors.items() if one is not None
        )
        comparisons.append(f"in {_POSITION_TEXTS[row.positions]} {', '.join(ratios)}")
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
            level = [
                None if r.roll is None or r.pitch is None else max(r.roll, r.pitch) for r in own
            ]
            for angle, sigma in (("heading", [r.heading for r in own]), ("level", level)):
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
