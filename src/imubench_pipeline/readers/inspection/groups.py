"""Group the columns of a log: axes of one gyro or accelerometer, or a temperature."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import PurePosixPath

import numpy as np

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.readers.contents import Contents
from imubench_pipeline.readers.file_format import LogColumn, LogTable
from imubench_pipeline.readers.inspection.clock import advances
from imubench_pipeline.readers.inspection.names import (
    DERIVED,
    DIMENSIONS,
    PLAIN,
    WEAK,
    Meaning,
    Quantity,
    meaning,
    quantity_of_text,
)
from imubench_pipeline.readers.stated_units import bracketed, unit_of
from imubench_pipeline.units import conversion

_AXES = "xyz"
GRAVITY_BY_UNIT: Mapping[str, float] = {"g": 1.0, "m/s^2": STANDARD_GRAVITY, "mg": 1000.0}
"""Gravity in each unit that can be guessed from it."""

_GRAVITY_TOLERANCE, _STATED_GRAVITY_TOLERANCE = 0.1, 0.2
_NAMELESS_GRAVITY_TOLERANCE = 0.05
_MIN_CONSTANT_RECORDS = 40
"""Least number of equal records of all axes of a sensor that was not read."""


@dataclass(frozen=True, eq=False)
class Group:
    """The axes of one sensor, or a temperature."""

    quantity: Quantity
    table: LogTable
    columns: dict[str, LogColumn]
    """Columns by axis; the key of a temperature is an empty text."""
    unit: str | None
    """The unit that the file states."""
    written: str
    """Text of the file in the place of the unit, if it is no known unit."""
    rank: int
    """See `imubench_pipeline.readers.inspection.names.Meaning`."""
    guessed: str = ""
    """Reason for the choice of the columns, if it is not from their names."""

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
        """Unit in which the mean has the length of gravity; the stated one, if there is one."""
        length = self.mean_length
        if length is None:
            return None
        if self.unit is not None:
            in_si = length * conversion(self.unit, DIMENSIONS["accel"])[0]
            is_gravity = abs(in_si / STANDARD_GRAVITY - 1) < _STATED_GRAVITY_TOLERANCE
            return self.unit if is_gravity else None
        return next(
            (u for u, g in GRAVITY_BY_UNIT.items() if abs(length / g - 1) < _GRAVITY_TOLERANCE),
            None,
        )


def groups(contents: Contents) -> list[Group]:
    """Return all groups of a recording, in the order of its tables."""
    recognised: list[Group] = []
    for table in contents.tables:
        if table.fault is None:
            recognised += _group_by_name(table, contents) or _group_without_names(table)
    return recognised


def _group_by_name(table: LogTable, contents: Contents) -> list[Group]:
    """Return the groups that are recognised by the names of their columns."""
    # The most specific name of the table or its file that contains a quantity.
    file = PurePosixPath(table.file or contents.path.name)
    titles = (table.name.rpartition("/")[2], table.name, file.name.partition(".")[0])
    context = next((title for title in titles if title and quantity_of_text(title)), "")
    together: dict[tuple[Quantity, str, bool], dict[str, tuple[LogColumn, Meaning]]] = {}
    for column in table.columns:
        if column.kind != "number":
            continue
        label = column.label or f"{context}[{column.source}]"
        meant = meaning(label, context)
        if meant is not None:
            if meant.quantity != "temperature":
                key = meant.quantity, meant.stem, meant.axis.isdecimal()
                together.setdefault(key, {}).setdefault(meant.axis, (column, meant))
            elif column.label or not advances(column.values):
                together["temperature", label, False] = {"": (column, meant)}
    result = []
    for (quantity, _, counted), axes in together.items():
        if counted:  # three numbered columns are axes, without a time before them
            columns = [axes[number] for number in sorted(axes, key=int)]
            if len(columns) == 4 and advances(columns[0][0].values):
                columns = columns[1:]
            axes = dict(zip(_AXES, columns, strict=True)) if len(columns) == 3 else {}
        if axes:
            result.append(_make_group(quantity, table, axes))
    return result + list(_find_roll_pitch_yaw(table, result))


def _make_group(
    quantity: Quantity, table: LogTable, axes: Mapping[str, tuple[LogColumn, Meaning]]
) -> Group:
    columns = {axis: axes[axis][0] for axis in sorted(axes)}
    meanings = [meaning for _, meaning in axes.values()]
    column = next(iter(columns.values()))
    beside = column.unit or ""
    unit = unit_of(beside, DIMENSIONS[quantity]) or meanings[0].unit
    same = {unit_of(c.unit or "", DIMENSIONS[quantity]) or m.unit for c, m in axes.values()} == {
        unit
    }
    written = beside or ", ".join(bracketed(column.label))
    rank = max(meaning.rank for meaning in meanings)
    if table.file_format.measured_by_name:
        rank = DERIVED if rank == DERIVED else PLAIN
    return Group(quantity, table, columns, unit if same else None, written, rank)


def _find_roll_pitch_yaw(table: LogTable, named: list[Group]) -> Iterator[Group]:
    """Yield the rates with the names p, q and r, if there is no other gyro."""
    if any(group.quantity == "gyro" for group in named):
        return
    by_name = {re.split(r"[\s(\[]", c.label)[0].lower(): c for c in table.columns}
    if {"p", "q", "r"} <= set(by_name):
        meanings = {
            axis: (by_name[name], meaning(by_name[name].label.lower().replace(name, f"w{axis}", 1)))
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
    if columns and advances(columns[0].values):
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
        quantity: Quantity = "accel" if is_accel else "gyro"
        guessed.append(replace(group, quantity=quantity, guessed=why))
    return guessed
