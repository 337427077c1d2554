"""Common code of the readers of array formats: find columns, convert blocks to batches.

``variable`` names an array of the file, and ``column`` a part of it:

- a number: the column of a matrix, counted from 1; the longer side of a matrix is time. A vector
  is a matrix of one column;
- a name: a field of an array of records, or a vector below a group or a structure
  (``variable: imu, column: wx`` is ``imu/wx``);
- without ``variable``: the name of a vector, or ``imu/wx``, or ``gyro[2]`` for the second column
  of the matrix ``gyro``.

A number as the column of time is a column of the same array.
"""

import re
from abc import abstractmethod
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.arrays.table import (
    DATE_KIND,
    NUMBER_KINDS,
    Column,
    Table,
    UnusableError,
)
from imubench_pipeline.readers.batch import Batch, LogFile, name_settings_file
from imubench_pipeline.readers.bounds import (
    MAX_ARRAYS,
    MAX_BLOCK_BYTES,
    MAX_CHUNK_BYTES,
    MAX_EXPANSION_RATIO,
    MAX_SEARCHED_COLUMNS,
    MIN_CHECKED_EXPANSION,
)
from imubench_pipeline.readers.file_format import (
    MAX_EXAMINED_RECORDS,
    MAX_SHOWN_VALUES,
    NOTHING_STATED,
    FileFormat,
    Kind,
    LogColumn,
    LogTable,
    format_first_numbers,
    join_first,
)
from imubench_pipeline.readers.stamps import Clock, format_date_of_stamp, format_nanoseconds
from imubench_pipeline.readers.stated_units import find_stated_unit
from imubench_pipeline.settings.sensor import TimeSource
from imubench_pipeline.tables.findings import RecordingError

_MAX_BLOCK_ROWS = 1 << 18
_TIME_KEY = "time"
_MATRIX_COLUMN = re.compile(r"(.+)\[(\d{1,9})\]")
_Place = tuple[Table, int]


