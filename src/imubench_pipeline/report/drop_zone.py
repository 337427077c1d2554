"""The outcome of every file in the drop zone, and its changes since the last run."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import get_args

from imubench_pipeline.model.recordings import FileRow
from imubench_pipeline.model.states import FileStatus
from imubench_pipeline.recordings.drop_zone import account_for, find_logs
from imubench_pipeline.recordings.known_logs import is_changed
from imubench_pipeline.report.folder import find_drop_zone
from imubench_pipeline.tables import read
from imubench_pipeline.tables.texts import escape_invisible
from imubench_pipeline.words.numbers import counted

_MAX_LINES = 10
_MAX_NAMES = 5


def describe_drop_zone(results: Path) -> list[str]:
    """Return the balance of the last run, and the changes in the drop zone since, as lines."""
    try:
        files = FileRow.rows_of(read("files", [results / "tables/files.parquet"]))
    except (OSError, ValueError):
        return []  # missing and damaged files are reported elsewhere
    logs = find_drop_zone(results)
    if logs is None:
        return [*count_files(files), *(["the drop zone of the run is not known"] if files else [])]
    if logs.is_dir():
        return [*count_files(files), *_list_changes(files, logs, results)]
    absent = f"the drop zone {logs} is not here: its files were not compared with the results"
    return [*count_files(files), absent] if files else []


def count_files(files: Sequence[FileRow]) -> Iterator[str]:
    """Yield how many files were analysed, rejected and skipped, and why files were skipped."""
    if not files:
        return
    counts = Counter(row.status for row in files)
    parts = [f"{counts[name]} {name}" for name in get_args(FileStatus) if counts[name]]
    yield f"{counted(len(files), 'file')} in the drop zone = {' + '.join(parts)}"
    skipped = [row for row in files if row.status == "skipped"]
    for row in skipped[:_MAX_LINES]:
        yield escape_invisible(f"  skipped: {row.file}: {row.reason}")
    if (more := len(skipped) - _MAX_LINES) > 0:
        yield f"  and {more} more in tables/files.csv"


def _list_changes(files: Iterable[FileRow], logs: Path, results: Path) -> Iterator[str]:
    """Yield which files were added to the drop zone, removed or changed since the last run."""
    recordings = find_logs(logs)
    before = {row.file for row in files}
    now = {found.file for found in account_for(logs, recordings)}
    changed = {
        f"{log.sensor}/{log.path.name}"
        for log in recordings
        if is_changed(log.path, results / "recordings" / log.sensor / log.name)
    }
    for what, names in (("added", now - before), ("removed", before - now), ("changed", changed)):
        if names:
            shown = ", ".join(sorted(names)[:_MAX_NAMES]) + ", ..." * (len(names) > _MAX_NAMES)
            number = counted(len(names), "file" if what != "changed" else "log")
            yield escape_invisible(f"{number} {what} since the last run: {shown}")
