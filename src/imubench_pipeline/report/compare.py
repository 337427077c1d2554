"""The page that compares sensors or recordings side by side: the data for its script.

The script computes the ratios of the recordings that the reader chooses, like `navigation.ratios`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from imubench_pipeline.estimators.estimate import COMPARED
from imubench_pipeline.report.glossary import term
from imubench_pipeline.report.payload import Arrays, looks
from imubench_pipeline.report.practical import unit_of, units_by_size
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.report.view import RecordingView
from imubench_pipeline.settings.requirements import DIMENSIONS, Requirement
from imubench_pipeline.tables import read
from imubench_pipeline.units import quantity_to_si
from imubench_pipeline.words.numbers import duration_text, number_text

KEPT = ("error_growth", "drawn_deviations")
"""The tables of each recording that the page uses, besides the joined tables."""

_COMPARED_ERRORS = ("attitude", "heading", "velocity", "position")
_MAX_DETAILED_RECORDINGS = 100
"""With more recordings, draws are at whole decades of tau, and errors of worst axes only."""


def _make_context(site: Site) -> dict[str, Any]:
    arrays = Arrays()
    views = _select_recordings(site)
    budget = site.settings["settings"]["error_budget"]
    channels: list[dict[str, Any]] = []
    datasheets: dict[str, dict[str, Any]] = {}
    recordings = []
    few = len(views) > _MAX_DETAILED_RECORDINGS
    for recording in site.compared(views):
        view = recording.view
        kept = {table: _read_columns(site, view, table) for table in KEPT}
        drawn = dict(_pack_draws(kept["drawn_deviations"], arrays, few=few))
        for channel in recording.channels:
            channels.append(channel.among(arrays) | {"drawn": drawn.get(channel.about["channel"])})
        own = datasheets.setdefault(view.sensor, {})
        for name, lines in recording.datasheet.items():
            own.setdefault(name, lines)
        growth = _pack_growth(kept["error_growth"], arrays, few=few)
        recordings.append(
            _describe_recording(view) | {"sold": site.is_sold(view.sensor), "growth": growth}
        )
    return {
        "several": len(views) > 1,
        "page": {
            "grouped": "sensor",
            "looks": looks({view.sensor: site.looks[view.sensor] for view in views}),
            "names": site.names,
            "compared": COMPARED,
            "channels": channels,
            "datasheets": datasheets,
            "recordings": recordings,
            "errors": {error: _describe_units(site, error) for error in _COMPARED_ERRORS},
            "window": quantity_to_si(budget["static_window"], "time"),
            "limits": list(_list_limits(site)),
            "arrays": arrays.texts,
        },
    }


def _select_recordings(site: Site) -> list[RecordingView]:
    """Return the static recordings, which can be compared."""
    return [view for view in site.views if view.static]


def _list_files(site: Site) -> Iterator[Path]:
    """Yield the files of each recording that the page shows."""
    for view in _select_recordings(site):
        for table in KEPT:
            yield _make_path(site, view, table)


def _make_path(site: Site, view: RecordingView, table: str) -> Path:
    return site.results / "recordings" / view.sensor / view.name / f"{table}.parquet"


def _read_columns(site: Site, view: RecordingView, table: str) -> Mapping[str, Any]:
    """Return the columns of a table of a recording; empty if the file is missing."""
    path = _make_path(site, view, table)
    if not path.is_file():
        return {}
    rows = read(table, [path])
    return {
        name: rows[name].to_numpy()
        for name in rows.column_names
        if name not in ("sensor", "recording", "unit")
    }


def _describe_recording(view: RecordingView) -> dict[str, Any]:
    row = view.row
    temperature = None
    if row.temperature_min is not None:
        low, high = (number_text(end, 3) for end in (row.temperature_min, row.temperature_max))
        temperature = f"{low} to {high} °C"
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
        "temperature": temperature,
        "decides": row.decides is not False,
        "doubts": [term(name).name for name in findings],
    }


def _describe_units(site: Site, error: str) -> dict[str, Any]:
    """Return the unit of an axis, and the units of numbers: smallest size in SI, sign, factor."""
    dimension = DIMENSIONS[error]
    axis = unit_of(dimension, site.system)
    sized = units_by_size(dimension, site.system)
    return {
        "axis": [axis.sign, axis.per_si],
        "sized": [[least, unit.sign, unit.per_si] for least, unit in sized],
    }


def _list_limits(site: Site) -> Iterator[dict[str, Any]]:
    """Yield the limits of requirements, as 1 sigma."""
    for name, declared in site.settings["requirements"].items():
        requirement = Requirement.model_validate(declared)
        for limit in requirement.limits:
            if limit.error in _COMPARED_ERRORS:
                yield {
                    "requirement": name,
                    "title": requirement.title,
                    "error": limit.error,
                    "time": limit.seconds,
                    "limit": limit.size / requirement.sigmas,
                }


def _pack_draws(
    kept: Mapping[str, Any], arrays: Arrays, *, few: bool
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield the Allan deviation of each channel at some tau, and those of drawn models, sorted."""
    if not kept:
        return
    of_draw = np.isfinite(np.asarray(kept["draw"], dtype=np.float64))  # null: the estimate itself
    decade = np.log10(kept["tau"])
    wanted = np.abs(decade - decade.round()) < 1e-6 if few else np.ones(len(decade), dtype=bool)
    for channel in dict.fromkeys(kept["channel"].tolist()):
        own = (kept["channel"] == channel) & wanted
        best = own & ~of_draw
        unknown = kept["unknown"][best].tolist()
        yield (
            channel,
            {
                "tau": arrays.exact(kept["tau"][best]),
                "adev": arrays.exact(kept["adev"][best]),
                "drawn": arrays.log(kept["adev"][own & of_draw]),
                "unknown": {place: text for place, text in enumerate(unknown) if text},
            },
        )


