"""Recognise, group and choose the columns of a log, and draft its sensor file."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from functools import partial
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.readers.contents import Contents
from imubench_pipeline.readers.file_format import LogColumn, LogTable
from imubench_pipeline.readers.inspection.clock import Clock, find_clocks, is_advancing
from imubench_pipeline.readers.inspection.draft import UNKNOWN, Draft, Entry, Source
from imubench_pipeline.readers.inspection.names import (
    DERIVED,
    DIMENSIONS,
    PLAIN,
    WEAK,
    WITHOUT_GRAVITY,
    Meaning,
    Quantity,
    find_quantity,
    interpret_label,
)
from imubench_pipeline.readers.stated_units import find_bracketed, parse_unit
from imubench_pipeline.settings.sensor import CHANNELS
from imubench_pipeline.units import find_conversion

_AXES = "xyz"
GRAVITY_BY_UNIT: Mapping[str, float] = {"g": 1.0, "m/s^2": STANDARD_GRAVITY, "mg": 1000.0}
"""Gravity in each unit that can be guessed from it."""

_GRAVITY_TOLERANCE, _STATED_GRAVITY_TOLERANCE = 0.1, 0.2
_NAMELESS_GRAVITY_TOLERANCE = 0.05
_MIN_CONSTANT_RECORDS = 40  # equal records of all axes of a sensor that was not read


@dataclass(frozen=True, eq=False)
class Group:
    """The columns of a log that are the axes of one sensor, or a temperature."""

    quantity: Quantity
    table: LogTable
    columns: dict[str, LogColumn]  # by axis; the key of a temperature is an empty text
    unit: str | None  # the unit that the file states
    written: str  # text of the file in the place of the unit, if it is no known unit
    rank: int  # see `imubench_pipeline.readers.inspection.names.Meaning`
    guessed: str = ""  # reason for the choice of the columns, if it is not from their names
    hint: str = ""  # what is known of unit and scale

    @property
    def names(self) -> str:
        """Names of the columns in the file."""
        return ", ".join(
            column.label or f"column {column.source}" for column in self.columns.values()
        )

    @property
    def mean_length(self) -> float | None:
        """Length of the mean vector in the unit of the file; None if an axis is missing."""
        if sorted(self.columns) != list(_AXES):
            return None
        axes = [column.values[np.isfinite(column.values)] for column in self.columns.values()]
        means = [values.mean() for values in axes if len(values)]
        return float(np.linalg.norm(means)) if len(means) == len(_AXES) else None

    @property
    def constant(self) -> bool:
        """Whether all axes are constant in the first records, as unused fields are."""
        axes = [column.values[np.isfinite(column.values)] for column in self.columns.values()]
        return all(len(axis) >= _MIN_CONSTANT_RECORDS and np.ptp(axis) == 0.0 for axis in axes)

    @property
    def gravity_unit(self) -> str | None:
        """Unit (the stated one, if any) in which the mean vector is as long as gravity; or None."""
        length = self.mean_length
        if length is None:
            return None
        if self.unit is not None:
            in_si = length * find_conversion(self.unit, DIMENSIONS["accel"])[0]
            is_gravity = abs(in_si / STANDARD_GRAVITY - 1) < _STATED_GRAVITY_TOLERANCE
            return self.unit if is_gravity else None
        return next(
            (u for u, g in GRAVITY_BY_UNIT.items() if abs(length / g - 1) < _GRAVITY_TOLERANCE),
            None,
        )


def group_columns(contents: Contents) -> list[Group]:
    """Return the gyros, accelerometers and temperatures of a recording, by table."""
    recognised: list[Group] = []
    for table in contents.tables:
        if table.fault is None:
            recognised += _group_by_name(table, contents) or _group_without_names(table)
    return recognised


def _group_by_name(table: LogTable, contents: Contents) -> list[Group]:
    # The most specific name of the table or its file that contains a quantity.
    file = PurePosixPath(table.file or contents.path.name)
    titles = (table.name.rpartition("/")[2], table.name, file.name.partition(".")[0])
    context = next((title for title in titles if title and find_quantity(title)), "")
    together: dict[tuple[Quantity, str, bool], dict[str, tuple[LogColumn, Meaning]]] = {}
    for column in table.columns:
        if column.kind != "number":
            continue
        label = column.label or f"{context}[{column.source}]"
        if column.label == "T" and parse_unit(column.unit or "", "temperature"):
            label = f"T ({column.unit})"  # too short without its unit
        meant = interpret_label(label, context)
        if meant is not None:
            if meant.quantity != "temperature":
                key = meant.quantity, meant.stem, meant.axis.isdecimal()
                together.setdefault(key, {}).setdefault(meant.axis, (column, meant))
            elif column.label or not is_advancing(column.values):
                together["temperature", label, False] = {"": (column, meant)}
    result = []
    for (quantity, _, counted), axes in together.items():
        if counted:  # three numbered columns are axes, without a time before them
            columns = [axes[number] for number in sorted(axes, key=int)]
            if len(columns) == 4 and is_advancing(columns[0][0].values):
                columns = columns[1:]
            axes = dict(zip(_AXES, columns, strict=True)) if len(columns) == 3 else {}
        if axes:
            result.append(_make_group(quantity, table, axes))
    return [*map(partial(_add_convention, contents), result), *_find_roll_pitch_yaw(table, result)]


_BETAFLIGHT_RATE = (
    "of Betaflight: 1 deg/s per count, or 0.1 deg/s (scale: 0.1) with blackbox_high_resolution"
)
_HINTS_BY_STEM = {
    "gyrounfilt": _BETAFLIGHT_RATE,
    "gyroadc": f"{_BETAFLIGHT_RATE}; filtered: gyroUnfilt is not",
    "accsmooth": "of Betaflight, filtered: acc_1G in the header of its log is 1 g",
}
"""What is known of columns without a unit, by their stem."""

_NAVEGO_UNITS = {"wb": "rad/s", "fb": "m/s^2"}  # fields of its structures of sensors


def _add_convention(contents: Contents, group: Group) -> Group:
    """Return a group with the unit of NaveGo's structures, if it is in one."""
    above, _, name = group.table.name.rpartition("/")
    names = {table.name for table in contents.tables}
    if name not in _NAVEGO_UNITS or not {f"{above}/{each}" for each in _NAVEGO_UNITS} <= names:
        return group
    return replace(group, unit=_NAVEGO_UNITS[name], guessed="as NaveGo's wb and fb are")


