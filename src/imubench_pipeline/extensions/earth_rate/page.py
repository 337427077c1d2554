"""The pages of the Earth's rate: of one turned gyro, and of all estimates and predictions."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter
from pathlib import Path

import numpy as np

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.pages import (
    describe_noise_model,
    group_by_run,
    list_without_result,
    select_calibrated,
)
from imubench_pipeline.extensions.earth_rate.tables import (
    AlignmentRow,
    EarthRatePredictionRow,
    EarthRatePublishedRow,
    EarthRateRow,
    EarthRateSeriesRow,
    TurningRow,
)
from imubench_pipeline.model.estimates import EnvelopeRow
from imubench_pipeline.report.payload import Arrays, Json, pack_samples
from imubench_pipeline.report.practical import System, choose_page_unit
from imubench_pipeline.report.recording import (
    describe_recording,
    read_sample_rows,
    summarise_recording,
)
from imubench_pipeline.report.site import Entry, RecordingPage, Section, Site
from imubench_pipeline.report.view import RecordingView
from imubench_pipeline.words.numbers import (
    count_digits,
    counted,
    degrees_text,
    duration_text,
    number_text,
    percent_text,
    sentence,
)

_METHODS = {  # term of the glossary, and words
    "pairs": ("by_pairs", "pairs of dwells"),
    "triples": ("by_triples", "A-B-A differences"),
    "filter": ("rate_filter", "filter, rate unknown"),
    "smoother": ("rate_smoother", "smoother, rate unknown"),
    "known_rate": ("known_rate", "bias tracking with known rate, P₀ in (°/s)²"),
    "known_rate_radians": ("known_rate", "bias tracking with known rate, P₀ in (rad/s)²"),
}
ESTIMATES = ("filter", "pairs", "triples")


@dataclass(frozen=True)
class EarthRateLine:
    """A line of the table of Earth-rate estimates on a page, with its texts."""

    row: EarthRateRow
    term: str
    words: str
    digits: int
    off: str
    why: str
    use: bool


@dataclass(frozen=True)
class Goal:
    """The turns and the time that a standard deviation of the Earth's rate requires, as texts."""

    goal: str
    turns: str
    time: str
    sigma: float | None
    heading: str


@dataclass(frozen=True)
class Needs:
    """The recordings required to find the Earth's rate."""

    latitude: str
    dwell: str
    goals: list[Goal]
    best: str


@dataclass(frozen=True)
class Alignment:
    """The predicted alignment of a sensor at rest; the lines end with roll, pitch and heading."""

    view: RecordingView
    latitude: str
    biases: str
    axes: str
    lines: list[tuple[str, str, str, list[str]]]
    none: list[str]
    check: str
    drawn: list[Json]


def make_turned_context(site: Site, view: RecordingView, folder: Path) -> Mapping[str, object]:
    """Return the context of the page of a turned gyro; ``folder``: results of the recording."""
    arrays = Arrays()
    rows = view.rows(EarthRateRow)
    channel = rows[0].channel if rows else ""
    whole = [row for row in rows if row.part == "whole"]
    turning = view.rows(TurningRow)
    parts = list(dict.fromkeys(row.part for row in rows if row.value is not None))
    envelope = read_sample_rows(folder, EnvelopeRow)
    prediction = view.rows(EarthRatePredictionRow)
    latitude = degrees_text(rows[0].latitude) if rows else ""
    # Dwells, turns and knocks in the order of time.
    stretches = sorted(
        (row for row in turning if row.start is not None), key=lambda row: (row.start, row.what)
    )
    turns = counted(sum(event.what == "turn" for event in turning), "turn")
    summary = [f"{turns} between north and south", *[f"at latitude {latitude}"] * bool(rows)]
    return {
        **describe_recording(site, view, [], folder),
        "channel": channel,
        "summary": summarise_recording(view, summary),
        "answer": summarise_earth_rate(whole, site.system),
        "doubts": [sentence("; ".join(row.doubts)) for row in turning if row.what == "doubt"],
        "findings": view.findings,
        "lines": [format_estimate(row) for row in rows],
        "given": describe_settling(rows),
        "noise": describe_noise_model(rows),
        "has_range": any(row.sigma_lower is not None for row in rows),
        "latitude": latitude,
        "parts": parts,
        "has_samples": any(row.channel == channel for row in envelope),
        "has_drift": any(row.quantity == "drift" for row in view.rows(EarthRateSeriesRow)),
        "published": [(view, row) for row in view.rows(EarthRatePublishedRow)],
        "needs": summarise_needs(prediction),
        "stretches": stretches,
        "command": site.again(view, "earth_rate"),
        "page": {
            "looks": {},
            "channels": [],
            "findings": [],
            "samples": pack_samples(envelope, [], arrays),
            "turned": _pack_figures(view, rows, turning, arrays),
            "prediction": pack_prediction(prediction, arrays),
            "arrays": arrays.texts,
        },
    }


