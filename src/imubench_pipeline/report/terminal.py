"""The comparison of the sensors in the terminal."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from textwrap import wrap
from typing import Any, TypeVar

import pyarrow as pa
from rich import box
from rich.cells import cell_len
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from imubench_pipeline.model.comparisons import NextStepRow, RankingRow
from imubench_pipeline.model.estimates import AllanRow, ParameterRow
from imubench_pipeline.model.recordings import DoubtRow, FailureRow, FindingRow, RecordingRow
from imubench_pipeline.model.states import Verdict
from imubench_pipeline.model.table import OfRecordingRow
from imubench_pipeline.report import run_summary
from imubench_pipeline.report.comparison import select_symbols
from imubench_pipeline.report.meaning import Group, format_rankings
from imubench_pipeline.report.practical import System, choose_page_unit, format_temperature
from imubench_pipeline.settings.experiments import AT_REST
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.tables.keys import group_rows
from imubench_pipeline.words import numbers
from imubench_pipeline.words.estimates import STATUS_WORDS, symbol_text
from imubench_pipeline.words.events import finding_text
from imubench_pipeline.words.findings.base import WHITE
from imubench_pipeline.words.verdicts import used_doubts_text

R = TypeVar("R", bound=OfRecordingRow)

About = Mapping[tuple[str, str], RecordingRow]  # by sensor and recording

_NAME_FOLDS_AT, _GAP = 16, 2  # of tables, columns of the terminal
TITLES = {"gyro": "Gyroscopes", "accel": "Accelerometers"}
_STYLES: Mapping[Verdict, str] = {
    "meets": "green",
    "likely_meets": "green",
    "not_enough_data": "dim",
    "likely_fails": "yellow",
    "fails": "red",
    "excluded": "dim",
}
_MAX_AFFECTED = 3  # parameters that are named in a warning
_LONGEST_FINDING, _LONGEST_VERDICT = 400, 2000
_STEPS, _MAX_ANSWERS = 3, 4
_BESIDE = 34  # columns of the remarks below a verdict


def render_comparison(
    tables: Mapping[str, pa.Table],
    *,
    requirement: str | None,
    channel: str | None,
    method: str | None,
    system: System,
    width: int,
) -> Iterator[RenderableType]:
    """Yield the parts of the comparison, from top to bottom.

    The ranking has all limits of a requirement; if it is None, the deciding limit of all
    requirements. Without ``channel``, parameters are of all channels; without ``method``, they are
    by the recommended method of each channel. The width is in columns of the terminal.
    """
    recordings = RecordingRow.rows_of(tables["recordings"])
    about = {(row.sensor, row.recording): row for row in recordings}
    yield Text(f"{_count_recordings(recordings)}\n")
    yield from _listed("Failed", run_summary.list_failures(FailureRow.rows_of(tables["failures"])))
    yield from _listed("Rejected", run_summary.list_rejections(recordings))
    findings = FindingRow.rows_of(tables["findings"])
    warnings = []
    for row in run_summary.select_warnings(findings):
        place = " ".join(filter(None, (f"{row.sensor}/{row.recording}", row.channel)))
        warnings.append(f"{place} ({row.finding.replace('_', ' ')}): {finding_text(row, system)}")
    yield from _listed("Warnings", warnings)
    yield from _listed("What to do next", _list_next_steps(tables["next_steps"]))
    ranking = RankingRow.rows_of(tables["ranking"])
    yield from _ranking_tables(ranking, requirement, about, system, width)
    chosen = [
        each
        for each in ParameterRow.rows_of(tables["parameters"])
        if (each.recommended if method is None else each.method == method)
        and channel in (None, each.channel)
    ]
    which = f"method {method}" if method else "the recommended method"
    yield from _parameter_tables(chosen, f"{which}, with 95 % intervals", about, system, width)


def render_overview(tables: Mapping[str, pa.Table]) -> Iterator[RenderableType]:
    """Yield what was compared, the best sensor for each requirement, and what to do next."""
    recordings = RecordingRow.rows_of(tables["recordings"])
    warnings = list(run_summary.select_warnings(FindingRow.rows_of(tables["findings"])))
    warned = len({(row.sensor, row.recording) for row in warnings})
    text = _count_recordings(recordings)
    if warnings:
        text += f"; {numbers.counted(len(warnings), 'warning')} in {warned} of them"
    yield Text(text)
    best = list(run_summary.list_best_sensors(RankingRow.rows_of(tables["ranking"]), recordings))
    yield from map(Text, best[:_MAX_ANSWERS])
    if len(best) > _MAX_ANSWERS:
        yield Text(f"and {numbers.counted(len(best) - _MAX_ANSWERS, 'more requirement')}")
    for line in _list_next_steps(tables["next_steps"]):
        yield Text(f"Next: {run_summary.fold_text(line)}")


def _count_recordings(recordings: Sequence[RecordingRow]) -> str:
    rejected, failed = (
        sum(row.status == status for row in recordings) for status in ("rejected", "failed")
    )
    simulated = sum(row.simulated for row in recordings)
    return (
        f"Recordings: {len(recordings)} of {len({row.sensor for row in recordings})} sensors; "
        f"{len(recordings) - rejected - failed} analysed, {rejected} rejected"
        + f", {failed} failed" * bool(failed)
        + f"; {simulated} simulated, not measured"
    )


def _list_next_steps(table: pa.Table) -> Iterator[str]:
    for row in NextStepRow.rows_of(table.slice(0, _STEPS)):
        yield f"{row.sensor}: {row.text} ({', '.join(row.requirements)})"


def render_logs(
    tables: Mapping[str, pa.Table], system: System, width: int
) -> Iterator[RenderableType]:
    """Yield properties, findings and parameters of each of a few logs; the width is in columns."""
    every_finding = FindingRow.rows_of(tables["findings"])
    every_doubt = DoubtRow.rows_of(tables["doubts"])
    every_parameter = ParameterRow.rows_of(tables["parameters"])
    allan = AllanRow.rows_of(tables["allan"])
    for row in RecordingRow.rows_of(tables["recordings"]):
        findings, parameters = select_of(row, every_finding), select_of(row, every_parameter)
        length = describe_length(row, parameters, select_of(row, allan))
        head = f"{run_summary.fold_text(row.recording)}: {length}".removesuffix(": ")
        yield Text(head, style="bold")
        if row.status != "ok":
            yield Text(
                f"  {row.status}: {run_summary.fold_text(row.reason or '', _LONGEST_FINDING)}\n"
            )
            continue
        warnings = list(run_summary.select_warnings(findings))
        yield from _listed("Warnings", (_of_log(row, system) for row in warnings))
        doubts = []
        warned = {(warning.channel, warning.finding) for warning in warnings}
        for doubt in select_of(row, every_doubt):
            if (doubt.channel, doubt.code) not in warned:
                of = " ".join(filter(None, (doubt.channel, ", ".join(doubt.parameters)))) or "all"
                doubts.append(f"{of}: {doubt.reason}")
        yield from _listed("In doubt", doubts)
        notes = [line for line in findings if line.severity == "note"]
        yield from _listed("Notes", (_of_log(row, system) for row in notes))
        about = {(row.sensor, row.recording): row}
        recommended = [line for line in parameters if line.recommended]
        yield from _parameter_tables(recommended, "95 % intervals below", about, system, width)
        if not parameters:
            yield explain_no_estimates(row)


def describe_length(
    row: RecordingRow, parameters: Sequence[ParameterRow], allan: Sequence[AllanRow]
) -> str:
    """Return duration, rate, channels and temperature of a log; empty if it was not read."""
    if row.duration is None:
        return ""
    rates = [line.cluster_size / line.tau for line in allan]
    channels = len({line.channel for line in parameters})
    words = [f"{numbers.duration_text(row.duration)} at {numbers.rates_text(row.rate, rates)}"]
    words += [numbers.counted(channels, "channel")]
    words += [text] if (text := format_temperature(row)) else []
    return ", ".join(words) + ", simulated" * row.simulated


def explain_no_estimates(row: RecordingRow) -> Text:
    """Return why an analysed log has no parameters."""
    why = "noise is not estimated for a turned sensor"
    why = "no channel can be analysed" if row.kind == AT_REST else why
    return Text(f"  {row.kind.replace('_', ' ')}: {why}\n")


def select_of(recording: RecordingRow, rows: Iterable[R]) -> list[R]:
    """Return the rows of a recording."""
    key = (recording.sensor, recording.recording)
    return [row for row in rows if (row.sensor, row.recording) == key]


def _of_log(row: FindingRow, system: System) -> str:
    name = row.finding.replace("_", " ")
    if 0 < len(row.affects) <= _MAX_AFFECTED:
        name += f", affects {', '.join(row.affects)}"
    elif row.affects and WHITE.isdisjoint(row.affects):
        name += ", affects slow noise"
    place = f"{row.channel} ({name})" if row.channel else name
    return f"{place}: {finding_text(row, system)}"


def _parameter_tables(
    rows: Sequence[ParameterRow], which: str, about: About, system: System, width: int
) -> Iterator[RenderableType]:
    for quantity, title in TITLES.items():
        own = [row for row in rows if quantity_of(row.channel) == quantity]
        if own:
            heads, lines = _parameter_lines(quantity, own, about, system)
            yield fit_table(f"{title}: {which}", heads, lines, width, names=0)
            # The reasons of values without a doubt, each remark once.
            channels: dict[str, dict[str, None]] = {}
            for row in own:
                if row.status == "ok" and row.reason:
                    remark = f"{symbol_text(row.parameter)}: {row.reason}"
                    channels.setdefault(remark, {})[row.channel] = None
            for remark, of in channels.items():
                yield Text(run_summary.fold_text(f"{', '.join(of)}: {remark}", _LONGEST_FINDING))
            yield Text()


def _listed(title: str, lines: Iterable[str]) -> Iterator[Text]:
    listed = list(lines)
    if listed:
        yield Text(f"{title}: {len(listed)}", style="bold")
        for line in listed:
            text = run_summary.fold_text(line, _LONGEST_FINDING)
            yield Text(f"  {text}")
        yield Text()


def _ranking_tables(
    rows: Sequence[RankingRow], requirement: str | None, about: About, system: System, width: int
) -> Iterator[RenderableType]:
    asked = [requirement] if requirement else dict.fromkeys(row.requirement for row in rows)
    simulated = {key: row.simulated for key, row in about.items()}
    limit = "limit" if requirement else "deciding limit"
    heads = ["", "sensor", "verdict", "error of allowed (1σ)", limit, "margin"]
    for name, groups in format_rankings(rows, asked, simulated, system):
        lines = [
            line
            for group in groups
            for line in _ranking_lines(group, every=requirement is not None)
        ]
        yield fit_table(f"Ranking for {name}", heads, lines, width, names=1)
        yield Text()


def _ranking_lines(group: Group, *, every: bool) -> Iterator[list[str | Text]]:
    """Yield the lines of a sensor: of every limit, or of the deciding one."""
    row = group.row
    sensor = run_summary.fold_text(group.sensor + " (simulated)" * group.simulated)
    if row.tied_with:
        sensor += "\n" + run_summary.fold_text(f"similar to {', '.join(row.tied_with)}")
    style = "yellow" if row.conditions else _STYLES[row.verdict]
    verdict = Text(run_summary.fold_text(group.stated, _LONGEST_VERDICT), style=style)
    if group.weak:
        verdict.stylize("dim")
    # A doubt that makes the evidence weak is printed there.
    doubts = tuple(doubt for doubt in row.doubts if doubt.code not in row.evidence_reasons)
    others = used_doubts_text(replace(row, doubts=doubts)) if group.doubts else ""
    for line in (
        f"weak evidence: {group.weak}" * bool(group.weak),
        f"doubts: {others}" * bool(others),
        group.corrected,
    ):
        # The column of names gets the rest of the width.
        wrapped = wrap(run_summary.fold_text(line, _LONGEST_FINDING), _BESIDE)
        verdict.append("".join(f"\n{part}" for part in wrapped), style="yellow")
    first: list[str | Text] = [group.rank, sensor, verdict]
    for limit in group.limits:
        if every or limit.decides:
            known = f"{limit.sigma} of {limit.allowed}\n{limit.interval}"
            shown = known if limit.sigma != numbers.NO_VALUE else limit.reason
            error, _, after = limit.limit.rpartition(", ")
            margins = "\n".join(filter(None, [limit.margin, *limit.other_margins.split(", ")]))
            yield [*first, shown, f"{error}\nafter {after}", margins]
            first = ["", "", ""]


def _parameter_lines(
    quantity: str, rows: Sequence[ParameterRow], about: About, system: System
) -> tuple[list[str], list[list[str | Text]]]:
    units = {symbol: choose_page_unit(quantity, symbol, system) for symbol in select_symbols(rows)}
    by_channel = group_rows(rows, lambda row: (row.sensor, row.recording, row.channel))
    lines: list[list[str | Text]] = []
    alone = len(about) == 1  # its name is above
    for (sensor, recording, channel), own in by_channel.items():
        log = about[sensor, recording]
        badge = " (simulated)" * log.simulated
        shown = channel if alone else f"{sensor} / {recording} {channel}{badge}"
        cells = (
            _cell([each for each in own if each.parameter == symbol], unit, log.duration)
            for symbol, unit in units.items()
        )
        lines.append([run_summary.fold_text(shown), *cells])
    return [
        "channel" if alone else "recording",
        *(f"{symbol_text(symbol)}\n{unit.sign}" for symbol, unit in units.items()),
    ], lines


def _cell(rows: Sequence[ParameterRow], unit: numbers.Unit, duration: float | None) -> str:
    """Return the value of each component with its interval, or the reason without one."""
    lines = []
    for row in rows:
        words = STATUS_WORDS[row.status]
        value, interval = unit.estimate_texts(row.value, row.lower, row.upper)
        if row.value is None:
            lines.append(words)
        else:
            lines.append(value + f" ({words})" * (row.status != "ok"))
        if interval != numbers.NO_VALUE:
            lines.append(interval)
        needed = row.duration_needed
        if row.status != "ok" and needed is not None and needed > (duration or 0.0):
            lines.append(f"(needs {numbers.duration_text(needed)})")
    return "\n".join(lines) or "–"


def fit_table(
    title: str,
    heads: Sequence[str],
    lines: Sequence[Sequence[str | Text]],
    width: int,
    *,
    names: int,
) -> Table:
    """Return a table for a terminal of ``width`` columns, which breaks no word or number.

    ``names`` is the index of the table's column of names, which may be broken anywhere. If there is
    no room, columns are omitted from the right. A head with two lines is of numbers, which are
    aligned to the right; the second line is the unit.
    """
    cells = [["-", *map(str, column)] for column in zip(heads, *lines, strict=True)]
    widths = [max(cell_len(word) for cell in column for word in cell.split()) for column in cells]
    wanted = [
        max(cell_len(text) for cell in column for text in cell.split("\n")) for column in cells
    ]
    widths[names] = min(widths[names], _NAME_FOLDS_AT)
    shown = len(heads)
    while shown > names + 1 and sum(widths[:shown]) + _GAP * (shown - 1) > width:
        shown -= 1
    spare = width - sum(widths[:shown]) - _GAP * (shown - 1)
    while spare > 0:
        lacking = [i for i in range(shown) if widths[i] < wanted[i]]
        # Names can be broken, so they get the rest.
        lacking = [i for i in lacking if i != names] or lacking
        if not lacking:
            break
        for i in lacking[:spare]:
            widths[i] += 1
        spare -= len(lacking)
    left_out = ", ".join(" in ".join(head.split("\n")) for head in heads[shown:])
    table = Table(
        title=title,
        caption=f"no room for: {left_out}" if left_out else None,
        title_justify="left",
        caption_justify="left",
        title_style="bold",
        box=box.SIMPLE_HEAD,
        show_edge=False,
        padding=(0, _GAP - 1, 0, 0),
        pad_edge=False,
    )
    for head, own in zip(heads[:shown], widths, strict=False):
        justify: Any = "right" if "\n" in head else "left"
        table.add_column(head, justify=justify, width=own, overflow="fold")
    for line in lines:
        table.add_row(*line[:shown])
    return table
