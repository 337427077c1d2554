"""The page that compares sensors or recordings side by side: the data for its script.

The script computes the ratios of the recordings that the reader chooses, like `navigation.ratios`.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa

from imubench_pipeline.estimators.estimate import COMPARED
from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.model.table import CATEGORY
from imubench_pipeline.model.verdicts import ErrorSource
from imubench_pipeline.report.comparison import Comparison
from imubench_pipeline.report.glossary import find_term
from imubench_pipeline.report.payload import Arrays, Json, pack_styles
from imubench_pipeline.report.practical import choose_unit, format_temperature, list_units_by_size
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.report.view import RecordingView
from imubench_pipeline.settings.requirements import DIMENSIONS
from imubench_pipeline.tables.files import read
from imubench_pipeline.units import parse_quantity
from imubench_pipeline.words import verdicts
from imubench_pipeline.words.numbers import duration_text, number_text

KEPT = ("error_growth", "drawn_deviations")
"""The tables of each recording that the page uses, besides the joined tables."""

_SOURCE_COLUMNS = tuple(field.name for field in fields(ErrorSource))
_COMPARED_ERRORS = ("attitude", "heading", "velocity", "position")


def _make_context(site: Site) -> Mapping[str, object]:
    views = _select_recordings(site)
    together = Comparison(site.compared(views), site.names)
    arrays, channels = together.arrays, together.channels
    recordings = []
    for view in views:
        kept = {table: _read_columns(_make_path(site, view, table)) for table in KEPT}
        drawn = dict(_pack_draws(kept["drawn_deviations"], arrays))
        for channel in channels:
            if (channel["sensor"], channel["recording"]) == view.full_name:
                channel["drawn"] = drawn.get(channel["channel"])
        growth = _pack_growth(kept["error_growth"], arrays)
        recordings.append(
            _describe_recording(view) | {"sold": site.is_sold(view.sensor), "growth": growth}
        )
    windows = [each.static_window for each in site.requirements.values() if each.static_window]
    window = [*windows, site.settings["settings"]["error_budget"]["static_window"]][0]
    errors = {}
    for error in _COMPARED_ERRORS:
        # The unit of an axis, and the units of numbers: smallest size in SI, sign, factor.
        axis = choose_unit(DIMENSIONS[error], site.system)
        sized = list_units_by_size(DIMENSIONS[error], site.system)
        units = [[least, unit.sign, unit.per_si] for least, unit in sized]
        errors[error] = {"axis": [axis.sign, axis.per_si], "sized": units}
    return {
        "several": len(views) > 1,
        "page": {
            "grouped": "sensor",
            "looks": pack_styles({view.sensor: site.looks[view.sensor] for view in views}),
            "names": site.names,
            "compared": COMPARED,
            "recordings": recordings,
            "errors": errors,
            "window": parse_quantity(window, "time"),
            "verdicts": verdicts.SHORT_VERDICTS,
            "requirements": [
                {
                    "title": requirement.title,
                    "sensors": {
                        row.sensor: _describe_verdict(row)
                        for row in site.rows(RankingRow)
                        if row.requirement == name and row.decides
                    },
                }
                for name, requirement in site.requirements.items()
            ],
            **together.page,
        },
    }


def _describe_verdict(row: RankingRow) -> str:
    if row.verdict == "excluded":
        return verdicts.SHORT_VERDICTS[row.verdict]
    margins = [f"margin in use {number_text(row.margin, 3)}" if row.margin is not None else ""]
    margins.append(verdicts.other_margins_text(row))
    return ", ".join(filter(None, [verdicts.SHORT_VERDICTS[row.verdict], *margins]))


def _select_recordings(site: Site) -> list[RecordingView]:
    """Return the static recordings, which can be compared; of many, the latest."""
    return site.select_compared([view for view in site.views if view.static])


def _make_path(site: Site, view: RecordingView, table: str) -> Path:
    return site.results / "recordings" / view.sensor / view.name / f"{table}.parquet"


def _read_columns(path: Path) -> Mapping[str, Any]:
    """Return the columns of a table of a recording; empty if the file is missing."""
    if not path.is_file():
        return {}
    rows = read(path.stem, [path])
    names = set(rows.column_names) - {"sensor", "recording", "unit"}
    # A category with nulls loses them in NumPy.
    plain = {name: rows[name].cast(pa.string()) for name in names if rows[name].type == CATEGORY}
    return {name: plain.get(name, rows[name]).to_numpy() for name in names}


def _describe_recording(view: RecordingView) -> Json:
    row = view.row
    findings = dict.fromkeys(finding.finding for finding in view.warnings)
    return {
        "sensor": view.sensor,
        "recording": view.name,
        "page": view.page,
        "device": row.device,
        "simulated": view.simulated,
        "seconds": row.duration,
        "duration": duration_text(row.duration),
        "rate": number_text(row.rate),
        "started": row.started,
        "temperature": format_temperature(row) or None,
        "decides": row.decides is not False,
        "doubts": [find_term(name).name for name in findings],
    }


def _pack_draws(kept: Mapping[str, Any], arrays: Arrays) -> Iterator[tuple[str, Json]]:
    """Yield the Allan deviation of each channel and of its drawn models at some tau, sorted."""
    if not kept:
        return
    of_draw = np.isfinite(np.asarray(kept["draw"], dtype=np.float64))  # null: the estimate itself
    for channel in dict.fromkeys(kept["channel"].tolist()):
        own = kept["channel"] == channel
        best = own & ~of_draw
        unknown = [list(texts) for texts in kept["unknown"][best]]
        drawn = {
            "tau": arrays.exact(kept["tau"][best]),
            "adev": arrays.exact(kept["adev"][best]),
            "drawn": arrays.log(kept["adev"][own & of_draw]),
            "unknown": {place: texts for place, texts in enumerate(unknown) if texts},
        }
        yield channel, drawn


def _pack_growth(kept: Mapping[str, Any], arrays: Arrays) -> Json | None:
    """Return the growth of errors of the worst axes and of each axis."""
    if not kept or not len(kept["error"]):
        return None
    windows, times = (np.unique(kept[name]) for name in ("window", "time"))
    kept = {**kept, "number": _number_sources(kept)}
    by_axis = {
        axis: _pack_errors(_take_rows(kept, kept["axis"] == axis), arrays)
        for axis in dict.fromkeys(kept["axis"].tolist())
    }
    worst = by_axis.pop("worst")
    only = {} if by_axis else dict.fromkeys({name[-1] for name in kept["gyro"]}, "worst")
    return {
        "windows": arrays.exact(windows),
        "times": arrays.exact(times),
        "errors": worst,
        "axes": by_axis or only,
    }


def _number_sources(kept: Mapping[str, Any]) -> Any:
    numbers = np.zeros(len(kept["source"]), dtype=np.intp)
    for name in _SOURCE_COLUMNS:
        codes, values = pd.factorize(kept[name], use_na_sentinel=False)
        numbers = numbers * len(values) + codes
    return numbers


def _take_rows(kept: Mapping[str, Any], rows: Any) -> Mapping[str, Any]:
    return {name: values[rows] for name, values in kept.items()}


def _pack_errors(kept: Mapping[str, Any], arrays: Arrays) -> Json:
    """Return the totals of each error with limits, and the shares of the variance by source."""
    errors = {}
    for error in dict.fromkeys(kept["error"].tolist()):
        own = _take_rows(kept, kept["error"] == error)
        of_total = own["source"] == "total"
        total, rest = _take_rows(own, of_total), _take_rows(own, ~of_total)
        variance = total["sigma"] ** 2
        keys = zip(total["window"].tolist(), total["time"].tolist(), strict=True)
        places = {key: place for place, key in enumerate(keys)}
        keys = zip(rest["window"].tolist(), rest["time"].tolist(), strict=True)
        at = np.array([places[key] for key in keys], dtype=np.intp)
        with np.errstate(divide="ignore", invalid="ignore"):
            parts = np.where(variance[at], rest["sigma"] ** 2 / variance[at], 0.0)
        sources = {}
        for number in pd.unique(rest["number"]):
            rows = np.flatnonzero(rest["number"] == number)
            shares = np.zeros(len(variance))
            shares[at[rows]] = parts[rows]
            if np.any(shares > 0.0):
                values = (rest[name][rows[0]] for name in _SOURCE_COLUMNS)
                plain: Any = (None if pd.isna(value) else value for value in values)
                source = ErrorSource(*plain)
                sources[verdicts.source_text(source)] = {
                    "kind": verdicts.source_text(source, sized=False),
                    "shares": arrays.even(shares),
                }
        errors[error] = {
            **{name: arrays.log(total[name]) for name in ("sigma", "lower", "upper")},
            "gyro": _merge_axes(total["gyro"]),
            "accel": _merge_axes(total["accel"]),
            "sources": sources,
        }
    return errors


def _merge_axes(channels: Sequence[str | None]) -> list[str]:
    """Return the channels that determine the error: one, or one per window and time."""
    named = [channel or "" for channel in channels]
    return named[:1] if len(set(named)) == 1 else named


COMPARE = Entry(
    file="compare.html",
    title="Side by side",
    context=_make_context,
    tables=("ranking",),
    views=_select_recordings,
    files=lambda site: (
        _make_path(site, view, table) for view in _select_recordings(site) for table in KEPT
    ),
    exists=lambda site: any(view.static for view in site.views),
)