def _pack_growth(kept: Mapping[str, Any], arrays: Arrays, *, few: bool) -> dict[str, Any] | None:
    """Return the growth of errors of the worst axes and of each axis."""
    if not kept or not len(kept["error"]):
        return None
    windows, times = (np.unique(kept[name]) for name in ("window", "time"))
    by_axis = {
        axis: _pack_errors(kept, kept["axis"] == axis, arrays)
        for axis in dict.fromkeys(kept["axis"].tolist())
        if axis == "worst" or not few
    }
    worst = by_axis.pop("worst")
    only = {} if by_axis or few else dict.fromkeys({name[-1] for name in kept["gyro"]}, "worst")
    return {
        "windows": arrays.exact(windows),
        "times": arrays.exact(times),
        "errors": worst,
        "axes": by_axis or only,
    }


def _pack_errors(kept: Mapping[str, Any], of_axis: Any, arrays: Arrays) -> dict[str, Any]:
    """Return the totals of each error with limits, and the shares of the variance by source."""
    errors = {}
    for error in dict.fromkeys(kept["error"][of_axis].tolist()):
        own = of_axis & (kept["error"] == error)
        total = own & (kept["source"] == "total")
        variance = kept["sigma"][total] ** 2
        sources = {
            source: np.zeros(len(variance))
            for source in dict.fromkeys(kept["source"][own & ~total].tolist())
        }
        places = {
            key: place
            for place, key in enumerate(
                zip(kept["window"][total].tolist(), kept["time"][total].tolist(), strict=True)
            )
        }
        rest = own & ~total
        columns = (kept[name][rest].tolist() for name in ("window", "time", "source", "sigma"))
        for window, time, source, sigma in zip(*columns, strict=True):
            place = places[window, time]
            sources[source][place] = sigma**2 / variance[place] if variance[place] else 0.0
        errors[error] = {
            **{name: arrays.log(kept[name][total]) for name in ("sigma", "lower", "upper")},
            "gyro": _merge_axes(kept["gyro"][total]),
            "accel": _merge_axes(kept["accel"][total]),
            "sources": {
                source: arrays.even(share)
                for source, share in sources.items()
                if np.any(share > 0.0)
            },
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
    views=_select_recordings,
    files=_list_files,
    exists=lambda site: bool(_select_recordings(site)),
)
"""The page that compares two or more sensors or recordings that the reader chooses."""