class ArrayFile(LogFile):
    """A log file that consists of arrays or tables, in any format."""

    @abstractmethod
    def tables(self, stack: ExitStack) -> Iterable[Table]:
        """Open the file, which ``stack`` closes, and return its tables."""

    def batches(self) -> Iterator[Batch]:
        """Yield the records in the order of the file (see `LogFile.batches`)."""
        check_not_empty(self.path)
        time = None if self.log.time is None else ArrayTime(self, self.log.time)
        for block in self._blocks():
            # Values in a damaged file may overflow; infinities are counted as such.
            with np.errstate(over="ignore", invalid="ignore"):
                try:
                    seconds = None if time is None else time.seconds(block.pop(_TIME_KEY))
                except UnusableError as error:
                    raise RecordingError(f"{self.path.name}: {error}") from None
                columns = {
                    name: self.to_si(name, convert_to_float(raw)) for name, raw in block.items()
                }
            yield Batch(seconds, columns)

    def _blocks(self) -> Iterator[dict[str, NDArray[Any]]]:
        """Yield the blocks as written; exceptions of the libraries become `RecordingError`."""
        with explain_errors(self.path), ExitStack() as stack:
            yield from self._read(self._places(list(islice(self.tables(stack), MAX_ARRAYS + 1))))

    def _read(self, places: dict[str, _Place]) -> Iterator[dict[str, NDArray[Any]]]:
        tables = list(dict.fromkeys(table for table, _ in places.values()))
        lengths = {key: table.rows for key, (table, _) in places.items()}
        if len(set(lengths.values())) > 1:
            raise UnusableError(
                f"columns of unequal length: {lengths}; expected one length: cut the longer ones, "
                "or put columns of different length into separate files, and name the file of "
                "each channel with 'file:' in the sensor file"
            )
        if 0 in lengths.values():
            names = join_first(table.shown for table in tables)
            raise UnusableError(
                f"no rows in {names}; expected at least one: the log is empty, record it again"
            )
        wanted = {
            table: sorted({position for owner, position in places.values() if owner is table})
            for table in tables
        }
        chunk_bytes = sum(table.held_bytes(wanted[table]) for table in tables)
        if chunk_bytes > MAX_CHUNK_BYTES:
            raise UnusableError(
                f"the columns are in chunks of {chunk_bytes} bytes together; expected at most "
                f"{MAX_CHUNK_BYTES}: repack the file with smaller chunks"
            )
        row_bytes = sum(table.row_bytes(wanted[table]) for table in tables)
        rows = count_block_rows(row_bytes, MAX_BLOCK_BYTES)
        read, size = 0, self.path.stat().st_size
        most = max(MIN_CHECKED_EXPANSION, MAX_EXPANSION_RATIO * size)
        for parts in zip(*[table.blocks(wanted[table], rows) for table in tables], strict=True):
            of_table = dict(zip(tables, parts, strict=True))
            block = {
                key: of_table[table][wanted[table].index(position)]
                for key, (table, position) in places.items()
            }
            count = len(next(iter(block.values())))
            read += count
            if 8 * read * len(places) > most:
                raise UnusableError(
                    f"its {size} bytes expand to more than {read - count} records; expected at "
                    f"most {MAX_EXPANSION_RATIO} times the size of the file: check its content"
                )
            if count:
                yield block
        if read == 0:
            raise UnusableError("no rows; expected at least one: the log is empty, record it again")
        promised = tables[0].rows
        if promised is not None and read != promised:
            raise UnusableError(f"cut short: {read} of {promised} records; copy it again")

    def _places(self, tables: Sequence[Table]) -> dict[str, _Place]:
        by_name: dict[str, Table] = {}
        if len(tables) > MAX_ARRAYS:
            raise UnusableError(f"more than {MAX_ARRAYS} arrays; save only arrays of one sensor")
        for table in tables:
            if table.name in by_name:
                raise UnusableError(f"{table.shown} occurs twice; expected one array of that name")
            by_name[table.name] = table
        places = {}
        for key, source in self.sources.items():
            places[key] = _find_column(by_name, source.column, source.variable, key)
            _check_kind(places[key], key, NUMBER_KINDS)
            table, position = places[key]
            label = table.column(position).label or table.name.rpartition("/")[2]
            where = f"an attribute of {table.shown}"
            if unit := find_stated_unit(key, table.unit(position), where, label):
                self.units[key] = unit
        if (time := self.log.time) is not None:
            if time.date is not None:
                raise UnusableError(
                    "'date' of 'time' is for text logs; drop it: expected one column of time"
                )
            if time.format not in (None, "iso8601"):
                raise UnusableError(
                    f"found format {time.format!r} of 'time', which is for text logs; expected "
                    "'format: iso8601' for a column of dates, or 'unit' for numbers"
                )
            variables = {source.variable for source in self.sources.values()}
            if isinstance(time.column, int) and len(variables) > 1:
                names = join_first(str(name) for name in variables)
                raise UnusableError(
                    f"'time' is column {time.column}, but the channels are from several variables "
                    f"({names}); say which has the stamps, as in 'column: name' or "
                    f"'column: name[{time.column}]'"
                )
            variable = next(iter(variables)) if len(variables) == 1 else None
            if isinstance(time.column, str) and not (
                _make_address(time.column, variable) in by_name
                or _find_addressed(by_name, time.column, variable)
            ):
                variable = None
            place = _find_column(by_name, time.column, variable, _TIME_KEY)
            _check_kind(place, _TIME_KEY, NUMBER_KINDS if time.unit else DATE_KIND)
            places[_TIME_KEY] = place
        self.simulated = any(table.simulated for table, _ in places.values())
        return places


