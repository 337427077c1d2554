"""Rows of tables as frozen dataclasses, from which columns, schema and documentation derive.

A class is declared with `table`; each field is a column, with its meaning, its unit (``-`` by
default: a text, a count or a ratio) and, where it is not the default of the type, its Arrow type:

    @table("recordings")
    class RecordingRow(TableRow):
        rate: Annotated[float | None, "sampling rate used", "Hz"] = None

The type of a field sets the type of its column; a column that may be null has a type with ``None``.
A ``Literal`` is a category (dictionary-encoded, other values are refused), a tuple a list, and a
frozen dataclass a struct.
"""

import types
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from types import ModuleType
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    ClassVar,
    Literal,
    Self,
    TypeVar,
    Union,
    dataclass_transform,
    get_args,
    get_origin,
    get_type_hints,
)

import numpy as np
import pyarrow as pa

from imubench_pipeline.model.states import Measured, SourceCode, SourcePath, Status

TYPES: Mapping[type, pa.DataType] = {
    str: pa.string(),
    float: pa.float64(),
    int: pa.int64(),
    bool: pa.bool_(),
}
"""Arrow type of each plain type of a field."""

CATEGORY = pa.dictionary(pa.int32(), pa.string())
"""Arrow type of a column with one of a few values."""


CHANNEL_KEY = ("sensor", "recording", "channel")
"""Columns that identify a channel."""

# Columns that several tables have.
LowerLimit = Annotated[float | None, "lower 95 % limit", "as in unit"]
UpperLimit = Annotated[float | None, "upper 95 % limit", "as in unit"]
Estimate = Annotated[float | None, "estimate; null: see status", "as in unit"]
Unit = Annotated[str, "SI unit"]
EstimateUnit = Annotated[str, "SI unit of value, lower and upper; degC for T_0"]
EstimateReason = Annotated[str | None, "reason for a missing or doubtful value"]
FittedValue = Annotated[
    float | None, "value in the fitted model if there is no estimate", "as in unit"
]
SourceColumn = Annotated[SourceCode, "total, or the source of the error"]
SourceQuantity = Annotated[Measured | None, "sensor of the source"]
SourceThrough = Annotated[SourcePath | None, "null: the source acts by the motion"]
SourceTime = Annotated[float | None, "correlation time of a source GM", "s"]
SourceFrequency = Annotated[float | None, "of a source line", "Hz"]
EstimateStatus = Annotated[Status, "whether there is a value, and its quality"]


@dataclass(frozen=True, slots=True)
class TypedColumn:
    """A column of a table, with its name and Arrow type."""

    name: str
    type: pa.DataType
    unit: str
    meaning: str
    required: bool = True
    values: tuple[str, ...] = ()
    """All values of a category; empty for other columns."""
    parts: type | None = None
    """The dataclass of the elements of a list of structs."""

    @property
    def is_list(self) -> bool:
        """Whether the values are lists."""
        return bool(pa.types.is_list(self.type))

    def read(self, content: pa.ChunkedArray) -> list[Any]:
        """Return the values of this column, from an Arrow table, in the types of the rows."""
        # The general `to_pylist` makes an object of Arrow for each value.
        if pa.types.is_floating(content.type):
            values: list[Any] = content.to_numpy().tolist()
            for place in np.flatnonzero(content.is_null().to_numpy()) if content.null_count else ():
                values[place] = None
            return values
        if pa.types.is_dictionary(content.type):
            values = []
            for chunk in content.chunks:
                names = [*chunk.dictionary.to_pylist(), None]
                values += [names[code] for code in chunk.indices.fill_null(-1).to_numpy().tolist()]
            return values
        if self.is_list and not any(len(chunk.flatten()) for chunk in content.chunks):
            return [()] * len(content)
        return self.from_arrow(content.to_pylist())

    def from_arrow(self, values: list[Any]) -> list[Any]:
        """Convert Python values from Arrow: lists become tuples, and structs dataclasses."""
        if not self.is_list:
            return values
        if self.parts is None:
            return [tuple(value or ()) for value in values]
        return [tuple(_make_struct(self.parts, part) for part in value or ()) for value in values]


if TYPE_CHECKING:

    class _Attributes:
        """Rows have only attributes for mypy, so that it finds each misspelt column."""

else:
    _Attributes = Mapping  # templates and tests may also take a column by its name


