"""A finding: what is wrong with a recording, or worth knowing of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

LEFT_OUT = ("rejected", "failed")
"""Findings that a recording is left out, with the reason: they are listed by themselves."""

Severity = Literal["note", "warning", "fatal"]


@dataclass(frozen=True)
class Finding:
    """One finding about a recording or one of its channels.

    Attributes
    ----------
    finding : str
        Its name, such as ``missing_samples``.
    severity : {"note", "warning", "fatal"}
        ``fatal``: the channel, or the whole recording, is left out of the analysis.
    detail : str
        In words, with the unit of ``value`` and what to do.
    value : float
        Its size.
    channel : str or None
        None: the whole recording.
    start, end : float or None
        The part of the recording that it concerns, s from the first sample; None: all of it.
    """

    finding: str
    severity: Severity
    detail: str
    value: float
    channel: str | None = None
    start: float | None = None
    end: float | None = None

    def row(self, sensor: str, recording: str) -> Mapping[str, Any]:
        """Return the row of the table ``findings``."""
        return {"sensor": sensor, "recording": recording, **asdict(self)}
