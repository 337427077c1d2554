"""Rows of tables as frozen dataclasses, from which columns, schema and documentation derive.

A class is declared with `table`; each field is a column, with its meaning and unit:

    @table("recordings")
    class RecordingRow(TableRow):
        rate: Annotated[float | None, Column("sampling rate used", "Hz")] = None

The type of a field sets the type of its column; a column that may be null has a type with ``None``.
"""

from __future__ import annotations

import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cache
from types import ModuleType
from typing import (
    Annotated,
    Any,
    ClassVar,
    Self,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

import pyarrow as pa

TYPES: Mapping[type, pa.DataType] = {
    str: pa.string(),
    float: pa.float64(),
    int: pa.int64(),
    bool: pa.bool_(),
}
"""Arrow type of each type of a field."""


@dataclass(frozen=True, slots=True)
class Column:
    """What a column means; ``unit`` is ``-`` for a text, a count or a ratio.

    ``single``: single precision, for columns of very many numbers.
    """

    meaning: str
    unit: str = "-"
    single: bool = False


# Columns that several tables have.
LowerLimit = Annotated[float | None, Column("lower 95 % limit", "as in unit")]
UpperLimit = Annotated[float | None, Column("upper 95 % limit", "as in unit")]
Estimate = Annotated[float | None, Column("estimate; null where status says why", "as in unit")]
Unit = Annotated[str, Column("SI unit")]
EstimateUnit = Annotated[str, Column("SI unit of value, lower and upper; degC for T_0")]
EstimateReason = Annotated[str | None, Column("why there is no plain value")]
FittedValue = Annotated[
    float | None, Column("what the model has where there is no value; no estimate", "as in unit")
]
EstimateStatus = Annotated[
    str, Column("ok, doubtful, not_shown, at_bound, not_identified or absent")
]
TurnedGyro = Annotated[str, Column("the gyro that was turned")]


@dataclass(frozen=True, slots=True)
class TypedColumn:
    """A column of a table, with its name and Arrow type."""

    name: str
    type: pa.DataType
    unit: str
    meaning: str
    required: bool = True


class TableRow(Mapping[str, Any]):
    """A row of a table; its columns are its attributes."""

    __slots__ = ()
    table: ClassVar[str]

    def __getitem__(self, name: str) -> Any:
        try:
            return getattr(self, name)
        except AttributeError:
            raise KeyError(name) from None

    def __iter__(self) -> Iterator[str]:
        return iter(names_of(type(self)))

    def __len__(self) -> int:
        return len(names_of(type(self)))

    def __or__(self, other: Mapping[str, Any]) -> dict[str, Any]:
        return {**self, **other}

    @classmethod
    def rows_of(cls, content: pa.Table) -> list[Self]:
        """Return the rows of an Arrow table that has the columns of this class."""
        names = names_of(cls)
        columns = [content.column(name).to_pylist() for name in names]
        return [
            cls(**dict(zip(names, values, strict=True))) for values in zip(*columns, strict=True)
        ]


R = TypeVar("R", bound=TableRow)


@dataclass_transform(frozen_default=True, kw_only_default=True, eq_default=False)
def table(name: str) -> Callable[[type[R]], type[R]]:
    """Return a decorator that makes a class the rows of a table."""

    def declare(cls: type[R]) -> type[R]:
        made = row(cls)
        made.table = name
        return made

    return declare


@dataclass_transform(frozen_default=True, kw_only_default=True, eq_default=False)
def row(cls: type[R]) -> type[R]:
    """Make a class a part of the rows of tables; it is declared as a dataclass."""
    # Rows are equal as mappings are.
    return dataclass(frozen=True, slots=True, kw_only=True, eq=False)(cls)


def rows_in(module: ModuleType) -> list[type[TableRow]]:
    """Return the classes of rows of tables that a module declares."""
    found = [value for value in vars(module).values() if isinstance(value, type)]
    return [cls for cls in found if issubclass(cls, TableRow) and hasattr(cls, "table")]


@cache
def names_of(cls: type[TableRow]) -> tuple[str, ...]:
    """Return the columns of a table by the class of its rows."""
    return tuple(field.name for field in fields(cls))  # type: ignore[arg-type]  # a dataclass


@cache
def columns_of(cls: type[TableRow]) -> tuple[TypedColumn, ...]:
    """Return the columns of a table by the class of its rows, with their Arrow types."""
    hints = get_type_hints(cls, include_extras=True)
    return tuple(_typed(name, hints[name]) for name in names_of(cls))


def _typed(name: str, hint: Any) -> TypedColumn:
    assert get_origin(hint) is Annotated, name
    kind, column = get_args(hint)
    options = get_args(kind) if get_origin(kind) in (Union, types.UnionType) else (kind,)
    (plain,) = (option for option in options if option is not types.NoneType)
    arrow = pa.float32() if column.single else TYPES[plain]
    return TypedColumn(name, arrow, column.unit, column.meaning, len(options) == 1)


@row
class SensorRow(TableRow):
    """What names a sensor in a table."""

    sensor: Annotated[str, Column("name of the sensor file")]


@row
class OfRecordingRow(SensorRow):
    """What names a recording in a table."""

    recording: Annotated[str, Column("name of the recording")]


@row
class ChannelRow(OfRecordingRow):
    """What names a channel in a table."""

    channel: Annotated[str, Column("axis and quantity, gyro_x to accel_z")]