def _make_group(
    quantity: Quantity, table: LogTable, axes: Mapping[str, tuple[LogColumn, Meaning]]
) -> Group:
    columns = {axis: axes[axis][0] for axis in sorted(axes)}
    meanings = [meaning for _, meaning in axes.values()]
    column = next(iter(columns.values()))
    beside = column.unit or ""
    unit = parse_unit(beside, DIMENSIONS[quantity]) or meanings[0].unit
    same = {parse_unit(c.unit or "", DIMENSIONS[quantity]) or m.unit for c, m in axes.values()} == {
        unit
    }
    written = beside or ", ".join(find_bracketed(column.label))
    rank = max(meaning.rank for meaning in meanings)
    if table.file_format.measured_by_name:
        rank = DERIVED if rank == DERIVED else PLAIN
    hint = column.hint or ("" if unit else _HINTS_BY_STEM.get(meanings[0].stem, ""))
    return Group(quantity, table, columns, unit if same else None, written, rank, hint=hint)


def _find_roll_pitch_yaw(table: LogTable, named: list[Group]) -> Iterator[Group]:
    if any(group.quantity == "gyro" for group in named):
        return
    by_name = {re.split(r"[\s(\[]", c.label)[0].lower(): c for c in table.columns}
    if {"p", "q", "r"} <= set(by_name):
        meanings = {
            axis: (
                by_name[name],
                interpret_label(by_name[name].label.lower().replace(name, f"w{axis}", 1)),
            )
            for axis, name in zip(_AXES, "pqr", strict=True)
        }
        axes = {axis: (column, meant) for axis, (column, meant) in meanings.items() if meant}
        if len(axes) == 3:
            why = "guessed from the names p, q and r"
            yield replace(_make_group("gyro", table, axes), rank=WEAK, guessed=why)


