"""The page of one recording and its channels."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from imubench_pipeline.estimators.estimate import SENSOR
from imubench_pipeline.model import estimates
from imubench_pipeline.model.comparisons import CoverageRow
from imubench_pipeline.model.table import R
from imubench_pipeline.recordings import recording
from imubench_pipeline.recordings.kept import Quality
from imubench_pipeline.registry import Hook
from imubench_pipeline.report import meaning, payload
from imubench_pipeline.report.comparison import make_methods_table
from imubench_pipeline.report.datasheets import compare_with_datasheet
from imubench_pipeline.report.log_screen import Event, list_events
from imubench_pipeline.report.picture import draw_picture
from imubench_pipeline.report.practical import System, choose_page_unit, format_temperature
from imubench_pipeline.report.site import Page, RecordingPage, Site, make_command
from imubench_pipeline.report.view import QUANTITY_NAMES, ChannelView, RecordingView
from imubench_pipeline.tables.files import read
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.words import numbers
from imubench_pipeline.words.estimates import model_text, precision_text, symbol_text
from imubench_pipeline.words.events import events_text, missing_axes_texts
from imubench_pipeline.words.findings.base import channels_text

_TEMPERATURE_TERMS = (
    ("sensitivity", "temperature_sensitivity", "sensitivity"),
    ("quadratic", "temperature_quadratic", "quadratic term"),
    ("lag", "thermal_lag", "thermal lag"),
    ("bias", "bias_at_reference", "bias at T₀"),
)
_LOW_PASS_TERMS = (("cutoff", "cutoff", "cut-off"), (SENSOR, SENSOR, "N before the low-pass"))
_UNIT_SYMBOLS = {"sensitivity": "sensitivity", "quadratic": "quadratic"}
_UNIT_SYMBOLS |= {"bias": "signal", SENSOR: "N"}
"""Symbol of the unit, for quantities whose unit the reader can choose."""

_Figure = estimates.TemperatureRow | estimates.LowPassRow | estimates.ParameterRow
_FIXED_UNITS = {"lag": "s", "cutoff": "Hz"}
_SHOWN_TAU = np.array([100.0, 300.0, 1_000.0, 3_000.0, 10_000.0, 30_000.0])
"""Averaging times for which the effect of temperature is stated, s."""

_NOT_COMPENSATED = (
    "Ranking, datasheet comparison and budgets use the log with its temperature effect. The "
    "method “temperature compensated” gives the noise at constant temperature."
)
_MIN_SHOWN_RATIO = 1.05
"""Ratio of Allan deviations without and with compensation from which it is stated."""


def list_thermal_figures(channel: ChannelView) -> Iterator[Mapping[str, object]]:
    """Yield lines of a table: the temperature effect, if it was fitted, and the low-pass."""
    estimated = channel.parameters.get("likelihood", ())
    before = {row.parameter: row for row in estimated if row.parameter == SENSOR}
    low_pass: Mapping[str, _Figure] = {**channel.low_pass, **before}
    entries: tuple[tuple[Mapping[str, _Figure], str, str, str], ...] = (
        *((channel.temperature, *names) for names in _TEMPERATURE_TERMS),
        *((low_pass, *names) for names in _LOW_PASS_TERMS),
    )
    for rows, name, term, words in entries:
        row = rows.get(name)
        if row is None or row.status == "absent":
            continue
        truth = channel.truth.get(name) if name != "bias" else None
        yield {
            "term": term,
            "words": words,
            "unit": f"{channel.quantity}.{_UNIT_SYMBOLS[name]}" if name in _UNIT_SYMBOLS else None,
            "sign": _FIXED_UNITS.get(name),
            "value": row.value,
            "lower": row.lower,
            "upper": row.upper,
            "digits": numbers.count_digits(row.value, row.lower, row.upper, name),
            "status": "" if row.status == "ok" else row.status,
            "truth": truth.value if truth else None,
            "why": numbers.sentence(row.reason),
        }


def describe_thermal(channel: ChannelView, system: System) -> list[str]:
    """Return the results for temperature and low-pass, as sentences."""
    lines = []
    temperature, low_pass = channel.temperature, channel.low_pass
    if temperature:
        sensitivity = temperature["sensitivity"]
        if sensitivity.compensated:
            unit = choose_page_unit(channel.quantity, "sensitivity", system)
            size = f"{unit.text(sensitivity.value)} {unit.sign}"
            change = f"The bias changes with temperature by {size}."
            lines += [change + _describe_reduction(channel), _NOT_COMPENSATED]
        else:
            lines.append(f"The temperature effect is not removed: {sensitivity.reason}.")
        lines.append(
            f"The mean temperature T₀ is {numbers.number_text(temperature['T_0'].value)} °C."
        )
    if low_pass and low_pass["cutoff"].status == "absent":
        lines.append("The spectrum shows no low-pass of the sensor.")
    elif low_pass:
        cutoff, order = low_pass["cutoff"].value, low_pass["cutoff"].order
        kind = "first order" if order == 1 else "Butterworth"
        kind += f", order {order}" if order not in (None, 1) else ""
        if cutoff is not None:
            lines.append(
                f"The sensor's own low-pass has its cut-off at {numbers.number_text(cutoff)} Hz "
                f"({kind})."
            )
    return lines


def _describe_reduction(channel: ChannelView) -> str:
    left = channel.compensated
    if not left:
        return ""
    ratio = np.interp(np.log(left["tau"]), np.log(channel.tau), channel.adev) / left["adev"]
    taus = _SHOWN_TAU[(_SHOWN_TAU >= left["tau"][0]) & (_SHOWN_TAU <= left["tau"][-1])]
    at = np.interp(np.log(taus), np.log(left["tau"]), ratio)
    parts = [
        f"{numbers.number_text(float(factor), 3)} at τ = {numbers.number_text(float(tau))} s"
        for tau, factor in zip(taus, at, strict=True)
        if factor > _MIN_SHOWN_RATIO
    ]
    if not parts:
        return ""
    return f" Compensated, the Allan deviation is lower by a factor of {', '.join(parts)}."


_MAX_HIDDEN_RATE_ERROR = 1e-9  # relative error of a rate up to which the page does not state it
_SHOWN_MODELS = 4  # models with the lowest BIC that the page lists, besides the model of the papers
_RATE_FROM = {"stamps": "from the time stamps", "stated": "as stated"}


Section = Callable[[Site, RecordingView], tuple[str, Any] | None]
"""Returns the template of a section of a page, and its variable `section`; None: no section."""

_SECTIONS: Hook[Section] = Hook("recording_sections")


def make_recording_page(site: Site, view: RecordingView, of: RecordingPage) -> Page:
    """Return the page of a recording; ``of`` is the page of its kind."""
    folder = site.results / "recordings" / view.sensor / view.name
    # The digest of the data of a recording's page; `folder` is the recording's
    shown = ("envelope", "histogram", "samples_of_models")
    samples = [folder / f"{table}.parquet" for table in shown]
    own = [path.read_bytes() for path in samples if path.is_file()]
    published = [row for row in site.rows(CoverageRow) if row.sensor == view.sensor]
    look = site.looks.get(view.sensor)
    key = site.key_of(view.key, view.device_page, look, published, load_metadata(folder), *own)
    return Page(view.page, of.template, key, lambda: of.context(site, view, folder))


def read_sample_rows(folder: Path, of: type[R]) -> list[R]:
    """Return the rows of the table of class ``of`` in the folder of a recording, if any."""
    path = folder / f"{of.table}.parquet"
    return of.rows_of(read(of.table, [path])) if path.is_file() else []


def make_recording_context(site: Site, view: RecordingView, folder: Path) -> Mapping[str, object]:
    """Return the variables of the template of a static recording; ``folder`` has its results."""
    arrays = payload.Arrays()
    envelope = read_sample_rows(folder, estimates.EnvelopeRow)
    histogram = read_sample_rows(folder, estimates.HistogramRow)
    channels = view.channels()
    findings = [
        _describe_event(number, event, site.system)
        for number, event in enumerate(list_events(view.findings), start=1)
    ]
    samples = payload.pack_samples(envelope, histogram, arrays)
    of_models = read_sample_rows(folder, estimates.ModelSampleRow)
    described = [_describe_channel(site, view, one, samples, of_models) for one in channels]
    budgets = list(
        meaning.make_budget_tables(view.budget, {view.full_name: view.simulated}, site.system)
    )
    return {
        **describe_recording(site, view, channels, folder),
        "summary": _summarise(view, len(channels)),
        "findings": findings,
        "channels": described,
        "quantities": [
            _tabulate_recommended(quantity, own)
            | {"picture": draw_picture([one["view"] for one in own], site.system)}
            for quantity in QUANTITY_NAMES
            if (own := [one for one in described if one["view"].quantity == quantity])
        ],
        "missing": []
        if view.left_out
        else missing_axes_texts(
            [channel.channel for channel in channels],
            [row.channel for row in view.findings if row.channel],
        ),
        "has_series": bool(samples["envelope"].keys() - {"temperature"}),
        "has_temperature": "temperature" in samples["envelope"],
        "added": [made for add in _SECTIONS.objects() if (made := add(site, view)) is not None],
        "budget": budgets[0] if budgets else None,
        "backtest": meaning.format_backtest(
            view.rows(estimates.BacktestRow), site.settings["requirements"], site.system
        ),
        "budget_words": meaning.explain_budget(site.settings["settings"]["error_budget"]),
        "command": site.again(view, "scores"),
        # A recording that is left out has no figures.
        "figures_command": None
        if view.left_out or site.at_once
        else make_command(
            "figures", site.results_name, {"--sensor": view.sensor, "--recording": view.name}
        ),
        "page": {
            "looks": payload.pack_styles({view.sensor: site.looks[view.sensor]}),
            "channels": [payload.pack_channel(channel, arrays) for channel in channels],
            "samples": samples,
            "of_models": payload.pack_model_samples(of_models, arrays),
            "budgets": [meaning.make_budget_bars(view.budget, site.system)] if budgets else [],
            "findings": [
                {name: row[name] for name in ("number", "finding", "channel", "spans", "detail")}
                for row in findings
            ],
            "arrays": arrays.texts,
        },
    }


def _describe_event(number: int, event: Event, system: System) -> dict[str, Any]:
    first = event.findings[0]
    text = events_text(event.findings, system, event.factors())
    where = channels_text(event.channels)
    if where and len(event.findings) > 1:
        text = text.removeprefix(f"{where[:1].upper()}{where[1:]}. ")
    spans = [(row.start, row.start if row.end is None else row.end)
             for row in event.findings if row.start is not None]  # fmt: skip
    return {
        "number": number,
        "finding": first.finding,
        "matters": event.score() > 0.0 and first.severity != "note",
        "channel": where,
        "linked": False,
        "short": re.split(r"(?<=\D[.;:]) ", numbers.sentence(text), maxsplit=1)[0].rstrip(":;.")
        + ".",
        "detail": text,
        "spans": spans,
        "start": min((start for start, _ in spans), default=None),
        "end": max((end for _, end in spans), default=None),
    }


def _tabulate_recommended(quantity: str, channels: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the parameters of the recommended methods: a line for each axis."""
    symbols = list(dict.fromkeys(name for one in channels for name in one["symbols"]))
    lines = [
        line | {"view": one["view"], "cells": dict(zip(one["symbols"], line["cells"], strict=True))}
        for one in channels
        for line in one["lines"]
        if line["recommended"] or not line["method"]
    ]
    return {"quantity": quantity, "title": QUANTITY_NAMES[quantity], "symbols": symbols,
            "lines": lines}  # fmt: skip


