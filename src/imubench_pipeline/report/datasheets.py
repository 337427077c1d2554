"""What the pages say of datasheets: measured against printed, and who publishes what."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from statistics import median
from typing import Any

from imubench_pipeline.report.practical import System, page_unit
from imubench_pipeline.report.view import ChannelView, RecordingView
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.typing import Row

_STATISTIC_NAMES = {
    "N": "N",
    "adev_minimum": "bias instability (minimum)",
    "plateau": "bias instability (0.664 B)",
    "K": "K",
    "T_B": "T_B",
}
_SYMBOLS = {
    "N": "N",
    "K": "K",
    "T_B": "T_B",
    "offset": "signal",
    "temperature_coefficient": "sensitivity",
}

_BESIDE = ("mean", "temperature")
"""What stands in place of a method where no method has a part in a figure."""

_TITLES = {"gyro": "Gyroscope: published figures", "accel": "Accelerometer: published figures"}
_SIGNS = {"yes": "yes", "no": "no", "other convention": "other", "not looked up": "?"}


def delta_rows(
    view: ChannelView, coverage: Mapping[tuple[str, str, str], str], system: System
) -> Iterator[dict[str, Any]]:
    """Yield each figure of the datasheet, what was measured, and the difference.

    ``coverage`` tells whether sensor, quantity and figure are published.
    """
    for row in view.datasheet:
        if row["method"] not in (view.recommended, *_BESIDE):
            continue
        unit = page_unit(view.quantity, _SYMBOLS.get(row["quantity"], "B"), system)
        published = row["printed"] is not None
        figure = "B" if row["quantity"] == "bias_instability" else row["quantity"]
        yield {
            "quantity": _figure_name(row),
            "published": published,
            "coverage": coverage.get((view.sensor, view.quantity, figure), "not looked up"),
            "printed": f"{row['printed']:g} {row['unit']}" if published else "–",
            "about": ", ".join(filter(None, (row["kind"], _read_as(row), row["condition"]))),
            "comparable": unit.text(row["comparable"]),
            "measured": _with_limits(row, unit.text),
            "unit": "" if row["comparable"] is None and not row["measured"] else unit.sign,
            "delta": _with_limits(row, _percent, "delta"),
            "value": row["delta"],
            "verdict": row["verdict"],
            "reason": (row["reason"] or "") if published else "",
        }


def deltas_of_sensors(views: Sequence[RecordingView], system: System) -> Iterator[dict[str, Any]]:
    """Yield each printed figure of a channel against all recordings of the sensor."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for view in views:
        recommended = view.recommended()
        for row in view.rows("datasheet"):
            if row["method"] not in (recommended[row["channel"]], *_BESIDE):
                continue
            if row["delta"] is not None:
                figure = ("quantity", "statistic", "printed", "unit", "kind", "sidedness")
                key = (view.sensor, view.simulated, row["channel"], *(row[f] for f in figure))
                groups.setdefault(key, []).append(row)
    for (sensor, simulated, channel, *_), group in groups.items():
        first = group[0]
        symbol = _SYMBOLS.get(first["quantity"], "B")
        unit = page_unit(quantity_of(channel), symbol, system)
        deltas = sorted(row["delta"] for row in group)
        measured = sorted(row["measured"] for row in group)
        verdicts = Counter(row["verdict"] for row in group)
        yield {
            "sensor": sensor,
            "simulated": simulated,
            "channel": channel,
            "quantity": _figure_name(first),
            "printed": f"{first['printed']:g} {first['unit']}",
            "about": ", ".join(filter(None, (first["kind"], _read_as(first)))),
            "comparable": unit.text(first["comparable"]),
            "unit": unit.sign,
            "measured": _range([unit.text(value) for value in (measured[0], measured[-1])]),
            "delta": median(deltas),
            "difference": _range([_percent(value) for value in (deltas[0], deltas[-1])]),
            "recordings": len(group),
            "verdicts": ", ".join(
                verdict if len(group) == 1 else f"{verdict} ({count})"
                for verdict, count in verdicts.items()
            ),
        }


