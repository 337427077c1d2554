"""The page of the Earth's rate: estimates by gyros, and recordings that they would need."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.figures import calibrated, of_all, without_result
from imubench_pipeline.extensions.earth_rate.page_alignment import alignments
from imubench_pipeline.extensions.earth_rate.page_turned import (
    ESTIMATES,
    answer,
    given_words,
    latitude_text,
    line,
    needs,
    off_words,
    prediction_payload,
    published_lines,
)
from imubench_pipeline.extensions.earth_rate.tables import (
    EarthRatePredictionRow,
    EarthRatePublishedRow,
    EarthRateRow,
)
from imubench_pipeline.report.payload import Arrays
from imubench_pipeline.report.site import Entry, Section, Site
from imubench_pipeline.report.view import RecordingView
from imubench_pipeline.words.numbers import counted, number_text


def turned(site: Site) -> list[RecordingView]:
    """Return the recordings of gyros that were turned between north and south."""
    return [view for view in site.views if view.row.kind == "two_position"]


def predicted(site: Site) -> list[RecordingView]:
    """Return the static recordings with a prediction for the Earth's rate from their noise."""
    named = site.named_in(EarthRatePredictionRow)
    return [view for view in site.views if view.static and view.full_name in named]


def _make_context(site: Site) -> dict[str, Any]:
    arrays = Arrays()
    runs = [_describe_run(site, view) for view in turned(site)]
    published = [row for view in turned(site) for row in view.rows(EarthRatePublishedRow)]
    predicted = list(_list_predictions(site))
    aligned = alignments(site, arrays)
    return {
        "truth": EARTH_RATE,
        "runs": runs,
        "given": given_words([row for view in turned(site) for row in view.rows(EarthRateRow)]),
        "rejected": [view for view in turned(site) if view.left_out],
        "published": [
            {**line, "view": view}
            for view in turned(site)
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
            "published": [_pack_estimates(row) for row in published],
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
        place = f"{view.sensor}-{view.name}"
        latitude = latitude_text(rows)
        yield needed | {"view": view, "place": place, "rows": rows, "latitude": latitude}


def _pack_estimates(row: EarthRatePublishedRow) -> dict[str, Any]:
    return {
        "name": row.recording + ("" if row.part == "whole" else f", {row.part}"),
        "published": row.published,
        "truth": row.truth,
        "sigma": row.sigma,
        "simulated": row.simulated,
    }


def published_words(rows: Sequence[EarthRatePublishedRow]) -> str:
    """Return whether noise explains the errors of published estimates, in sentences."""
    if not rows:
        return ""
    beyond = [row for row in rows if row.verdict == "beyond the noise"]
    names = ", ".join(
        row.recording + ("" if row.part == "whole" else f" ({row.part})") + f" by {off_words(row)}"
        for row in beyond
    )
    if not beyond:
        every = (
            "the error of the published estimate"
            if len(rows) == 1
            else f"the errors of all {len(rows)} published estimates"
        )
        return f"Noise explains {every}. {_describe_gain(rows)}"
    within = len(rows) - len(beyond)
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