class TableRow(_Attributes):
    """A row of a table; its columns are its attributes."""

    __slots__ = ()
    table: ClassVar[str]
    key: ClassVar[tuple[str, ...]]  # columns that identify a row; empty: not declared

    def columns(self) -> dict[str, object]:
        """Return the values by the names of the columns."""
        return {name: getattr(self, name) for name in names_of(type(self))}

    if not TYPE_CHECKING:

        def __getitem__(self, name):  # noqa: ANN001, ANN204 - not for typed code
            if name in names_of(type(self)):
                return getattr(self, name)
            raise KeyError(name)

        def __iter__(self):  # noqa: ANN204 - not for typed code
            return iter(names_of(type(self)))

        def __len__(self):  # noqa: ANN204 - not for typed code
            return len(names_of(type(self)))

        def __or__(self, other):  # noqa: ANN001, ANN204 - not for typed code
            return {**self, **other}

    @classmethod
    def taken_from(cls, source: object, /, **columns: object) -> Self:
        """Return a row with ``columns``; the other columns are attributes of ``source``."""
        names = [name for name in names_of(cls) if hasattr(source, name)]
        return cls(**{**{name: getattr(source, name) for name in names}, **columns})

    @classmethod
    def rows_of(cls, content: pa.Table) -> list[Self]:
        """Return the rows of an Arrow table that has the columns of this class."""
        rows = [cls.__new__(cls) for _ in range(content.num_rows)]
        for column in columns_of(cls):
            # One assignment for a whole column is many times faster than a call for each row.
            store = getattr(cls, column.name).__set__
            deque(map(store, rows, column.read(content.column(column.name))), maxlen=0)
        return rows


R = TypeVar("R", bound=TableRow)

AnyRow = TableRow | Mapping[str, Any]
"""A row of a table: typed, or a mapping of its columns."""


@dataclass_transform(frozen_default=True, kw_only_default=True, eq_default=False)
def table(name: str, key: tuple[str, ...] = ()) -> Callable[[type[R]], type[R]]:
    """Return a decorator that declares a class of rows; the columns ``key`` identify a row."""

    def declare(cls: type[R]) -> type[R]:
        made = row(cls)
        made.table, made.key = name, key
        made.__doc__ = f"A row of the table ``{name}``."
        return made

    return declare


@dataclass_transform(frozen_default=True, kw_only_default=True, eq_default=False)
def row(cls: type[R]) -> type[R]:
    """Make a class of columns a frozen dataclass, without declaring a table of its own."""
    # Rows are equal as mappings are.
    return dataclass(frozen=True, slots=True, kw_only=True, eq=False)(cls)


def rows_in(module: ModuleType) -> list[type[TableRow]]:
    """Return the classes of rows of tables that a module declares."""
    found = [value for value in vars(module).values() if isinstance(value, type)]
    return [cls for cls in found if issubclass(cls, TableRow) and hasattr(cls, "table")]


_NAMES: dict[type, tuple[str, ...]] = {}
_COLUMNS: dict[type, tuple[TypedColumn, ...]] = {}


def names_of(cls: type[TableRow]) -> tuple[str, ...]:
    """Return the names of the columns of a class of rows."""
    if cls not in _NAMES:
        _NAMES[cls] = tuple(field.name for field in fields(cls))  # type: ignore[arg-type]  # a dataclass
    return _NAMES[cls]


def columns_of(cls: type[TableRow]) -> tuple[TypedColumn, ...]:
    """Return the columns of a class of rows, with their Arrow types."""
    if cls not in _COLUMNS:
        hints = get_type_hints(cls, include_extras=True)
        _COLUMNS[cls] = tuple(_typed(name, hints[name]) for name in names_of(cls))
    return _COLUMNS[cls]


def _typed(name: str, hint: Any) -> TypedColumn:
    assert get_origin(hint) is Annotated, name
    kind, meaning, *stated = get_args(hint)
    plain = _without_none(kind)
    values = get_args(plain) if get_origin(plain) is Literal else ()
    element = get_args(plain)[0] if get_origin(plain) is tuple else None
    unit = stated[0] if stated else "-"
    arrow = stated[1] if len(stated) > 1 else arrow_type(plain)
    parts = element if is_dataclass(element) else None
    return TypedColumn(name, arrow, unit, meaning, plain is kind, values, parts)


def arrow_type(kind: Any) -> pa.DataType:
    """Return the Arrow type for a Python type: plain, ``Literal``, tuple or dataclass."""
    if get_origin(kind) is Literal:
        return CATEGORY
    if get_origin(kind) is tuple:
        element = arrow_type(get_args(kind)[0])
        return pa.list_(pa.string() if element == CATEGORY else element)
    if is_dataclass(kind):
        hints = get_type_hints(kind)
        return pa.struct([(name, arrow_type(_without_none(hint))) for name, hint in hints.items()])
    return TYPES[kind]


def _without_none(hint: Any) -> Any:
    options = get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)
    return next(option for option in options if option is not types.NoneType)


def _make_struct(kind: type, values: Mapping[str, Any]) -> Any:
    lists = {name: tuple(value) for name, value in values.items() if isinstance(value, list)}
    return kind(**{**values, **lists})


@row
class SensorRow(TableRow):
    """Key columns of a sensor in a table."""

    sensor: Annotated[str, "name of the sensor file"]


@row
class OfRecordingRow(SensorRow):
    """Key columns of a recording in a table."""

    recording: Annotated[str, "name of the recording"]


@row
class ChannelRow(OfRecordingRow):
    """Key columns of a channel in a table."""

    channel: Annotated[str, "channel, gyro_x to accel_z"]