STATIC = RecordingPage("recording.html.jinja", make_recording_context)


def _summarise(view: RecordingView, channels: int) -> str:
    if view.left_out:
        why = "was rejected" if view.rejected else "could not be analysed, because a step failed"
        return f"This recording {why}; the comparison does not include it."
    started = f"from {numbers.started_text(view.row.started)}" if view.row.started else ""
    warnings = numbers.counted(len(view.warnings), "warning") if view.warnings else "no warnings"
    parts = (started, format_temperature(view.row), numbers.counted(channels, "channel"), warnings)
    return summarise_recording(view, [part for part in parts if part])


def summarise_recording(view: RecordingView, parts: Sequence[str]) -> str:
    """Return length and rate of a recording, and additional parts, as a sentence."""
    row = view.row
    length = f"{numbers.duration_text(row.duration)} at {numbers.rates_text(row.rate, view.rates)}"
    kind = "Simulated from known parameters, not measured: " if view.simulated else ""
    return kind + ", ".join([length, *parts]) + "."


def _describe_channel(
    site: Site,
    view: RecordingView,
    channel: ChannelView,
    samples: Mapping[str, Any],
    of_models: Sequence[estimates.ModelSampleRow],
) -> dict[str, Any]:
    symbols, lines = make_methods_table(channel, view.row.duration, site.system)
    used = next(line for line in lines if line["recommended"])
    for line in lines:
        line |= {"score": "–", "drawn": ("–", ""), "inside": "–"}
        score = channel.scores.get(line["method"] or "")
        if score is not None and score.rms_log10 is not None:
            ends = (score.drawn_log10_lower, score.drawn_log10_upper)
            low, high = (numbers.number_text(end, 2) for end in ends)
            inside = score.inside_band
            line["score"] = numbers.number_text(score.rms_log10, 2)
            line["drawn"] = numbers.number_text(score.drawn_log10, 2), f"{low} to {high}"
            line["inside"] = numbers.NO_VALUE if inside is None else f"{100 * inside:.0f} %"
    best = channel.models[0] if channel.models else None
    return {
        "view": channel,
        "answer": _describe_values(channel, site.system),
        "words": list(_describe_missing(symbols, used["cells"])),
        "symbols": symbols,
        "lines": lines,
        "has_spectrum": bool(channel.spectrum),
        "has_samples": channel.channel in samples["envelope"],
        "of_models": _compare_deviations(of_models, channel.channel),
        "model": _describe_model(channel),
        "models": [
            {
                "model": row.model,
                "chosen": row.chosen,
                "above": numbers.number_text(row.bic - best.bic, 3) if best else "",
                "deviance": numbers.number_text(row.deviance, 3),
                "verdict": row.verdict,
            }
            for place, row in enumerate(channel.models)
            if place < _SHOWN_MODELS or row.model == "N+GM+K"
        ],
        "spectral_lines": channel.lines,
        "thermal": describe_thermal(channel, site.system),
        "thermal_figures": list(list_thermal_figures(channel)),
        "line_count": numbers.counted(len(channel.lines), "line"),
        "deltas": list(compare_with_datasheet(channel, site.coverage, site.system)),
    }


