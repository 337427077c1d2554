"""The pages of a sensor and of a device: agreement and change of its recordings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any
from urllib.parse import urlencode

from imubench_pipeline.model.comparisons import (
    CoverageRow,
    DriftRow,
    PooledRow,
    RankingRow,
    RepeatabilityRow,
)
from imubench_pipeline.navigation.drift import SIGNIFICANCE_LEVEL
from imubench_pipeline.report.comparison import Comparison
from imubench_pipeline.report.datasheets import delta_rows, repeatability_lines
from imubench_pipeline.report.evidence import evidence
from imubench_pipeline.report.meaning import budget_bars, budget_tables, budget_words
from imubench_pipeline.report.palette import recording_styles
from imubench_pipeline.report.payload import FOREST, looks
from imubench_pipeline.report.site import Page, Site
from imubench_pipeline.report.start import summary
from imubench_pipeline.report.view import QUANTITY_NAMES, RecordingView
from imubench_pipeline.words.estimates import symbol_text
from imubench_pipeline.words.numbers import counted, limit_digits

_MAX_DETAILED_RECORDINGS = 12
"""With more recordings the page of a sensor has no budgets and no comparison with the datasheet."""


def sensor_page(site: Site, sensor: str) -> Page:
    """Return the page of a sensor."""
    own = [view for view in site.views if view.sensor == sensor]
    key = site.key_of(
        *(view.key for view in own),
        *(view.device_page for view in own),
        [row for row in site.rows(PooledRow) if row.sensor == sensor],
        [row for row in site.rows(RepeatabilityRow) if row.sensor == sensor],
        [row for row in site.rows(RankingRow) if row.decides or row.sensor == sensor],
        [row for row in site.rows(CoverageRow) if row.sensor == sensor],
        site.looks[sensor],
    )
    return Page(
        site.sensor_page(sensor),
        "sensor.html.jinja",
        key,
        lambda: _make_sensor_context(site, sensor, own),
    )


def _make_sensor_context(site: Site, sensor: str, own: Sequence[RecordingView]) -> dict[str, Any]:
    together = Comparison(site.compared(own), site.names)
    pooled = [_format_pooled(row) for row in site.rows(PooledRow) if row.sensor == sensor]
    shown = own if len(own) <= _MAX_DETAILED_RECORDINGS else []
    simulated = {view.full_name: view.simulated for view in own}
    budget = [row for view in shown for row in view.budget]
    return {
        "name": site.names[sensor],
        "summary": _describe_price_class(site, sensor) + summary(own, several=False),
        "verdicts": list(evidence(site, sensor, own)),
        "beside": urlencode({"a": sensor}) if any(view.static for view in own) else "",
        "devices": list(_list_devices(own)),
        "forest": FOREST,
        "several": sum(view.static for view in own) > 1,
        "parameter_tables": list(together.tables()),
        "pooled": pooled,
        "pooled_filters": {
            "axis": list(dict.fromkeys(row["axis"] for row in pooled)),
            "parameter": list(dict.fromkeys(row["name"] for row in pooled)),
        },
        "budgets": list(budget_tables(budget, simulated, site.system)),
        "budget_words": budget_words(site.settings["settings"]["error_budget"]),
        "too_many": len(own) > _MAX_DETAILED_RECORDINGS,
        "deltas": list(_list_deltas(site, shown)),
        "repeated": list(repeatability_lines(site.rows(RepeatabilityRow), sensor, site.system)),
        "page": {
            "grouped": "recording",
            "recordings": [view.name for view in own],
            "looks": looks({sensor: site.looks[sensor]})
            | {"places": [asdict(look) for look in recording_styles(site.looks[sensor])]},
            "names": site.names,
            "budgets": [budget_bars(view.budget, site.system) for view in shown if view.budget],
            **together.page,
        },
    }


def _list_deltas(site: Site, views: Sequence[RecordingView]) -> Iterator[dict[str, Any]]:
    """Yield the comparison of each channel with the figures of the datasheet, if there are any."""
    for view in views:
        for channel in view.channels():
            rows = list(delta_rows(channel, site.coverage, site.system))
            if any(row["published"] for row in rows):
                yield {"view": channel, "rows": rows}


def _describe_price_class(site: Site, sensor: str) -> str:
    price_class = site.settings["sensors"].get(sensor, {}).get("price_class")
    return f"Price class: {price_class}. " if price_class else ""


def _list_devices(own: Sequence[RecordingView]) -> Iterator[dict[str, Any]]:
    for device in dict.fromkeys((view.row.device, view.device_page) for view in own):
        views = [view for view in own if (view.row.device, view.device_page) == device]
        count = counted(len(views), "recording")
        yield {"name": device[0], "page": device[1], "views": views, "count": count}


def _format_pooled(row: PooledRow) -> dict[str, Any]:
    quantity = row.channel.split("_", maxsplit=1)[0]
    symbol = "signal" if row.parameter == "bias" else row.parameter
    return row.columns() | {
        "axis": row.channel.replace("_", " "),
        "digits": limit_digits(row.lower, row.upper, 4),
        "ref": f"{quantity}.{symbol}",
        "name": symbol_text(row.parameter),
    }


def device_page(site: Site, page: str) -> Page:
    """Return the page of a device: its recordings over time."""
    own = [view for view in site.views if view.device_page == page]
    rows = [row for row in site.rows(DriftRow) if site.device_page_of(row) == page]
    key = site.key_of(*(view.key for view in own), rows)
    return Page(page, "device.html.jinja", key, lambda: _make_device_context(site, own, rows))


def _make_device_context(
    site: Site, own: Sequence[RecordingView], rows: Sequence[DriftRow]
) -> dict[str, Any]:
    sensor, device = own[0].sensor, own[0].row.device
    named = {view.full_name for view in own}
    rows = [row for row in rows if (row.sensor, row.recording) in named]
    # As in `navigation.drift.order_of`: equal time stamps give no order.
    stamps = {row.started for row in rows}
    dated = None not in stamps and len(stamps) > 1
    trends, payload = _list_trends(rows, dated=dated, simulated=own[0].simulated)
    return {
        "sensor_page": site.sensor_page(sensor),
        "name": site.names[sensor],
        "device": device,
        "views": own,
        "summary": summary(own, several=False),
        "changes": [
            change_words(row, simulated=own[0].simulated)
            for row in rows
            if row.verdict == "changed"
        ],
        "order": "Recordings are plotted at their start times."
        if dated
        else "Some logs have no start time, so the recordings are plotted in the order of their "
        "names.",
        "trends": list(trends.items()),
        "page": {"trends": payload, "arrays": []},
    }


def _list_trends(
    rows: Sequence[DriftRow], *, dated: bool, simulated: bool
) -> tuple[dict[str, list[dict[str, Any]]], list[dict[str, Any]]]:
    """Return the trends of a device by channel, and the data of their figures."""
    trends: dict[str, list[dict[str, Any]]] = {}
    payload: list[dict[str, Any]] = []
    mark = " (simulated)" * simulated
    for channel, parameter in dict.fromkeys((row.channel, row.parameter) for row in rows):
        series = sorted(
            (row for row in rows if (row.channel, row.parameter) == (channel, parameter)),
            key=lambda row: row.position,
        )
        if all(row.value is None for row in series):
            continue
        quantity, axis = channel.split("_")
        title = f"{QUANTITY_NAMES[quantity]} {axis}"
        name = symbol_text(parameter)
        changes = [row.recording + mark for row in series if row.verdict == "changed"]
        outside = [
            row.recording + mark
            for row in series
            if row.verdict == "as before"
            and row.p_value is not None
            and row.p_value < SIGNIFICANCE_LEVEL
        ]
        trends.setdefault(channel, []).append(
            {
                "title": title,
                "number": len(payload),
                "label": f"{name} of {title} in {counted(len(series), 'recording')}",
                "caption": f"{name}: {_describe_trend(changes, outside)}",
            }
        )
        payload.append(
            {
                "channel": channel,
                "parameter": parameter,
                "dated": dated,
                "started": [row.started for row in series],
                "recordings": [row.recording for row in series],
                "value": [row.value for row in series],
                "lower": [row.lower for row in series],
                "upper": [row.upper for row in series],
                "expected_lower": [row.expected_lower for row in series],
                "expected_upper": [row.expected_upper for row in series],
                "verdict": [row.verdict for row in series],
            }
        )
    return trends, payload


def _describe_trend(changes: Sequence[str], outside: Sequence[str]) -> str:
    """Return which recordings have changed, and which lie outside the band without significance."""
    words = f"changed in {', '.join(changes)}." if changes else "no change."
    if outside:
        lie = "lies" if len(outside) == 1 else "lie"
        names = ", ".join(outside)
        words += f" {names} {lie} outside the band, which may be chance among so many parameters."
    return words


def change_words(row: DriftRow, *, simulated: bool) -> str:
    """Return a change of a device in words."""
    name = symbol_text(row.parameter)
    by = ""
    if row.change is not None:
        by = f" by {100 * row.change:+.0f} %".replace("-", "−")
    chance = f"{row.p_value:.1g}" if row.p_value is not None else "–"
    where = row.channel.replace("_", " ")
    recording = row.recording + (" (simulated)" if simulated else "")
    return f"{recording}, {where}: {name} changed{by} (p = {chance})."
