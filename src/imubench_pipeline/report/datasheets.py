"""Datasheets on the pages: measured against printed figures."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
from statistics import median

from imubench_pipeline.model.comparisons import DatasheetRow, RepeatabilityRow
from imubench_pipeline.report.payload import Json
from imubench_pipeline.report.practical import System, choose_page_unit, format_printed
from imubench_pipeline.report.view import ChannelView, RecordingView
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.tables.keys import group_rows
from imubench_pipeline.words.numbers import NO_VALUE, Unit

_STATISTIC_NAMES = dict.fromkeys(("adev_minimum", "plateau"), "bias instability")
_STATISTIC_NAMES |= {"N": "N", "K": "K", "T_B": "T_B"}
_STATISTIC_TEXTS = {"adev_minimum": "by σ_min", "plateau": "by 0.664 B"}
UNIT_SYMBOLS = {
    "N": "N",
    "K": "K",
    "T_B": "T_B",
    "offset": "signal",
    "temperature_coefficient": "sensitivity",
}
"""Symbols of the figures whose unit the reader can switch; other figures take the unit of B."""

_WITHOUT_METHOD = ("mean", "temperature")
"""Entries of the column ``method`` for figures that no estimation method gives."""


def compare_with_datasheet(
    view: ChannelView, coverage: Mapping[tuple[str, str, str], str], system: System
) -> Iterator[Json]:
    """Yield a line per figure of a datasheet: the printed and measured values, and the verdict.

    ``coverage`` states whether a figure is published, by sensor, quantity and figure.
    """
    own = [row for row in view.datasheet if row.method in (view.recommended, *_WITHOUT_METHOD)]
    for rows in _group_by_figure(own).values():
        first = rows[0]
        published = first.printed is not None
        figure = "B" if first.quantity == "bias_instability" else first.quantity
        verdict, why = merge_verdicts(rows)
        unit = choose_page_unit(view.quantity, UNIT_SYMBOLS.get(first.quantity, "B"), system)
        yield {
            "quantity": _name_figure(first),
            "published": published,
            "coverage": coverage.get((view.sensor, view.quantity, figure), "not looked up"),
            "printed": format_printed(first),
            "about": ", ".join(filter(None, (first.kind, first.condition))),
            "readings": [
                {
                    "as": _name_reading(row),
                    "comparable": unit.text(row.comparable),
                    "measured": _format_measured(row, unit),
                    "unit": "" if row.comparable is None and row.measured is None else unit.sign,
                    "delta": _format_difference(row),
                    "value": row.delta,
                }
                for row in rows
            ],
            "verdict": verdict,
            "reason": why if published else "",
        }


_Figure = tuple[str, str, float | None, str | None, str | None, str | None]
"""Identity of a printed figure of a channel: channel, quantity, number, unit, kind, condition."""


def _group_by_figure(rows: Iterable[DatasheetRow]) -> dict[_Figure, list[DatasheetRow]]:
    return group_rows(
        rows, lambda r: (r.channel, r.quantity, r.printed, r.unit, r.kind, r.condition)
    )


def merge_verdicts(readings: Sequence[DatasheetRow]) -> tuple[str, str]:
    """Return the verdict on a printed figure, and the reason, from a row per interpretation.

    A bias instability is judged by the minimum of the curve, as vendors print it. If a density may
    be one-sided or two-sided and the two verdicts differ, the verdict is `DEPENDS`.
    """
    judged = [row for row in readings if row.statistic == "adev_minimum"] or list(readings)
    verdicts = list(dict.fromkeys(row.verdict for row in judged))
    if len(verdicts) == 1:
        return verdicts[0], "; ".join(judged[0].reasons)
    return DEPENDS, "; ".join(f"as {row.sidedness}: {row.verdict}" for row in judged)


DEPENDS = "depends on whether the density is one-sided"


def compare_sensors_with_datasheets(
    views: Sequence[RecordingView], system: System
) -> Iterator[Json]:
    """Yield a line per printed figure and channel: the range measured in the recordings."""
    groups: dict[tuple[str, bool, _Figure], list[list[DatasheetRow]]] = {}
    for view in views:
        recommended = view.recommended()
        own = [
            row
            for row in view.rows(DatasheetRow)
            if row.method in (recommended[row.channel], *_WITHOUT_METHOD) and row.delta is not None
        ]
        for figure, rows in _group_by_figure(own).items():
            groups.setdefault((view.sensor, view.simulated, figure), []).append(rows)
    for (sensor, simulated, (channel, *_)), group in groups.items():
        first = group[0][0]
        unit = choose_page_unit(quantity_of(channel), UNIT_SYMBOLS.get(first.quantity, "B"), system)
        verdicts = Counter(merge_verdicts(rows)[0] for rows in group)
        if first.kind in ("max", "range") and "as printed" in verdicts:
            verdicts["within it"] = verdicts.pop("as printed")
        by_reading = group_rows(chain(*group), _name_reading)
        readings: list[dict[str, str]] = []
        for name, rows in by_reading.items():
            measured = sorted(row.measured for row in rows if row.measured is not None)
            ends = (measured[0], measured[-1]) if measured else (None, None)
            # A figure is not expected to be at the end of a range.
            deltas = [None] if first.kind == "range" else _list_deltas(rows)
            readings.append(
                {
                    "as": name,
                    "comparable": unit.text(rows[0].comparable),
                    "measured": _format_range([unit.text(value) for value in ends]),
                    "difference": _format_range([*map(_format_percent, (deltas[0], deltas[-1]))]),
                }
            )
        time = first.condition if first.statistic == "adev" else None
        yield {
            "sensor": sensor,
            "simulated": simulated,
            "comparable": _name_different(readings, "comparable"),
            "measured": _name_different(readings, "measured"),
            "channel": channel,
            "quantity": _name_figure(first),
            "printed": format_printed(first),
            "about": ", ".join(filter(None, (first.kind, time))),
            "unit": unit.sign,
            "readings": readings,
            "delta": median(_list_deltas(next(iter(by_reading.values())))),
            "recordings": len(group),
            "verdicts": ", ".join(
                verdict if len(group) == 1 else f"{verdict} ({count})"
                for verdict, count in verdicts.items()
            ),
        }


def _name_different(readings: Sequence[Mapping[str, str]], of: str) -> list[tuple[str, str]]:
    """Return a number of all interpretations, each with its name; once if they are equal."""
    if len({one[of] for one in readings}) == 1:
        return [(readings[0][of], "")]
    return [(one[of], one["as"]) for one in readings]


def _list_deltas(rows: Iterable[DatasheetRow]) -> list[float]:
    return sorted(row.delta for row in rows if row.delta is not None)


def format_repeatability(
    rows: Sequence[RepeatabilityRow], sensor: str, system: System
) -> Iterator[Json]:
    """Yield, per device and channel, the scatter of biases between logs, measured and printed."""
    for row in rows:
        if row.sensor != sensor:
            continue
        unit = choose_page_unit(quantity_of(row.channel), "adev", system)
        yield {
            "device": row.device,
            "channel": row.channel.replace("_", " "),
            "recordings": row.recordings,
            "printed": format_printed(row),
            "about": ", ".join(filter(None, (row.kind, row.condition))),
            "comparable": unit.text(row.comparable),
            "measured": _format_measured(row, unit),
            "unit": unit.sign,
            "delta": _format_percent(row.delta),
            "verdict": row.verdict,
            "reasons": row.reasons,
        }


def _name_figure(row: DatasheetRow) -> str:
    return _STATISTIC_NAMES.get(row.statistic, row.quantity.replace("_", " ")).replace(
        "allan", "Allan"
    )


def _name_reading(row: DatasheetRow) -> str:
    """Return the name of an interpretation of a printed figure, if there are several."""
    if row.sidedness:
        return f"if {row.sidedness}"
    return _STATISTIC_TEXTS.get(row.statistic, "")


def _format_range(ends: Sequence[str]) -> str:
    return ends[0] if ends[0] == ends[1] else f"{ends[0]} to {ends[1]}"


def _format_percent(share: float | None) -> str:
    return "–" if share is None else f"{round(100 * share):+d} %".replace("-", "−")


def _format_measured(row: DatasheetRow | RepeatabilityRow, unit: Unit) -> list[str]:
    value, interval = unit.estimate_texts(row.measured, row.lower, row.upper)
    return [value] if row.measured is None or interval == NO_VALUE else [value, interval]


def _format_difference(row: DatasheetRow) -> list[str]:
    lower, upper = row.delta_lower, row.delta_upper
    if lower is None or upper is None:
        return [_format_percent(row.delta)]
    return [_format_percent(row.delta), f"{_format_percent(lower)} to {_format_percent(upper)}"]
