"""Convert the chosen columns of a log to the entries of a sensor file."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

import numpy as np

from imubench_pipeline.readers.contents import Contents
from imubench_pipeline.readers.file_format import LogColumn, LogTable
from imubench_pipeline.readers.inspection.choice import Choice, chosen
from imubench_pipeline.readers.inspection.clock import rate_entry
from imubench_pipeline.readers.inspection.draft import UNKNOWN, Draft, Entry
from imubench_pipeline.readers.inspection.groups import Group
from imubench_pipeline.readers.inspection.names import WITHOUT_GRAVITY
from imubench_pipeline.settings.sensor import CHANNELS

_GYRO_HINT = "the file does not say: deg/s or rad/s? see the logger's manual"
_MAX_LISTED_NAMES = 20
_FILE_SUFFIXES = re.compile(r"(?:\.[A-Za-z]\w{0,7})+$")
_COUNTS_PER_G = tuple(1 << bits for bits in range(8, 20))
_GRAVITY_TOLERANCE = 0.06


def draft(contents: Contents, model: str | None = None) -> Draft:
    """Draft a sensor file from the contents of a recording.

    ``model``: name of the sensor; None: the name of the log.
    """
    choice = chosen(contents)
    drafted = Draft(
        Entry(_find_vendor(contents), "who makes the sensor, for the report"),
        Entry(model or _FILE_SUFFIXES.sub("", contents.path.name) or "sensor", "what it is called"),
    )
    if contents.stated is not None:
        drafted.reader = Entry(contents.stated.name, "the file does not tell it by its first bytes")
    if choice.clock is not None:
        value = dict(choice.clock.entry.value)
        if choice.local:
            value["column"] = choice.clock.column.source
        drafted.time = Entry(value, choice.clock.entry.comment)
    if choice.clock is None or choice.clock.counts:
        drafted.rate = rate_entry(choice.anchor or _find_table_with_rate(contents.tables))
    files = {group.table.file for group in choice.selected}
    alone = len(files) == 1 and files == {contents.only}
    for group in (choice.gyro, choice.accel):
        if group is not None:
            _add_group(drafted, group, alone)
    if choice.temperature is not None:
        _add_temperature(drafted, choice.temperature, alone)
    if not drafted.channels:
        _add_placeholders(drafted)
    drafted.left_over += _list_remarks(choice, contents)
    return drafted


def _find_vendor(contents: Contents) -> str:
    usable = (table.file_format for table in contents.tables if table.fault is None)
    return next((made.vendor for made in usable if made.vendor), "unknown")


def _find_table_with_rate(tables: Iterable[LogTable]) -> LogTable | None:
    return next((table for table in tables if table.rate is not None), None)


def _describe_source(table: LogTable, column: LogColumn, unit: str, alone: bool) -> dict[str, Any]:
    """Return the values of a sensor file that select a column."""
    source: dict[str, Any] = {}
    if table.file is not None and not alone:
        source["file"] = table.file
    if table.variable is not None:
        source["variable"] = table.variable
    return source | {"column": column.source, "unit": unit}


# --------------------------------------------------------------------------------- channels


def _add_group(drafted: Draft, group: Group, alone: bool) -> None:
    """Add the axes of a group to a draft."""
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
        comment = f"the mean is {group.mean_length:.4g} {unit} long, which is not gravity"
    comment = "; ".join(text for text in (group.guessed, comment) if text)
    for axis, column in group.columns.items():
        entry = Entry(_describe_source(group.table, column, unit, alone), comment)
        drafted.channels[f"{group.quantity}_{axis}"] = entry


def _guess_acceleration_unit(group: Group) -> tuple[str, str]:
    """Return the unit in which the mean has the length of gravity, and a comment."""
    length, unit = group.mean_length, group.gravity_unit
    if length is None:
        return UNKNOWN, "the file does not say: m/s^2, g or mg?"
    if unit is not None:
        return unit, f"guessed: the mean is {length:.4g} long, as gravity in {unit}"
    counts = [count for count in _COUNTS_PER_G if abs(length / count - 1) < _GRAVITY_TOLERANCE]
    hint = (
        f": counts of g/{counts[0]}? then 'unit: g, scale: {1 / counts[0]:.10g}'" if counts else ""
    )
    what = f"the file says {group.written!r}, and" if group.written else "the file does not say;"
    return UNKNOWN, f"{what} the mean is {length:.4g} long{hint}"


def _add_temperature(drafted: Draft, group: Group, alone: bool) -> None:
    """Add the temperature to a draft, unless its unit is unknown."""
    (column,) = list(group.columns.values())[:1]
    unit, comment = group.unit, ""
    present = column.values[np.isfinite(column.values)]
    if unit is None and len(present):
        level = float(np.median(present))
        unit = "degC" if -60 <= level <= 130 else "K" if 230 <= level <= 400 else None
        comment = f"guessed: {level:.4g} is one in {unit}"
    if unit is None:
        drafted.left_over.append(
            f"not taken: {_name_group(group)}, a temperature in a unit that the file does not say"
        )
        return
    drafted.temperature = Entry(_describe_source(group.table, column, unit, alone), comment)


def _add_placeholders(drafted: Draft) -> None:
    for name in CHANNELS:
        drafted.channels[name] = Entry(
            {"column": UNKNOWN, "unit": UNKNOWN}, "no name of a column tells: fill in, or remove"
        )


def _is_whole(column: LogColumn) -> bool:
    values = column.values[np.isfinite(column.values)]
    return bool(len(values)) and bool((values == np.rint(values)).all()) and bool(values.any())


# -------------------------------------------------------------------------------- left over


def _list_remarks(choice: Choice, contents: Contents) -> list[str]:
    remarks = [f"not taken: {_name_group(group)} ({why})" for group, why in choice.left]
    if choice.other_clocks:
        names = _join_names(str(clock.entry.value["column"]) for clock in choice.other_clocks)
        remarks.append(f"also a time: {names}")
    if choice.unknown:
        names = _join_names(c.label or f"column {c.source}" for c in choice.unknown)
        remarks.append(f"not recognised: {names}")
    if contents.files > len({table.file for table in contents.tables}):
        remarks.append(f"only some of the {contents.files} files were looked into")
    return remarks


def _name_group(group: Group) -> str:
    where = ", ".join(text for text in (group.table.file, group.table.name) if text)
    return f"{group.names} of {where}" if where else group.names


def _join_names(names: Iterable[str]) -> str:
    every = list(names)
    more = f" and {len(every) - _MAX_LISTED_NAMES} more" if len(every) > _MAX_LISTED_NAMES else ""
    return ", ".join(every[:_MAX_LISTED_NAMES]) + more
