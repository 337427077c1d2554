"""Differences between the results of two runs, A and B."""

from dataclasses import dataclass
from typing import Literal

DifferenceKind = Literal[
    "recording_status",
    "value_lost",
    "verdict",
    "beyond_intervals",
    "new_finding",
    "finding_gone",
    "parameter_status",
    "value_gained",
    "only_in_a",
    "only_in_b",
    "within_intervals",
]
"""Kind of a difference, the most important first."""


@dataclass(frozen=True)
class ResultKey:
    """The table, recording, channel and name that identify a result in a run."""

    table: str
    sensor: str
    recording: str | None = None
    channel: str | None = None
    name: str | None = None  # parameter, requirement or finding
    component: int | None = None  # number of a repeated term, from 1


@dataclass(frozen=True)
class Result:
    """A result of a run; numbers are in SI."""

    state: str  # fitness or status, verdict, severity
    value: float | None = None
    lower: float | None = None
    upper: float | None = None
    unit: str | None = None
    detail: str | None = None


@dataclass(frozen=True)
class RunDifference:
    """A difference between two runs; ``regression``: run B is worse."""

    kind: DifferenceKind
    key: ResultKey
    a: Result | None
    b: Result | None
    regression: bool = False
    ratio: float | None = None  # value of run B over value of run A
