"""The pages of recordings on a rate table and in positions, and sections for other pages."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from imubench_pipeline.extensions.calibration.tables import CalibrationPointRow, CalibrationRow
from imubench_pipeline.extensions.earth_rate.tables import EarthRateRow
from imubench_pipeline.report.payload import Arrays
from imubench_pipeline.report.practical import System, choose_page_unit
from imubench_pipeline.report.recording import describe_recording, summarise_recording
from imubench_pipeline.report.site import RecordingPage, Section, Site
from imubench_pipeline.report.view import RecordingView
from imubench_pipeline.words.numbers import (
    count_digits,
    counted,
    degrees_text,
    number_text,
    percent_text,
    sentence,
)

WORDS = {
    "bias": "bias at the start",
    "present_bias": "bias at the end",
    "scale_factor": "scale factor",
    "quadratic": "quadratic term",
    "asymmetry": "asymmetry",
    "linearity": "linearity, of the largest rate",
    "earth_rate": "the Earth's rate",
    "heading": "heading",
}

_PPM_PER_UNIT = 1e6
_PERCENT_PER_UNIT = 1e2
_RATIO_UNITS = {  # unit of each dimensionless quantity on a page, and the factor to it
    "scale_factor": ("", 1.0),
    "asymmetry": (" ppm", _PPM_PER_UNIT),
    "quadratic": (" ppm per °/s", _PPM_PER_UNIT * math.radians(1.0)),
    "linearity": (" %", _PERCENT_PER_UNIT),
}
_MIN_LINEARITY_P_VALUE = 0.05  # below it the response of a gyro counts as nonlinear
_MIN_SCATTER_P_VALUE = 0.01  # below it the scatter of the means contradicts the noise model


def summarise_calibration(rows: Sequence[CalibrationRow], system: System) -> str:
    """Return sentences with scale factor and bias of a recording, or the reason for no result."""
    by_parameter = {row.parameter: row for row in rows}
    bias = by_parameter.get("bias")
    if bias is None:
        return "This recording has no result."
    if bias.value is None:
        return sentence(bias.reason)
    unit = choose_page_unit("gyro", "adev", system)
    size = _format_half_width((bias.value, bias.lower, bias.upper), unit.text)
    text = f"The bias is {size} {unit.sign} (95 %)"
    scale = by_parameter.get("scale_factor")
    if scale is not None and scale.value is not None:
        errors = [
            None if factor is None else _PPM_PER_UNIT * (factor - 1.0)
            for factor in (scale.value, scale.lower, scale.upper)
        ]
        off = _format_half_width(errors, number_text)
        text = f"The scale factor error is {off} ppm. {text}"
    text += ". "
    straight = by_parameter.get("linearity")
    if straight is not None and straight.chance is not None and straight.value is not None:
        nonlinear = straight.chance < _MIN_LINEARITY_P_VALUE
        largest = number_text(_PERCENT_PER_UNIT * straight.value, 3)
        text += f"The largest deviation from the line is {largest} % of the largest rate. "
        text += f"Noise {'does not explain' if nonlinear else 'explains'} this deviation "
        text += f"(p = {percent_text(straight.chance, 2)})."
    return text.strip()


def _format_half_width(
    limits: Sequence[float | None], as_text: Callable[[float | None, int], str]
) -> str:
    """Return a value and half the width of its interval as text, such as ``1.2 ± 0.3``."""
    value, lower, upper = limits
    half = None if lower is None or upper is None else (upper - lower) / 2.0
    return f"{as_text(value, count_digits(value, lower, upper))} ± {as_text(half, 2)}"


@dataclass(frozen=True)
class CalibrationLine:
    """A line of the tables of results and attitudes; dimensionless quantities as text."""

    row: CalibrationRow
    words: str
    why: str
    digits: int
    percent: str = "–"
    text: str = "–"
    limits: str = "–"
    sigma: str = "–"
    truth: str = "–"
    off: str = "–"


def format_estimates(rows: Sequence[CalibrationRow]) -> Iterator[CalibrationLine]:
    """Yield the lines of the table of results."""
    for row in rows:
        if row.status == "not_observable" and row.parameter in ("earth_rate", "heading"):
            continue
        line = CalibrationLine(
            row=row,
            words=WORDS[row.parameter],
            why=sentence(row.reason),
            digits=count_digits(row.value, row.lower, row.upper, row.parameter),
            percent="–" if row.chance is None else percent_text(row.chance, 2),
        )
        name, shown = row.parameter, (row.value, row.lower, row.upper, row.truth)
        if row.value is None or name not in _RATIO_UNITS:
            yield line
            continue
        if name == "scale_factor":
            value, low, high, true = (number_text(size, line.digits) for size in shown)
            sigma = "–" if row.sigma is None else f"{number_text(_PPM_PER_UNIT * row.sigma, 3)} ppm"
        else:
            value, low, high, true, sigma = (
                number_text(None if size is None else _RATIO_UNITS[name][1] * size, 3)
                for size in (*shown, row.sigma)
            )
        text, limits = value + _RATIO_UNITS[name][0], f"{low} to {high}"
        yield replace(line, text=text, limits=limits, sigma=sigma, truth=true)


def list_not_observable(rows: Sequence[CalibrationRow]) -> list[tuple[str, str, float | None]]:
    """Return the names of unobservable quantities, with reasons and possible half-widths."""
    return [
        (WORDS[row.parameter], sentence(row.reason), row.half_width)
        for row in rows
        if row.status == "not_observable"
    ]


def describe_scatter(rows: Sequence[CalibrationRow]) -> str:
    """Return whether the scatter agrees with the noise model, in a sentence."""
    chance = next((row.scatter for row in rows if row.scatter is not None), None)
    if chance is None:
        return ""
    text = percent_text(chance, 2)
    if chance < _MIN_SCATTER_P_VALUE:
        return (
            f"The means scatter more than the noise model predicts (p = {text}), so the intervals "
            "are too narrow. Check for other noise, a warm-up or motion."
        )
    return f"The scatter of the means agrees with the noise model (p = {text})."


def describe_earth_rate(rows: Sequence[CalibrationRow], system: System) -> str:
    """Return the correction for the Earth's rate, in a sentence."""
    row = next((row for row in rows if row.earth_rate is not None), None)
    if row is None:
        return "The bias includes the Earth's rate along the axis."
    unit = choose_page_unit("gyro", "adev", system)
    direction = f"elevation {degrees_text(row.elevation)}"
    if row.heading is not None:
        direction = f"heading {degrees_text(row.heading)}, {direction}"
    elif row.elevation is None or abs(math.cos(row.elevation)) >= 1e-6:
        direction += ", no heading"
    text = (
        f"The Earth's rate along the axis, {unit.text(row.earth_rate, 4)} {unit.sign} (latitude "
        f"{degrees_text(row.latitude)}, {direction}), is subtracted"
    )
    if row.half_width:
        half = f"{unit.text(row.half_width, 3)} {unit.sign}"
        text += f"; without a heading it is uncertain by ± {half}"
    elif row.earth_rate_sigma:
        sigma = f"{unit.text(row.earth_rate_sigma, 2)} {unit.sign}"
        text += f"; the stated direction determines it to {sigma} (1σ)"
    return text + "."


