"""What a log holds, before anything is known of it: its tables and columns, from its beginning."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers import log_files, only_log
from imubench_pipeline.readers.compressed import is_archive, is_member, members
from imubench_pipeline.readers.content import content_of, is_ros_2_bag, reader_of
from imubench_pipeline.settings.sensor import LogFormat, Reader
from imubench_pipeline.tables.findings import RecordingError

Kind = Literal["number", "date", "text", "other"]

ROWS = 1000
"""Records that are looked at, at most."""

FIRST = 4
"""Values of a column that are shown."""

_FAULTS = 5

MOST_FILES = 200
"""Files of a folder that are looked at, at most."""

NOTHING_STATED = LogFormat.model_validate(
    {"rate": "1 Hz", "channels": {"gyro_x": {"column": 1, "unit": "rad/s"}}}
)
"""The format of a log of which nothing is known; what it has to have says nothing."""

_HELD: dict[Reader, str] = {
    "csv": "text.contents",
    "vectornav": "vectornav.contents",
    "ubx": "ubx.contents",
    "rosbag": "rosbag.contents",
    "matlab": "arrays.contents",
    "numpy": "arrays.contents",
    "arrow": "arrays.contents",
    "hdf5": "arrays.contents",
}
"""The module that looks into the files of each reader."""

FORMATS: dict[Reader, str] = {
    "csv": "text",
    "vectornav": "VectorNav ASCII sentences",
    "ubx": "u-blox UBX messages",
    "rosbag": "ROS bag",
    "matlab": "MATLAB file",
    "numpy": "NumPy arrays",
    "arrow": "Parquet, Feather or Arrow table",
    "hdf5": "HDF5 file",
}
"""What the formats are called."""


@dataclass(frozen=True, eq=False)
class HeldColumn:
    """One column, as far as the beginning of a file tells.

    Attributes
    ----------
    source : str or int
        What ``column`` of a sensor file says for it.
    label : str
        Its name; empty where it has none.
    kind : {"number", "date", "text", "other"}
    first : tuple of str
        The first values as written.
    values : ndarray of float64, shape (n,)
        The first values, ns since 1970 (or since midnight) of dates, NaN where one is missing;
        empty where they are no figures.
    unit : str or None
        As the file states it, or its format fixes it.
    forms : tuple of str
        Of dates in text: ``iso8601`` or patterns that fit, the likeliest first; a date alone or a
        time of day alone is a part of one.
    address : str or int or None
        What ``column`` of ``time`` says for it, where that is not ``source``.
    """

    source: str | int
    label: str
    kind: Kind
    first: tuple[str, ...] = ()
    values: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    unit: str | None = None
    forms: tuple[str, ...] = ()
    address: str | int | None = None


@dataclass(frozen=True, eq=False)
class HeldTable:
    """Columns that have their records in common: of a text log, an array, a topic, a message.

    Attributes
    ----------
    reader : Reader
    name : str
        Of the array, topic or message; empty in a text log.
    columns : tuple of HeldColumn
    variable : str or None
        What ``variable`` of a sensor file says for it.
    file : str or None
        What ``file`` of a sensor file says for it; None: the recording is one file.
    rows : int or None
        Records, where that is cheap to know.
    rate : float or None
        Hz, as the file states it.
    started : str or None
        ISO 8601, as the file states it.
    about : str
        How it is written.
    notes : tuple of str
        What the file says in words.
    fault : str or None
        Why it cannot be used, as the end of a sentence.
    """

    reader: Reader
    name: str = ""
    columns: tuple[HeldColumn, ...] = ()
    variable: str | None = None
    file: str | None = None
    rows: int | None = None
    rate: float | None = None
    started: str | None = None
    about: str = ""
    notes: tuple[str, ...] = ()
    fault: str | None = None


@dataclass(frozen=True)
class Contents:
    """What a recording holds.

    Attributes
    ----------
    path : Path
    about : str
        What it is.
    tables : tuple of HeldTable
    reader : Reader or None
        What the sensor file must state, since the file does not tell it by its first bytes.
    files : int
        How many there are; at most `MOST_FILES` are looked into.
    only : str or None
        The one file of a folder that is read where no ``file`` is stated.
    """

    path: Path
    about: str
    tables: tuple[HeldTable, ...]
    reader: Reader | None = None
    files: int = 1
    only: str | None = None


def contents(path: Path) -> Contents:
    """Look into a recording; no more than the beginning of each of its files is read.

    Parameters
    ----------
    path : Path
        A log file, or the folder, zip archive or ROS 2 bag of a recording.

    Raises
    ------
    RecordingError
        If it cannot be read, or holds nothing.
    """
    if not path.exists():
        raise RecordingError(f"{path}: no such file or folder; expected a log")
    if path.is_dir() and not is_ros_2_bag(path):
        return _of_files(path, "a folder", log_files(path))
    if is_archive(path) and reader_of(path) == "csv":
        return _of_files(path, "a zip archive", members(path))
    reader, packed = content_of(path)
    about = FORMATS[reader] + (f", compressed by {packed}" if packed else "")
    tables = tuple(_tables(path, reader))
    _check_figures(path, tables)
    return Contents(path, about, tables, None if reader_of(path) == reader else reader)


def _of_files(path: Path, kind: str, files: list[Path]) -> Contents:
    if not files:
        raise RecordingError(f"{path.name}: {kind} without a visible file; expected logs in it")
    seen = list(_of_each(path, files[:MOST_FILES]))
    tables = [table for held, _ in seen for table in held]
    stated = {reader for held, reader in seen if not all(table.fault for table in held)}
    (reader,) = stated if len(stated) == 1 else (None,)
    _check_figures(path, tables)
    only = None
    with suppress(RecordingError):
        only = only_log(path, files).relative_to(path).as_posix()
    about = f"{kind} of {len(files)} file" + ("s" if len(files) > 1 else "")
    return Contents(path, about, tuple(tables), reader, len(files), only)


def _check_figures(path: Path, tables: Sequence[HeldTable]) -> None:
    """Raise `RecordingError` if nothing can be used, with the reasons."""
    if any(column.kind == "number" for table in tables for column in table.columns):
        return
    faults = [
        " ".join(text for text in (table.file, table.name, table.fault) if text)
        for table in tables
        if table.fault
    ]
    said = "; ".join(faults[:_FAULTS]) or "text alone"
    raise RecordingError(
        f"{path.name}: holds no column of figures ({said}); expected the log of an inertial sensor"
    )


def _of_each(path: Path, files: list[Path]) -> Iterator[tuple[list[HeldTable], Reader | None]]:
    """Yield the tables of each file, and the reader that the sensor file must state."""
    for file in files:
        name = file.relative_to(path).as_posix()
        default: Reader = "csv"
        try:
            log = file
            if not is_member(file) and is_archive(file) and reader_of(file) == "csv":
                log = only_log(file, members(file))  # a log that is packed alone
            reader, packed = content_of(log)
            default = "csv" if is_member(log) else reader_of(log)
            held = [
                replace(table, file=name, about=table.about + (f", {packed}" if packed else ""))
                for table in _tables(log, reader)
            ]
        except RecordingError as error:
            said = str(error).removeprefix(f"{file.name}").removeprefix(f"{path.name}/{name}")
            held = [HeldTable("csv", file=name, fault=said.lstrip(":, "))]
            reader = default
        yield held, None if reader == default else reader


def _tables(path: Path, reader: Reader) -> list[HeldTable]:
    module = import_module(f"imubench_pipeline.readers.{_HELD[reader]}")
    held: Callable[[Path, Reader], list[HeldTable]] = module.held
    return held(path, reader)


def shown(values: NDArray[Any]) -> tuple[str, ...]:
    """Return the first figures as text."""
    whole = values.dtype.kind in "iu"
    return tuple(str(value) if whole else f"{value:.10g}" for value in values[:FIRST])
