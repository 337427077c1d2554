"""Summary of a nightly run: changes since the last run, as data and as text."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime
from typing import Any, Literal

from pydantic import BaseModel

from imubench_pipeline.extensions.nightly.state import (
    Known,
    Leader,
    RunRows,
    State,
    changes,
    drifted,
    name_in,
    warned,
)
from imubench_pipeline.report.run_summary import leaders, left_out, one_line, serious

Outcome = Literal["fine", "flagged", "failed"]

STATUS: Mapping[Outcome, int] = {"fine": 0, "flagged": 1, "failed": 2}
"""Exit status of each outcome."""

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
    """Changes since the last successful nightly run.

    Attributes
    ----------
    seconds : float
        Duration of the run.
    since : datetime or None
        The end of the run that this one is compared with; None: there is none.
    recordings : int
        Number of recordings in the tables.
    files : list of str
        Status of the files in the drop zone, as lines.
    put_right : list of str
        Repairs after an earlier run.
    failure : list of str
        Reason of a failure: the last lines of the log.
    """

    outcome: Outcome
    began: datetime
    finished: datetime
    seconds: float
    since: datetime | None = None
    recordings: int = 0
    new: list[str] = []
    changed: list[Changed] = []
    removed: list[str] = []
    files: list[str] = []
    skipped: list[Skipped] = []
    failed: list[Failed] = []
    rejected: list[Rejected] = []
    warnings: list[NewWarning] = []
    drift: list[Drift] = []
    first: list[First] = []
    put_right: list[str] = []
    failure: list[str] = []
    report: str = ""
    log: str = ""


def compared(
    before: State | None, after: State, tables: RunRows, without: Iterable[str]
) -> dict[str, Any]:
    """Return the changes of a state since the last successful run, as fields of the summary.

    `tables` are the rows of the state `after`. The recordings `without` are left out: their logs
    changed while they were read.
    """
    was = before or State(finished=after.finished)
    written_to = set(without)
    now = {name: outcome for name, outcome in after.recordings.items() if name not in written_to}
    both = [name for name in now if name in was.recordings]
    known_warnings, known_drift = set(was.warned), set(was.drifted)
    fields: dict[str, Any] = {
        "since": before and before.finished,
        "recordings": len(after.recordings),
        "new": [name for name in now if name not in was.recordings],
        "changed": [
            Changed(recording=name, because=_explain_change(name, was, after))
            for name in both
            if now[name].digest != was.recordings[name].digest
        ],
        "removed": [name for name in was.recordings if name not in after.recordings],
        "failed": [
            Failed(**row.columns())
            for row in tables.failures
            if row.recording is None or name_in(row) not in written_to
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
            NewWarning.model_validate({**row.columns(), "recording": name_in(row)})
            for row in serious(tables.findings)
            if name_in(row) not in written_to and warned(row) not in known_warnings
        ],
        "drift": [
            Drift.model_validate(row.columns())
            for row in changes(tables.drift)
            if name_in(row) not in written_to and drifted(row) not in known_drift
        ],
        "first": list(_list_new_leaders(was, after, tables)),
    }
    rejected = any(rejection.new for rejection in fields["rejected"])
    flagged = rejected or fields["warnings"] or fields["drift"]
    outcome = "failed" if fields["failed"] else "flagged" if flagged else "fine"
    return fields | {"outcome": outcome}


def _explain_change(name: str, was: State, now: State) -> str:
    if was.logs.get(name) != now.logs.get(name):
        return "its log changed"
    return "settings, or the code of the analysis, changed"


def _list_new_leaders(was: State, now: State, tables: RunRows) -> Iterator[First]:
    for name, leader in now.leaders.items():
        if name in was.leaders and leader == was.leaders[name]:
            continue
        of_it = [row for row in tables.ranking if row.requirement == name]
        yield First(
            requirement=name,
            sensor=leader and leader.sensor,
            before=_describe_leader(was.leaders.get(name)),
            said=next(leaders(of_it, tables.recordings)),
        )


def _describe_leader(leader: Leader | None) -> str | None:
    return leader and (leader.sensor if leader.fulfils else f"{leader.sensor}, which failed it")


def in_words(summary: Summary) -> str:
    """Return a summary as text."""
    new = sum(rejection.new for rejection in summary.rejected)
    counts = (
        f"{len(summary.new)} new, {len(summary.changed)} analysed again, "
        f"{len(summary.removed)} removed, {len(summary.skipped)} skipped; "
        f"{summary.recordings} in all, {len(summary.rejected)} of them rejected"
        + f"; {len(summary.failed)} failed"
        * bool(summary.failed)
    )
    counts += "".join(f"\n{line}" for line in summary.files)
    since = f"since {_format_time(summary.since)}" if summary.since else "the first run"
    lines = [
        f"imubench nightly: {summary.outcome}, {_format_time(summary.finished)}, "
        f"took {_format_duration(summary.seconds)}"
    ]
    if summary.failure:
        lines += ["", "why it failed:", *(f"  {one_line(line, 500)}" for line in summary.failure)]
    else:
        lines.append(f"recordings, {since}: {counts}")
    failed = "failed, left out of a report that is there, and tried again next time"
    rejected = sorted(summary.rejected, key=lambda rejection: not rejection.new)
    sections = {
        failed: [*left_out(summary.failed)],
        "new": summary.new,
        "analysed again": [f"{change.recording}: {change.because}" for change in summary.changed],
        "removed": summary.removed,
        "skipped, and looked at again next time": [
            _describe_skip(skip) for skip in summary.skipped
        ],
        f"rejected ({new or 'none'} of them new)": [
            f"{rejection.recording}{' (new)' * rejection.new}: {rejection.reason}"
            for rejection in rejected
        ],
        "new warnings": [_describe_warning(warning) for warning in summary.warnings],
        "devices that have changed": [_describe_drift(drift) for drift in summary.drift],
        "first for a requirement": [
            lead.said + f" (before: {lead.before})" * bool(lead.before) for lead in summary.first
        ],
        "put right after an earlier run": summary.put_right,
    }
    for title, entries in sections.items():
        if entries:
            lines += ["", f"{title}:", *_limit_lines(entries)]
    lines += ["", f"report: {summary.report}", f"log: {summary.log}"]
    return "\n".join(lines) + "\n"


def _describe_skip(skip: Skipped) -> str:
    stays = "; its results stay" * skip.keeps_results
    return f"{skip.recording}: {skip.reason}{stays} (since {_format_time(skip.since)})"


def _describe_warning(warning: NewWarning) -> str:
    channel = f"{warning.channel}: " if warning.channel else ""
    return f"{warning.recording}: {channel}{warning.finding.replace('_', ' ')}: {warning.detail}"


def _describe_drift(drift: Drift) -> str:
    value = f" {drift.value:.4g} {drift.unit}" if drift.value is not None else ""
    expected = ""
    if drift.expected_lower is not None and drift.expected_upper is not None:
        expected = f", expected {drift.expected_lower:.4g} to {drift.expected_upper:.4g}"
    return (
        f"{drift.sensor}, device {drift.device}: {drift.channel} {drift.parameter}{value} in "
        f"{drift.recording}{expected}" + f" ({drift.reason})" * bool(drift.reason)
    )


def _limit_lines(lines: list[str]) -> list[str]:
    more = len(lines) - _MAX_LINES
    shown = lines if more <= 1 else [*lines[:_MAX_LINES], f"and {more} more"]
    return [f"  {one_line(line, 300)}" for line in shown]


def _format_time(stamp: datetime) -> str:
    return stamp.astimezone().strftime("%Y-%m-%d %H:%M %Z")


def _format_duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s"
