"""List the tables and columns of an unknown log, from the beginning of its files."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from imubench_pipeline.readers import find_only_log, log_files
from imubench_pipeline.readers.compressed import is_archive, is_member, list_members
from imubench_pipeline.readers.content import find_format, recognise_content, recognise_folder
from imubench_pipeline.readers.file_format import FileFormat, LogTable
from imubench_pipeline.readers.formats import TEXT
from imubench_pipeline.tables.findings import RecordingError

_MAX_SHOWN_FAULTS = 5
MAX_FILES = 200  # largest number of files of a folder that are examined


@dataclass(frozen=True)
class Contents:
    """Tables and columns of a recording, as the beginning of its files shows them."""

    path: Path
    about: str  # kind of the recording, such as its format
    tables: tuple[LogTable, ...]
    stated: FileFormat | None = None  # to be stated as `reader`: the first bytes do not show it
    files: int = 1  # number of files; at most `MAX_FILES` are examined
    only: str | None = None  # the only file of a folder that is read if no `file` is stated


def list_contents(path: Path) -> Contents:
    """Return the contents of a recording; raise `RecordingError` without a column of numbers."""
    if not path.exists():
        raise RecordingError(f"{path.name}: no such file or folder; expected a log")
    if path.is_dir() and recognise_folder(path) is None:
        return _inspect_files(path, "a folder", log_files(path))
    if is_archive(path) and find_format(path) is TEXT:
        return _inspect_files(path, "a zip archive", list_members(path))
    file_format, packed = recognise_content(path)
    about = file_format.title + (f", compressed by {packed}" if packed else "")
    tables = tuple(file_format.tables(path))
    _check_has_numbers(path, tables)
    return Contents(path, about, tables)


def _inspect_files(path: Path, kind: str, files: list[Path]) -> Contents:
    if not files:
        raise RecordingError(f"{path.name}: is {kind} without a visible file; put a log into it")
    tables: list[LogTable] = []
    to_state = set()  # the formats that the sensor file must state
    for file in files[:MAX_FILES]:
        name = file.relative_to(path).as_posix()
        untold = TEXT
        try:
            log = file
            if not is_member(file) and is_archive(file) and find_format(file) is TEXT:
                log = find_only_log(file, list_members(file))  # an archive with one log
            file_format, packed = recognise_content(log)
            untold = TEXT if is_member(log) else file_format
            of_file = [
                replace(table, file=name, about=table.about + (f", {packed}" if packed else ""))
                for table in file_format.tables(log)
            ]
        except RecordingError as error:
            fault = str(error).removeprefix(f"{file.name}").removeprefix(f"{path.name}/{name}")
            of_file = [LogTable(TEXT, file=name, fault=fault.lstrip(":, "))]
            file_format = untold
        tables += of_file
        if not all(table.fault for table in of_file):
            to_state.add(None if file_format is untold else file_format)
    (stated,) = to_state if len(to_state) == 1 else (None,)
    _check_has_numbers(path, tables)
    only = None
    with suppress(RecordingError):
        only = find_only_log(path, files).relative_to(path).as_posix()
    about = f"{kind} of {len(files)} file" + ("s" if len(files) > 1 else "")
    return Contents(path, about, tuple(tables), stated, len(files), only)


def _check_has_numbers(path: Path, tables: Sequence[LogTable]) -> None:
    if any(column.kind == "number" for table in tables for column in table.columns):
        return
    faults = [
        " ".join(text for text in (table.file, table.name, table.fault) if text)
        for table in tables
        if table.fault
    ]
    why = "; ".join(faults[:_MAX_SHOWN_FAULTS]) or "only text"
    raise RecordingError(
        f"{path.name}: has no column of numbers ({why}); expected the log of an inertial sensor"
    )
