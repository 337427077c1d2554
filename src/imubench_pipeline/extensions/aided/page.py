"""The page of navigation during outages of GNSS, with filters of different tunings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, TypeVar

from imubench_pipeline.extensions.aided.tables import NavigationRow
from imubench_pipeline.recordings.fitness import left_out
from imubench_pipeline.report.site import Entry, Site
from imubench_pipeline.words.numbers import NO_VALUE, counted, number_text, percent_text
from imubench_pipeline.words.verdicts import doubts_text

TUNINGS = {
    "true": "true model",
    "datasheet": "datasheet",
    "datasheet_misread": "datasheet misread",
    "times_ten": "ten times the estimate",
    "table_1": "read by the authors",
    "overbound": "overbound",
    "curve": "read from the curve",
    "paper": "printed weights",
    "weighted": "correct weights",
    "likelihood": "likelihood",
    "likelihood_gm": "likelihood of the papers’ model",
    "compensated": "temperature compensated",
}
"""Name of each tuning on the page."""

_SIGNAL_TEXTS: Mapping[str | None, str] = {
    None: NO_VALUE,
    "truth": "simulated from the truth",
    "estimate": "simulated from the estimate",
    "log": "pieces of the log",
}

_CONSISTENT_TEXTS = {True: "yes", False: "no", None: "not determined"}

_MIN_RELEVANT_RATIO = 1.1
"""Ratio of the error to that of the true model from which a tuning matters."""


def _make_context(site: Site) -> dict[str, Any]:
    rows = site.rows(NavigationRow)
    shown = [row for row in rows if row.position is not None]
    recordings = [view.row for view in site.views]
    apart = left_out(recordings)
    doubts = {(row.sensor, row.recording): doubts_text(row.doubts) for row in recordings}
    deciding = [row for row in shown if (row.sensor, row.recording) not in apart]
    return {
        "answers": [
            answer | {"doubts": doubts.get((answer["sensor"], answer["recording"]))}
            for answer in answers(shown)
        ],
        "ranking": list(ranking(deciding)),
        "apart": {
            row.sensor: f"{row.recording} is not used: {doubts_text(apart[key])}"
            for row in shown
            if (key := (row.sensor, row.recording)) in apart
        },
        "lines": [line_of(row) for row in shown],
        "lacking": [row.columns() | {"tuning": TUNINGS[row.tuning]} for row in rows if row.reason],
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
    context=_make_context,
    tables=("navigation",),
    exists=lambda site: bool(site.rows(NavigationRow)),
    place=1,
)
"""The page of navigation filters with different tunings."""


def answers(rows: Sequence[NavigationRow]) -> Iterator[dict[str, Any]]:
    """Yield, for each sensor, trajectory and kind of signals, whether the tuning matters.

    The criterion is the position error after the longest outage, relative to the true model on the
    same signals.
    """
    for (sensor, trajectory, signals), own in _group_rows(
        rows, lambda row: (row.sensor, row.trajectory, row.signals)
    ):
        longest = max(row.outage or 0.0 for row in own)
        last = [row for row in own if row.outage == longest and row.tuning != "true"]
        known = [row for row in last if row.position_ratio is not None]
        if not known:
            continue
        worse = [row for row in known if _find_ratio_limits(row)[0] > _MIN_RELEVANT_RATIO]
        no_worse = [row for row in known if _find_ratio_limits(row)[1] < _MIN_RELEVANT_RATIO]
        equal = [row for row in no_worse if _find_ratio_limits(row)[0] > 1.0 / _MIN_RELEVANT_RATIO]
        no_worse = [row for row in no_worse if row not in equal]
        inconclusive = [row for row in known if row not in worse + equal + no_worse]
        smallest = next((row for row in own if row.smallest), None)
        yield {
            "sensor": sensor,
            "trajectory": trajectory,
            "signals": signals,
            "recording": own[0].recording,
            "runs": own[0].runs,
            "words": _SIGNAL_TEXTS[signals],
            "outage": f"{number_text(longest)} s",
            "matters": _describe_effect(worse, equal, no_worse, inconclusive),
            "smallest": None
            if smallest is None
            else f"{TUNINGS[smallest.tuning]}, {smallest.states} states",
            "dishonest": ", ".join(
                dict.fromkeys(TUNINGS[row.tuning] for row in own if row.consistent is False)
            )
            or None,
        }


def _find_ratio_limits(row: NavigationRow) -> tuple[float, float]:
    """Return the limits of the ratio of positions; unknown limits are the widest possible."""
    return _fill_limits(row.position_ratio_lower, row.position_ratio_upper)


def _fill_limits(lower: float | None, upper: float | None) -> tuple[float, float]:
    return 0.0 if lower is None else lower, math.inf if upper is None else upper


def _describe_effect(
    worse: Sequence[NavigationRow],
    equal: Sequence[NavigationRow],
    no_worse: Sequence[NavigationRow],
    inconclusive: Sequence[NavigationRow],
) -> str:
    """Return which tunings are worse than the true model, equal to it, or undecided."""
    parts = []
    if worse:
        by = ", ".join(
            f"{TUNINGS[row.tuning]} {number_text(row.position_ratio, 3)} times" for row in worse
        )
        parts.append(f"The tuning matters: {by} the error of the true model")
    for text, rows in (
        ("within 10 %", equal),
        ("at most 10 % worse", no_worse),
        ("inconclusive", inconclusive),
    ):
        if rows:
            parts.append(f"{text}: {', '.join(TUNINGS[row.tuning] for row in rows)}")
    text = "; ".join(parts)
    return f"{text[0].upper()}{text[1:]}."


def ranking(rows: Sequence[NavigationRow]) -> Iterator[dict[str, Any]]:
    """Yield the sensors by the position error after the longest outage, recommended tuning."""
    for trajectory, own in _group_rows(rows, lambda row: row.trajectory):
        chosen = [row for row in own if row.recommended and row.signals != "log"]
        longest = max((row.outage or 0.0 for row in chosen), default=0.0)
        last = sorted((row for row in chosen if row.outage == longest), key=_get_position)
        for place, row in enumerate(last, start=1):
            ties = [
                other.sensor for other in last if other is not row and _is_overlapping(row, other)
            ]
            yield line_of(row) | {"place": place, "ties": ties, "trajectory": trajectory}


def _get_position(row: NavigationRow) -> float:
    """Return the error of the position; infinity if unknown."""
    return math.inf if row.position is None else row.position


def _is_overlapping(one: NavigationRow, other: NavigationRow) -> bool:
    """Tell whether the limits of two positions overlap."""
    lower, upper = _fill_limits(one.position_lower, one.position_upper)
    other_lower, other_upper = _fill_limits(other.position_lower, other.position_upper)
    return other_lower <= upper and lower <= other_upper


def line_of(row: NavigationRow) -> dict[str, Any]:
    """Return a row as the page shows it."""
    inside, error = row.nees_inside, row.nees_error
    return {
        "sensor": row.sensor,
        "trajectory": row.trajectory,
        "states": row.states,
        "model": row.model,
        "assumed": row.assumed,
        "outage": _format_outage(row),
        "seconds": row.outage or 0.0,
        "signals": _SIGNAL_TEXTS[row.signals],
        "tuning": TUNINGS[row.tuning],
        "recommended": row.recommended,
        "position": row.position,
        "position_text": _format_figure(row.position, row.position_lower, row.position_upper),
        "ratio": row.position_ratio,
        "ratio_text": _format_figure(
            row.position_ratio, row.position_ratio_lower, row.position_ratio_upper
        ),
        "velocity_text": _format_figure(row.velocity, row.velocity_lower, row.velocity_upper),
        "heading_text": _format_figure(
            row.heading, row.heading_lower, row.heading_upper, 180.0 / math.pi
        ),
        "expected": number_text(row.position_predicted, 3),
        "inside": None if inside is None else 100.0 * inside,
        "inside_text": ""
        if inside is None or error is None
        else f"{number_text(100.0 * inside, 3)} ± {percent_text(error, 2)}",
        "consistent": row.consistent,
        "as_sure": _CONSISTENT_TEXTS[row.consistent],
        "of": counted(row.outages, "outage") if row.outage and row.outages else "",
    }


def _format_outage(row: NavigationRow) -> str:
    return "none" if row.outage is None else f"{number_text(row.outage)} s"


def _format_figure(
    value: float | None, lower: float | None, upper: float | None, factor: float = 1.0
) -> str:
    if value is None:
        return "–"
    text, low, high = (
        number_text(None if size is None else factor * size, 3) for size in (value, lower, upper)
    )
    return text if low == high else f"{text} ({low} to {high})"


_Key = TypeVar("_Key")


def _group_rows(
    rows: Sequence[NavigationRow], key: Callable[[NavigationRow], _Key]
) -> Iterator[tuple[_Key, list[NavigationRow]]]:
    groups: dict[_Key, list[NavigationRow]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    yield from groups.items()
