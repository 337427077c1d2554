"""Workbooks of Excel: each sheet is a table with a clock of its own, ``variable`` is its name.

The names of the columns are in the row before the first row of numbers. The library holds a whole
sheet in memory, and ends the process if there is too little: it runs in a process of its own.
"""

import datetime
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from python_calamine import CalamineError, CalamineWorkbook

from imubench_pipeline.readers.arrays import table
from imubench_pipeline.readers.arrays.file import ArrayFile
from imubench_pipeline.readers.bounded import BoundError, run_bounded
from imubench_pipeline.readers.bounds import MAX_SEARCHED_COLUMNS, MAX_SHEET_MEMORY, MAX_SHEETS

_MAX_WAIT = 60.0  # s; a sheet of a million rows takes some seconds
_MAX_ROWS_BEFORE = 100  # searched for the first row of numbers
_EXPORT = "expected .xlsx or .xls with a sheet of numbers, without password: export it as CSV"


class Sheet(table.Table):
    """A sheet of a workbook; a column of text has no values."""

    def __init__(
        self, name: str, labels: Sequence[str], columns: Sequence[NDArray[Any] | None]
    ) -> None:
        self.name, self.labels, self.width = name, labels, len(columns)
        self._columns = columns
        self.rows = next((len(values) for values in columns if values is not None), None)
        if self.rows is None:
            self.fault = "has no row of numbers; expected a column for each channel"

    def column(self, position: int) -> table.Column:
        """Return a column by its position, counted from 0."""
        values, label = self._columns[position], self.labels[position] if self.labels else ""
        if values is None:
            return table.Column(label, "U", "text")
        dated = values.dtype.kind == table.DATE_KIND
        return table.Column(label, values.dtype.kind, "dates" if dated else "numbers")

    def blocks(self, positions: Sequence[int], rows: int) -> Iterator[list[NDArray[Any]]]:
        """Yield these columns, ``rows`` records at a time or fewer (see `Table.blocks`)."""
        columns = [values for at in positions if (values := self._columns[at]) is not None]
        for start in range(0, self.rows or 0, rows):
            yield [values[start : start + rows] for values in columns]


class ExcelFile(ArrayFile):
    """A workbook of Excel."""

    def tables(self, stack: ExitStack) -> Iterable[table.Table]:
        """Return the sheets that the sensor file names, or all if it names none."""
        stated = frozenset(s.variable for s in self.sources.values() if s.variable is not None)
        try:
            return run_bounded(_MAX_WAIT, MAX_SHEET_MEMORY, _read_sheets, self.path, stated)
        except (BoundError, CalamineError) as error:
            raise table.UnusableError(f"its sheets cannot be read ({error}); {_EXPORT}") from None


def _read_sheets(path: Path, stated: frozenset[str]) -> list[Sheet]:
    with CalamineWorkbook.from_path(path) as workbook:
        names = workbook.sheet_names[:MAX_SHEETS]
        chosen = [name for name in names if name in stated] or names
        return [_read_sheet(workbook, name) for name in chosen]


def _read_sheet(workbook: CalamineWorkbook, name: str) -> Sheet:
    before: list[Any] = []
    columns: list[list[Any]] = []
    for number, row in enumerate(workbook.get_sheet_by_name(name).iter_rows()):
        present = [cell for cell in row if cell != ""]
        if columns:
            for column, cell in zip(columns, row, strict=False):
                column.append(cell)
        elif 2 * sum(not isinstance(cell, str) for cell in present) > len(present):
            columns = [[cell] for cell in row[:MAX_SEARCHED_COLUMNS]]
        elif number < _MAX_ROWS_BEFORE:
            before = row
        else:
            break
    named = any(before) and all(isinstance(cell, str) for cell in before)
    labels = [cell.strip() for cell in before[: len(columns)]] if named else []
    return Sheet(name, labels, [_convert(cells) for cells in columns])


def _convert(cells: list[Any]) -> NDArray[Any] | None:
    """Return a column as numbers or dates, NaN or NaT where a cell has none; None if it is text."""
    kinds = set(map(type, cells))
    if datetime.datetime in kinds:
        whole = [cell if isinstance(cell, datetime.datetime) else None for cell in cells]
        return np.array(whole, "M8[us]")
    if kinds.isdisjoint((float, int)):
        return None
    return np.array([cell if isinstance(cell, float | int) else np.nan for cell in cells], float)
