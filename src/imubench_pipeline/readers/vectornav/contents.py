"""What a log of VectorNav's sentences holds, told from its beginning."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from imubench_pipeline.readers.file_format import (
    FIRST,
    ROWS,
    FileFormat,
    LogColumn,
    LogTable,
    shown,
)
from imubench_pipeline.readers.text.cells import is_number
from imubench_pipeline.readers.text.stamp_forms import stamps_of
from imubench_pipeline.readers.text.stamps import StampError
from imubench_pipeline.readers.vectornav.file import AROUND_STAMP, COUNTER, HOST
from imubench_pipeline.readers.vectornav.sentences import (
    FIELDS,
    UNITS,
    Row,
    Sentences,
    fields_of,
    lines_of,
)
from imubench_pipeline.tables.findings import RecordingError

_LOOKED_AT = 1 << 21


def tables(path: Path, file_format: FileFormat) -> list[LogTable]:
    """Return a table for each kind of sentence that holds inertial figures.

    Raises
    ------
    RecordingError
        If there is none with a right checksum.
    """
    sentences = {kind: Sentences(kind, stamped=True) for kind in FIELDS}
    rows: dict[str, list[Row]] = {kind: [] for kind in FIELDS}
    read = 0
    for text in lines_of(path, []):
        for kind, of_kind in sentences.items():
            if b"$" + kind.encode() in text:
                rows[kind] += of_kind.add(text)
        read += len(text)
        if read > _LOOKED_AT:
            break
    present = [kind for kind, kept in rows.items() if kept]
    if not present:
        raise RecordingError(
            f"{path.name}: no sentence of {', '.join(FIELDS)} with a right checksum at its "
            "beginning; set the output of the device (registers 6 and 30)"
        )
    return [_table(file_format, kind, rows[kind], len(present) == 1) for kind in present]


def _table(file_format: FileFormat, kind: str, rows: list[Row], alone: bool) -> LogTable:
    fields, _ = fields_of(kind, rows[:ROWS], set(range(len(FIELDS[kind]))))
    columns = [
        LogColumn(
            name if alone else f"{kind}.{name}",
            name,
            "number",
            shown(fields[place]),
            fields[place],
            UNITS.get(name),
        )
        for place, name in enumerate(FIELDS[kind])
    ]
    columns += _time(HOST, [row.before.strip(AROUND_STAMP) for row in rows[:ROWS]])
    columns += _time(COUNTER, [row.counter for row in rows[:ROWS]])
    about = f"{len(rows)} sentences at the beginning"
    return LogTable(file_format, kind, tuple(columns), about=about)


def _time(name: str, cells: list[bytes]) -> list[LogColumn]:
    """Return a column of stamps, if it is there."""
    texts = [cell.decode("ascii", "replace") for cell in cells]
    first = tuple(text for text in texts[:FIRST])
    if not any(texts):
        return []
    if all(is_number(text, ".") for text in texts if text):
        values = np.array([float(text) if text else np.nan for text in texts])
        return [LogColumn(name, name, "number", first, values)]
    try:
        return [
            LogColumn(name, name, "date", first, stamps_of("iso8601", texts), None, ("iso8601",))
        ]
    except StampError:
        return [LogColumn(name, name, "text", first)]