def _group_without_names(table: LogTable) -> list[Group]:
    """Return gyro and accelerometer from unnamed columns, distinguished by gravity."""
    columns = [c for c in table.columns if c.kind == "number"]
    if any(column.label for column in columns) or len(columns) > 8:
        return []
    if columns and is_advancing(columns[0].values):
        columns = columns[1:]
    threes = [
        Group("accel", table, dict(zip(_AXES, columns[n : n + 3], strict=True)), None, "", WEAK)
        for n in range(0, len(columns) - 2, 3)
    ]
    lengths = [group.mean_length for group in threes]
    gravities = np.array(list(GRAVITY_BY_UNIT.values()))
    heavy = [
        n
        for n, length in enumerate(lengths)
        if length and (abs(length / gravities - 1) < _NAMELESS_GRAVITY_TOLERANCE).any()
    ]
    if len(threes) not in (1, 2) or len(heavy) != 1:
        return []
    guessed = []
    for n, group in enumerate(threes):
        is_accel = n == heavy[0]
        why = "no names" if is_accel else "no names: guessed by its place"
        guessed.append(replace(group, quantity="accel" if is_accel else "gyro", guessed=why))
    return guessed


_QUANTITY_NAMES = {"gyro": "gyro", "accel": "accelerometer", "temperature": "temperature"}


@dataclass(frozen=True)
class Choice:
    """The columns of a log that are used, and the others."""

    groups: list[Group]  # gyro, accelerometer and temperature, as far as there are any
    clock: Clock | None
    local: bool  # the time column is in the table of the channels, in each file
    anchor: LogTable | None  # the table whose records or clock all others must share
    other_clocks: list[Clock]
    left: list[tuple[Group, str]]  # recognised groups that are not used, with the reason
    unknown: list[LogColumn]  # number columns of the used tables that were not recognised


def choose_columns(contents: Contents) -> Choice:
    """Choose the channels, the temperature and the time of a recording."""
    recognised = group_columns(contents)
    left = [(g, _explain_rejection(g)) for g in recognised if _explain_rejection(g)]
    able = [group for group in recognised if not _explain_rejection(group)]
    gyro = _select_best([g for g in able if g.quantity == "gyro"], None, able)
    accels = [g for g in able if g.quantity == "accel"]
    first = gyro or _select_best(accels, None, able)
    anchor = first.table if first else None
    if anchor is None:
        anchor = next((table for table in contents.tables if table.columns), None)
    in_groups = {id(column) for group in recognised for column in group.columns.values()}

    def find_table_clocks(table: LogTable) -> list[Clock]:
        columns = list(table.columns)
        if table.file_format.clock_of == "length":
            for other in contents.tables:
                if other is not table and other.file == table.file and other.rows == table.rows:
                    columns += other.columns
        return find_clocks(table, [column for column in columns if id(column) not in in_groups])

    ours = [] if anchor is None else find_table_clocks(anchor)
    others = {id(g.table): find_table_clocks(g.table) for g in able}
    rest = [others[id(g.table)] for g in able if anchor is not g.table]

    clock = max(
        ours,
        key=lambda clock: (
            not clock.counts,
            sum(any(_has_equal_entries(clock, other) for other in theirs) for theirs in rest),
        ),
        default=None,
    )

    def fits(group: Group) -> bool:
        table, clock_of = group.table, group.table.file_format.clock_of
        if anchor is None or anchor is table:
            return anchor is table
        if anchor.file == table.file and clock_of != "variable":
            return clock_of == "length" and anchor.rows == table.rows
        return clock is None or any(_has_equal_entries(clock, other) for other in others[id(table)])

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
    spoken = in_groups | {id(other.column) for other in ours}
    return Choice(
        selected,
        clock,
        _is_local(selected, clock),
        anchor,
        [other for other in ours if other is not clock],
        left,
        [
            column
            for table in _collect_tables(selected, anchor)
            for column in table.columns
            if id(column) not in spoken and not (clock and column.source == clock.column.source)
        ],
    )


def find_imus(contents: Contents) -> list[tuple[str, ...]]:
    """Return the topics of each IMU of a log: its gyro, and the accelerometer of closest name."""
    able = [group for group in group_columns(contents) if not _explain_rejection(group)]
    gyros = {group.table.name: group for group in able if group.quantity == "gyro"}
    accels = {group.table.name: group for group in able if group.quantity == "accel"}
    free = [name for name in accels if name not in gyros]
    imus: list[tuple[str, ...]] = []
    for name in gyros:
        if name in accels or not free:
            imus.append((name,))
            continue
        nearest = max(free, key=lambda other: SequenceMatcher(None, name, other).ratio())
        free.remove(nearest)
        imus.append((name, nearest))
    return imus


