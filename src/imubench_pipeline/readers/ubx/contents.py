"""What a u-blox log holds, told from its beginning."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from imubench_pipeline.readers.file_format import ROWS, FileFormat, LogColumn, LogTable, shown
from imubench_pipeline.readers.ubx.file import COLUMNS, KINDS, RAW, TICK_MS, UNITS, Words
from imubench_pipeline.readers.ubx.frames import Frames
from imubench_pipeline.tables.findings import RecordingError

_LOOKED_AT, _LOOKED_FOR = 1 << 22, 1 << 26
"""Bytes after which a log is known, and those in which a first message is looked for."""


def tables(path: Path, file_format: FileFormat) -> list[LogTable]:
    """Return a table for each message that holds inertial figures.

    Raises
    ------
    RecordingError
        If there is none.
    """
    names = list(COLUMNS)
    words = {kind: Words(kind, names) for kind in KINDS}
    frames = Frames(path, [])
    for key, payload in frames:
        if key in words and len(words[key]) < ROWS * len(names):
            words[key].add(payload)
        if frames.read > (_LOOKED_AT if any(map(len, words.values())) else _LOOKED_FOR):
            break
    present = [kind for kind in KINDS if len(words[kind])]
    described = [_table(file_format, kind, words[kind], frames) for kind in present]
    others = ", ".join(f"{key.hex(' ')} ({count})" for key, count in frames.right.most_common(10))
    if not any(table.columns for table in described):
        raise RecordingError(
            f"{path.name}: no inertial figures in ESF-MEAS or ESF-RAW among {frames.right.total()} "
            f"UBX messages (class and id {others or 'none'}); switch ESF-RAW on in the receiver"
        )
    return sorted(described, key=lambda table: table.name != KINDS[RAW])


def _table(file_format: FileFormat, kind: bytes, words: Words, frames: Frames) -> LogTable:
    """Describe one kind of message."""
    places, figures, tags, _ = words.taken()
    name = KINDS[kind]
    columns = []
    for place, column in enumerate(COLUMNS):
        values = figures[places == place]
        if len(values):
            unit = UNITS[column.split("_")[0]]
            columns.append(LogColumn(column, column, "number", shown(values), values, unit))
    if columns:
        first = tags[places == places[0]].astype(np.float64)
        ticks = first * TICK_MS if kind == RAW else first
        columns.append(LogColumn("time_tag", "time_tag", "number", shown(ticks), ticks, "ms"))
        if kind == RAW:
            columns.append(LogColumn("sTtag", "sTtag", "number", shown(first), first))
    about = f"{frames.right[kind]} messages at the beginning"
    return LogTable(file_format, name, tuple(columns), variable=name, about=about)
