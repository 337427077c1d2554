"""The columns of a log put together: the axes of one gyro, of one accelerometer, a temperature."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
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
GRAVITIES: Mapping[str, float] = {"g": 1.0, "m/s^2": STANDARD_GRAVITY, "mg": 1000.0}
"""The length of gravity in each unit that is guessed from it."""

_NEAR, _STATED_NEAR = 0.1, 0.2
_NAMELESS = 0.05
_TELLING = 40
"""Records of all axes that are the same, from which a sensor was not read."""


@dataclass(frozen=True, eq=False)
class Group:
    """The axes of one sensor, or a temperature."""

    quantity: Quantity
    table: LogTable
    columns: dict[str, LogColumn]
    """By axis; of a temperature by an empty text."""
    unit: str | None
    """The unit that the file states."""
    written: str
    """What the file says where a unit is expected and none is understood."""
    rank: int
    """See `imubench_pipeline.readers.inspection.names.Meaning`."""
    guessed: str = ""
    """Why these columns are taken for it, where no name says so."""

    @property
    def names(self) -> str:
        """What the file calls the columns."""
        return ", ".join(
            column.label or f"column {column.source}" for column in self.columns.values()
        )

    @property
    def mean_length(self) -> float | None:
        """The length of the mean vector, as written; None where an axis is missing."""
        if sorted(self.columns) != list(_AXES):
            return None
        means = [_mean(column) for column in self.columns.values()]
        return None if None in means else float(np.linalg.norm(np.array(means, np.float64)))

    @property
    def constant(self) -> bool:
        """Whether no axis ever changes in the first records: fields that nothing was put into."""
        axes = [column.values[np.isfinite(column.values)] for column in self.columns.values()]
        return all(values.size >= _TELLING and np.ptp(values) == 0.0 for values in axes)

    @property
    def gravity_unit(self) -> str | None:
        """The unit in which the mean is as long as gravity; the stated one, if that is right."""
        length = self.mean_length
        if length is None:
            return None
        if self.unit is not None:
            in_si = length * conversion(self.unit, DIMENSIONS["accel"])[0]
            return self.unit if abs(in_si / STANDARD_GRAVITY - 1) < _STATED_NEAR else None
        return next((u for u, g in GRAVITIES.items() if abs(length / g - 1) < _NEAR), None)


def groups(contents: Contents) -> list[Group]:
    """Return all groups of a recording, in the order of its tables."""
    recognised: list[Group] = []
    for table in contents.tables:
        if table.fault is None:
            recognised += _named(table, contents) or _nameless(table)
    return recognised


def _named(table: LogTable, contents: Contents) -> list[Group]:
    """Return the groups that the names of the columns tell."""
    context = _context(table, contents)
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
        placed = _counted_axes(axes) if counted else axes
        if placed:
            result.append(_group(quantity, table, placed))
    return result + list(_roll_pitch_yaw(table, result))


def _context(table: LogTable, contents: Contents) -> str:
    """Return the nearest of the names about a table that says a quantity."""
    file = PurePosixPath(table.file or contents.path.name)
    names = (table.name.rpartition("/")[2], table.name, file.name.partition(".")[0])
    return next((name for name in names if name and quantity_of_text(name)), "")


def _counted_axes(
    axes: Mapping[str, tuple[LogColumn, Meaning]],
) -> dict[str, tuple[LogColumn, Meaning]]:
    """Return three axes that are counted, without a time before them; none if they are not."""
    columns = [axes[number] for number in sorted(axes, key=int)]
    if len(columns) == 4 and advances(columns[0][0].values):
        columns = columns[1:]
    return dict(zip(_AXES, columns, strict=True)) if len(columns) == 3 else {}


def _group(
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


def _roll_pitch_yaw(table: LogTable, named: list[Group]) -> Iterator[Group]:
    """Yield the rates that are called p, q and r, where no other gyro is there."""
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
            group = _group("gyro", table, axes)
            yield Group("gyro", table, group.columns, group.unit, group.written, WEAK,
                        "guessed from the names p, q and r")  # fmt: skip


def _nameless(table: LogTable) -> list[Group]:
    """Return gyro and accelerometer of columns without names, where gravity tells them apart."""
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
    heavy = [
        n
        for n, length in enumerate(lengths)
        if length and any(abs(length / gravity - 1) < _NAMELESS for gravity in GRAVITIES.values())
    ]
    if len(threes) not in (1, 2) or len(heavy) != 1:
        return []
    guessed = []
    for n, group in enumerate(threes):
        is_accel = n == heavy[0]
        why = "no names" if is_accel else "no names: guessed by its place"
        guessed.append(
            Group("accel" if is_accel else "gyro", table, group.columns, None, "", WEAK, why)
        )
    return guessed


def _mean(column: LogColumn) -> float | None:
    values = column.values[np.isfinite(column.values)]
    return float(values.mean()) if len(values) else None
