"""What every reader gives: batches of SI samples, and findings on what it left out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.stated_units import StatedUnit, contradictions
from imubench_pipeline.settings.sensor import (
    CHANNELS,
    POSITION,
    QUANTITIES,
    TABLE_RATE,
    TEMPERATURE,
    ColumnSource,
    LogFormat,
    quantity_of,
)
from imubench_pipeline.tables.findings import Finding, Severity
from imubench_pipeline.units import conversion

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""Seconds in a unit of time stamps."""

_LEAST = 1e-75
"""SI. Less was never measured, and its square is 0: a column of such figures is one of zeros."""


def stated_in(key: str) -> str:
    """Return where it is to be mended from which column a channel, or what is beside, is read."""
    notes = "the notes beside the log or " if key == POSITION else ""
    return f"{notes}the sensor file"


@dataclass(frozen=True)
class Batch:
    """Consecutive records of one log file."""

    time: NDArray[np.float64] | None
    """s since the first stamp of the file, shape (n,); NaN where the stamp is missing."""
    columns: Mapping[str, NDArray[np.float64]]
    """rad/s, m/s² or °C by channel, shape (n,); NaN where the sample is missing."""

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def after(self, records: int) -> Batch:
        """Return it without its first records."""
        time = None if self.time is None else self.time[records:]
        return Batch(time, {name: values[records:] for name, values in self.columns.items()})


@dataclass
class LogFile(ABC):
    """One file of a recording, read as a stream in bounded memory."""

    fixed_units: ClassVar[Mapping[str, str]] = {}
    fixed_by: ClassVar[str] = ""
    """Units that the format fixes, by quantity, and what it is called."""

    path: Path
    log: LogFormat
    sources: Mapping[str, ColumnSource]
    """The columns that are taken from this file: channels, and perhaps temperature."""
    started: str | None = None
    """ISO 8601 date and time of the first sample, known after the first batch."""
    rate: float | None = None
    """Sampling rate that the file itself states, Hz; known after the first batch."""
    findings: list[Finding] = field(default_factory=list)
    """What was left out or passed over; complete once `batches` is exhausted."""
    units: dict[str, StatedUnit] = field(default_factory=dict)
    """Units of channels that the file itself states, known after the first batch."""
    simulated: bool = False
    """The file has the mark of a simulated log; known after the first batch."""

    @abstractmethod
    def batches(self) -> Iterator[Batch]:
        """Yield the records in the order of the file.

        Raises
        ------
        RecordingError
            If the file is not what its sensor file says, or is corrupt inside.
        """

    def note(self, finding: str, text: str, value: float, severity: Severity = "warning") -> None:
        """Add a finding about the whole file."""
        self.findings.append(Finding(finding, severity, f"{self.path.name}: {text}", value))

    def contradicted_units(self) -> list[Finding]:
        """Return the channels of which the file states another unit than the sensor file."""
        fixed = {
            name: StatedUnit(self.fixed_units[quantity_of(name)], self.fixed_by)
            for name in self.sources
            if name in CHANNELS and self.fixed_units
        }
        return contradictions(self.path.name, self.sources, fixed | self.units)

    def seconds(self, stamps: NDArray[Any], first: Any) -> NDArray[np.float64]:
        """Convert stamps as written to s since the first one; integers lose no digit."""
        assert self.log.time is not None  # asked for where there are stamps
        unit, scale = self.log.time.unit or "ns", self.log.time.scale
        if unit == "samples":
            assert self.log.rate_hz is not None  # checked with the sensor file
            return np.asarray((stamps - first) * scale / self.log.rate_hz, np.float64)
        return np.asarray((stamps - first) * (SECONDS[unit] * scale), np.float64)

    def to_si(self, name: str, raw: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert the figures of a column as written to SI: scale * (raw - offset), then unit."""
        source = self.sources[name]
        if name == POSITION:
            return source.scale * (raw - source.offset)
        others = {TEMPERATURE: "temperature", TABLE_RATE: "angular_rate"}
        dimension = others[name] if name in others else QUANTITIES[quantity_of(name)]
        factor, zero = conversion(source.unit, dimension)
        if source.offset:
            raw = raw - source.offset
        with np.errstate(over="ignore"):  # infinite, and counted as such
            figures = raw * (source.scale * factor)
        if len(figures) and max(np.fmax.reduce(figures), -np.fmin.reduce(figures)) < _LEAST:
            figures = np.where(np.isnan(figures), np.nan, 0.0)
        return figures + zero if zero else figures