TURNED_PAGE = RecordingPage("turned.html.jinja", make_turned_context, "two positions")


def summarise_earth_rate(rows: Sequence[EarthRateRow], system: System) -> str:
    """Return the filter's estimate of a whole recording, or why there is none, in sentences."""
    by_method = {row.method: row for row in rows}
    best = by_method.get("filter")
    if best is None:
        return "This recording has no estimate of the Earth's rate."
    if best.value is None:
        return sentence("; ".join(best.reasons))
    unit = choose_page_unit("gyro", "adev", system)
    digits = unit.digits(best.value, best.lower, best.upper)
    value, truth = (unit.text(number, digits) for number in (best.value, best.truth))
    size = None if best.upper is None else best.upper - best.value
    away = None if best.off_sigma is None else abs(best.off_sigma)
    text = (
        f"The filter estimates an Earth's rate of {value} ± {unit.text(size, 2)} {unit.sign} "
        f"(95 %). The true rate is {truth} {unit.sign}, {number_text(away, 2)} standard deviations "
        "away."
    )
    if away is not None and away > _MAX_NOISE_ERROR:
        text += (
            " Noise does not explain this error. Check sense, axis and latitude, a warm-up, and "
            "whether the noise is that at rest."
        )
    return text + (f" {sentence('; '.join(best.reasons))}" if best.reasons else "")


def describe_settling(rows: Sequence[EarthRateRow]) -> str:
    """Return the settling times of the filter with known rate in recordings, in a sentence."""
    given = [row for row in rows if row.part == "whole" and row.status == "given"]
    parts = []
    for method, unit in (("known_rate", "(°/s)²"), ("known_rate_radians", "(rad/s)²")):
        times = [row.settled for row in given if row.method == method]
        reached = sorted(time for time in times if time is not None)
        if not times:
            continue
        ends = [duration_text(time) for time in dict.fromkeys(reached[:1] + reached[-1:])]
        text = f"after {' to '.join(ends)} of data" if ends else "never"
        if ends and len(reached) < len(times):
            text += f" (never in {len(times) - len(reached)} of {len(times)} runs)"
        parts.append(f"{text} with P₀ in {unit}")
    if not parts:
        return ""
    return (
        f"It settles within 10 % of the given rate {'; '.join(parts)}. Until then, noise dominates "
        "its mean."
    )


_MAX_NOISE_ERROR = 4.0  # standard deviations beyond which noise does not explain an error


def format_estimate(row: EarthRateRow) -> EarthRateLine:
    """Return a line of the table of estimates, from a row of ``earth_rate``."""
    term, words = _METHODS[row.method]
    return EarthRateLine(
        row=row,
        term=term,
        words=words,
        digits=count_digits(row.value, row.lower, row.upper),
        off="–" if row.off_sigma is None else f"{number_text(row.off_sigma, 2)} σ",
        why=sentence("; ".join(row.reasons)),
        use=row.method == "filter" and row.status == "ok",
    )


def summarise_needs(rows: Sequence[EarthRatePredictionRow]) -> Needs | None:
    """Return the recordings required to find the Earth's rate, by the rows of one recording."""
    goals = [row for row in rows if row.of == "goal"]
    if not goals:
        return None
    curve = [row for row in rows if row.of == "dwell"]
    best = next((row for row in curve if row.best), None)
    best_words = ""
    if best is not None:
        nearly = [row.dwell for row in curve if row.nearly_best]
        best_words = (
            f"In a run of {duration_text(best.time)} the best dwell has "
            f"{number_text(best.dwell, 3)} s of data ({counted(best.turns, 'turn')}) and gives "
            f"the Earth's rate to {percent_text(best.relative)} (1σ). "
            + _describe_near_best(best.dwell, [row.dwell for row in curve], nearly)
        )
    return Needs(
        latitude=degrees_text(goals[0].latitude),
        dwell=duration_text(goals[0].dwell),
        goals=[
            Goal(
                goal=percent_text(row.goal),
                turns=f"{row.turns:,}".replace(",", " "),
                time=duration_text(row.time),
                sigma=row.sigma,
                heading=f"above {degrees_text(_MAX_SMALL_HEADING, 2)}"
                if row.heading is not None and row.heading > _MAX_SMALL_HEADING
                else degrees_text(row.heading, 3),
            )
            for row in goals
        ],
        best=best_words,
    )


