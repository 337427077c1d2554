"""The page that says how sensors navigate, and whether it matters how a filter is tuned."""

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
    "curve": "curve",
    "paper": "weights of the paper",
    "weighted": "weighted",
    "likelihood": "likelihood",
    "likelihood_gm": "likelihood of the papers’ model",
    "compensated": "temperature taken out",
}
"""What the page calls each tuning."""

_SIGNALS: Mapping[str | None, str] = {
    None: NO_VALUE,
    "truth": "simulated from the truth",
    "estimate": "simulated from the estimate",
    "log": "pieces of the log",
}

_AS_SURE = {True: "yes", False: "no: it goes astray from what it expects", None: "not told"}

_MATTERS = 1.1
"""Times the error of the true model from which a tuning matters, surely so."""


def _context(site: Site) -> dict[str, Any]:
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
            "outage": list(dict.fromkeys(_outage(row) for row in shown)),
            "tuning": list(dict.fromkeys(TUNINGS[row.tuning] for row in shown)),
            "sensor": list(dict.fromkeys(site.names[row.sensor] for row in shown)),
        },
    }


NAVIGATION = Entry(
    file="navigation.html",
    title="Navigation",
    context=_context,
    tables=("navigation",),
    exists=lambda site: bool(site.rows(NavigationRow)),
    place=1,
)
"""The page of filters that were tuned by what is known of the sensors."""


def answers(rows: Sequence[NavigationRow]) -> Iterator[dict[str, Any]]:
    """Yield, for each sensor, trajectory and kind of signals, whether the tuning matters.

    By the position after the longest outage, over that of the true model on the same signals.
    """
    for (sensor, trajectory, signals), own in _grouped(
        rows, lambda row: (row.sensor, row.trajectory, row.signals)
    ):
        longest = max(row.outage or 0.0 for row in own)
        last = [row for row in own if row.outage == longest and row.tuning != "true"]
        told = [row for row in last if row.position_ratio is not None]
        if not told:
            continue
        worse = [row for row in told if _limits(row)[0] > _MATTERS]
        no_worse = [row for row in told if _limits(row)[1] < _MATTERS]
        sure = [row for row in no_worse if _limits(row)[0] > 1.0 / _MATTERS]
        no_worse = [row for row in no_worse if row not in sure]
        open_ones = [row for row in told if row not in worse + sure + no_worse]
        smallest = next((row for row in own if row.smallest), None)
        yield {
            "sensor": sensor,
            "trajectory": trajectory,
            "signals": signals,
            "recording": own[0].recording,
            "runs": own[0].runs,
            "words": _SIGNALS[signals],
            "outage": f"{number_text(longest)} s",
            "matters": _matters(worse, sure, no_worse, open_ones),
            "smallest": None
            if smallest is None
            else f"{TUNINGS[smallest.tuning]}, {smallest.states} states",
            "dishonest": _dishonest(own),
        }


def _limits(row: NavigationRow) -> tuple[float, float]:
    """Return the limits of the ratio of positions; of one that is not known, the widest."""
    return _known_or_widest(row.position_ratio_lower, row.position_ratio_upper)


def _known_or_widest(lower: float | None, upper: float | None) -> tuple[float, float]:
    return 0.0 if lower is None else lower, math.inf if upper is None else upper


def _matters(
    worse: Sequence[NavigationRow],
    sure: Sequence[NavigationRow],
    no_worse: Sequence[NavigationRow],
    open_ones: Sequence[NavigationRow],
) -> str:
    parts = []
    if worse:
        by = ", ".join(
            f"{TUNINGS[row.tuning]} {number_text(row.position_ratio, 3)} times" for row in worse
        )
        parts.append(f"It matters: {by} the error of the true model")
    if sure:
        names = ", ".join(TUNINGS[row.tuning] for row in sure)
        parts.append(f"no difference of a tenth: {names}")
    if no_worse:
        names = ", ".join(TUNINGS[row.tuning] for row in no_worse)
        parts.append(f"no worse by a tenth: {names}")
    if open_ones:
        names = ", ".join(TUNINGS[row.tuning] for row in open_ones)
        parts.append(f"these runs do not tell of {names}")
    text = "; ".join(parts)
    return f"{text[0].upper()}{text[1:]}."


def _dishonest(rows: Sequence[NavigationRow]) -> str | None:
    """Return which tunings are surely not as sure as they claim."""
    names = dict.fromkeys(TUNINGS[row.tuning] for row in rows if row.consistent is False)
    return ", ".join(names) or None


def ranking(rows: Sequence[NavigationRow]) -> Iterator[dict[str, Any]]:
    """Yield the sensors by the position after the longest outage, tuned as is recommended."""
    for trajectory, own in _grouped(rows, lambda row: row.trajectory):
        chosen = [row for row in own if row.recommended and row.signals != "log"]
        longest = max((row.outage or 0.0 for row in chosen), default=0.0)
        last = sorted((row for row in chosen if row.outage == longest), key=_position)
        for place, row in enumerate(last, start=1):
            ties = [other.sensor for other in last if other is not row and _overlap(row, other)]
            yield line_of(row) | {"place": place, "ties": ties, "trajectory": trajectory}


def _position(row: NavigationRow) -> float:
    """Return the error of the position; of one that is not known, the largest."""
    return math.inf if row.position is None else row.position


def _overlap(one: NavigationRow, other: NavigationRow) -> bool:
    """Tell whether the limits of two positions overlap."""
    lower, upper = _known_or_widest(one.position_lower, one.position_upper)
    other_lower, other_upper = _known_or_widest(other.position_lower, other.position_upper)
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
        "outage": _outage(row),
        "seconds": row.outage or 0.0,
        "signals": _SIGNALS[row.signals],
        "tuning": TUNINGS[row.tuning],
        "recommended": row.recommended,
        "position": row.position,
        "position_text": _figure(row.position, row.position_lower, row.position_upper),
        "ratio": row.position_ratio,
        "ratio_text": _figure(
            row.position_ratio, row.position_ratio_lower, row.position_ratio_upper
        ),
        "velocity_text": _figure(row.velocity, row.velocity_lower, row.velocity_upper),
        "heading_text": _figure(row.heading, row.heading_lower, row.heading_upper, 180.0 / math.pi),
        "expected": number_text(row.position_predicted, 3),
        "inside": None if inside is None else 100.0 * inside,
        "inside_text": ""
        if inside is None or error is None
        else f"{number_text(100.0 * inside, 3)} ± {percent_text(error, 2)}",
        "consistent": row.consistent,
        "as_sure": _AS_SURE[row.consistent],
        "of": counted(row.outages, "outage") if row.outage and row.outages else "",
    }


def _outage(row: NavigationRow) -> str:
    return "none" if row.outage is None else f"{number_text(row.outage)} s"


def _figure(
    value: float | None, lower: float | None, upper: float | None, factor: float = 1.0
) -> str:
    if value is None:
        return "–"
    text, low, high = (
        number_text(None if size is None else factor * size, 3) for size in (value, lower, upper)
    )
    return text if low == high else f"{text} ({low} to {high})"


_Key = TypeVar("_Key")


def _grouped(
    rows: Sequence[NavigationRow], key: Callable[[NavigationRow], _Key]
) -> Iterator[tuple[_Key, list[NavigationRow]]]:
    groups: dict[_Key, list[NavigationRow]] = {}
    for row in rows:
        groups.setdefault(key(row), []).append(row)
    yield from groups.items()