def count_block_rows(row_bytes: int, most: int) -> int:
    """Return how many records fit into ``most`` bytes; `UnusableError` if one record is larger."""
    if row_bytes > most:
        raise UnusableError(
            f"one record takes {row_bytes} bytes; expected at most {most}: store the columns of "
            "the log in a separate array"
        )
    return min(_MAX_BLOCK_ROWS, most // max(row_bytes, 1))


def check_not_empty(path: Path) -> None:
    """Raise `RecordingError` if a file cannot be opened or has no byte."""
    try:
        with path.open("rb") as file:
            empty = not file.read(1)
    except OSError as error:
        raise RecordingError(
            f"{path.name}: cannot be opened ({error.strerror}); expected a file"
        ) from None
    if empty:
        raise RecordingError(f"{path.name}: the file is empty; copy it again")


@contextmanager
def explain_errors(path: Path) -> Iterator[None]:
    """Convert all exceptions of the libraries about a file to `RecordingError`."""
    try:
        yield
    except UnusableError as error:
        raise RecordingError(f"{path.name}: {error}") from None
    # The libraries raise nearly every kind of exception on damaged files.
    except Exception as error:
        said = str(error).replace(f"{path.parent}/", "")
        reason = " ".join(said.split())[:300] or type(error).__name__
        raise RecordingError(
            f"{path.name}: corrupt data, or cut short ({reason}); copy it again"
        ) from error


def convert_to_float(raw: NDArray[Any]) -> NDArray[np.float64]:
    """Return a column as float64, with NaN where a value is missing."""
    return np.ma.filled(np.ma.asanyarray(raw, np.float64), np.nan)


def _find_column(
    tables: dict[str, Table], column: str | int, variable: str | None, key: str
) -> _Place:
    """Return table and position of the only matching column, else raise `UnusableError`."""
    if isinstance(column, int):
        return _take_numbered(_find_table(tables, variable, key), column, key)
    matches = _find_addressed(tables, column, variable)
    if len(matches) == 1:
        return matches[0]
    if matches:
        names = join_first(table.shown for table, _ in matches)
        if len({table for table, _ in matches}) == 1:
            raise UnusableError(
                f"column {column!r} for {key} occurs twice in {names}; give its position instead, "
                "as a number"
            )
        raise UnusableError(
            f"column {column!r} for {key} is in several variables ({names}); name one of them with "
            f"'variable:', or as in 'column: {matches[0][0].name}/{column}'"
        )
    address = _make_address(column, variable)
    if address in tables:
        table = _check_usable(tables[address], key)
        if table.width > 1:
            raise UnusableError(
                f"{address!r} for {key} is a matrix of {table.width} columns; name one of them, "
                f"as in 'column: 2, variable: {address}'"
            )
        return table, 0
    if variable is None and (match := _MATRIX_COLUMN.fullmatch(column)) and match[1] in tables:
        return _take_numbered(_check_usable(tables[match[1]], key), int(match[2]), key)
    if variable is not None:
        table = _find_table(tables, variable, key)
        has = join_first(table.labels) or f"{table.width} columns without names: give a number"
        raise UnusableError(
            f"no column {column!r} for {key}; {table.shown} has {has}; correct 'column' of {key} "
            f"in {name_settings_file(key)}"
        )
    raise UnusableError(
        f"no variable or column {column!r} for {key}; the file has "
        f"{_describe_contents(tables, labels=True)}; correct 'column' of {key} in "
        f"{name_settings_file(key)}"
    )


def _make_address(column: str, variable: str | None) -> str:
    parts = [column] if variable is None else [variable, column]
    return "/".join(part.strip("/") for part in parts)


def _find_addressed(tables: dict[str, Table], column: str, variable: str | None) -> list[_Place]:
    address = _make_address(column, variable)
    return [
        (table, position)
        for table in tables.values()
        if table.fault is None
        for position, label in enumerate(table.labels)
        if f"{table.name}/{label}" == address or (variable is None and label == column)
    ]


def _find_table(tables: dict[str, Table], variable: str | None, key: str) -> Table:
    if variable is not None:
        name = variable.strip("/")
        if name and name in tables:
            return _check_usable(tables[name], key)
        if list(tables) == [""]:
            raise UnusableError(
                f"'variable' of {key} is {variable!r}, but the file has one array without a name; "
                "drop 'variable:'"
            )
        raise UnusableError(
            f"no variable {variable!r} for {key}; the file has {_describe_contents(tables)}; "
            f"correct 'variable' of {key} in {name_settings_file(key)}"
        )
    usable = [table for table in tables.values() if table.fault is None]
    # Single values, such as the rate, are not counted.
    usable = [table for table in usable if (table.rows, table.width) != (1, 1)] or usable
    if len(tables) == 1:
        return _check_usable(next(iter(tables.values())), key)
    if not usable:
        raise UnusableError(
            f"no numeric array for {key}; the file has {_describe_contents(tables)}; save numbers"
        )
    if len(usable) > 1:
        raise UnusableError(
            f"several variables ({join_first(table.shown for table in usable)}); name the one of "
            f"{key} with 'variable:'"
        )
    return usable[0]


def _take_numbered(table: Table, column: int, key: str) -> _Place:
    if column > table.width:
        samples = "" if table.rows is None else f" of {table.rows} samples"
        names = f" ({join_first(table.labels)})" if table.labels else ""
        raise UnusableError(
            f"no column {column} for {key}; {table.shown} has {table.width} columns{samples}"
            f"{names}; correct 'column' of {key} in {name_settings_file(key)}"
        )
    return table, column - 1


def _check_usable(table: Table, key: str) -> Table:
    if table.fault is not None:
        raise UnusableError(f"{table.shown} for {key} {table.fault}")
    return table


def _check_kind(place: _Place, key: str, expected: str) -> None:
    table, position = place
    column: Column = table.column(position)
    if column.kind in expected:
        return
    where = table.shown
    if column.label or table.width > 1:
        where = f"column {column.label or position + 1!r} of {where}"
    if expected == DATE_KIND:
        mend = "give 'unit' of 'time' (s, ms, us, ns), or store dates"
        raise UnusableError(f"{where} for {key} holds {column.holds}; expected dates: {mend}")
    mend = "store the column as numbers"
    if key == _TIME_KEY and column.kind in DATE_KIND:
        mend = "give 'format: iso8601' of 'time' in the sensor file"
    raise UnusableError(f"{where} for {key} holds {column.holds}; expected numbers: {mend}")


def _describe_contents(tables: dict[str, Table], labels: bool = False) -> str:
    """Describe the arrays of a file and, if ``labels``, their columns, or why none can be used."""
    usable = [table for table in tables.values() if table.fault is None]
    has = [table.name for table in usable if table.name]
    if labels:
        has += [f"column {label}" for table in usable for label in table.labels]
    if not has:
        has = [f"{table.width} columns without names" for table in usable]
    return (
        join_first(has)
        or join_first(f"{table.shown}, which {table.fault}" for table in tables.values())
        or "none"
    )


_MAX_TABLES = 1000
_MAX_EXAMINED_BYTES = 1 << 24
_RATE_NAMES = frozenset(
    ("fs", "rate", "sr", "samplerate", "samplingrate", "samplefreq", "samplingfreq", "freq",
     "samplefrequency", "samplingfrequency", "frequency", "odr")
)  # fmt: skip
_MAX_RATE = 1e6


def list_tables(path: Path, file_format: FileFormat) -> list[LogTable]:
    """Return the first thousand tables of a file; raise `RecordingError` if it cannot be read."""
    check_not_empty(path)
    file = file_format.load().log_file(path, NOTHING_STATED, {})
    assert isinstance(file, ArrayFile)  # the readers of these files
    with explain_errors(path), ExitStack() as stack:
        tables = islice(file.tables(stack), _MAX_TABLES)
        described = [_describe_table(path, file_format, table) for table in tables]
    rates = set()
    for table in described:
        # A single value with the name of a rate.
        name = re.sub(r"[\W_\d]+", "", table.name.rpartition("/")[2]).lower().removesuffix("hz")
        if table.rows == len(table.columns) == 1 and name in _RATE_NAMES:
            rates |= {float(value) for value in table.columns[0].values if 0 < value < _MAX_RATE}
    if len(rates) == 1:
        (rate,) = rates
        described = [replace(table, rate=rate) for table in described]
    # Combine vectors of equal length in the same group into one table.
    combined: dict[object, LogTable] = {}
    for number, table in enumerate(described):
        alone = table.fault or table.variable or not table.name or table.rows in (None, 1)
        above = table.name.rpartition("/")[0]
        key = number if alone else (above, table.rows)
        if key in combined:
            first = combined[key]
            columns = (*first.columns, *table.columns)
            combined[key] = replace(
                first, name=above, columns=columns, about=f"{len(columns)} vectors of {table.rows}"
            )
        else:
            combined[key] = table
    return list(combined.values())


def _describe_table(path: Path, file_format: FileFormat, table: Table) -> LogTable:
    if table.fault is not None:
        return LogTable(file_format, table.name, fault=table.fault)
    described = [table.column(place) for place in range(min(table.width, MAX_SEARCHED_COLUMNS))]
    usable = [n for n, column in enumerate(described) if column.kind in NUMBER_KINDS + DATE_KIND]
    try:
        with explain_errors(path):
            values = _read_first_records(table, usable)
            units = [table.unit(place) for place in range(len(described))]
    except RecordingError as error:
        return LogTable(file_format, table.name, fault=str(error).removeprefix(f"{path.name}: "))
    kinds: dict[str, Kind] = {DATE_KIND: "date", **dict.fromkeys(NUMBER_KINDS, "number")}
    columns = []
    labels = Counter(table.labels)
    for place, column in enumerate(described):
        label = table.labels[place] if table.labels else ""
        is_unique = label.isprintable() and labels[label] == 1
        source: str | int = label if label and is_unique else place + 1  # in its table
        address = source  # in the whole file
        if table.name and table.labels:
            address = f"{table.name}/{label}"
        elif table.name and table.width == 1:
            source = address = table.name
        elif table.name:
            address = f"{table.name}[{place + 1}]"
        raw = values.get(place, np.empty(0))
        dated = column.kind == DATE_KIND
        first = tuple(map(str, raw[:MAX_SHOWN_VALUES])) if dated else format_first_numbers(raw)
        if dated:
            dates = raw.astype("M8[ns]")
            raw = np.where(np.isnat(dates), np.nan, dates.astype(np.int64).astype(np.float64))
        columns.append(
            LogColumn(
                source,
                column.label or (table.name if table.width == 1 else ""),
                kinds.get(column.kind, "other"),
                first,
                convert_to_float(raw),
                units[place],
                ("iso8601",) if dated else (),
                address,
            )
        )
    whole = not table.labels and table.width == 1 and table.name != ""
    variable = None if whole or not table.name else table.name
    about = "" if table.rows is None else f"{table.rows} x {table.width}"
    return LogTable(file_format, table.name, tuple(columns), variable, rows=table.rows, about=about)


def _read_first_records(table: Table, places: Sequence[int]) -> dict[int, NDArray[Any]]:
    if not places:
        return {}
    rows = min(MAX_EXAMINED_RECORDS, count_block_rows(table.row_bytes(places), _MAX_EXAMINED_BYTES))
    for block in table.blocks(places, rows):
        if len(block[0]):
            return {place: values[:rows] for place, values in zip(places, block, strict=True)}
    return {}


_NANOSECONDS_PER_UNIT = {"D": 86_400 * 10**9, "h": 3_600 * 10**9, "m": 60 * 10**9, "s": 10**9,
                         "ms": 10**6, "us": 10**3, "ns": 1}  # fmt: skip
_MAX_INT64 = 2**63 - 1


class ArrayTime:
    """Converts the stamps of an array to seconds; exact for integers and dates."""

    def __init__(self, file: LogFile, source: TimeSource) -> None:
        self._source = source
        self._clock = Clock(file, source.wraps, self._started)
        self._dated = False

    def seconds(self, raw: NDArray[Any]) -> NDArray[np.float64]:
        """Return the time since the first stamp of the file, s; NaN where the stamp is missing."""
        missing = np.ma.getmaskarray(raw).copy()
        values = np.ma.getdata(raw)
        self._dated = values.dtype.kind == DATE_KIND
        if self._dated:
            missing |= np.isnat(values)
            unit, count = np.datetime_data(values.dtype)
            if unit not in _NANOSECONDS_PER_UNIT:
                raise UnusableError(
                    f"time stamps are dates in units of {unit}; expected "
                    f"{', '.join(_NANOSECONDS_PER_UNIT)}: convert them"
                )
            factor = _NANOSECONDS_PER_UNIT[unit] * count
            whole = values.astype(f"M8[{count}{unit}]", copy=False).view(np.int64)
            limit = _MAX_INT64 // factor
            if np.any(~missing & ((whole > limit) | (whole < -limit))):
                raise UnusableError(
                    "time stamps are dates before 1678 or after 2262, expected the time of a log; "
                    "correct 'column' of 'time' in the sensor file, or copy the file again"
                )
            stamps = np.where(missing, 0, whole) * np.int64(factor)
        elif values.dtype.kind == "f":
            stamps = values.astype(np.float64)
            missing |= ~np.isfinite(stamps)
        else:
            # In int64 the differences of uint64 stamps are correct, and may be negative.
            stamps = values.astype(np.int64)
        return self._clock.seconds(stamps, ~missing)

    def _started(self, first: Any) -> str | None:
        return (
            format_nanoseconds(first) if self._dated else format_date_of_stamp(first, self._source)
        )