def _describe_near_best(best: float, tried: Sequence[float], nearly: Sequence[float]) -> str:
    near = [*nearly, best]
    low, high = (number_text(limit, 3) for limit in (min(near), max(near)))
    if best in (max(tried), min(tried)):
        longest = best == max(tried)
        text = f"It is the {'longest' if longest else 'shortest'} dwell that was tried"
        if low == high:
            return f"{text}."
        limit = f"down to {low}" if longest else f"up to {high}"
        return f"{text}; dwells {limit} s are less than 1 % worse."
    if low == high:
        return "All other dwells that were tried are at least 1 % worse."
    return f"Dwells from {low} s to {high} s are less than 1 % worse."


_MAX_SMALL_HEADING = 0.5  # rad; largest sigma of a heading for which the small-angle formula holds


def _pack_figures(
    view: RecordingView, rows: Sequence[EarthRateRow], turning: Sequence[TurningRow], arrays: Arrays
) -> Json:
    dwells, turns = ([row for row in turning if row.what == what] for what in ("dwell", "turn"))
    series = view.rows(EarthRateSeriesRow)
    parts: Json = {}
    for part in dict.fromkeys(row.part for row in series):
        in_part = [row for row in series if row.part == part]
        courses: Json = {}
        for quantity, method in dict.fromkeys((row.quantity, row.method) for row in in_part):
            own = [row for row in in_part if (row.quantity, row.method) == (quantity, method)]
            courses["drift" if quantity == "drift" else method] = {
                "name": "drift" if quantity == "drift" else _METHODS[method][1],
                "time": arrays.exact([row.time for row in own]),
                "value": arrays.exact([row.value for row in own]),
                "sigma": arrays.exact([row.sigma for row in own]),
            }
        parts[part] = {"range": _find_range(in_part, rows[0].truth), "courses": courses}
    return {
        "channel": rows[0].channel if rows else "",
        "truth": rows[0].truth if rows else None,
        "dwells": {
            "start": arrays.exact([row.start for row in dwells]),
            "stop": arrays.exact([row.stop for row in dwells]),
            "mean": arrays.exact([row.mean for row in dwells]),
            "north": [row.sense == 1 for row in dwells],
        },
        "turns": arrays.exact([row.time for row in turns]),
        "found_by": [row.found_by for row in turns],
        "parts": parts,
    }


def _find_range(series: Sequence[EarthRateSeriesRow], truth: float) -> list[float]:
    """Return the range of the rate in the figure of estimates, without the first estimates."""
    rates = [row for row in series if row.quantity == "rate"]
    if not rates:
        return [0.0, 2.0 * truth]
    first, last = rates[0].time, max(row.time for row in rates)
    later = [row for row in rates if row.time >= first + 0.12 * (last - first)]
    high = max(abs(row.value - truth) + 2.0 * (row.sigma or 0.0) for row in later)
    return [truth - 1.1 * high, truth + 1.1 * high]


def pack_prediction(rows: Sequence[EarthRatePredictionRow], arrays: Arrays) -> Json:
    """Return the data of the figures of the prediction of a recording."""
    goals = [row.goal for row in rows if row.of == "goal"]
    payload: Json = {"goals": goals, "truth": EARTH_RATE}
    for of, x in (("time", attrgetter("time")), ("dwell", attrgetter("dwell"))):
        own = sorted((row for row in rows if row.of == of and row.sigma is not None), key=x)
        payload[of] = {
            "x": arrays.exact([x(row) for row in own]),
            "sigma": arrays.exact([row.sigma for row in own]),
            "turns": [row.turns for row in own],
            "run": own[0].time if own else None,
            "length": own[0].dwell if own else None,
            "best": next((k for k, row in enumerate(own) if row.best), None),
            "nearly": [row.dwell for row in own if row.nearly_best],
        }
    return payload


