"""Summary of a nightly run: changes since the last run, as data and as text."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import Any, Literal

from pydantic import BaseModel

from imubench_pipeline.extensions.nightly.state import (
    Known,
    RunRows,
    State,
    get_recording_name,
    make_drift_keys,
    make_warning_key,
)
from imubench_pipeline.report.run_summary import (
    fold_text,
    list_best_sensors,
    list_failures,
    select_warnings,
)

Outcome = Literal["fine", "flagged", "failed"]

STATUS: Mapping[Outcome, int] = {"fine": 0, "flagged": 1, "failed": 2}  # exit status
_MAX_LINES = 20


class Changed(BaseModel):
    """A recording with another outcome than at the last run."""

    recording: str
    because: str


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


class Failed(BaseModel):
    """A step that failed for a recording, or for a whole sensor, which is left out."""

    sensor: str
    recording: str | None
    step: str
    cause: str
    reason: str


class NewWarning(BaseModel):
    """A finding that puts results in doubt."""

    recording: str
    channel: str | None
    finding: str
    detail: str


class Drift(BaseModel):
    """A parameter of a device outside the interval from its earlier recordings."""

    sensor: str
    device: str
    channel: str
    parameter: str
    recording: str
    value: float | None
    expected_lower: float | None
    expected_upper: float | None
    unit: str
    reason: str | None


class First(BaseModel):
    """The best sensor for a requirement, if it has changed."""

    requirement: str
    sensor: str | None
    before: str | None
    said: str


class Summary(BaseModel):
    """Changes since the last successful nightly run."""

    outcome: Outcome
    began: datetime
    finished: datetime
    seconds: float
    since: datetime | None = None  # end of the run that this one is compared with
    recordings: int = 0  # number in the tables
    new: list[str] = []
    changed: list[Changed] = []
    removed: list[str] = []
    files: list[str] = []  # lines about the drop zone
    skipped: list[Skipped] = []
    failed: list[Failed] = []
    rejected: list[Rejected] = []
    warnings: list[NewWarning] = []
    drift: list[Drift] = []
    first: list[First] = []
    put_right: list[str] = []  # repairs after an earlier run
    failure: list[str] = []  # reason, and the last lines of the log
    report: str = ""
    log: str = ""


def compare_states(
    before: State | None, after: State, tables: RunRows, without: Iterable[str]
) -> dict[str, Any]:
    """Return the changes since the last successful run, apart from the recordings `without`."""
    was = before or State(finished=after.finished)
    written_to = set(without)
    now = {name: outcome for name, outcome in after.recordings.items() if name not in written_to}
    known_warnings, known_drift = set(was.warned), set(was.drifted)
    first = []
    for name, leader in after.leaders.items():
        old = was.leaders.get(name)
        if name not in was.leaders or leader != old:
            of_it = [row for row in tables.ranking if row.requirement == name]
            first.append(
                First(
                    requirement=name,
                    sensor=leader and leader.sensor,
                    before=old and f"{old.sensor}{', which failed it' * (not old.fulfils)}",
                    said=next(list_best_sensors(of_it, tables.recordings)),
                )
            )
    fields: dict[str, Any] = {
        "since": before and before.finished,
        "recordings": len(after.recordings),
        "new": [name for name in now if name not in was.recordings],
        "changed": [
            Changed(
                recording=name,
                because="its log changed"
                if was.logs.get(name) != after.logs.get(name)
                else "settings, or the code of the analysis, changed",
            )
            for name in now
            if name in was.recordings and now[name].digest != was.recordings[name].digest
        ],
        "removed": [name for name in was.recordings if name not in after.recordings],
        "failed": [
            Failed(**row.columns())
            for row in tables.failures
            if row.recording is None or get_recording_name(row) not in written_to
        ],
        "rejected": [
            Rejected(
                recording=name,
                reason=outcome.rejected,
                new=was.recordings.get(name, Known("")).rejected != outcome.rejected,
            )
            for name, outcome in now.items()
            if outcome.rejected is not None
        ],
        "warnings": [
            NewWarning.model_validate({**row.columns(), "recording": get_recording_name(row)})
            for row in select_warnings(tables.findings)
            if get_recording_name(row) not in written_to
            and make_warning_key(row) not in known_warnings
        ],
        "drift": [
            Drift.model_validate(row.columns())
            for key, row in make_drift_keys(tables.drift).items()
            if key.name not in written_to and key not in known_drift
        ],
        "first": first,
    }
    rejected = any(rejection.new for rejection in fields["rejected"])
    flagged = rejected or fields["warnings"] or fields["drift"]
    outcome = "failed" if fields["failed"] else "flagged" if flagged else "fine"
    return fields | {"outcome": outcome}


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
    minutes, seconds = divmod(round(summary.seconds), 60)
    hours, minutes = divmod(minutes, 60)
    took = f"{hours} h {minutes} min" if hours else f"{minutes} min {seconds} s"
    finished = _format_time(summary.finished)
    lines = [f"imubench nightly: {summary.outcome}, {finished}, took {took}"]
    if summary.failure:
        lines += ["", "why it failed:", *(f"  {fold_text(line, 500)}" for line in summary.failure)]
    else:
        lines.append(f"recordings, {since}: {counts}")
    rejected = sorted(summary.rejected, key=lambda rejection: not rejection.new)
    sections = {
        "failed, left out of a report that is there, and tried again next time": [
            *list_failures(summary.failed)
        ],
        "new": summary.new,
        "analysed again": [f"{change.recording}: {change.because}" for change in summary.changed],
        "removed": summary.removed,
        "skipped, and looked at again next time": [
            f"{skip.recording}: {skip.reason}{'; its results stay' * skip.keeps_results} "
            f"(since {_format_time(skip.since)})"
            for skip in summary.skipped
        ],
        f"rejected ({new or 'none'} of them new)": [
            f"{rejection.recording}{' (new)' * rejection.new}: {rejection.reason}"
            for rejection in rejected
        ],
        "new warnings": [
            f"{warning.recording}: {f'{warning.channel}: ' if warning.channel else ''}"
            f"{warning.finding.replace('_', ' ')}: {warning.detail}"
            for warning in summary.warnings
        ],
        "devices that have changed": [_describe_drift(drift) for drift in summary.drift],
        "first for a requirement": [
            lead.said + f" (before: {lead.before})" * bool(lead.before) for lead in summary.first
        ],
        "put right after an earlier run": summary.put_right,
    }
    for title, entries in sections.items():
        if entries:
            more = len(entries) - _MAX_LINES
            shown = entries if more <= 1 else [*entries[:_MAX_LINES], f"and {more} more"]
            lines += ["", f"{title}:", *(f"  {fold_text(line, 300)}" for line in shown)]
    lines += ["", f"report: {summary.report}", f"log: {summary.log}"]
    return "\n".join(lines) + "\n"


def _describe_drift(drift: Drift) -> str:
    value = f" {drift.value:.4g} {drift.unit}" if drift.value is not None else ""
    expected = ""
    if drift.expected_lower is not None and drift.expected_upper is not None:
        expected = f", expected {drift.expected_lower:.4g} to {drift.expected_upper:.4g}"
    return (
        f"{drift.sensor}, device {drift.device}: {drift.channel} {drift.parameter}{value} in "
        f"{drift.recording}{expected}" + f" ({drift.reason})" * bool(drift.reason)
    )


def _format_time(stamp: datetime) -> str:
    return stamp.astimezone().strftime("%Y-%m-%d %H:%M %Z")
