"""State of a run, and its changes since the last nightly run, as data and as text."""

import hashlib
import json
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass
from datetime import datetime
from pathlib import Path
from typing import Literal, NamedTuple

from pydantic import BaseModel, ConfigDict

from imubench_pipeline.extensions.nightly.run_differences import (
    Results,
    describe_differences,
    list_differences,
)
from imubench_pipeline.extensions.nightly.settling import Signature
from imubench_pipeline.model.comparisons import DriftRow, RankingRow
from imubench_pipeline.model.estimates import FixedBiasRow, ParameterRow
from imubench_pipeline.model.recordings import FailureRow, FindingRow, RecordingRow
from imubench_pipeline.model.table import OfRecordingRow, R
from imubench_pipeline.report.run_summary import (
    fold_text,
    list_best_sensors,
    list_failures,
    select_warnings,
)
from imubench_pipeline.tables.datapackage import read_software
from imubench_pipeline.tables.files import locate_table, read
from imubench_pipeline.tables.seals import read_sealed_json, write_sealed_json
from imubench_pipeline.words.numbers import Unit, duration_text


class StateError(ValueError):
    """Raised for an unreadable state; the message names the consequence."""


class Known(NamedTuple):
    """Digest of the results of a recording, and the events that were reported already."""

    digest: str
    rejected: str | None = None  # the reason
    warned: tuple[tuple[str | None, str], ...] = ()  # channel and finding; its size may change
    drifted: tuple[tuple[str, str, str], ...] = ()  # device, channel and parameter


