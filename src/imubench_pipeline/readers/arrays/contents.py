"""What a file of arrays holds: its tables, and the first records of each."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.arrays.file import (
    ArrayFile,
    check_not_empty,
    explained,
    numbers,
    rows_of_block,
)
from imubench_pipeline.readers.arrays.table import DATES, NUMBERS, Table
from imubench_pipeline.readers.file_format import (
    FIRST,
    NOTHING_STATED,
    ROWS,
    FileFormat,
    Kind,
    LogColumn,
    LogTable,
    shown,
)
from imubench_pipeline.tables.findings import RecordingError

_MOST_TABLES, _MOST_COLUMNS = 1000, 1000
_MOST_BYTES = 1 << 24
_RATES = frozenset(
    ("fs", "rate", "sr", "samplerate", "samplingrate", "samplefreq", "samplingfreq", "freq",
     "samplefrequency", "samplingfrequency", "frequency", "odr")
)  # fmt: skip
_HIGHEST_RATE = 1e6


def tables(path: Path, file_format: FileFormat) -> list[LogTable]:
    """Return the tables of a file, as far as the first thousand.

    Raises
    ------
    RecordingError
        If it cannot be read.
    """
    check_not_empty(path)
    file = file_format.code().log_file(path, NOTHING_STATED, {})
    assert isinstance(file, ArrayFile)  # the readers of these files
    with explained(path), ExitStack() as stack:
        tables = list(islice(file.tables(stack), _MOST_TABLES))
        described = [_table(path, file_format, table) for table in tables]
    rates = {rate for table in described if (rate := _rate(table)) is not None}
    if len(rates) == 1:
        (rate,) = rates
        described = [replace(table, rate=rate) for table in described]
    return _together(described)


def _rate(table: LogTable) -> float | None:
    """Return the rate that a single value is, by its name."""
    name = re.sub(r"[\W_\d]+", "", table.name.rpartition("/")[2]).lower().removesuffix("hz")
    if table.rows != 1 or len(table.columns) != 1 or name not in _RATES:
        return None
    values = table.columns[0].values
    return float(values[0]) if len(values) and 0 < values[0] < _HIGHEST_RATE else None


def _together(described: Sequence[LogTable]) -> list[LogTable]:
    """Put vectors of one length, side by side in the file, into one table."""
    tables: dict[object, LogTable] = {}
    for number, table in enumerate(described):
        alone = table.fault or table.variable or not table.name or table.rows in (None, 1)
        above = table.name.rpartition("/")[0]
        key = number if alone else (above, table.rows)
        if key in tables:
            first = tables[key]
            columns = (*first.columns, *table.columns)
            tables[key] = replace(
                first, name=above, columns=columns, about=f"{len(columns)} vectors of {table.rows}"
            )
        else:
            tables[key] = table
    return list(tables.values())


def _table(path: Path, file_format: FileFormat, table: Table) -> LogTable:
    if table.fault is not None:
        return LogTable(file_format, table.name, fault=table.fault)
    described = [table.column(place) for place in range(min(table.width, _MOST_COLUMNS))]
    usable = [n for n, column in enumerate(described) if column.kind in NUMBERS + DATES]
    try:
        with explained(path):
            values = _first(table, usable)
            units = [table.unit(place) for place in range(len(described))]
    except RecordingError as error:
        return LogTable(file_format, table.name, fault=str(error).removeprefix(f"{path.name}: "))
    kinds: dict[str, Kind] = {DATES: "date", **dict.fromkeys(NUMBERS, "number")}
    columns = []
    labels = Counter(table.labels)
    for place, column in enumerate(described):
        source, address = _called(table, place, labels)
        raw = values.get(place, np.empty(0))
        dated = column.kind == DATES
        columns.append(
            LogColumn(
                source,
                column.label or (table.name if table.width == 1 else ""),
                kinds.get(column.kind, "other"),
                tuple(map(str, raw[:FIRST])) if dated else shown(raw),
                _nanoseconds(raw) if dated else numbers(raw),
                units[place],
                ("iso8601",) if dated else (),
                address,
            )
        )
    whole = not table.labels and table.width == 1 and table.name != ""
    variable = None if whole or not table.name else table.name
    about = "" if table.rows is None else f"{table.rows} x {table.width}"
    return LogTable(file_format, table.name, tuple(columns), variable, rows=table.rows, about=about)


def _called(table: Table, place: int, labels: Mapping[str, int]) -> tuple[str | int, str | int]:
    """Return what a column is called, in its table and in the whole file."""
    label = table.labels[place] if table.labels else ""
    if label and (not label.isprintable() or labels[label] > 1):
        label = ""
    if label:
        return label, f"{table.name}/{label}" if table.name else label
    if not table.name:
        return place + 1, place + 1
    if table.labels:
        return place + 1, f"{table.name}/{table.labels[place]}"
    return (
        (table.name, table.name) if table.width == 1 else (place + 1, f"{table.name}[{place + 1}]")
    )


def _first(table: Table, places: Sequence[int]) -> dict[int, NDArray[Any]]:
    """Return the first records of some columns, by position."""
    if not places:
        return {}
    rows = min(ROWS, rows_of_block(table.row_bytes(places), _MOST_BYTES))
    for block in table.blocks(places, rows):
        if len(block[0]):
            return {place: values[:rows] for place, values in zip(places, block, strict=True)}
    return {}


def _nanoseconds(raw: NDArray[Any]) -> NDArray[np.float64]:
    dates = raw.astype("M8[ns]")
    return np.where(np.isnat(dates), np.nan, dates.astype(np.int64).astype(np.float64))
