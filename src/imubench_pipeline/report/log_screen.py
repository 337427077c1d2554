"""The screen of `imubench analyse`: state, noise of each axis, and the events that matter."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap

import pyarrow as pa
from rich.console import RenderableType
from rich.text import Text

from imubench_pipeline.model.estimates import AllanRow, ParameterRow
from imubench_pipeline.model.recordings import FindingRow, RecordingRow
from imubench_pipeline.report import run_summary
from imubench_pipeline.report.practical import System, choose_page_unit
from imubench_pipeline.report.terminal import (
    TITLES,
    describe_length,
    explain_no_estimates,
    select_of,
)
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.words.estimates import symbol_text
from imubench_pipeline.words.events import events_text, state_text
from imubench_pipeline.words.numbers import NO_VALUE, Unit, counted

SHOWN = ("N", "B_curve", "K", "sigma_min")
_MAX_EVENTS = 3
_MAX_EVENT_LINES = 4
_CHANNEL_WIDTH = 8
_CELL_WIDTH = 18
_SUDDEN = ("bias_step", "step")
_MAX_PAUSE = 30.0  # s, between findings of one disturbance


@dataclass(frozen=True)
class Event:
    """Findings of one recording with one cause."""

    findings: tuple[FindingRow, ...]

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels concerned."""
        return tuple(dict.fromkeys(row.channel for row in self.findings if row.channel))

    @property
    def affects(self) -> frozenset[str]:
        """The parameters with doubtful estimates."""
        return frozenset(name for row in self.findings for name in row.affects)

    def rank(self) -> tuple[bool, int, int]:
        """Return the place of the event: fatal ones first, then by affected figures."""
        fatal = any(row.severity == "fatal" for row in self.findings)
        return fatal, len(self.affects) * max(len(self.channels), 1), len(self.findings)


def group_events(findings: Iterable[FindingRow]) -> list[Event]:
    """Return the events of a recording, the most important first.

    Sudden findings of all channels are one disturbance if less than 30 s lie between them. Other
    findings are one event if they are of the same kind.
    """
    sudden: list[FindingRow] = []
    groups: dict[str, list[FindingRow]] = defaultdict(list)
    for row in findings:
        timed = row.finding in _SUDDEN and row.start is not None
        (sudden if timed else groups[row.finding]).append(row)
    disturbances: list[list[FindingRow]] = []
    end = -float("inf")
    for row in sorted(sudden, key=lambda row: row.start or 0.0):
        if (row.start or 0.0) > end + _MAX_PAUSE:
            disturbances.append([])
        disturbances[-1].append(row)
        end = max(end, row.end or row.start or 0.0)
    events = [Event(tuple(group)) for group in (*groups.values(), *disturbances)]
    return sorted(events, key=Event.rank, reverse=True)


def render_log_screen(
    tables: Mapping[str, pa.Table], system: System, width: int
) -> Iterator[RenderableType]:
    """Yield the screen of each of a few logs, at most 40 lines each for six axes."""
    every_finding = FindingRow.rows_of(tables["findings"])
    every_parameter = ParameterRow.rows_of(tables["parameters"])
    allan = AllanRow.rows_of(tables["allan"])
    for row in RecordingRow.rows_of(tables["recordings"]):
        findings = select_of(row, every_finding)
        parameters = [each for each in select_of(row, every_parameter) if each.recommended]
        length = describe_length(row, parameters, select_of(row, allan))
        yield Text(run_summary.fold_text(state_text(row, length)), style="bold")
        if row.status != "ok":
            yield Text()
            continue
        for quantity, title in TITLES.items():
            lines = [line for line in parameters if quantity_of(line.channel) == quantity]
            if lines:
                yield Text("\n".join(_tabulate(title, quantity, lines, system)) + "\n")
        if not parameters:
            yield explain_no_estimates(row)
        events = group_events(run_summary.select_warnings(findings))
        yield from _list_events(events, len(findings), width)


def _tabulate(
    title: str, quantity: str, rows: Sequence[ParameterRow], system: System
) -> Iterator[str]:
    """Yield the lines of a table: a value for each axis, its 95 % interval below."""
    units = {symbol: choose_page_unit(quantity, symbol, system) for symbol in SHOWN}
    yield f"{title}: 95 % intervals below; ?: doubtful; <: upper limit"
    yield _line("", (f"{symbol_text(symbol)}, {units[symbol].sign}" for symbol in SHOWN))
    by_channel: dict[str, dict[str, ParameterRow]] = defaultdict(dict)
    for row in rows:
        by_channel[row.channel].setdefault(row.parameter, row)
    for channel, own in by_channel.items():
        cells = [_cell(own.get(symbol), units[symbol]) for symbol in SHOWN]
        yield _line(channel, (value for value, _ in cells))
        yield _line("", (interval for _, interval in cells))


def _line(name: str, cells: Iterable[str]) -> str:
    return f"{name:<{_CHANNEL_WIDTH}}" + "".join(f"{cell:>{_CELL_WIDTH}}" for cell in cells)


def _cell(row: ParameterRow | None, unit: Unit) -> tuple[str, str]:
    """Return a value, or a bound, and the interval."""
    if row is None:
        return NO_VALUE, ""
    value, interval = unit.estimate_texts(row.value, row.lower, row.upper)
    if row.value is not None:
        mark = " ?" * (row.status != "ok")
        return value + mark, "" if interval == NO_VALUE else interval
    if row.upper is None:
        return NO_VALUE, ""
    return f"< {unit.text(row.upper, unit.digits(None, None, row.upper))}", ""


def _list_events(events: Sequence[Event], findings: int, width: int) -> Iterator[Text]:
    """Yield the most important events, and the number of the others."""
    for number, event in enumerate(events[:_MAX_EVENTS], start=1):
        text = run_summary.fold_text(events_text(event.findings), 400)
        lines = wrap(
            f"{number}. {text}",
            width,
            subsequent_indent="   ",
            max_lines=_MAX_EVENT_LINES,
            placeholder=" …",
        )
        yield Text("\n".join(lines))
    shown = sum(len(event.findings) for event in events[:_MAX_EVENTS])
    if findings > shown:
        yield Text(f"{counted(findings - shown, 'other finding')} and all parameters: --verbose")
    yield Text()
