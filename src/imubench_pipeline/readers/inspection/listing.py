"""List the contents of a log as text."""

from __future__ import annotations

from collections.abc import Iterator

from imubench_pipeline.readers.contents import Contents
from imubench_pipeline.readers.file_format import LogColumn, LogTable
from imubench_pipeline.readers.inspection.draft import printable
from imubench_pipeline.readers.inspection.names import meaning
from imubench_pipeline.readers.stated_units import bracketed

_MAX_LINES = 40
"""Largest number of tables, and of columns of a table, that are listed."""

_MAX_NAME_WIDTH, _MAX_VALUES_WIDTH = 44, 60
_NOT_STATED = "-"


def listing(contents: Contents) -> str:
    """Return the tables of a recording with their columns, as text."""
    lines = [f"{printable(contents.path.name)}: {printable(contents.about)}"]
    stated: set[object] = set()
    for table in contents.tables[:_MAX_LINES]:
        rate = (table.file, table.rate)
        lines += _list_table(table, rate not in stated)
        stated.add(rate)
    if len(contents.tables) > _MAX_LINES:
        lines.append(f"... and {len(contents.tables) - _MAX_LINES} more")
    if contents.files > len({table.file for table in contents.tables}):
        lines.append(f"... of {contents.files} files")
    return "\n".join(lines) + "\n"


def _list_table(table: LogTable, with_rate: bool) -> Iterator[str]:
    title = " ".join(printable(text) for text in (table.file, table.name) if text)
    about = [table.about] if table.about else []
    if table.rows is not None and " x " not in table.about:
        about.append(f"{table.rows} records")
    if table.rate is not None and with_rate:
        about.append(f"states {table.rate:.6g} Hz")
    if table.started is not None:
        about.append(f"started {table.started}")
    if table.fault is not None:
        about = [table.fault]
    yield "  " + ": ".join(text for text in (title, printable("; ".join(about))) if text)
    for note in table.notes:
        yield f"    | {printable(note)}"
    shown = table.columns[:_MAX_LINES]
    rows = [_list_column(column) for column in shown]
    widths = [max((len(row[place]) for row in rows), default=0) for place in range(3)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, [*widths, 0], strict=True))
        yield ("    " + "  ".join(cells)).rstrip()
    if len(table.columns) > _MAX_LINES:
        yield f"    ... and {len(table.columns) - _MAX_LINES} more"


def _list_column(column: LogColumn) -> tuple[str, str, str, str]:
    """Return name, kind, unit and first values of a column."""
    name = printable(column.label) or f"column {column.source}"
    meant = meaning(column.label)
    in_name = (meant and meant.unit) or ", ".join(bracketed(column.label))
    unit = column.unit or in_name or _NOT_STATED
    values = ", ".join(printable(text) for text in column.first)
    return (
        _shorten(name, _MAX_NAME_WIDTH),
        column.kind,
        _shorten(printable(unit), 12),
        _shorten(values, _MAX_VALUES_WIDTH),
    )


def _shorten(text: str, longest: int) -> str:
    return text if len(text) <= longest else text[: longest - 3] + "..."
