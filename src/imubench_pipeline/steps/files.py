"""What became of every file in the drop zone: analysed, rejected, failed, or skipped."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from imubench_pipeline.tables import build, read, write_arrow
from imubench_pipeline.typing import Row

NEEDED = ("recordings", "failures")

_STATUS = {"ok": "analysed"}


def file_rows(
    files: Iterable[Mapping[str, str | None]], recordings: Iterable[Row], failures: Iterable[Row]
) -> Iterator[Row]:
    """Yield the rows of the table ``files``.

    Parameters
    ----------
    files : iterable of mapping
        Every file in the drop zone (`imubench_pipeline.recordings.drop_zone.FoundFile`).
    recordings, failures : iterable of mapping
        Rows of these tables. The files of a recording that has no row have failed with its sensor.
    """
    outcome = {(row["sensor"], row["recording"]): row for row in recordings}
    of_sensor = {row["sensor"]: row["reason"] for row in failures if row["recording"] is None}
    for file in files:
        if file["recording"] is None:
            yield {**file, "status": "skipped"}
        elif row := outcome.get((file["sensor"], file["recording"])):
            status = _STATUS.get(row["status"], row["status"])
            yield {**file, "status": status, "reason": row["reason"]}
        else:
            reason = of_sensor.get(file["sensor"], "it is in no table of its sensor")
            yield {**file, "status": "failed", "reason": reason}


def write_files(tables: Mapping[str, Path], files: str, outputs: Iterable[Path]) -> None:
    """Write the table ``files``, as Parquet and CSV; `files` is what the plan found, as JSON."""
    rows = {name: read(name, [tables[name]]).to_pylist() for name in NEEDED}
    table = build("files", file_rows(json.loads(files), **rows))
    for output in outputs:
        write_arrow(table, output)
