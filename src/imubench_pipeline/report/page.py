"""The page: one file that opens from disk, with everything in it."""

from __future__ import annotations

import platform
from collections.abc import Callable, Iterator, Mapping
from importlib.metadata import version
from typing import Any

import jinja2
import pyarrow as pa

from imubench_pipeline.estimators.estimate import FAMILY, PARAMETERS
from imubench_pipeline.report.coverage import coverage_tables
from imubench_pipeline.report.figures import (
    channel_figure,
    comparison_figure,
    datasheet_figure,
    spectrum_figure,
)
from imubench_pipeline.report.meaning import budget_tables, rankings
from imubench_pipeline.report.practical import PageUnit, System, duration_text, page_unit
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
        ``report``: title and units; ``settings``: those of the steps; ``sensors``: vendor and
        model of each; ``requirements``: what was asked.
    """
    system: System = settings["report"]["units"]
    views = channel_views(tables)
    recordings = tables["recordings"].to_pylist()
    simulated = {(row["sensor"], row["recording"]): row["simulated"] for row in recordings}
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
        models=list(_models(views)),
        lines=list(_lines(views, system)),
        pooled=list(_pooled(tables["pooled"].to_pylist(), system)),
        channels=[
            {
                "view": view,
                "curve": channel_figure(view, system),
                "datasheet": datasheet_figure(view, system),
                "away": list(_away(view, system)),
                "spectrum": spectrum_figure(view, system),
            }
            for view in views
        ],
        deltas=list(_deltas(views, system)),
        coverage=list(coverage_tables(tables["coverage"].to_pylist())),
        rankings=list(
            rankings(tables["ranking"].to_pylist(), settings["requirements"], simulated, system)
        ),
        budgets=list(budget_tables(tables["error_budget"].to_pylist(), simulated, system)),
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
        symbols = _shown(chosen)
        units = {symbol: page_unit(quantity, symbol, system) for symbol in symbols}
        groups = []
        for view in chosen:
            rows = []
            for method in view.parameters:
                cells = [_cell(view.named(method, s), units[s]) for s in symbols]
                model = view.parameters[method][0]["model"]
                rows.append(_method_row(view, method, [_plain(model), *cells]))
            if view.truth:
                truth = [_truth_cell(view, symbol, units[symbol].text) for symbol in symbols]
                rows.append(_method_row(view, "truth of the simulation", [_plain(""), *truth]))
            groups.append({"view": view, "rows": rows})
        heads = ["model", *(f"{symbol} ({units[symbol].sign})" for symbol in symbols)]
        yield {"title": f"{title}: parameters", "heads": heads, "groups": groups}


def _method_row(
    view: ChannelView, method: str, cells: list[dict[str, Any]], note: str = ""
) -> dict[str, Any]:
    return {
        "method": METHOD_NAMES.get(method, method),
        "recommended": method == view.recommended,
        "cells": cells,
        "note": note,
    }


def _shown(views: list[ChannelView]) -> list[str]:
    """Return the parameters of the papers' model, and those others that a channel has."""
    there = {
        row["parameter"]
        for view in views
        for rows in view.parameters.values()
        for row in rows
        if row["status"] != "absent"
    }
    return [symbol for symbol in FAMILY if symbol in PARAMETERS or symbol in there]


def _plain(text: str) -> dict[str, Any]:
    return {"lines": [text], "note": "", "class": ""}


def _cell(rows: list[Mapping[str, Any]], unit: PageUnit) -> dict[str, Any]:
    """Return a cell with a line for each component: its value, and its interval."""
    if not rows:
        return {"lines": ["–"], "note": "", "class": "none"}
    lines = []
    for row in rows:
        status = row["status"].replace("_", " ")
        flag = "" if row["status"] == "ok" else f" ({status})"
        lines.append(status if row["value"] is None else unit.text(row["value"]) + flag)
        if row["upper"] is not None and row["status"] == "absent":
            lines.append(f"below {unit.text(row['upper'], 3)}")
        elif row["upper"] is not None:
            lines.append(f"{unit.text(row['lower'], 3)} to {unit.text(row['upper'], 3)}")
    notes = [row["reason"] for row in rows if row["reason"]]
    needed = rows[0]["duration_needed"]
    if needed is not None and rows[0]["status"] != "absent":
        notes.append(f"a log of {duration_text(needed)} tells it to 10 %")
    empty = all(row["value"] is None for row in rows)
    return {"lines": lines, "note": "; ".join(notes), "class": "none" if empty else "number"}


def _truth_cell(
    view: ChannelView, symbol: str, text: Callable[[float | None], str]
) -> dict[str, Any]:
    row = view.truth.get(symbol)
    if row is None:
        return {"lines": ["none"], "note": "", "class": "none"}
    assumed = " (assumed)" if row["assumed"] else ""
    return {"lines": [text(row["value"]) + assumed], "note": row["source"], "class": "number"}


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
                cells = [{"lines": [text], "note": "", "class": "number"} for text in texts]
                rows.append(_method_row(view, method, cells, score["reason"] or ""))
            groups.append({"view": view, "rows": rows})
        heads = [f"RMS ({unit.sign})", "RMS of log10 (decades)", "inside the 95 % band"]
        yield {"title": f"{title}: scores", "heads": heads, "groups": groups}


