"""Short state of a run, which the next run compares to find new results."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from pydantic import BaseModel, ConfigDict

from imubench_pipeline.extensions.nightly.settling import Signature
from imubench_pipeline.model.comparisons import DriftRow, RankingRow
from imubench_pipeline.model.estimates import FixedBiasRow, ParameterRow
from imubench_pipeline.model.recordings import FailureRow, FindingRow, RecordingRow
from imubench_pipeline.model.table import OfRecordingRow, R
from imubench_pipeline.report.run_summary import select_warnings
from imubench_pipeline.tables import read
from imubench_pipeline.tables.digests import read_sealed_json, write_sealed_json


class StateError(ValueError):
    """Raised for an unreadable state; the message names the consequence."""


class Warned(NamedTuple):
    """Key of a finding, without its size, which may change between runs."""

    recording: str
    channel: str | None
    finding: str


class Drifted(NamedTuple):
    """Key of a change of a device."""

    sensor: str
    device: str
    channel: str
    parameter: str
    recording: str

    @property
    def name(self) -> str:
        """Sensor and name of the recording."""
        return f"{self.sensor}/{self.recording}"


class Leader(NamedTuple):
    """The sensor that comes first for a requirement."""

    sensor: str
    fulfils: bool


class Known(NamedTuple):
    """Digest of a recording, and the reason if it was rejected."""

    digest: str
    rejected: str | None = None


class State(BaseModel):
    """State after a successful run."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    finished: datetime
    logs: dict[str, Signature] = {}  # that were read
    recordings: dict[str, Known] = {}
    warned: list[Warned] = []
    drifted: list[Drifted] = []
    leaders: dict[str, Leader | None] = {}  # by requirement
    skipped: dict[str, datetime] = {}  # since when, without a break

    def write(self, path: Path) -> None:
        """Write the state atomically."""
        write_sealed_json(self.model_dump(mode="json"), path)

    def without(self, names: Collection[str], before: State | None) -> State:
        """Return a state with the previous entries of some recordings, if there were any."""
        was = before or State(finished=self.finished)
        old = {name: was.recordings[name] for name in names if name in was.recordings}
        others = {name: row for name, row in self.recordings.items() if name not in names}
        return self.model_copy(
            update={
                "logs": {name: log for name, log in self.logs.items() if name not in names},
                "recordings": others | old,
                "warned": [warning for warning in self.warned if warning.recording not in names]
                + [warning for warning in was.warned if warning.recording in names],
                "drifted": [drift for drift in self.drifted if drift.name not in names]
                + [drift for drift in was.drifted if drift.name in names],
            }
        )


def read_state(path: Path) -> State | None:
    """Return the state that a run has written; None without one; StateError if unreadable."""
    try:
        return State.model_validate(read_sealed_json(path))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise StateError(
            f"{path.name} is damaged, or of another version: what is new is not known, and "
            "everything is told"
        ) from error


@dataclass(frozen=True)
class RunRows:
    """Rows of the tables of a run, for a state."""

    recordings: list[RecordingRow]
    parameters: list[ParameterRow]  # of the recommended methods
    fixed_bias: list[FixedBiasRow]
    failures: list[FailureRow]
    findings: list[FindingRow]
    drift: list[DriftRow]
    ranking: list[RankingRow]


def load_tables(results: Path) -> RunRows:
    """Return the rows of the tables for a state; OSError or ValueError if one is unreadable."""

    def rows(of: type[R]) -> list[R]:
        return of.rows_of(read(of.table, [results / f"tables/{of.table}.parquet"]))

    return RunRows(
        recordings=rows(RecordingRow),
        parameters=[row for row in rows(ParameterRow) if row.recommended],
        fixed_bias=rows(FixedBiasRow),
        failures=rows(FailureRow),
        findings=rows(FindingRow),
        drift=rows(DriftRow),
        ranking=rows(RankingRow),
    )


def make_state(
    tables: RunRows,
    finished: datetime,
    logs: Mapping[str, Signature],
    skipped: Mapping[str, datetime],
) -> State:
    """Return the state after a run, of tables as of `load_tables` and the logs that were read."""
    rejected = {
        get_recording_name(row): row.reason or "no reason is kept"
        for row in tables.recordings
        if row.status == "rejected"
    }
    # The digest of the rows of a recording changes with its outcome.
    digests = {get_recording_name(row): hashlib.sha256() for row in tables.recordings}
    rows: list[RecordingRow | ParameterRow | FixedBiasRow]
    rows = [*tables.recordings, *tables.parameters, *tables.fixed_bias]
    for row in rows:
        columns = json.dumps(row.columns(), sort_keys=True, default=asdict)
        digests[get_recording_name(row)].update(columns.encode())
    return State(
        finished=finished,
        logs=dict(logs),
        recordings={
            name: Known(digest.hexdigest()[:16], rejected.get(name))
            for name, digest in digests.items()
        },
        warned=sorted({make_warning_key(row) for row in select_warnings(tables.findings)}, key=str),
        drifted=sorted(make_drift_keys(tables.drift)),
        leaders=find_leaders(tables.ranking),
        skipped=dict(skipped),
    )


def make_drift_keys(drift: Iterable[DriftRow]) -> dict[Drifted, DriftRow]:
    """Return the rows of the table ``drift`` about devices that have changed, by their keys."""
    return {
        Drifted(row.sensor, row.device, row.channel, row.parameter, row.recording): row
        for row in drift
        if row.verdict == "changed"
    }


def get_recording_name(row: OfRecordingRow | RecordingRow | FailureRow | DriftRow) -> str:
    """Return sensor and name of the recording of a row."""
    return f"{row.sensor}/{row.recording}"


def make_warning_key(row: FindingRow) -> Warned:
    """Return the key of a finding."""
    return Warned(get_recording_name(row), row.channel, row.finding)


def find_leaders(ranking: Iterable[RankingRow]) -> dict[str, Leader | None]:
    """Return the best sensor for each requirement; None if no sensor can be ranked."""
    first: dict[str, Leader | None] = {}
    margins: dict[str, float] = {}
    for row in ranking:
        if row.decides:
            name = row.requirement
            first.setdefault(name, None)
            margin = row.margin or 0.0
            if row.rank == 1 and (name not in margins or margin > margins[name]):
                first[name] = Leader(row.sensor, row.verdict not in ("likely_fails", "fails"))
                margins[name] = margin
    return first
