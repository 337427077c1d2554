"""Findings about recordings, and the errors that reject them."""

import json
import re
from dataclasses import asdict, dataclass, fields

from imubench_pipeline.model.recordings import FindingRow
from imubench_pipeline.model.states import Severity
from imubench_pipeline.words.findings.base import FindingData

LEFT_OUT = ("rejected", "failed")  # codes of findings about left-out recordings, listed separately

_HALF_REASON = 700
_ADDRESS = re.compile(r" at 0x[0-9a-f]{6,}")


@dataclass(frozen=True)
class Finding:
    """One finding about a recording or one of its channels."""

    finding: str  # code, such as ``missing_samples``
    severity: Severity  # ``fatal``: the channel or recording is left out of the analysis
    detail: str  # in words, with the unit of ``value`` and what to do
    value: float  # size
    channel: str | None = None  # None: the whole recording
    # start, end: its part of the recording, s from the first sample; None: all of it
    start: float | None = None
    end: float | None = None
    affects: tuple[str, ...] = ()  # doubtful parameters
    data: str | None = None  # data of the finding (`imubench_pipeline.words.findings`) as JSON

    def row(self, sensor: str, recording: str) -> FindingRow:
        """Return the row of the table ``findings``."""
        own = {field.name: getattr(self, field.name) for field in fields(self)}
        return FindingRow(sensor=sensor, recording=recording, **own)


def find(
    data: FindingData,
    severity: Severity,
    value: float,
    channel: str | None = None,
    start: float | None = None,
    end: float | None = None,
) -> Finding:
    """Return a finding from its data; the other arguments are as in `Finding`."""
    detail, affects = data.text(channel or ""), tuple(sorted(data.affects))
    where = channel, start, end
    return Finding(data.code, severity, detail, value, *where, affects, json.dumps(asdict(data)))


def make_finding(row: FindingRow) -> Finding:
    """Convert a row of the table ``findings`` back to a `Finding`."""
    return Finding(**{field.name: getattr(row, field.name) for field in fields(Finding)})


def remove_addresses(reason: str) -> str:
    """Return a text without memory addresses of objects, which differ between runs."""
    return _ADDRESS.sub("", reason)


class RecordingError(ValueError):
    """A recording that cannot be used; long messages are shortened, and all are made printable."""

    def __init__(self, reason: str) -> None:
        if not reason.isprintable():
            reason = "".join(sign if sign.isprintable() else "?" for sign in reason)
        reason = remove_addresses(reason)
        if len(reason) > 2 * _HALF_REASON:
            reason = f"{reason[:_HALF_REASON]} [...] {reason[-_HALF_REASON:]}"
        super().__init__(reason)


class UnavailableError(OSError):
    """A log that cannot be read now, for an external reason, such as a missing mount."""
