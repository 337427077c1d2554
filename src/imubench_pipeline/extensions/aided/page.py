"""The page of navigation during outages of GNSS, with filters of different tunings."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from imubench_pipeline.extensions.aided.tables import NavigationRow
from imubench_pipeline.recordings.fitness import list_excluded
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.tables.keys import group_rows
from imubench_pipeline.words.numbers import NO_VALUE, counted, number_text, percent_text
from imubench_pipeline.words.verdicts import doubts_text

TUNINGS = {
    "true": "true model",
    "datasheet": "datasheet",
    "datasheet_misread": "datasheet misread",
    "times_ten": "ten times the estimate",
    "table_1": "values of the authors",
    "overbound": "overbound",
    "curve": "read from the curve",
    "paper": "printed weights",
    "weighted": "correct weights",
    "robust": "robust fit",
    "likelihood": "likelihood",
    "likelihood_gm": "likelihood of the papers’ model",
    "compensated": "temperature compensated",
}
_SIGNAL_TEXTS: Mapping[str | None, str] = {
    None: NO_VALUE,
    "truth": "simulated from the truth",
    "estimate": "simulated from the estimate",
    "log": "pieces of the log",
}

_CONSISTENT_TEXTS = {True: "yes", False: "no", None: "not determined"}

_MIN_RELEVANT_RATIO = 1.1  # error over the error of the true model from which a tuning matters


@dataclass(frozen=True)
class TuningAnswer:
    """Texts on whether the tuning matters for a sensor, a trajectory and a source of signals."""

    row: NavigationRow
    signals: str
    outage: str
    effect: str
    smallest: str | None
    inconsistent: str | None


@dataclass(frozen=True)
class NavigationLine:
    """A row of the table ``navigation``, with its texts on the page."""

    row: NavigationRow
    outage: str
    signals: str
    tuning: str
    position: str
    ratio: str
    velocity: str
    heading: str
    inside: str
    consistent: str
    outages: str


def _make_context(site: Site) -> Mapping[str, object]:
    views = site.select_compared(site.views)
    compared = {view.full_name for view in views}
    rows = [row for row in site.rows(NavigationRow) if (row.sensor, row.recording) in compared]
    shown = [row for row in rows if row.position is not None]
    recordings = [view.row for view in views]
    apart = list_excluded(recordings)
    deciding = [row for row in shown if (row.sensor, row.recording) not in apart]
    return {
        "answers": list(describe_tunings(shown)),
        "doubts": {(row.sensor, row.recording): doubts_text(row.doubts) for row in recordings},
        "ranking": list(rank_sensors(deciding)),
        "apart": {
            row.sensor: f"{row.recording} is not used: {doubts_text(apart[key])}"
            for row in shown
            if (key := (row.sensor, row.recording)) in apart
        },
        "lines": [describe_row(row) for row in shown],
        "lacking": [describe_row(row) for row in rows if row.reason],
        "filters": {
            "trajectory": list(dict.fromkeys(row.trajectory for row in shown)),
            "outage": list(dict.fromkeys(_format_outage(row) for row in shown)),
            "tuning": list(dict.fromkeys(TUNINGS[row.tuning] for row in shown)),
            "sensor": list(dict.fromkeys(site.names[row.sensor] for row in shown)),
        },
    }


NAVIGATION = Entry(
    file="navigation.html",
    title="Navigation",
    about="filters on simulated drives with outages of GNSS: which tuning, which sensor",
    context=_make_context,
    tables=("navigation", "ranking"),
    exists=lambda site: bool(site.rows(NavigationRow)),
    place=1,
)


def describe_tunings(rows: Sequence[NavigationRow]) -> Iterator[TuningAnswer]:
    """Yield whether the tuning matters to the position after the longest outage, by sensor."""
    for own in group_rows(rows, lambda row: (row.sensor, row.trajectory, row.signals)).values():
        longest = max(row.outage or 0.0 for row in own)
        last = [row for row in own if row.outage == longest and row.tuning != "true"]
        known = [row for row in last if row.position_ratio is not None]
        if not known:
            continue
        smallest = next((row for row in own if row.smallest), None)
        inconsistent = dict.fromkeys(TUNINGS[row.tuning] for row in own if row.consistent is False)
        yield TuningAnswer(
            row=own[0],
            signals=_SIGNAL_TEXTS[own[0].signals],
            outage=f"{number_text(longest)} s",
            effect=_describe_effect(known),
            smallest=None
            if smallest is None
            else f"{TUNINGS[smallest.tuning]}, {smallest.states} states",
            inconsistent=", ".join(inconsistent) or None,
        )


def _fill_limits(lower: float | None, upper: float | None) -> tuple[float, float]:
    """Replace unknown limits by the widest possible ones."""
    return 0.0 if lower is None else lower, math.inf if upper is None else upper


def _describe_effect(rows: Sequence[NavigationRow]) -> str:
    """Return which tunings are worse than the true model, equal to it, or undecided."""
    worse: list[str] = []
    groups: dict[str, list[str]] = {"within 10 %": [], "at most 10 % worse": [], "inconclusive": []}
    for row in rows:
        name = TUNINGS[row.tuning]
        lower, upper = _fill_limits(row.position_ratio_lower, row.position_ratio_upper)
        if lower > _MIN_RELEVANT_RATIO:
            worse.append(f"{name} {number_text(row.position_ratio, 3)} times")
        elif upper >= _MIN_RELEVANT_RATIO:
            groups["inconclusive"].append(name)
        elif lower > 1.0 / _MIN_RELEVANT_RATIO:
            groups["within 10 %"].append(name)
        else:
            groups["at most 10 % worse"].append(name)
    parts = [f"{text}: {', '.join(names)}" for text, names in groups.items() if names]
    if worse:
        parts.insert(0, f"The tuning matters: {', '.join(worse)} the error of the true model")
    text = "; ".join(parts)
    return f"{text[0].upper()}{text[1:]}."


def rank_sensors(rows: Sequence[NavigationRow]) -> Iterator[tuple[int, NavigationLine, list[str]]]:
    """Rank sensors by the error after the longest outage; yield rank, line and tied sensors."""
    for trajectory in dict.fromkeys(row.trajectory for row in rows):
        chosen = [
            row
            for row in rows
            if row.trajectory == trajectory and row.recommended and row.signals != "log"
        ]
        longest = max((row.outage or 0.0 for row in chosen), default=0.0)
        last = [row for row in chosen if row.outage == longest]
        last.sort(key=lambda row: math.inf if row.position is None else row.position)
        limits = [_fill_limits(row.position_lower, row.position_upper) for row in last]
        for place, row in enumerate(last, start=1):
            lower, upper = limits[place - 1]
            ties = [
                other.sensor
                for other, (low, high) in zip(last, limits, strict=True)
                if other is not row and low <= upper and lower <= high
            ]
            yield place, describe_row(row), ties


def describe_row(row: NavigationRow) -> NavigationLine:
    """Return a row of the table ``navigation`` with its texts on the page."""
    inside, error = row.nees_inside, row.nees_error
    return NavigationLine(
        row=row,
        outage=_format_outage(row),
        signals=_SIGNAL_TEXTS[row.signals],
        tuning=TUNINGS[row.tuning],
        position=_format_figure(row, "position"),
        ratio=_format_figure(row, "position_ratio"),
        velocity=_format_figure(row, "velocity"),
        heading=_format_figure(row, "heading", 180.0 / math.pi),
        inside=""
        if inside is None or error is None
        else f"{number_text(100.0 * inside, 3)} ± {percent_text(error, 2)}",
        consistent=_CONSISTENT_TEXTS[row.consistent],
        outages=counted(row.outages, "outage") if row.outage and row.outages else "",
    )


def _format_outage(row: NavigationRow) -> str:
    return "none" if row.outage is None else f"{number_text(row.outage)} s"


def _format_figure(row: NavigationRow, name: str, factor: float = 1.0) -> str:
    sizes = [getattr(row, f"{name}{end}") for end in ("", "_lower", "_upper")]
    if sizes[0] is None:
        return "–"
    text, low, high = (number_text(None if one is None else factor * one, 3) for one in sizes)
    return text if low == high else f"{text} ({low} to {high})"