Estimated = CalibrationRow | EarthRateRow


def select_calibrated(site: Site) -> list[RecordingView]:
    """Return the recordings on a rate table, in positions, or at rest with a direction."""
    named = site.named_in(CalibrationRow)
    kinds = ("rate_table", "positions")
    return [view for view in site.views if view.row.kind in kinds or view.full_name in named]


def list_without_result(
    views: Sequence[RecordingView], rows_of: Callable[[RecordingView], Sequence[Estimated]]
) -> Iterator[tuple[RecordingView, str]]:
    """Yield the recordings of an experiment without an estimate, with the reasons."""
    for view in views:
        rows = rows_of(view)
        if rows and all(row.value is None for row in rows):
            row = rows[0]
            reason = row.reason if isinstance(row, CalibrationRow) else "; ".join(row.reasons)
            yield view, sentence(reason)


NOT_CALIBRATED = Section(
    page="index.html",
    template="not_calibrated.html.jinja",
    context=lambda site: (
        list(list_without_result(select_calibrated(site), lambda view: view.rows(CalibrationRow)))
        or None
    ),
)


def make_rest_section(site: Site, view: RecordingView) -> tuple[str, Mapping[str, object]] | None:
    """Return template and data of the bias of a static recording; None without a direction."""
    rows = [row for row in view.rows(CalibrationRow) if row.run == "at_rest"]
    if not rows:
        return None
    return "at_rest.html.jinja", {
        "channel": rows[0].channel,
        "lines": [line for line in format_estimates(rows) if line.row.status != "not_observable"],
        "open": list_not_observable(rows),
        "noise": describe_noise_model(rows),
        "scatter": describe_scatter(rows),
        "earth": describe_earth_rate(rows, site.system),
    }


