"""Failed steps, as the tables show them.

A step that raises, is killed twice or exceeds its time leaves empty outputs with the reason in
their metadata (the ingest in ``quality.json``), which the following steps pass on.
"""

import contextlib
import json
import os
import traceback
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

import pyarrow as pa
import pyarrow.parquet as pq

from imubench_pipeline.model.recordings import FailureRow, FindingRow, RecordingRow
from imubench_pipeline.model.table import R
from imubench_pipeline.tables import files
from imubench_pipeline.tables.findings import Finding, UnavailableError, find, remove_addresses
from imubench_pipeline.words.findings.files import Failed

Cause = Literal["error", "killed", "time"]
QUALITY = "quality.json"
_METADATA = b"imubench.failure"
_BESIDE = ("earth_rotation", "calibration")  # steps that need more than a static log
_NAMED = ("recordings", "findings", "estimate_findings", "failures")  # tables with the reasons


@dataclass(frozen=True)
class Failure:
    """A step that failed."""

    sensor: str
    recording: str | None  # None: a step of the whole sensor
    step: str
    cause: Cause
    reason: str  # one line

    @property
    def name(self) -> str:
        """``sensor/recording``, or only the sensor for a step of the whole sensor."""
        return f"{self.sensor}/{self.recording}" if self.recording else self.sensor

    def row(self) -> FailureRow:
        """Return the row of the table ``failures``."""
        return FailureRow(**asdict(self))

    def finding(self) -> Finding:
        """Return the fatal finding that states this failure."""
        return find(Failed(self.reason), "fatal", 1.0)


def describe_error(error: BaseException) -> str:
    """Return the text of an error without memory addresses and folders, which vary by run."""
    if isinstance(error, UnavailableError):
        return str(error)
    text = "".join(traceback.format_exception_only(error)).strip()
    for name in filter(None, (getattr(error, "filename", None), getattr(error, "filename2", None))):
        text = text.replace(repr(name), repr(Path(os.fsdecode(name)).name))
    return remove_addresses(text)


def read_failure(path: Path) -> Failure | None:
    """Return the failure that left an output, Parquet or ``quality.json``, empty; or None."""
    if path.name == QUALITY:
        with contextlib.suppress(ValueError, TypeError, AttributeError):
            failure = files.read_json(path).get("failure")
            return Failure(**failure) if failure else None
    if path.suffix == ".parquet":
        with contextlib.suppress(OSError, ValueError, TypeError, pa.ArrowException):
            return parse_failure(pq.read_schema(path))
    return None


def parse_failure(read: pa.Schema) -> Failure | None:
    """Return the failure in the metadata of a table; None without one."""
    text = (read.metadata or {}).get(_METADATA)
    return Failure(**json.loads(text)) if text else None


def read_with_failures(table: str, paths: Sequence[Path]) -> tuple[pa.Table, list[Failure]]:
    """Return the joined files of one table, and the failures that left some of them empty."""
    parts = [files.read_part(table, path) for path in paths]
    failures = [
        failure for part in parts if len(part) == 0 and (failure := parse_failure(part.schema))
    ]
    return files.join_tables(table, parts), failures


def write_empty(tables: Iterable[Path], failure: Failure) -> None:
    """Write empty tables for a failed step, with the failure in their metadata."""
    metadata = {_METADATA: json.dumps(asdict(failure), sort_keys=True).encode()}
    for path in tables:
        files.write_arrow(
            files.make_schema(path.stem).empty_table().replace_schema_metadata(metadata), path
        )


def mark_failures(
    tables: Mapping[str, pa.Table], failures: Sequence[Failure]
) -> dict[str, pa.Table]:
    """Return tables in which failures are listed and failed recordings have no results.

    A recording with a failed step gets a finding and the status ``failed``; its rows in other
    tables are removed. A static recording keeps its status and rows if the failed step needs more
    than a static log.
    """
    if not failures:
        return {"failures": files.make_schema("failures").empty_table()} | dict(tables)
    recordings = RecordingRow.rows_of(tables["recordings"])
    kinds = {(row.sensor, row.recording): row.kind for row in recordings}
    reasons = {
        (failure.sensor, failure.recording): failure.reason
        for failure in reversed(failures)
        if failure.step not in _BESIDE
        or kinds.get((failure.sensor, failure.recording or "")) != "static"
    }
    marked = remove_recordings(tables, reasons)
    marked["recordings"] = files.build(
        "recordings",
        (
            replace(row, status="failed", reason=reasons[key], fitness=None, decides=False)
            if key in reasons
            else row
            for row in recordings
            for key in [(row.sensor, row.recording)]
        ),
    )
    of_recordings = [failure for failure in failures if failure.recording]
    listed = FindingRow.rows_of(tables["findings"])
    found = [
        failure.finding().row(failure.sensor, str(failure.recording)) for failure in of_recordings
    ]
    marked["findings"] = files.build("findings", append_new_rows(listed, found))
    before = FailureRow.rows_of(tables["failures"]) if "failures" in tables else []
    marked["failures"] = files.build(
        "failures", append_new_rows(before, [one.row() for one in failures])
    )
    return marked


def append_new_rows(listed: Sequence[R], rows: Iterable[R]) -> list[R]:
    """Return ``listed`` rows, followed by those ``rows`` that are not among them."""
    known = {tuple(row.columns().values()) for row in listed}
    return [*listed, *(row for row in rows if tuple(row.columns().values()) not in known)]


def remove_recordings(
    tables: Mapping[str, pa.Table], left_out: Container[tuple[str, str | None]]
) -> dict[str, pa.Table]:
    """Return tables without rows of ``left_out`` recordings; tables with the reasons keep them."""
    filtered = dict(tables)
    for name, table in tables.items():
        if "recording" in table.schema.names and name not in _NAMED:
            keys = zip(table["sensor"].to_pylist(), table["recording"].to_pylist(), strict=True)
            filtered[name] = table.filter(
                pa.array([key not in left_out for key in keys], pa.bool_())
            )
    return filtered