def _explain_rejection(group: Group) -> str:
    if group.rank == DERIVED:
        return "filter output or metadata, not a measurement of the sensor"
    if group.rank == WITHOUT_GRAVITY and group.gravity_unit is None:
        return "without gravity: not a raw accelerometer measurement"
    if group.quantity != "temperature" and len(group.columns) > 1 and group.constant:
        return "constant in the first records: no measurement"
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


def _has_equal_entries(clock: Clock, other: Clock) -> bool:
    if clock.column.source != other.column.source:
        return False
    (own, other_source) = (
        replace(source, column="", wraps=None) for source in (clock.entry.value, other.entry.value)
    )
    return own == other_source


def _is_local(groups: Sequence[Group], clock: Clock | None) -> bool:
    if clock is None:
        return True
    tables = _collect_tables(groups, None)
    own_clocks = all(table.file_format.clock_of == "variable" for table in tables)
    if len({table.file for table in tables}) < len(tables) and not own_clocks:
        return False
    return len(tables) > 1 or any(clock.column is c for t in tables for c in t.columns)


def _collect_tables(groups: Sequence[Group], anchor: LogTable | None) -> list[LogTable]:
    tables = [group.table for group in groups] or ([anchor] if anchor else [])
    return list({id(table): table for table in tables}.values())


_GYRO_HINT = "not stated in the file: deg/s or rad/s? see the logger's manual"
_MAX_LISTED_NAMES = 20
_FILE_SUFFIXES = re.compile(r"(?:\.[A-Za-z]\w{0,7})+$")
_COUNTS_PER_G = tuple(1 << bits for bits in range(8, 20))
_COUNT_TOLERANCE = 0.06


def draft_sensor_file(contents: Contents, model: str | None = None) -> Draft:
    """Draft a sensor file for a recording; ``model``: name of the sensor, None: of the log."""
    choice = choose_columns(contents)
    usable = (table.file_format for table in contents.tables if table.fault is None)
    vendor = next((made.vendor for made in usable if made.vendor), "unknown")
    drafted = Draft(
        Entry(vendor, "vendor of the sensor, for the report"),
        Entry(model or _FILE_SUFFIXES.sub("", contents.path.name) or "sensor", "model name"),
    )
    if contents.stated is not None:
        drafted.reader = Entry(
            contents.stated.name, "not detected from the first bytes of the file"
        )
    if choice.clock is not None:
        source = choice.clock.entry.value
        if choice.local:
            source = replace(source, column=choice.clock.column.source)
        drafted.time = Entry(source, choice.clock.entry.comment)
    if choice.clock is None or choice.clock.counts:
        stating = (table for table in contents.tables if table.rate is not None)
        drafted.rate = Entry(UNKNOWN, "not stated in the file: such as 100 Hz")
        table = choice.anchor or next(stating, None)
        if table is not None and table.rate is not None:
            drafted.rate = Entry(f"{table.rate:.10g} Hz", "stated in the file")
    alone = {group.table.file for group in choice.groups} == {contents.only}
    for group in choice.groups:
        add = _add_temperature if group.quantity == "temperature" else _add_group
        add(drafted, group, alone)
    if not drafted.channels:
        several = sum(table.variable is not None for table in contents.tables) > 1
        source = Source(variable=UNKNOWN if several else None, column=UNKNOWN, unit=UNKNOWN)
        entry = Entry(source, "no column name identifies it: fill in, or remove")
        drafted.channels = dict.fromkeys(CHANNELS, entry)
    drafted.left_over += [f"not taken: {_name_group(g)} ({why})" for g, why in choice.left]
    drafted.left_over += _list_unused_tables(contents, choice)
    if choice.other_clocks:
        names = _join_names(str(clock.entry.value.column) for clock in choice.other_clocks)
        drafted.left_over.append(f"also a time: {names}")
    if choice.unknown:
        names = _join_names(c.label or f"column {c.source}" for c in choice.unknown)
        drafted.left_over.append(f"not recognised: {names}")
    if contents.files > len({table.file for table in contents.tables}):
        drafted.left_over.append(f"only some of the {contents.files} files were looked into")
    return drafted