class State(BaseModel):
    """State after a successful run."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    finished: datetime
    logs: dict[str, Signature] = {}  # that were read
    recordings: dict[str, Known] = {}
    answers: list[str] = []  # the best sensor of each requirement, in words
    skipped: dict[str, datetime] = {}  # since when, without a break
    software: dict[str, str] = {}  # version, and digest of the settings

    def write(self, path: Path) -> None:
        """Write the state atomically."""
        write_sealed_json(self.model_dump(mode="json"), path)

    def get(self, name: str) -> Known:
        """Return the entry of a recording; an empty one if it is new."""
        return self.recordings.get(name, Known(""))

    def without(self, names: Collection[str], before: "State | None") -> "State":
        """Return a state with the previous entries of some recordings, if there were any."""
        was = before or State(finished=self.finished)
        old = {name: was.recordings[name] for name in names if name in was.recordings}
        others = {name: known for name, known in self.recordings.items() if name not in names}
        logs = {name: log for name, log in self.logs.items() if name not in names}
        return self.model_copy(update={"logs": logs, "recordings": others | old})


def read_state(path: Path) -> State | None:
    """Return the state that a run wrote; None if there is none; StateError if unreadable."""
    try:
        return State.model_validate(read_sealed_json(path))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise StateError(
            f"{path.name} is damaged, or of another version: everything is reported as new"
        ) from error


@dataclass(frozen=True)
class RunRows:
    """Rows of the tables of a run, for a state."""

    recordings: list[RecordingRow]
    parameters: list[ParameterRow]  # of the recommended methods
    fixed_bias: list[FixedBiasRow]
    failures: list[FailureRow]
    findings: list[FindingRow]
    drift: list[DriftRow]  # of devices that have changed
    ranking: list[RankingRow]
    software: Mapping[str, str]


def load_tables(results: Path) -> RunRows:
    """Return the rows of the tables for a state; OSError or ValueError if one is unreadable."""

    def rows(of: type[R]) -> list[R]:
        return of.rows_of(read(of.table, [locate_table(results, of.table)]))

    return RunRows(
        recordings=rows(RecordingRow),
        parameters=[row for row in rows(ParameterRow) if row.recommended],
        fixed_bias=rows(FixedBiasRow),
        failures=rows(FailureRow),
        findings=rows(FindingRow),
        drift=[row for row in rows(DriftRow) if row.verdict == "changed"],
        ranking=rows(RankingRow),
        software=read_software(results),
    )


def make_state(
    tables: RunRows,
    finished: datetime,
    logs: Mapping[str, Signature],
    skipped: Mapping[str, datetime],
) -> State:
    """Return the state after a run, from its tables (`load_tables`) and the logs that it read."""
    rejected = {
        get_recording_name(row): row.reason or "no reason is recorded"
        for row in tables.recordings
        if row.status == "rejected"
    }
    warned: dict[str, set[tuple[str | None, str]]] = defaultdict(set)
    for finding in select_warnings(tables.findings):
        warned[get_recording_name(finding)].add((finding.channel, finding.finding))
    drifted: dict[str, set[tuple[str, str, str]]] = defaultdict(set)
    for drift in tables.drift:
        drifted[get_recording_name(drift)].add((drift.device, drift.channel, drift.parameter))
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
            name: Known(
                digest.hexdigest()[:16],
                rejected.get(name),
                tuple(sorted(warned[name], key=str)),
                tuple(sorted(drifted[name])),
            )
            for name, digest in digests.items()
        },
        answers=[*list_best_sensors(tables.ranking, tables.recordings)],
        skipped=dict(skipped),
        software=dict(tables.software),
    )


def get_recording_name(row: OfRecordingRow | RecordingRow | FailureRow | DriftRow) -> str:
    """Return sensor and name of the recording of a row."""
    return f"{row.sensor}/{row.recording}"


Outcome = Literal["fine", "flagged", "failed"]

STATUS: Mapping[Outcome, int] = {"fine": 0, "flagged": 1, "failed": 2}  # exit status
_MAX_LINES = 20


class Changed(BaseModel):
    """A recording with a different outcome than in the last run."""

    recording: str
    because: str
    new_log: bool


class Skipped(BaseModel):
    """A log that was not read, since it is being written."""

    recording: str
    reason: str
    keeps_results: bool
    since: datetime


class Rejected(BaseModel):
    """A rejected recording; ``new``: it was not rejected for this reason at the last run."""

    recording: str
    reason: str
    new: bool


class Changes(BaseModel):
    """Changes since the last successful nightly run; ``outcome`` is failed without tables."""

    outcome: Outcome = "failed"
    since: datetime | None = None  # end of the run that this one is compared with
    recordings: int = 0  # number in the tables
    new: list[str] = []
    changed: list[Changed] = []
    removed: list[str] = []
    failed: list[FailureRow] = []
    rejected: list[Rejected] = []
    warnings: list[FindingRow] = []
    drift: list[DriftRow] = []
    reanalysis: list[str] = []  # effect of another version, code or settings on the same logs
    answers: list[str] = []  # the best sensor of each requirement whose answer has changed


class Summary(Changes):
    """Summary of a nightly run."""

    began: datetime
    finished: datetime
    seconds: float
    files: list[str] = []  # lines about the drop zone
    skipped: list[Skipped] = []
    put_right: list[str] = []  # repairs after an earlier run
    failure: list[str] = []  # reason, and the last lines of the log
    report: str = ""
    log: str = ""


def compare_states(
    before: State | None, after: State, tables: RunRows, without: Iterable[str]
) -> Changes:
    """Return the changes since the last successful run, apart from the recordings `without`."""
    was = before or State(finished=after.finished)
    written_to = set(without)
    now = {name: outcome for name, outcome in after.recordings.items() if name not in written_to}
    failed = [
        row
        for row in tables.failures
        if row.recording is None or get_recording_name(row) not in written_to
    ]
    rejected = [
        Rejected(
            recording=name,
            reason=outcome.rejected,
            new=was.get(name).rejected != outcome.rejected,
        )
        for name, outcome in now.items()
        if outcome.rejected is not None
    ]
    warnings = [
        row
        for row in select_warnings(tables.findings)
        if (name := get_recording_name(row)) not in written_to
        and (row.channel, row.finding) not in was.get(name).warned
    ]
    changed = [
        name
        for name in now
        if name in was.recordings and now[name].digest != was.recordings[name].digest
    ]
    reanalysed = {name for name in changed if was.logs.get(name) == after.logs.get(name)}
    drift = [
        row
        for row in tables.drift
        if (name := get_recording_name(row)) not in written_to
        and (row.device, row.channel, row.parameter) not in was.get(name).drifted
    ]
    flagged = warnings or drift or any(rejection.new for rejection in rejected)
    return Changes(
        outcome="failed" if failed else "flagged" if flagged else "fine",
        since=before and before.finished,
        recordings=len(after.recordings),
        new=[name for name in now if name not in was.recordings],
        changed=[
            Changed(
                recording=name,
                because=_explain_reanalysis(was.software, after.software)
                if name in reanalysed
                else "its log changed",
                new_log=name not in reanalysed,
            )
            for name in changed
        ],
        removed=[name for name in was.recordings if name not in after.recordings],
        failed=failed,
        rejected=rejected,
        warnings=warnings,
        drift=drift,
        answers=[answer for answer in after.answers if answer not in was.answers],
    )


def _explain_reanalysis(was: Mapping[str, str], now: Mapping[str, str]) -> str:
    """Return why a recording was analysed again although its log is the same."""
    old, new = (software.get("version", "") for software in (was, now))
    if old and old != new:
        return f"the program changed from version {old} to {new}"
    if was and was["settings"] != now.get("settings"):
        return "settings changed"
    return "settings, or the code of the analysis, changed"


def describe_reanalysis(old: Results, new: Results, names: Collection[str]) -> list[str]:
    """Return how the results of recordings that were analysed again differ, in lines."""
    before, after = (
        {key: run[key] for key in run if f"{key.sensor}/{key.recording}" in names}
        for run in (old, new)
    )
    return [*filter(None, describe_differences(list_differences(before, after), "practical"))]


def format_summary(summary: Summary) -> str:
    """Return a summary as text."""
    new = sum(rejection.new for rejection in summary.rejected)
    counts = (
        f"{len(summary.new)} new, {len(summary.changed)} analysed again, "
        f"{len(summary.removed)} removed, {len(summary.skipped)} skipped; "
        f"{summary.recordings} in all, {len(summary.rejected)} of them rejected"
    )
    if summary.failed:
        counts += f"; {len(summary.failed)} failed"
    counts += "".join(f"\n{line}" for line in summary.files)
    since = f"since {_format_time(summary.since)}" if summary.since else "the first run"
    finished = _format_time(summary.finished)
    lines = [
        f"imubench nightly: {summary.outcome}, {finished}, took {duration_text(summary.seconds)}"
    ]
    if summary.failure:
        lines += ["", "why it failed:", *(f"  {fold_text(line, 500)}" for line in summary.failure)]
    else:
        lines.append(f"recordings, {since}: {counts}")
    rejected = sorted(summary.rejected, key=lambda rejection: not rejection.new)
    reanalysed = {change.recording for change in summary.changed if not change.new_log}
    sections = {
        "failed, omitted in the report, and tried again next time": [
            *list_failures(summary.failed)
        ],
        "new": summary.new,
        "analysed again": [f"{change.recording}: {change.because}" for change in summary.changed],
        "changed by the analysis, with the same logs": summary.reanalysis,
        "removed": summary.removed,
        "skipped, and checked again next time": [
            f"{skip.recording}: {skip.reason}{'; its results stay' * skip.keeps_results} "
            f"(since {_format_time(skip.since)})"
            for skip in summary.skipped
        ],
        f"rejected ({new or 'none'} of them new)": [
            f"{rejection.recording}{' (new)' * rejection.new}: {rejection.reason}"
            for rejection in rejected
        ],
        "new warnings": [
            f"{get_recording_name(warning)}: {f'{warning.channel}: ' if warning.channel else ''}"
            f"{warning.finding.replace('_', ' ')}: {warning.detail}"
            for warning in summary.warnings
        ],
        "devices that have changed": [
            _describe_drift(drift, get_recording_name(drift) in reanalysed)
            for drift in summary.drift
        ],
        "other answers to a requirement": summary.answers,
        "repaired after an earlier run": summary.put_right,
    }
    for title, entries in sections.items():
        if entries:
            more = len(entries) - _MAX_LINES
            shown = entries if more <= 1 else [*entries[:_MAX_LINES], f"and {more} more"]
            lines += ["", f"{title}:", *(f"  {fold_text(line, 300)}" for line in shown)]
    lines += ["", f"report: {summary.report}", f"log: {summary.log}"]
    return "\n".join(lines) + "\n"


def _describe_drift(drift: DriftRow, reanalysed: bool) -> str:
    unit = Unit(drift.unit, 1.0, drift.parameter)
    low, high = drift.expected_lower, drift.expected_upper
    size, limits = unit.estimate_texts(drift.value, low, high)
    value = f" {size} {drift.unit}" if drift.value is not None else ""
    expected = f", expected {limits}" if low is not None and high is not None else ""
    return (
        f"{drift.sensor}, device {drift.device}: {drift.channel} {drift.parameter}{value} in "
        f"{drift.recording}{expected}"
        + f" ({'; '.join(drift.reasons)})" * bool(drift.reasons)
        + "; analysed again with the same log: the analysis may be the cause" * reanalysed
    )


def _format_time(stamp: datetime) -> str:
    return stamp.astimezone().strftime("%Y-%m-%d %H:%M %Z")
