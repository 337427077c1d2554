"""A finding: what is wrong with a recording, or worth knowing of it, or why it cannot be used."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass, fields

from imubench_pipeline.model.recordings import FindingRow
from imubench_pipeline.model.states import Severity
from imubench_pipeline.words.findings.base import FindingData

LEFT_OUT = ("rejected", "failed")
"""Findings that a recording is left out, with the reason: they are listed by themselves."""


_HALF_REASON = 700
_ADDRESS = re.compile(r" at 0x[0-9a-f]{6,}")


@dataclass(frozen=True)
class Finding:
    """One finding about a recording or one of its channels."""

    finding: str
    """Its name, such as ``missing_samples``."""
    severity: Severity
    """``fatal``: the channel, or the whole recording, is left out of the analysis."""
    detail: str
    """In words, with the unit of ``value`` and what to do."""
    value: float
    """Its size."""
    channel: str | None = None
    """None: the whole recording."""
    start: float | None = None
    end: float | None = None
    """The part of the recording that it concerns, s from the first sample; None: all of it."""
    affects: tuple[str, ...] = ()
    """Parameters whose estimates it puts in doubt."""
    data: str | None = None
    """Its data (`imubench_pipeline.words.findings`) as JSON."""

    def row(self, sensor: str, recording: str) -> FindingRow:
        """Return the row of the table ``findings``."""
        return FindingRow(
            sensor=sensor,
            recording=recording,
            channel=self.channel,
            finding=self.finding,
            severity=self.severity,
            detail=self.detail,
            value=self.value,
            start=self.start,
            end=self.end,
            affects=self.affects,
            data=self.data,
        )


def find(
    data: FindingData,
    severity: Severity,
    value: float,
    channel: str | None = None,
    start: float | None = None,
    end: float | None = None,
) -> Finding:
    """Return a finding from its data; the other arguments are as in `Finding`."""
    return Finding(
        data.code,
        severity,
        data.text(channel or ""),
        value,
        channel,
        start,
        end,
        tuple(sorted(data.affects)),
        json.dumps(asdict(data)),
    )


def finding_of(row: FindingRow) -> Finding:
    """Return the finding that a row of the table ``findings`` stands for."""
    return Finding(**{field.name: getattr(row, field.name) for field in fields(Finding)})


def without_addresses(reason: str) -> str:
    """Return a text without addresses of objects, which are others in each run."""
    return _ADDRESS.sub("", reason)


class RecordingError(ValueError):
    """A recording that cannot be used; the text is the reason, with what to mend.

    What a damaged file puts into it, such as a name of a million letters, is left out of the
    middle; of what is no sign to print, such as a line break in a name, a question mark is left.
    The address of an object, which a library may print, is another one in each run: it is left out.
    """

    def __init__(self, reason: str) -> None:
        if not reason.isprintable():
            reason = "".join(sign if sign.isprintable() else "?" for sign in reason)
        reason = without_addresses(reason)
        if len(reason) > 2 * _HALF_REASON:
            reason = f"{reason[:_HALF_REASON]} [...] {reason[-_HALF_REASON:]}"
        super().__init__(reason)


class UnavailableError(OSError):
    """A log that cannot be read now, for a reason outside of it, such as a mount that is away.

    It says nothing about the log: the ingest fails, and the next run tries again.
    """
