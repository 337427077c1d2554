"""The page of the Earth's rate: what gyros find of it, and what they would need."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.report.alignment import alignments
from imubench_pipeline.report.calibration import of_all
from imubench_pipeline.report.payload import Arrays
from imubench_pipeline.report.site import Page, Site
from imubench_pipeline.report.turned import (
    ESTIMATES,
    answer,
    latitude_text,
    line,
    needs,
    prediction_payload,
    published_lines,
)
from imubench_pipeline.report.view import RecordingView
from imubench_pipeline.report.words import counted
from imubench_pipeline.typing import Row


def earth_rate_page(site: Site) -> Page:
    """Return the page of all experiments that look for the Earth's rate.

    Parameters
    ----------
    site : Site
    """
    views = [*site.turned, *site.calibrated, *site.predicted]
    return Page(
        "earth_rate.html",
        "earth_rate.html.jinja",
        site.key_of([view.key for view in views], [view.page for view in views]),
        lambda: _context(site),
    )


def _context(site: Site) -> dict[str, Any]:
    arrays = Arrays()
    runs = [_run(site, view) for view in site.turned]
    published = [
        {**one, "view": view}
        for view in site.turned
        for one in published_lines(view.rows("earth_rate_published"))
    ]
    predicted = list(_predicted(site))
    aligned = alignments(site, arrays)
    return {
        "truth": EARTH_RATE,
        "runs": runs,
        "rejected": [view for view in site.turned if view.left_out],
        "published": published,
        "verdict": published_words(published),
        "needs": predicted,
        "alignments": aligned,
        "calibrations": of_all(site),
        "not_calibrated": [view for view in site.calibrated if view.left_out],
        "page": {
            "looks": {},
            "channels": [],
            "published": [_drawn(one) for one in published],
            "predictions": {
                one["place"]: prediction_payload(one["rows"], arrays) for one in predicted
            },
            "alignments": {one["view"].sensor: one["drawn"] for one in aligned},
            "arrays": arrays.texts,
        },
    }


def _run(site: Site, view: RecordingView) -> dict[str, Any]:
    rows = view.rows("earth_rate")
    whole = [row for row in rows if row["part"] == "whole"]
    shown = [line(row) for row in rows if row["method"] in ESTIMATES]
    return {
        "view": view,
        "answer": view.row["reason"] if view.left_out else answer(whole, site.system),
        "parts": [
            {
                "part": part,
                "duration": next(one["duration"] for one in shown if one["part"] == part),
                "lines": {one["method"]: one for one in shown if one["part"] == part},
            }
            for part in dict.fromkeys(one["part"] for one in shown)
        ],
    }


def _predicted(site: Site) -> Iterator[dict[str, Any]]:
    """Yield what each sensor would need, once where several recordings say the same."""
    said: list[tuple[str, Any]] = []
    for view in [*site.turned, *site.predicted]:
        rows = view.rows("earth_rate_prediction")
        found = needs(rows)
        if found is None or (view.sensor, found) in said:
            continue
        said.append((view.sensor, found))
        place = f"{view.sensor}-{view.name}"
        latitude = latitude_text(rows)
        yield found | {"view": view, "place": place, "rows": rows, "latitude": latitude}


def _drawn(one: Row) -> dict[str, Any]:
    name = one["recording"] + ("" if one["part"] == "whole" else f", {one['part']}")
    numbers = ("published", "truth", "sigma", "simulated")
    return {"name": name} | {key: one[key] for key in numbers}


def published_words(lines: Sequence[Row]) -> str:
    """Return whether published estimates lie within what noise allows, in sentences.

    Parameters
    ----------
    lines : sequence of mapping
        Of `imubench_pipeline.report.turned.published_lines`.
    """
    if not lines:
        return ""
    beyond = [one for one in lines if one["verdict"] == "beyond the noise"]
    names = ", ".join(
        one["recording"]
        + ("" if one["part"] == "whole" else f" ({one['part']})")
        + f" by {one['off']}"
        for one in beyond
    )
    if not beyond:
        return f"All {len(lines)} published estimates lie within what the noise allows."
    within = len(lines) - len(beyond)
    return (
        f"{counted(within, 'published estimate lies', 'published estimates lie')} within what the "
        f"noise of the source's own figures allows, {len(beyond)} of {len(lines)} do not: {names}. "
        "No filter takes that off: it is no noise, but another error of those runs, such as a "
        "sensor that warms up, an axis off north, or samples of the turns in the means."
    )
