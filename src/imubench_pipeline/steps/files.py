"""Outcome of every file in the drop zone: analysed, rejected, failed, or skipped."""

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from imubench_pipeline.model.recordings import FailureRow, FileRow, RecordingRow
from imubench_pipeline.model.states import FileStatus, RecordingStatus
from imubench_pipeline.tables.files import read, write_each
from imubench_pipeline.words.reasons import simulations as texts

NEEDED = ("recordings", "failures")

_STATUS: Mapping[RecordingStatus, FileStatus] = {
    "ok": "analysed",
    "rejected": "rejected",
    "failed": "failed",
}


def list_files(
    files: Iterable[Mapping[str, Any]],
    recordings: Iterable[RecordingRow],
    failures: Iterable[FailureRow],
) -> Iterator[FileRow]:
    """Yield a row of the table ``files`` for each of `files`, the files in the drop zone.

    Each is a mapping with the fields of `FoundFile`. If its recording has no row, the file has
    failed; the reason is the reason of its sensor, if there is one.
    """
    outcome = {(row.sensor, row.recording): row for row in recordings}
    of_sensor = {row.sensor: row.reason for row in failures if row.recording is None}
    for found in files:
        file = FileRow(**found, status="skipped")
        if file.sensor is None or file.recording is None:
            yield file
        elif row := outcome.get((file.sensor, file.recording)):
            yield replace(file, status=_STATUS[row.status], reason=row.reason)
        else:
            reason = of_sensor.get(file.sensor, texts.IN_NO_TABLE)
            yield replace(file, status="failed", reason=reason)


def write_files(tables: Mapping[str, Path], files: str, outputs: Iterable[Path]) -> None:
    """Write the table ``files``, as Parquet and CSV; `files`: files found by the plan, as JSON."""
    recordings = RecordingRow.rows_of(read("recordings", [tables["recordings"]]))
    failures = FailureRow.rows_of(read("failures", [tables["failures"]]))
    write_each({"files": list_files(json.loads(files), recordings, failures)}, outputs)
