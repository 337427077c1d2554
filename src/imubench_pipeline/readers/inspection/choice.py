"""Choose the channels, the temperature and the time of a log for its sensor file."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from imubench_pipeline.readers.contents import Contents
from imubench_pipeline.readers.file_format import LogColumn, LogTable
from imubench_pipeline.readers.inspection.clock import Clock, clocks
from imubench_pipeline.readers.inspection.groups import Group, groups
from imubench_pipeline.readers.inspection.names import DERIVED, PLAIN, WITHOUT_GRAVITY

_QUANTITY_NAMES = {"gyro": "gyro", "accel": "accelerometer", "temperature": "temperature"}


@dataclass(frozen=True)
class Choice:
    """The columns of a log that are used, and the others."""

    gyro: Group | None
    accel: Group | None
    temperature: Group | None
    clock: Clock | None
    local: bool
    """The time column is in the table of the channels, in each file."""
    anchor: LogTable | None
    """The table with which all others must share their records or their clock."""
    other_clocks: list[Clock]
    left: list[tuple[Group, str]]
    """Recognised groups that are not used, each with the reason."""
    unknown: list[LogColumn]
    """Number columns of the used tables that were not recognised."""

    @property
    def selected(self) -> list[Group]:
        """The groups that are used."""
        return [g for g in (self.gyro, self.accel, self.temperature) if g is not None]


def chosen(contents: Contents) -> Choice:
    """Choose the channels, the temperature and the time of a recording."""
    recognised = groups(contents)
    left = [(g, _explain_rejection(g)) for g in recognised if _explain_rejection(g)]
    able = [group for group in recognised if not _explain_rejection(group)]
    gyro = _select_best([g for g in able if g.quantity == "gyro"], None, able)
    accels = [g for g in able if g.quantity == "accel"]
    first = gyro or _select_best(accels, None, able)
    anchor = first.table if first else None
    if anchor is None:
        anchor = next((table for table in contents.tables if table.columns), None)
    ours = [] if anchor is None else _find_clocks(contents, anchor, recognised)
    others = {id(g.table): _find_clocks(contents, g.table, recognised) for g in able}
    clock = _select_common_clock(ours, [others[id(g.table)] for g in able if anchor is not g.table])

    def fits(group: Group) -> bool:
        return (
            anchor is not None
            and _is_readable_together(anchor, group.table)
            and (
                clock is None
                or _has_same_clock(anchor, group.table)
                or any(_has_equal_entries(clock, other) for other in others[id(group.table)])
            )
        )

    fitting = [group for group in able if group is gyro or fits(group)]
    why = "other records than the channels, or another time"
    if first is None:
        why = "there is no channel"
    left += [(g, why) for g in able if g not in fitting]
    accel = _select_best([g for g in fitting if g.quantity == "accel"], gyro, able)
    temperature = _select_best(
        [g for g in fitting if g.quantity == "temperature"], gyro or accel, able
    )
    selected = [group for group in (gyro, accel, temperature) if group is not None]
    left += [(g, f"another {_QUANTITY_NAMES[g.quantity]}") for g in fitting if g not in selected]
    columns = {id(column) for group in recognised for column in group.columns.values()}
    spoken = columns | ({id(clock.column)} if clock else set())
    spoken |= {id(other.column) for other in ours}
    return Choice(
        gyro,
        accel,
        temperature,
        clock,
        _is_local(selected, clock),
        anchor,
        [other for other in ours if other is not clock],
        left,
        [
            column
            for table in _collect_tables(selected, anchor)
            for column in table.columns
            if id(column) not in spoken
            and not (clock is not None and column.source == clock.column.source)
        ],
    )


def _explain_rejection(group: Group) -> str:
    """Return the reason why a group is never used; empty if it can be used."""
    if group.rank == DERIVED:
        return "of a filter or about the measurement, not what the sensor measures"
    if group.rank == WITHOUT_GRAVITY and group.gravity_unit is None:
        return "without gravity: not what the accelerometer measures"
    if group.quantity != "temperature" and len(group.columns) > 1 and group.constant:
        return "the same in all of the first records: nothing was measured here"
    return ""


def _select_best(
    likely: Sequence[Group], beside: Group | None, every: Sequence[Group]
) -> Group | None:
    """Return the most plausible group, preferring tables with ``beside`` or with other groups."""

    def order(group: Group) -> tuple[Any, ...]:
        near = beside is not None and (group.table is beside.table)
        same_file = beside is not None and group.table.file == beside.table.file
        heavy = group.quantity != "accel" or group.gravity_unit is not None
        company = {g.quantity for g in every if g.table is group.table}
        sure = group.rank == PLAIN or (group.rank == WITHOUT_GRAVITY and heavy)
        return (
            not sure,
            -len(group.columns),
            not heavy,
            not near,
            not same_file,
            -len(company),
            group.unit is None,
        )

    return min(likely, key=order, default=None)


# ------------------------------------------------------------------------------------- time


def _find_clocks(contents: Contents, table: LogTable, recognised: Sequence[Group]) -> list[Clock]:
    """Return the columns that may be the time of a table, the most plausible first."""
    in_groups = {id(column) for group in recognised for column in group.columns.values()}
    columns = [c for c in table.columns if id(c) not in in_groups]
    rate = table.rate
    if table.file_format.clock_of == "length":
        for other in contents.tables:
            if other is not table and other.file == table.file and other.rows == table.rows:
                columns += [c for c in other.columns if id(c) not in in_groups]
    return clocks(table, columns, rate)


def _select_common_clock(ours: Sequence[Clock], others: Iterable[Sequence[Clock]]) -> Clock | None:
    """Return the first clock that most of the other tables share."""
    rest = list(others)

    def shared(clock: Clock) -> int:
        return sum(any(_has_equal_entries(clock, other) for other in theirs) for theirs in rest)

    return max(ours, key=lambda clock: (not clock.counts, shared(clock)), default=None)


def _has_equal_entries(clock: Clock, other: Clock) -> bool:
    """Return whether two clocks have the same entries in a sensor file."""
    if clock.column.source != other.column.source:
        return False
    keys = ("unit", "format", "date", "scale")
    return all(clock.entry.value.get(key) == other.entry.value.get(key) for key in keys)


def _is_readable_together(anchor: LogTable, table: LogTable) -> bool:
    if anchor is table or anchor.file != table.file:
        return True
    clock_of = table.file_format.clock_of
    return clock_of == "variable" or (clock_of == "length" and anchor.rows == table.rows)


def _has_same_clock(anchor: LogTable, table: LogTable) -> bool:
    """Return whether two tables have the same records, so that one clock serves both."""
    by_length = table.file_format.clock_of == "length"
    return anchor is table or (anchor.file == table.file and by_length)


def _is_local(groups: Sequence[Group], clock: Clock | None) -> bool:
    if clock is None:
        return True
    by_file: dict[str | None, set[int]] = {}
    for group in groups:
        by_file.setdefault(group.table.file, set()).add(id(group.table))
    if any(len(tables) > 1 for tables in by_file.values()):
        return False
    tables = _collect_tables(groups, None)
    return len(tables) > 1 or any(clock.column is c for t in tables for c in t.columns)


def _collect_tables(groups: Sequence[Group], anchor: LogTable | None) -> list[LogTable]:
    tables = [group.table for group in groups] or ([anchor] if anchor else [])
    return list({id(table): table for table in tables}.values())
