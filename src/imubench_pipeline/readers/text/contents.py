"""What a text log holds, told from its first lines."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from imubench_pipeline.readers.file_format import (
    FIRST,
    NOTHING_STATED,
    ROWS,
    FileFormat,
    LogColumn,
    LogTable,
)
from imubench_pipeline.readers.text.cells import Decimal, is_missing, is_number
from imubench_pipeline.readers.text.layout import TextLayout, find_layout
from imubench_pipeline.readers.text.preamble import stated_rate, stated_start
from imubench_pipeline.readers.text.stamp_forms import stamp_forms, stamps_of
from imubench_pipeline.readers.text.units import line_of_units

_NOTES = 12


def tables(path: Path, file_format: FileFormat) -> list[LogTable]:
    """Return the one table of a text log.

    Parameters
    ----------
    path : Path
        A file, compressed or not, or a member of a zip archive.

    Raises
    ------
    RecordingError
        If it is no text, or has no records.
    """
    layout = find_layout(path, NOTHING_STATED, [], [])
    before = [line.decode("utf-8", "replace") for line in layout.preamble]
    units, units_line = line_of_units(layout)
    rows = [row for row in layout.rows[:ROWS] if len(row) >= len(layout.names)]
    rows = rows[:-1] or rows  # the last one may be cut short
    named = layout.names != [str(number) for number in range(1, len(layout.names) + 1)]
    columns = tuple(
        _column(layout, place, [row[place] for row in rows], named, units.get(place))
        for place in range(len(layout.names))
    )
    names = "with names" if named else "without names"
    return [
        LogTable(
            file_format,
            columns=columns,
            rate=stated_rate(before),
            started=stated_start(before),
            about=f"delimiter {layout.split}, decimal sign {layout.decimal!r}, {names}",
            notes=tuple(
                text.strip().replace("\t", " ")
                for raw, text in zip(layout.preamble, before, strict=True)
                if raw not in (layout.header, units_line)
            )[:_NOTES],
        )
    ]


def _column(
    layout: TextLayout, place: int, cells: list[str], named: bool, unit: str | None
) -> LogColumn:
    name = layout.names[place] if named else ""
    source: str | int = name
    if not name or layout.names.count(name) > 1 or not name.isprintable():
        source = place + 1
    first = tuple(cell.strip() for cell in cells[:FIRST])
    unit = None if unit is None or is_missing(unit) else unit
    present = [cell for cell in cells if not is_missing(cell)]
    if present and all(is_number(cell, layout.decimal) for cell in present):
        values = np.array([_figure(cell, layout.decimal) for cell in cells])
        return LogColumn(source, name, "number", first, values, unit)
    if forms := stamp_forms(present):
        return LogColumn(source, name, "date", first, stamps_of(forms[0], cells), None, forms)
    return LogColumn(source, name, "text", first, unit=unit)


def _figure(cell: str, decimal: Decimal) -> float:
    if is_missing(cell):
        return np.nan
    return float(cell.strip().replace(decimal, "."))
