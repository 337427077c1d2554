"""The screen of `imubench analyse`: state, noise of each axis, and the events that matter."""

import math
import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from textwrap import wrap

import pyarrow as pa
from rich.console import RenderableType
from rich.text import Text

from imubench_pipeline.model.estimates import AllanRow, ParameterRow
from imubench_pipeline.model.recordings import FindingRow, RecordingRow
from imubench_pipeline.recordings.quality.rest import find_still_spans, merge_spans
from imubench_pipeline.report import run_summary, terminal
from imubench_pipeline.report.practical import System, choose_page_unit
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.tables.findings import LEFT_OUT
from imubench_pipeline.words.estimates import symbol_text
from imubench_pipeline.words.events import (
    events_text,
    longer_log_text,
    motion_text,
    read_data,
    reason_text,
    state_text,
)
from imubench_pipeline.words.findings import FINDINGS
from imubench_pipeline.words.numbers import NO_VALUE, Unit, counted, join_names

SHOWN = ("N", "B_curve", "K", "sigma_min")
_MAX_EVENTS = 3
_MAX_EVENT_LINES = 4
_CHANNEL_WIDTH = 8
_CELL_WIDTH = 18
_MAX_WIDTH = 80
_SUDDEN = ("bias_step", "step")
_MAX_PAUSE = 30.0  # s, between findings of one disturbance
_REMOVED = ("bias_step", "warm_up_drift", "periodic_drift")
_NOTES = ("slow_sampling", "missing_samples", "lines", "filtered", "noise_grows")
"""Notes that are listed after all warnings, in this order."""

_MIN_LINE = 20.0  # ratio of the density of a listed spectral line to the noise floor
_MAX_WAIT = 30.0  # ratio of the longest length of a log that is advised to its present length
_SHARE_UNTIL_IDENTIFIED = 0.02
"""Length of a log that gives limits with a ratio of 4, divided by the length for ± 10 %."""

_MAX_EFFECT = 3.0  # natural logarithm of a factor


@dataclass(frozen=True)
class Event:
    """The findings in one recording that have the same cause."""

    findings: tuple[FindingRow, ...]

    @property
    def channels(self) -> tuple[str, ...]:
        """The channels that the findings name, each once."""
        return tuple(dict.fromkeys(row.channel for row in self.findings if row.channel))

    def factors(self) -> dict[str, float] | None:
        """Return the factor on each parameter if no signal is removed; None if not known."""
        largest: dict[str, float] = {}
        measured = False
        for row in self.findings:
            own = getattr(read_data(row), "factors", None)
            measured |= own is not None
            for name, factor in (own or {}).items():
                if _effect(factor) > _effect(largest.get(name, 1.0)):
                    largest[name] = factor
        return largest if measured else None

    def casts_doubt(self) -> bool:
        """Return whether the event makes the estimate of a parameter doubtful."""
        return any(row.severity != "note" and row.affects for row in self.findings)

    def score(self) -> float:
        """Return the importance: 100 or more if the log cannot be used, 0 for a note to ignore."""
        if any(row.severity == "fatal" for row in self.findings):
            return 1000.0
        if any(FINDINGS[row.finding].unfit for row in self.findings):
            return 100.0
        channels = max(len(self.channels), 1)
        if all(row.severity == "note" for row in self.findings):
            code = self.findings[0].finding
            strong = max(getattr(read_data(row), "ratio", _MIN_LINE) for row in self.findings)
            if code not in _NOTES or (code == "lines" and strong < _MIN_LINE):
                return 0.0
            return 1e-3 * (len(_NOTES) - _NOTES.index(code))
        factors = self.factors()
        if factors is None:
            affected = any(row.affects for row in self.findings)
            return channels if affected else 0.01 * channels
        return 0.1 + channels * max(map(_effect, factors.values()), default=0.0)


def _effect(factor: float) -> float:
    return min(abs(math.log(factor)), _MAX_EFFECT) if factor > 0.0 else _MAX_EFFECT


def group_events(findings: Iterable[FindingRow]) -> list[Event]:
    """Return the events of a recording with an importance above 0, the most important first."""
    return [one for one in list_events(findings) if one.score() > 0.0]


def list_events(findings: Iterable[FindingRow]) -> list[Event]:
    """Return the events of a recording, the most important first, notes last.

    Steps in all channels are one event if less than 30 s lie between them. Other findings are one
    event if they have the same kind and severity.
    """
    sudden: list[FindingRow] = []
    groups: dict[str, list[FindingRow]] = defaultdict(list)
    for row in findings:
        timed = row.finding in _SUDDEN and row.start is not None
        if timed and row.severity != "note":
            sudden.append(row)
        else:
            groups[f"{row.finding} {row.severity}"].append(row)
    disturbances: list[list[FindingRow]] = []
    end = -float("inf")
    for row in sorted(sudden, key=lambda row: row.start or 0.0):
        if (row.start or 0.0) > end + _MAX_PAUSE:
            disturbances.append([])
        disturbances[-1].append(row)
        end = max(end, row.end or row.start or 0.0)
    events = [Event(tuple(group)) for group in (*groups.values(), *disturbances)]
    return sorted(events, key=Event.score, reverse=True)