def select_turned(site: Site) -> list[RecordingView]:
    """Return the recordings of gyros that were turned between north and south."""
    return [view for view in site.views if view.row.kind == "two_position"]


def select_predicted(site: Site) -> list[RecordingView]:
    """Return the static recordings with a prediction for the Earth's rate from their noise."""
    named = site.named_in(EarthRatePredictionRow)
    return site.select_compared(
        [view for view in site.views if view.static and view.full_name in named]
    )


def _make_context(site: Site) -> Mapping[str, object]:
    arrays = Arrays()
    turned_gyros = select_turned(site)
    published = [(view, row) for view in turned_gyros for row in view.rows(EarthRatePublishedRow)]
    predicted = list(_list_predictions(site))
    aligned = summarise_alignments(site, arrays)
    return {
        "truth": EARTH_RATE,
        "runs": [(view, lines) for view in turned_gyros for lines in _format_parts(view)],
        "given": describe_settling(
            [row for view in turned_gyros for row in view.rows(EarthRateRow)]
        ),
        "rejected": [view for view in turned_gyros if view.left_out],
        "published": published,
        "verdict": describe_published([row for _, row in published]),
        "needs": predicted,
        "alignments": aligned,
        "calibrations": group_by_run(site),
        "not_calibrated": [view for view in select_calibrated(site) if view.left_out],
        "page": {
            "looks": {},
            "channels": [],
            "published": [
                {
                    "name": row.recording + ("" if row.part == "whole" else f", {row.part}"),
                    "published": row.published,
                    "truth": row.truth,
                    "sigma": row.sigma,
                    "simulated": row.simulated,
                }
                for _, row in published
            ],
            "predictions": {
                f"{view.sensor}-{view.name}": pack_prediction(
                    view.rows(EarthRatePredictionRow), arrays
                )
                for view, _ in predicted
            },
            "alignments": {one.view.sensor: one.drawn for one in aligned},
            "arrays": arrays.texts,
        },
    }


def _select_recordings(site: Site) -> list[RecordingView]:
    return [*select_turned(site), *select_calibrated(site), *select_predicted(site)]


EARTH_RATE_PAGE = Entry(
    file="earth_rate.html",
    title="Earth’s rate",
    about="a gyro turned between north and south: how well it senses the Earth’s rate",
    context=_make_context,
    tables=("ranking",),
    views=_select_recordings,
    exists=lambda site: bool(_select_recordings(site)),
    place=4,
)
NOT_FOUND = Section(
    page="index.html",
    template="not_found.html.jinja",
    context=lambda site: (
        list(list_without_result(select_turned(site), lambda view: view.rows(EarthRateRow))) or None
    ),
)


def _format_parts(view: RecordingView) -> Iterator[dict[str, EarthRateLine]]:
    shown = [row for row in view.rows(EarthRateRow) if row.method in ESTIMATES]
    for part in dict.fromkeys(row.part for row in shown):
        yield {row.method: format_estimate(row) for row in shown if row.part == part}


def _list_predictions(site: Site) -> Iterator[tuple[RecordingView, Needs]]:
    """Yield the recordings that each sensor would need, without duplicates."""
    yielded: list[tuple[str, Needs]] = []
    for view in [*select_turned(site), *select_predicted(site)]:
        needed = summarise_needs(view.rows(EarthRatePredictionRow))
        if needed is None or (view.sensor, needed) in yielded:
            continue
        yielded.append((view.sensor, needed))
        yield view, needed


def describe_published(rows: Sequence[EarthRatePublishedRow]) -> str:
    """Return whether noise explains the errors of published estimates, in sentences."""
    if not rows:
        return ""
    beyond = [row for row in rows if row.verdict == "beyond the noise"]
    if not beyond:
        every = "the error of the published estimate"
        if len(rows) > 1:
            every = f"the errors of all {len(rows)} published estimates"
        return f"Noise explains {every}. {_describe_gain(rows)}"
    within = len(rows) - len(beyond)
    names = ", ".join(
        row.recording
        + ("" if row.part == "whole" else f" ({row.part})")
        + f" by {number_text(row.off_sigma, 3)} σ"
        for row in beyond
    )
    return (
        f"The noise that the source prints explains {counted(within, 'published estimate')}. "
        f"{len(beyond)} of {len(rows)} {'has' if len(beyond) == 1 else 'have'} a larger error: "
        f"{names}. A filter cannot remove it. Possible causes are a warm-up, miscounted turns, or "
        "samples of the turns in the means. " + _describe_gain(rows)
    )


