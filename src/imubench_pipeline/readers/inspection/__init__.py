"""Inspect a log and draft a sensor file for it: `imubench inspect`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from imubench_pipeline.readers.contents import Contents, contents
from imubench_pipeline.readers.file_format import LogTable
from imubench_pipeline.readers.inspection.draft import Draft, block, printable
from imubench_pipeline.readers.inspection.drafting import draft
from imubench_pipeline.readers.inspection.names import meaning
from imubench_pipeline.readers.inspection.proof import Proof, proof
from imubench_pipeline.readers.stated_units import bracketed

__all__ = ["Draft", "Inspection", "Proof", "inspect"]


@dataclass(frozen=True)
class Inspection:
    """Contents of a recording, and the drafted sensor file."""

    listing: str
    """The contents as text."""
    block: str
    """The sensor file as YAML."""
    draft: Draft
    """The sensor file as values."""
    proof: Proof
    """Result of reading the first records with it."""

    @property
    def complete(self) -> bool:
        """Whether the draft has no gaps and the log can be read with it."""
        return self.proof.read and not self.draft.unfilled()


def inspect(path: Path, model: str | None = None) -> Inspection:
    """Inspect a recording and draft a sensor file for it.

    Only the beginning of each file is read, so that the time does not depend on the length.

    Parameters
    ----------
    path : Path
        A log file, or the folder, zip archive or ROS 2 bag of a recording.
    model : str or None
        Name of the sensor; None: the name of the log.

    Raises
    ------
    RecordingError
        If the recording cannot be read, or is no log.
    """
    # Numbers in a damaged file may overflow.
    with np.errstate(all="ignore"):
        log = contents(path)
        drafted = draft(log, model)
        return Inspection(listing(log), block(drafted, path.name), drafted, proof(path, drafted))


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
    rows = []
    for column in table.columns[:_MAX_LINES]:
        name = printable(column.label) or f"column {column.source}"
        meant = meaning(column.label)
        in_name = (meant and meant.unit) or ", ".join(bracketed(column.label))
        unit = _shorten(printable(column.unit or in_name or _NOT_STATED), 12)
        values = _shorten(", ".join(map(printable, column.first)), _MAX_VALUES_WIDTH)
        rows.append((_shorten(name, _MAX_NAME_WIDTH), column.kind, unit, values))
    widths = [max((len(row[place]) for row in rows), default=0) for place in range(3)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, [*widths, 0], strict=True))
        yield ("    " + "  ".join(cells)).rstrip()
    if len(table.columns) > _MAX_LINES:
        yield f"    ... and {len(table.columns) - _MAX_LINES} more"


def _shorten(text: str, longest: int) -> str:
    return text if len(text) <= longest else text[: longest - 3] + "..."
