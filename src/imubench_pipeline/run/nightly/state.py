"""What a run found, in short: the next one tells by it what is new."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterable, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import BaseModel, ConfigDict

from imubench_pipeline.model.recordings import FindingRow
from imubench_pipeline.report.run_summary import serious
from imubench_pipeline.run.nightly.settling import Signature
from imubench_pipeline.tables import read
from imubench_pipeline.tables.digests import read_sealed_json, write_sealed_json

Rows = list[dict[str, Any]]

_OF_A_RECORDING = ("recordings", "parameters", "fixed_bias")
"""The tables whose rows tell whether a recording was analysed again with another outcome."""


class StateError(ValueError):
    """A state that cannot be read; the text says what follows."""


class Warned(NamedTuple):
    """What names a finding: its size may change from run to run."""

    recording: str
    channel: str | None
    finding: str


class Drifted(NamedTuple):
    """What names a change of a device."""

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
    """A recording, in short."""

    digest: str
    rejected: str | None = None


class State(BaseModel):
    """What a successful run found.

    Attributes
    ----------
    logs : dict
        Size and stamps of each log that was read.
    warned, drifted : list
        Findings that put results in doubt, and changes of devices.
    leaders : dict
        By requirement.
    skipped : dict
        Since when a log has been skipped, run by run.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    finished: datetime
    logs: dict[str, Signature] = {}
    recordings: dict[str, Known] = {}
    warned: list[Warned] = []
    drifted: list[Drifted] = []
    leaders: dict[str, Leader | None] = {}
    skipped: dict[str, datetime] = {}

    def write(self, path: Path) -> None:
        """Keep it, atomically."""
        write_sealed_json(self.model_dump(mode="json"), path)

    def without(self, names: Collection[str], before: State | None) -> State:
        """Return a state in which some recordings are as they were before, if they were."""
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
    """Return the state that a run has kept; None where there is none.

    Raises
    ------
    StateError
        If it is damaged, or of another version.
    """
    try:
        return State.model_validate(read_sealed_json(path))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:  # that of the model, too
        raise StateError(
            f"{path.name} is damaged, or of another version: what is new is not known, and "
            "everything is told"
        ) from error


def load_tables(results: Path) -> dict[str, Rows]:
    """Return the rows of the tables that a state is made of.

    Raises
    ------
    OSError, ValueError
        If one is not there, or is of another form.
    """
    tables: dict[str, Rows] = {}
    for name in (*_OF_A_RECORDING, "failures", "findings", "drift", "ranking"):
        table = read(name, [results / f"tables/{name}.parquet"])
        if name == "parameters":
            table = table.filter(table["recommended"])
        tables[name] = table.to_pylist()
    return tables


def state_of(
    tables: Mapping[str, Rows],
    finished: datetime,
    logs: Mapping[str, Signature],
    skipped: Mapping[str, datetime],
) -> State:
    """Return the state after a run, of tables as of `load_tables` and the logs that were read."""
    rejected = {
        name_in(row): row["reason"] or "no reason is kept"
        for row in tables["recordings"]
        if row["status"] == "rejected"
    }
    findings = [FindingRow(**row) for row in tables["findings"]]
    return State(
        finished=finished,
        logs=dict(logs),
        recordings={
            name: Known(digest, rejected.get(name)) for name, digest in _digests(tables).items()
        },
        warned=sorted({warned(row) for row in serious(findings)}, key=str),
        drifted=sorted({drifted(row) for row in changes(tables["drift"])}),
        leaders=leading(tables["ranking"]),
        skipped=dict(skipped),
    )


def name_in(row: Mapping[str, Any]) -> str:
    """Return sensor and name of the recording of a row."""
    return f"{row['sensor']}/{row['recording']}"


def warned(row: Mapping[str, Any]) -> Warned:
    """Return what names a row of the table ``findings``."""
    return Warned(name_in(row), row["channel"], row["finding"])


def changes(drift: Iterable[dict[str, Any]]) -> Rows:
    """Return the rows of the table ``drift`` that say that a device has changed."""
    return [row for row in drift if row["verdict"] == "changed"]


def drifted(row: Mapping[str, Any]) -> Drifted:
    """Return what names a row of the table ``drift``."""
    return Drifted(*(row[column] for column in Drifted._fields))


def leading(ranking: Iterable[Mapping[str, Any]]) -> dict[str, Leader | None]:
    """Return the sensor that comes first for each requirement; None where none can be ranked."""
    first: dict[str, Leader | None] = {}
    margins: dict[str, float] = {}
    for row in ranking:
        if row["decides"]:
            name = row["requirement"]
            first.setdefault(name, None)
            margin = row["margin"] or 0.0
            if row["rank"] == 1 and (name not in margins or margin > margins[name]):
                first[name] = Leader(row["sensor"], not row["verdict"].endswith("fails"))
                margins[name] = margin
    return first


def _digests(tables: Mapping[str, Rows]) -> dict[str, str]:
    """Return a digest of what the tables say of each recording."""
    digests = {name_in(row): hashlib.sha256() for row in tables["recordings"]}
    for table in _OF_A_RECORDING:
        for row in tables[table]:
            digests[name_in(row)].update(json.dumps(row, sort_keys=True).encode())
    return {name: digest.hexdigest()[:16] for name, digest in digests.items()}
