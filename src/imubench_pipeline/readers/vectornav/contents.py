"""What a log of VectorNav's sentences holds, told from its beginning."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from imubench_pipeline.readers.contents import FIRST, ROWS, HeldColumn, HeldTable, shown
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
from imubench_pipeline.settings.sensor import Reader
from imubench_pipeline.tables.findings import RecordingError

_LOOKED_AT = 1 << 21


def held(path: Path, reader: Reader) -> list[HeldTable]:
    """Return a table for each kind of sentence that holds inertial figures.

    Parameters
    ----------
    path : Path
    reader : Reader

    Raises
    ------
    RecordingError
        If there is none with a right checksum.
    """
    sentences = {kind: Sentences(kind, stamped=True) for kind in FIELDS}
    rows: dict[str, list[Row]] = {kind: [] for kind in FIELDS}
    read = 0
    for text in lines_of(path, []):
        for kind, found in sentences.items():
            if b"$" + kind.encode() in text:
                rows[kind] += found.add(text)
        read += len(text)
        if read > _LOOKED_AT:
            break
    present = [kind for kind, found in rows.items() if found]
    if not present:
        raise RecordingError(
            f"{path.name}: no sentence of {', '.join(FIELDS)} with a right checksum at its "
            "beginning; set the output of the device (registers 6 and 30)"
        )
    return [_held(reader, kind, rows[kind], len(present) == 1) for kind in present]


def _held(reader: Reader, kind: str, rows: list[Row], alone: bool) -> HeldTable:
    fields, _ = fields_of(kind, rows[:ROWS], set(range(len(FIELDS[kind]))))
    columns = [
        HeldColumn(
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
    return HeldTable(reader, kind, tuple(columns), about=about)


def _time(name: str, cells: list[bytes]) -> list[HeldColumn]:
    """Return a column of stamps, if it is there."""
    texts = [cell.decode("ascii", "replace") for cell in cells]
    first = tuple(text for text in texts[:FIRST])
    if not any(texts):
        return []
    if all(is_number(text, ".") for text in texts if text):
        values = np.array([float(text) if text else np.nan for text in texts])
        return [HeldColumn(name, name, "number", first, values)]
    try:
        return [
            HeldColumn(name, name, "date", first, stamps_of("iso8601", texts), None, ("iso8601",))
        ]
    except StampError:
        return [HeldColumn(name, name, "text", first)]