def _deltas(views: list[ChannelView], system: System) -> Iterator[dict[str, Any]]:
    symbols = {"N": "N", "K": "K", "T_B": "T_B"}
    for view in views:
        rows = []
        for row in view.datasheet:
            if row["method"] not in (view.recommended, "mean"):
                continue
            unit = page_unit(view.quantity, symbols.get(row["quantity"], "B"), system)
            published = row["printed"] is not None
            plain = row["quantity"].replace("_", " ")
            rows.append(
                {
                    "quantity": _STATISTIC_NAMES.get(row["statistic"], plain),
                    "printed": f"{row['printed']:g} {row['unit']}" if published else "–",
                    "about": ", ".join(filter(None, (row["kind"], row["condition"]))),
                    "comparable": unit.text(row["comparable"]),
                    "measured": _with_limits(row, unit.text),
                    "unit": "" if row["comparable"] is None and not row["measured"] else unit.sign,
                    "delta": _with_limits(row, _percent, "delta"),
                    "verdict": row["verdict"],
                    "reason": (row["reason"] or "") if published else "",
                }
            )
        if rows:
            yield {"view": view, "rows": rows}


def _away(view: ChannelView, system: System) -> Iterator[str]:
    """Yield how far the curve is from the lines of the datasheet."""
    unit = page_unit(view.quantity, "adev", system)
    for row in view.datasheet_curve:
        reading = f", density read as {row['sidedness']}" if row["sidedness"] else ""
        yield f"{unit.text(row['rms'], 3)} {unit.sign}, {row['rms_log10']:.3f} decades{reading}"


def _percent(share: float | None) -> str:
    return "–" if share is None else f"{round(100 * share):+d} %"


def _with_limits(
    row: Mapping[str, Any], text: Callable[[float | None], str], of: str = ""
) -> list[str]:
    """Return a figure, and its 95 % limits below it."""
    value, ends = (of, f"{of}_") if of else ("measured", "")
    lower, upper = row[f"{ends}lower"], row[f"{ends}upper"]
    if lower is None or upper is None:
        return [text(row[value])]
    return [text(row[value]), f"{text(lower)} to {text(upper)}"]


def _models(views: list[ChannelView]) -> Iterator[dict[str, Any]]:
    """Yield what the likelihood says of the models of each channel."""
    for view in views:
        if not view.models:
            continue
        chosen, *others = view.models
        papers = next((row for row in view.models if row["model"] == "N+GM+K"), None)
        runner = others[0] if others else None
        yield {
            "view": view,
            "model": chosen["model"],
            "runner": f"{runner['model']} +{runner['bic'] - chosen['bic']:.1f}" if runner else "–",
            "papers": f"+{papers['bic'] - chosen['bic']:.1f}" if papers else "–",
            "deviance": f"{chosen['deviance']:.2f}",
            "verdict": chosen["verdict"],
            "chance": f"{chosen['chance']:.2g}",
            "note": "; ".join(t for t in (chosen["note"], chosen["band_source"]) if t),
        }


def _lines(views: list[ChannelView], system: System) -> Iterator[dict[str, Any]]:
    """Yield the lines of each channel that has some."""
    for view in views:
        unit = page_unit(view.quantity, "adev", system)
        rows = [
            {
                "frequency": f"{row['frequency']:.5g}",
                "frequency_limits": f"{row['frequency_lower']:.5g} to {row['frequency_upper']:.5g}",
                "amplitude": unit.text(row["amplitude"]),
                "amplitude_limits": f"{unit.text(row['amplitude_lower'])} to "
                f"{unit.text(row['amplitude_upper'])}",
                "unit": unit.sign,
                "ratio": f"{row['ratio']:.3g}",
                "kind": row["kind"],
            }
            for row in view.lines
        ]
        if rows:
            yield {"view": view, "rows": rows}


def _pooled(rows: list[Mapping[str, Any]], system: System) -> Iterator[dict[str, Any]]:
    """Yield the pools of several recordings."""
    for row in rows:
        quantity = row["channel"].split("_", maxsplit=1)[0]
        symbol = "B" if row["parameter"] == "bias" else row["parameter"]
        unit = page_unit(quantity, symbol, system)
        limits = "–"
        if row["lower"] is not None and row["upper"] is not None:
            limits = f"{unit.text(row['lower'])} to {unit.text(row['upper'])}"
        yield {
            "sensor": row["sensor"],
            "device": row["device"] or "all",
            "channel": row["channel"],
            "parameter": "fixed bias" if row["parameter"] == "bias" else row["parameter"],
            "recordings": row["recordings"],
            "value": unit.text(row["value"]),
            "limits": limits,
            "spread": unit.text(row["spread"]),
            "unit": unit.sign,
            "verdict": row["verdict"] or "–",
            "p_value": "–" if row["p_value"] is None else f"{row['p_value']:.2g}",
            "reason": row["reason"] or "",
        }