def repeatability_lines(
    rows: Sequence[Row], sensor: str, system: System
) -> Iterator[dict[str, Any]]:
    """Yield how the fixed biases of each device of a sensor differ, against what is printed.

    Of the table ``repeatability``.
    """
    for row in rows:
        if row["sensor"] != sensor:
            continue
        unit = page_unit(quantity_of(row["channel"]), "adev", system)
        yield {
            "device": row["device"],
            "channel": row["channel"].replace("_", " "),
            "recordings": row["recordings"],
            "printed": f"{row['printed']:g} {row['unit']}",
            "about": ", ".join(filter(None, (row["kind"], row["condition"]))),
            "comparable": unit.text(row["comparable"]),
            "measured": _with_limits(row, unit.text),
            "unit": unit.sign,
            "delta": _percent(row["delta"]),
            "verdict": row["verdict"],
            "reason": row["reason"] or "",
        }


def _figure_name(row: Row) -> str:
    return _STATISTIC_NAMES.get(row["statistic"], row["quantity"].replace("_", " "))


def _read_as(row: Row) -> str:
    return f"read as {row['sidedness']}" if row["sidedness"] else ""


def _range(ends: Sequence[str]) -> str:
    return ends[0] if ends[0] == ends[1] else f"{ends[0]} to {ends[1]}"


def curve_distances(view: ChannelView, system: System) -> Iterator[str]:
    """Yield how far the curve is from the lines of the datasheet, in words."""
    unit = page_unit(view.quantity, "adev", system)
    for row in view.datasheet_curve:
        reading = f", density read as {row['sidedness']}" if row["sidedness"] else ""
        yield f"{unit.text(row['rms'], 3)} {unit.sign}, {row['rms_log10']:.3f} decades{reading}"


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{round(100 * share):+d} %".replace("-", "−")


def _with_limits(row: Row, text: Callable[[float | None], str], of: str = "") -> list[str]:
    """Return a figure, and its 95 % limits below it."""
    value, ends = (of, f"{of}_") if of else ("measured", "")
    lower, upper = row[f"{ends}lower"], row[f"{ends}upper"]
    if lower is None or upper is None:
        return [text(row[value])]
    return [text(row[value]), f"{text(lower)} to {text(upper)}"]


def coverage_tables(rows: Sequence[Mapping[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield a table a quantity: a line a sensor, a column a figure, of the table ``coverage``."""
    for quantity, title in _TITLES.items():
        own = [row for row in rows if row["quantity"] == quantity]
        figures = list(dict.fromkeys(row["figure"] for row in own))
        lines: dict[str, dict[str, Any]] = {}
        for row in own:
            name = f"{row['vendor']} {row['model']}"
            line = lines.setdefault(
                row["sensor"], {"name": name, "document": row["document"] or "–", "cells": {}}
            )
            line["cells"][row["figure"]] = {
                "text": _SIGNS[row["published"]],
                "note": row["as_printed"] or "",
                "class": "" if row["published"] == "yes" else "none",
            }
        if not lines:
            continue
        published = {
            figure: Counter(r["published"] for r in own if r["figure"] == figure)
            for figure in figures
        }
        yield {
            "title": title,
            "figures": [
                figure.replace("_", " ") if len(figure) > 3 else figure for figure in figures
            ],
            "lines": [
                line | {"cells": [line["cells"][figure] for figure in figures]}
                for line in sorted(lines.values(), key=lambda line: str(line["name"]))
            ],
            "counts": [_count(published[figure]) for figure in figures],
        }


def _count(published: Counter[str]) -> str:
    """Return of how many of those looked up a figure is published, and how many were not."""
    unknown = published["not looked up"]
    text = f"{published['yes']} of {published.total() - unknown} looked up"
    return f"{text}; {unknown} not looked up" if unknown else text