def _describe_missing(symbols: Sequence[str], cells: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the reasons for missing or doubtful values; sigma_min and tau_min share one."""
    of = dict(zip(symbols, cells, strict=True))
    statuses = {symbol: {part["status"] for part in cell["parts"]} for symbol, cell in of.items()}
    words, of_time = (
        of[symbol]["words"] if symbol in of else "" for symbol in ("sigma_min", "tau_min")
    )
    lowest, time = (symbol_text(symbol) for symbol in ("sigma_min", "tau_min"))
    reason = words.removeprefix(f"{lowest}: ")
    same = reason not in ("", words) and of_time == f"{time}: {reason}"
    together = f"{lowest} and {time}: {reason}" if same else ""
    for symbol, cell in of.items():
        if symbol == "T_B" and statuses["T_B"] == {"absent"}:
            # The sentence on an absent B includes this.
            if statuses["B"] != {"absent"}:
                yield "B is flicker noise, which has no correlation time T_B."
        elif symbol == "sigma_min" and together:
            yield together
        elif cell["words"] and not (symbol == "tau_min" and together):
            yield cell["words"]


def _describe_values(channel: ChannelView, system: System) -> str:
    parts = []
    for symbol in ("N", "B_curve", "B", "T_B", "K"):
        unit = choose_page_unit(channel.quantity, symbol, system)
        for row in channel.named(channel.recommended, symbol)[:1]:
            if row.value is not None:
                doubt = "doubtful" if row.status == "doubtful" else ""
                certainty = ", ".join(filter(None, [precision_text(row, unit), doubt]))
                size, _ = unit.estimate_texts(row.value, row.lower, row.upper)
                text = f"{symbol_text(symbol)} {size} {unit.sign}"
                parts.append(f"{text} ({certainty})" if certainty else text)
    if channel.fixed_bias is not None:
        unit = choose_page_unit(channel.quantity, "signal", system)
        parts.append(f"mean {unit.text(channel.fixed_bias, 4)} {unit.sign}")
    return "; ".join(parts) + "."


def _compare_deviations(rows: Sequence[estimates.ModelSampleRow], channel: str) -> str:
    own = {row.of: row for row in rows if row.channel == channel and row.what == "deviation"}
    log = own.get("log")
    widths = [(of, own[of].mean) for of in ("before", "after") if of in own]
    if log is None or not log.mean:
        return ""
    ratios = [
        f"{numbers.number_text(w / log.mean, 4)} {of} the fit" for of, w in widths if w is not None
    ]
    length = f"Standard deviation relative to the log ({numbers.duration_text(log.end)})"
    return f"{length}: {', '.join(ratios)}." if ratios else ""


def _describe_model(channel: ChannelView) -> str:
    if not channel.models:
        return ""
    best = channel.models[0]
    text = (
        f"{model_text(best.model)} has the lowest BIC ({best.verdict}). The deviance per bin is "
        f"{numbers.number_text(best.deviance, 3)}; a correct model gives about 1."
    )
    return " ".join(
        filter(None, [text, numbers.sentence(best.note), numbers.sentence(best.band_source)])
    )


def describe_recording(
    site: Site, view: RecordingView, channels: Sequence[ChannelView], folder: Path
) -> Mapping[str, object]:
    """Return variables that the pages of all recordings share; ``folder`` has its results."""
    metadata, row = load_metadata(folder), view.row
    provenance = [
        ("Recording", f"{row.sensor} / {row.recording}"),
        ("Device", str(row.device)),
        ("Kind", row.kind.replace("_", " ") + (", simulated" if row.simulated else "")),
        ("Started", numbers.started_text(row.started) or "not stated in the log"),
    ]
    if metadata is not None:
        provenance.append(("Format", metadata.reader or "detected from the content"))
    if row.rate is not None:
        error = ""
        if row.rate_error is not None and row.rate_error > _MAX_HIDDEN_RATE_ERROR * row.rate:
            error = f" ± {numbers.number_text(row.rate_error, 2)} Hz"
        source = _RATE_FROM.get(row.rate_from or "", "")
        provenance.append(("Rate", f"{numbers.number_text(row.rate, 7)} Hz{error}, {source}"))
        rates = {channel.channel: numbers.number_text(channel.rate, 6) for channel in channels}
        if len(set(rates.values())) > 1:
            each = ", ".join(f"{name} {rate} Hz" for name, rate in rates.items())
            provenance.append(("Rate per channel", each))
    if row.samples is not None:
        removed = " (removed after the analysis)" if metadata and metadata.removed else ""
        provenance.append(("Samples", f"{row.samples:,}".replace(",", " ") + removed))
    if metadata is not None and len(metadata.segments) > 1:
        provenance.append(("Segments", str(len(metadata.segments))))
    truths = {parameter.source for channel in channels for parameter in channel.truth.values()}
    return {
        "view": view,
        "name": site.names[view.sensor],
        "sensor_page": site.sensor_page(view.sensor),
        "provenance": provenance + [("Simulated from", truth) for truth in truths],
        "sources": metadata.sources if metadata else (),
        "figures_command": None,
    }


def load_metadata(folder: Path) -> recording.LogMetadata | None:
    """Return the metadata of a log, None without samples; raises RecordingError if altered."""
    stored = folder / recording.METADATA_FILE
    if stored.is_file():  # of an object store: the samples are not needed for it
        return recording.read_metadata(stored) if stored.read_bytes() != b"null" else None
    quality = folder / "quality.json"
    if quality.is_file() and (fault := Quality.read(quality).fault(folder)):
        raise RecordingError(fault)
    paths = recording.list_log_files(folder)
    return recording.read_metadata(paths[0]) if paths else None