@dataclass(frozen=True)
class CalibratedRun:
    """A calibrated recording: table lines by parameter, and result and correction in words."""

    view: RecordingView
    lines: Mapping[str, CalibrationLine]
    answer: str
    earth: str


def group_by_run(site: Site) -> dict[str, list[CalibratedRun]]:
    """Return all calibrated recordings, by kind of run."""
    by_run: dict[str, list[CalibratedRun]] = {"rate_table": [], "at_rest": [], "positions": []}
    for view in select_calibrated(site):
        rows = view.rows(CalibrationRow)
        if rows:
            lines = format_attitude if rows[0].run == "positions" else format_estimates
            run = CalibratedRun(
                view,
                lines={line.row.parameter: line for line in lines(rows)},
                answer=summarise_calibration(rows, site.system),
                earth=describe_earth_rate(rows, site.system),
            )
            by_run[rows[0].run].append(run)
    return by_run


def format_attitude(rows: Sequence[CalibrationRow]) -> Iterator[CalibrationLine]:
    """Yield lines with roll, pitch and heading in degrees, from the rows of one recording."""
    for row in rows:
        value, lower, upper, truth = (
            None if angle is None else math.degrees(angle)
            for angle in (row.value, row.lower, row.upper, row.truth)
        )
        digits = count_digits(value, lower, upper)
        off = None
        if value is not None and truth is not None and row.sigma is not None:
            off = math.remainder(value - truth, 360.0) / math.degrees(row.sigma)
        yield CalibrationLine(
            row=row,
            words=row.parameter,
            why=sentence(row.reason),
            digits=digits,
            text="–" if value is None else f"{number_text(value, digits)}°",
            limits=""
            if lower is None or upper is None
            else f"{number_text(lower, digits)}° to {number_text(upper, digits)}°",
            truth="–" if truth is None else f"{number_text(truth, digits)}°",
            off="–" if off is None else f"{number_text(off, 2)} σ",
        )


def describe_noise_model(rows: Sequence[Estimated]) -> str:
    """Return the noise model that weights the data, in a sentence."""
    fitted = next((row for row in rows if row.model), None)
    if fitted is None:
        return ""
    origin = f", from {fitted.model_from}" if fitted.model_from else ""
    return f"Noise model: {fitted.model}{origin}."


def _rate_table(site: Site, view: RecordingView, folder: Path) -> Mapping[str, object]:
    rows = view.rows(CalibrationRow)
    points = view.rows(CalibrationPointRow)
    arrays, summary = Arrays(), []
    if points:
        most = math.degrees(max(abs(point.table_rate) for point in points))
        rates = counted(len(points), "constant rate")
        summary = [f"{rates} up to {number_text(most)} °/s"]
    return {
        **describe_recording(site, view, [], folder),
        "summary": summarise_recording(view, summary),
        "answer": summarise_calibration(rows, site.system),
        "lines": list(format_estimates(rows)),
        "open": list_not_observable(rows),
        "noise": describe_noise_model(rows),
        "scatter": describe_scatter(rows),
        "earth": describe_earth_rate(rows, site.system),
        "points": points,
        "findings": view.findings,
        "command": site.again(view, "calibration"),
        "page": {
            "looks": {},
            "channels": [],
            "findings": [],
            "table": {
                **{
                    name: arrays.exact([getattr(row, name) for row in points])
                    for name in ("table_rate", "mean", "line", "residual", "sigma")
                },
                "number": [row.number for row in points],
            },
            "arrays": arrays.texts,
        },
    }


RATE_TABLE = RecordingPage("rate_table.html.jinja", _rate_table, "rate table")


def _positions(site: Site, view: RecordingView, folder: Path) -> Mapping[str, object]:
    rows = view.rows(CalibrationRow)
    number = rows[0].rates if rows else None
    return {
        **describe_recording(site, view, [], folder),
        "summary": summarise_recording(view, [] if number is None else [f"{number} positions"]),
        "lines": list(format_attitude(rows)),
        "noise": describe_noise_model(rows),
        "findings": view.findings,
        "command": site.again(view, "calibration"),
        "page": {"looks": {}, "channels": [], "findings": []},
    }


POSITIONS = RecordingPage("positions.html.jinja", _positions, "several positions")