def _list_unused_tables(contents: Contents, choice: Choice) -> list[str]:
    """Return remarks on the arrays, topics and files of which no column is mentioned otherwise."""
    groups = [*choice.groups, *(group for group, _ in choice.left)]
    used = {id(choice.anchor), *(id(group.table) for group in groups)}
    clocks = [choice.clock, *choice.other_clocks]
    of_time = {id(clock.column) for clock in clocks if clock is not None}
    by_reason: dict[str, list[str]] = {}
    for table in contents.tables:
        if id(table) in used or of_time & set(map(id, table.columns)):
            continue
        name = ", ".join(text for text in (table.file, table.name) if text)
        why = table.fault or "no column is named as one of a gyro or an accelerometer"
        if name and table.rows != 1:
            by_reason.setdefault(why, []).append(name)
    return [f"not taken: {_join_names(names)} ({why})" for why, names in by_reason.items()]


def _describe_source(table: LogTable, column: LogColumn, unit: str, alone: bool) -> Source:
    file = None if alone else table.file
    return Source(
        file=file, variable=table.variable, column=column.source, unit=unit, scale=column.scale
    )


def _add_group(drafted: Draft, group: Group, alone: bool) -> None:
    unit, comment = group.unit, ""
    if unit is None and group.quantity == "accel":
        unit, comment = _guess_acceleration_unit(group)
    elif unit is None:
        unit, comment = UNKNOWN, _GYRO_HINT
        if group.written:
            comment = f"the file says {group.written!r}: deg/s or rad/s, or counts?"
        elif all(_is_whole(column) for column in group.columns.values()):
            comment = f"{_GYRO_HINT}; whole numbers may be counts: add 'scale'"
    elif group.rank == WITHOUT_GRAVITY:
        comment = "with gravity, by its mean: so this is what the accelerometer measures"
    elif group.quantity == "accel" and group.mean_length is not None and not group.gravity_unit:
        comment = f"the length of the mean is {group.mean_length:.4g} {unit}, which is not gravity"
    if group.hint and (group.quantity == "gyro" or next(iter(group.columns.values())).hint):
        comment = ""  # the hint says more
    comment = "; ".join(text for text in (group.guessed, group.hint, comment) if text)
    for axis, column in group.columns.items():
        entry = Entry(_describe_source(group.table, column, unit, alone), comment)
        drafted.channels[f"{group.quantity}_{axis}"] = entry


def _guess_acceleration_unit(group: Group) -> tuple[str, str]:
    """Return the unit in which the mean has the length of gravity, and a comment."""
    length, unit = group.mean_length, group.gravity_unit
    if length is None:
        return UNKNOWN, "not stated in the file: m/s^2, g or mg?"
    if unit is not None:
        return unit, f"guessed: the length of the mean is {length:.4g}, as gravity in {unit}"
    counts = [count for count in _COUNTS_PER_G if abs(length / count - 1) < _COUNT_TOLERANCE]
    hint = (
        f": counts of g/{counts[0]}? then 'unit: g, scale: {1 / counts[0]:.10g}'" if counts else ""
    )
    what = f"the file says {group.written!r}, and" if group.written else "the file does not say;"
    return UNKNOWN, f"{what} the length of the mean is {length:.4g}{hint}"


def _add_temperature(drafted: Draft, group: Group, alone: bool) -> None:
    (column,) = list(group.columns.values())[:1]
    unit, comment = group.unit, ""
    present = column.values[np.isfinite(column.values)]
    if unit is None and len(present):
        level = float(np.median(present))
        unit = "degC" if -60 <= level <= 130 else "K" if 230 <= level <= 400 else None
        comment = f"guessed: {level:.4g} is plausible in {unit}"
    if unit is None:
        drafted.left_over.append(
            f"not taken: {_name_group(group)}, a temperature in a unit that the file does not state"
        )
        return
    drafted.temperature = Entry(_describe_source(group.table, column, unit, alone), comment)


def _is_whole(column: LogColumn) -> bool:
    values = column.values[np.isfinite(column.values)]
    return bool(len(values)) and bool((values == np.rint(values)).all()) and bool(values.any())


def _name_group(group: Group) -> str:
    where = ", ".join(text for text in (group.table.file, group.table.name) if text)
    return f"{group.names} of {where}" if where else group.names


def _join_names(names: Iterable[str]) -> str:
    every = list(names)
    more = f" and {len(every) - _MAX_LISTED_NAMES} more" if len(every) > _MAX_LISTED_NAMES else ""
    return ", ".join(every[:_MAX_LISTED_NAMES]) + more
