"""The page: one file that opens from disk, with everything in it."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import version
from typing import Any

import jinja2
import pyarrow as pa

from imubench_pipeline.estimators.estimate import PARAMETERS
from imubench_pipeline.report.figures import channel_figure, comparison_figure, datasheet_figure
from imubench_pipeline.report.practical import System, page_unit
from imubench_pipeline.report.view import METHOD_NAMES, ChannelView, channel_views

_LIBRARIES = ("imubench_pipeline", "numpy", "scipy", "numba", "pyarrow", "snakemake")
_STATISTIC_NAMES = {
    "N": "N",
    "adev_minimum": "bias instability (minimum)",
    "plateau": "bias instability (0.664 B)",
    "K": "K",
    "T_B": "T_B",
}
_QUANTITY_NAMES = {"gyro": "Gyroscope", "accel": "Accelerometer"}


def render(tables: Mapping[str, pa.Table], settings: Mapping[str, Any]) -> str:
    """Return the report as HTML.

    Parameters
    ----------
    tables : mapping of str to pyarrow.Table
        All tables of `imubench_pipeline.tables.TABLES`.
    settings : mapping
        ``report``: title and units; ``sensors``: vendor and model of each.
    """
    system: System = settings["report"]["units"]
    views = channel_views(tables)
    recordings = tables["recordings"].to_pylist()
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("imubench_pipeline.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = environment.get_template("index.html.jinja").render(
        title=settings["report"]["title"],
        sensors=settings["sensors"],
        recordings=recordings,
        rejected=[row for row in recordings if row["status"] == "rejected"],
        findings=[row for row in tables["findings"].to_pylist() if row["finding"] != "rejected"],
        comparisons=list(_comparisons(views, system)),
        parameter_tables=list(_parameter_tables(views, system)),
        score_tables=list(_score_tables(views, system)),
        channels=[
            {
                "view": view,
                "curve": channel_figure(view, system),
                "datasheet": datasheet_figure(view, system),
            }
            for view in views
        ],
        deltas=list(_deltas(views, system)),
        settings={
            f"{section}.{key}": value
            for section, values in settings["settings"].items()
            for key, value in values.items()
        },
        versions={"python": platform.python_version()} | {n: version(n) for n in _LIBRARIES},
    )
    return page + "\n"


def _comparisons(views: list[ChannelView], system: System) -> Iterator[dict[str, Any]]:
    sensors = list(dict.fromkeys(view.sensor for view in views))
    for channel in dict.fromkeys(view.channel for view in views):
        chosen = [view for view in views if view.channel == channel]
        yield {
            "title": f"{_QUANTITY_NAMES[chosen[0].quantity]}, {channel[-1]} axis",
            "figure": comparison_figure(chosen, sensors, system),
            "names": ", ".join(view.label for view in chosen),
        }


def _parameter_tables(views: list[ChannelView], system: System) -> Iterator[dict[str, Any]]:
    for quantity, title in _QUANTITY_NAMES.items():
        chosen = [view for view in views if view.quantity == quantity]
        if not chosen:
            continue
        units = {symbol: page_unit(quantity, symbol, system) for symbol in PARAMETERS}
        groups = []
        for view in chosen:
            rows = [
                _method_row(view, method, [_cell(parameters[s], units[s].text) for s in PARAMETERS])
                for method, parameters in view.parameters.items()
            ]
            if view.truth:
                truth = [_truth_cell(view, symbol, units[symbol].text) for symbol in PARAMETERS]
                rows.append(_method_row(view, "truth of the simulation", truth))
            groups.append({"view": view, "rows": rows})
        heads = [f"{symbol} ({units[symbol].sign})" for symbol in PARAMETERS]
        yield {"title": f"{title}: parameters", "heads": heads, "groups": groups}


def _method_row(
    view: ChannelView, method: str, cells: list[dict[str, str]], note: str = ""
) -> dict[str, Any]:
    return {
        "method": METHOD_NAMES.get(method, method),
        "recommended": method == view.recommended,
        "cells": cells,
        "note": note,
    }


def _cell(row: Mapping[str, Any], text: Callable[[float | None], str]) -> dict[str, str]:
    status = row["status"].replace("_", " ")
    if row["value"] is None:
        return {"text": status, "note": row["reason"] or "", "class": "none"}
    flag = "" if row["status"] == "ok" else f" ({status})"
    return {"text": text(row["value"]) + flag, "note": row["reason"] or "", "class": "number"}


def _truth_cell(
    view: ChannelView, symbol: str, text: Callable[[float | None], str]
) -> dict[str, str]:
    row = view.truth.get(symbol)
    if row is None:
        return {"text": "none", "note": "", "class": "none"}
    assumed = " (assumed)" if row["assumed"] else ""
    return {"text": text(row["value"]) + assumed, "note": row["source"], "class": "number"}


def _score_tables(views: list[ChannelView], system: System) -> Iterator[dict[str, Any]]:
    for quantity, title in _QUANTITY_NAMES.items():
        chosen = [view for view in views if view.quantity == quantity]
        if not chosen:
            continue
        unit = page_unit(quantity, "adev", system)
        groups = []
        for view in chosen:
            rows = []
            for method, score in view.scores.items():
                known = score["rms"] is not None
                texts = [
                    unit.text(score["rms"]),
                    f"{score['rms_log10']:.3f}" if known else "–",
                    f"{100 * score['inside_band']:.0f} %" if known else "–",
                ]
                cells = [{"text": text, "note": "", "class": "number"} for text in texts]
                rows.append(_method_row(view, method, cells, score["reason"] or ""))
            groups.append({"view": view, "rows": rows})
        heads = [f"RMS ({unit.sign})", "RMS of log10 (decades)", "inside the 95 % band"]
        yield {"title": f"{title}: scores", "heads": heads, "groups": groups}


def _deltas(views: list[ChannelView], system: System) -> Iterator[dict[str, Any]]:
    symbols = {"N": "N", "bias_instability": "B", "K": "K", "T_B": "T_B"}
    for view in views:
        rows = []
        for row in view.datasheet:
            if row["method"] != view.recommended:
                continue
            unit = page_unit(view.quantity, symbols[row["quantity"]], system)
            published = row["printed"] is not None
            rows.append(
                {
                    "quantity": _STATISTIC_NAMES[row["statistic"]],
                    "printed": f"{row['printed']:g} {row['unit']}" if published else "–",
                    "kind": row["kind"] or "",
                    "comparable": unit.text(row["comparable"]),
                    "measured": unit.text(row["measured"]),
                    "unit": unit.sign,
                    "delta": "–" if row["delta"] is None else f"{round(100 * row['delta']):+d} %",
                    "verdict": row["verdict"],
                    "reason": (row["reason"] or "") if published else "",
                }
            )
        if rows:
            yield {"view": view, "rows": rows}