def render_log_screen(
    tables: Mapping[str, pa.Table], system: System, width: int
) -> Iterator[RenderableType]:
    """Yield the parts of the screen of a few logs, for each at most 40 lines for six axes."""
    width = min(width, _MAX_WIDTH)
    every_finding = FindingRow.rows_of(tables["findings"])
    every_parameter = ParameterRow.rows_of(tables["parameters"])
    allan = AllanRow.rows_of(tables["allan"])
    for row in RecordingRow.rows_of(tables["recordings"]):
        findings = terminal.select_of(row, every_finding)
        parameters = [each for each in terminal.select_of(row, every_parameter) if each.recommended]
        length = terminal.describe_length(row, parameters, terminal.select_of(row, allan))
        others = [each for each in findings if each.finding not in (*LEFT_OUT, "motion")]
        motion = [each for each in findings if each.finding == "motion"]
        events = [] if motion else group_events(others)[:_MAX_EVENTS]
        doubting = [n for n, event in enumerate(events, start=1) if event.casts_doubt()]
        moved = any(each.finding in ("motion", "turning") for each in findings)
        yield Text(_fold(state_text(row, length, doubting, moved), width, 6), style="bold")
        if row.status != "ok":
            yield Text()
            continue
        if motion:
            spans = merge_spans((each.start or 0.0, each.end or 0.0) for each in motion)
            rest = find_still_spans(spans, 0.0, row.duration or 0.0)
            channels = [each.channel for each in motion if each.channel]
            yield Text(_fold(motion_text(channels, spans, rest), width, 6))
        elif reason := reason_text(row):
            yield Text(_fold(reason, width, 2))
        if not parameters:
            yield terminal.explain_no_estimates(row)
        elif not motion:
            yield Text("95 % intervals are below the values; ?: doubtful; <: upper limit")
            doubted = {
                (row.channel, name)
                for row in others
                if row.channel and row.severity != "note" and row.finding not in _REMOVED
                for name in row.affects
            }
            for quantity, title in terminal.TITLES.items():
                lines = [line for line in parameters if quantity_of(line.channel) == quantity]
                if lines:
                    table = _tabulate(title, quantity, lines, system, row.duration or 0.0, doubted)
                    yield Text("\n".join(table))
        yield from _list_events(events, others, system, width)


def _fold(text: str, width: int, lines: int, indent: str = "") -> str:
    text = run_summary.fold_text(text, 1000)
    return "\n".join(wrap(text, width, subsequent_indent=indent, max_lines=lines, placeholder=" …"))


def _tabulate(
    title: str,
    quantity: str,
    rows: Sequence[ParameterRow],
    system: System,
    duration: float,
    doubted: Collection[tuple[str, str]],
) -> Iterator[str]:
    """Yield the lines of a table: a value for each axis, its 95 % interval below."""
    units = {symbol: choose_page_unit(quantity, symbol, system) for symbol in SHOWN}
    yield _line(title, (f"{symbol_text(symbol)}, {units[symbol].sign}" for symbol in SHOWN))
    by_channel: dict[str, dict[str, ParameterRow]] = defaultdict(dict)
    needed: dict[str, list[float]] = defaultdict(list)
    for row in rows:
        by_channel[row.channel].setdefault(row.parameter, row)
        time = _SHARE_UNTIL_IDENTIFIED * (row.duration_needed or 0.0)
        if row.parameter in SHOWN and row.value is None and 1.0 < time / duration < _MAX_WAIT:
            needed[symbol_text(row.parameter)].append(time)
    for channel, own in by_channel.items():
        cells = [
            _cell(own.get(symbol), units[symbol], doubted=(channel, symbol) in doubted)
            for symbol in SHOWN
        ]
        yield _line(channel, (value for value, _ in cells))
        if any(interval for _, interval in cells):
            yield _line("", (interval for _, interval in cells))
    if needed:
        times = {symbol: (min(own), max(own)) for symbol, own in needed.items()}
        yield _fold(longer_log_text(times), _MAX_WIDTH, 2)


def _line(name: str, cells: Iterable[str]) -> str:
    """Return a line; a long name takes the space of the first cell."""
    text = f"{name:<{_CHANNEL_WIDTH}}"
    for number, cell in enumerate(cells, start=1):
        text += f"{cell:>{_CHANNEL_WIDTH + number * _CELL_WIDTH - len(text)}}"
    return text


def _cell(row: ParameterRow | None, unit: Unit, *, doubted: bool) -> tuple[str, str]:
    if row is None:
        return NO_VALUE, ""
    value, interval = unit.estimate_texts(row.value, row.lower, row.upper)
    if row.value is not None:
        mark = " ?" * (doubted or row.status != "ok")
        if len(interval) >= _CELL_WIDTH:
            interval = interval.replace(" to ", "–")
        return value + mark, "" if interval == NO_VALUE else interval
    if row.upper is None:
        return NO_VALUE, ""
    return f"< {unit.text(row.upper, unit.digits(None, None, row.upper))}", ""


def _list_events(
    events: Sequence[Event], findings: Sequence[FindingRow], system: System, width: int
) -> Iterator[Text]:
    """Yield the most important events, and the number of the other findings."""
    for number, event in enumerate(events, start=1):
        text = f"{number}. {events_text(event.findings, system, event.factors())}"
        # Sentences before the last one, which gives the advice, are left out until it fits.
        sentences = re.split(r"(?<=\D\.) (?=[A-Z])", text)
        while len(sentences) > 2 and len(wrap(" ".join(sentences), width - 3)) > _MAX_EVENT_LINES:
            del sentences[-2]
        yield Text(_fold(" ".join(sentences), width, _MAX_EVENT_LINES, "   "))
    shown = sum(len(event.findings) for event in events)
    removed = sum(row.severity == "note" and row.finding in _REMOVED for row in findings)
    counts = [f"{counted(removed, 'signal')} removed without effect on a parameter"] * (removed > 0)
    if others := len(findings) - shown - removed:
        counts.append(counted(others, "other finding"))
    rest = f"{join_names(counts)}; all" if counts else "All"
    yield Text(_fold(f"{rest} findings and parameters: --verbose", width, 2) + "\n")