def _describe_gain(rows: Sequence[EarthRatePublishedRow]) -> str:
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


_TABLE_TIMES = (60.0, 600.0, 3600.0)  # times at rest that the table shows, s; the figure has more

_POSITION_TEXTS = {1: "one position", 2: "two opposite positions"}


def summarise_alignments(site: Site, arrays: Arrays) -> list[Alignment]:
    """Return the predicted alignment of each sensor for a page; ``arrays`` gets the curves."""
    entries = []
    unit = choose_page_unit("gyro", "adev", site.system)
    fine = choose_page_unit("accel", "adev", "si")
    for view in site.select_compared(
        [view for view in site.views if view.part(AlignmentRow.table).num_rows]
    ):
        rows = view.rows(AlignmentRow)
        about = rows[0]
        gyro_bias = f"{unit.text(about.gyro_bias, 3)} {unit.sign} ({about.gyro_bias_from})"
        accel_bias = f"{fine.text(about.accelerometer_bias, 3)} {fine.sign}"
        lines = [
            (
                _POSITION_TEXTS[row.positions],
                row.method,
                duration_text(row.time),
                [
                    "not determined" if angle is None else degrees_text(angle, 3)
                    for angle in (row.roll, row.pitch, row.heading)
                ],
            )
            for row in rows
            if row.time in _TABLE_TIMES
        ]
        entries.append(
            Alignment(
                view=view,
                latitude=degrees_text(about.latitude),
                biases=f"Fixed biases of {gyro_bias} and {accel_bias} "
                f"({about.accelerometer_bias_from}).",
                axes=_describe_missing_axes(about),
                lines=lines,
                none=list(dict.fromkeys(sentence(row.reason) for row in rows if row.reason)),
                check=_describe_check(rows),
                drawn=_pack_curves(rows, arrays),
            )
        )
    return entries


def _describe_missing_axes(row: AlignmentRow) -> str:
    lent_axes = []
    for channels, words in ((row.gyros, "gyro"), (row.accelerometers, "accelerometer")):
        lent = [axis for axis, channel in zip("xyz", channels, strict=True) if channel[-1] != axis]
        if lent:
            lent_axes.append(f"{words} {' and '.join(lent)}")
    if not lent_axes:
        return ""
    return f"The log has no {', '.join(lent_axes)}; the other axes replace them."


def _describe_check(rows: Sequence[AlignmentRow]) -> str:
    comparisons = []
    for row in rows:
        if row.simulated is None:
            continue
        errors = {name: getattr(row, f"error_{name}") for name in ("roll", "pitch", "heading")}
        ratios = (f"{name} {number_text(one, 3)}" for name, one in errors.items() if one)
        comparisons.append(f"in {_POSITION_TEXTS[row.positions]} {', '.join(ratios)}")
    if not comparisons:
        return ""
    number = next(row.simulated for row in rows if row.simulated is not None)
    last = duration_text(max(row.time for row in rows))
    return (
        f"Check: {number} simulated triads with this noise, aligned for {last} by the filter. "
        f"Rms error / predicted σ: {'; '.join(comparisons)}."
    )


def _pack_curves(rows: Sequence[AlignmentRow], arrays: Arrays) -> list[Json]:
    """Return the curves of the figure; ``level`` is the larger of roll and pitch."""
    courses = []
    for positions in _POSITION_TEXTS:
        for method in ("coarse", "fine"):
            own = [r for r in rows if r.positions == positions and r.method == method]
            level = [
                None if r.roll is None or r.pitch is None else max(r.roll, r.pitch) for r in own
            ]
            for angle, sigma in (("heading", [r.heading for r in own]), ("level", level)):
                points = [(r.time, s) for r, s in zip(own, sigma, strict=True) if s]
                if points:
                    courses.append(
                        {
                            "positions": positions,
                            "method": method,
                            "angle": angle,
                            "time": arrays.exact([time for time, _ in points]),
                            "sigma": arrays.exact(np.degrees([s for _, s in points]).tolist()),
                        }
                    )
    return courses
