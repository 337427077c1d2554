"""Interface of the readers: batches of SI samples, and findings on omitted data."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.model.states import Severity
from imubench_pipeline.readers.stated_units import StatedUnit
from imubench_pipeline.settings import sensor
from imubench_pipeline.tables.findings import Finding, find
from imubench_pipeline.units import find_conversion
from imubench_pipeline.words.findings.base import FindingData
from imubench_pipeline.words.findings.files import UnitContradicts

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # seconds in a unit of time stamps
_MIN_MAGNITUDE = 1e-75
"""Least magnitude of the largest value of a column, SI. A column of smaller values is set to 0:
they are no measurements, and their squares underflow."""

_MIN_FACTOR_OF_OTHER_UNIT = 1.5
"""Least ratio of two different units. The ratio of mg and cm/s² is 1.02, but no logger uses both;
the next one, of mrad/s and °/s, is 17. Smaller ratios may be a calibration in ``scale``."""


def name_settings_file(key: str) -> str:
    """Return the name of the file that declares the column of ``key``, for messages."""
    notes = "the notes beside the log or " if key == sensor.POSITION else ""
    return f"{notes}the sensor file"


@dataclass(frozen=True)
class Batch:
    """Consecutive records of one log file."""

    time: NDArray[np.float64] | None  # s since the first stamp of the file, shape (n,); NaN: none
    columns: Mapping[str, NDArray[np.float64]]  # rad/s, m/s² or °C, shape (n,); NaN: missing

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def after(self, records: int) -> "Batch":
        """Return the batch without its first ``records`` records."""
        time = None if self.time is None else self.time[records:]
        return Batch(time, {name: values[records:] for name, values in self.columns.items()})


@dataclass
class LogFile(ABC):
    """One file of a recording, read as a stream in bounded memory."""

    fixed_units: ClassVar[Mapping[str, str]] = {}
    fixed_by: ClassVar[str] = ""  # name of the format that fixes units by quantity

    path: Path
    log: sensor.LogFormat
    sources: Mapping[
        str, sensor.ColumnSource
    ]  # columns that are read from this file, with temperature
    started: str | None = None  # ISO 8601 date of the first sample, after the first batch
    rate: float | None = None  # Hz, stated in the file; known after the first batch
    findings: list[Finding] = field(default_factory=list)  # omitted data; complete after `batches`
    units: dict[str, StatedUnit] = field(default_factory=dict)  # stated in the file; see `started`
    simulated: bool = False  # the file has the mark of a simulated log; known after the first batch

    @abstractmethod
    def batches(self) -> Iterator[Batch]:
        """Yield the records in order; `RecordingError` if corrupt, or not as `log` describes."""

    def note(self, data: FindingData, value: float, severity: Severity = "warning") -> None:
        """Add a finding about the whole file; ``value``: its size, as in `Finding`."""
        self.findings.append(find(data, severity, value))

    def contradicted_units(self) -> list[Finding]:
        """Return findings on channels for which log and sensor file state different units."""
        fixed = {
            name: StatedUnit(self.fixed_units[sensor.quantity_of(name)], self.fixed_by)
            for name in self.sources
            if name in sensor.CHANNELS and self.fixed_units
        }
        findings = []
        for channel, in_log in (fixed | self.units).items():
            source = self.sources[channel]
            dimension = sensor.QUANTITIES[sensor.quantity_of(channel)]
            read = find_conversion(source.unit, dimension)[0] * abs(source.scale)
            factor = find_conversion(in_log.unit, dimension)[0] / read
            if 1.0 / _MIN_FACTOR_OF_OTHER_UNIT < factor < _MIN_FACTOR_OF_OTHER_UNIT:
                continue
            data = UnitContradicts(
                file=self.path.name,
                in_log=in_log.unit,
                where=in_log.where,
                in_sensor_file=source.unit,
                scale=source.scale,
                factor=factor,
            )
            findings.append(find(data, "warning", factor, channel))
        return findings

    def seconds(self, stamps: NDArray[Any], first: Any) -> NDArray[np.float64]:
        """Convert stamps as written to s since the stamp ``first``; exact for integers."""
        assert self.log.time is not None  # requested if there are stamps
        unit, scale = self.log.time.unit or "ns", self.log.time.scale
        if unit == "samples":
            assert self.log.rate_hz is not None  # checked with the sensor file
            return np.asarray((stamps - first) * scale / self.log.rate_hz, np.float64)
        return np.asarray((stamps - first) * (SECONDS[unit] * scale), np.float64)

    def to_si(self, name: str, raw: NDArray[np.float64]) -> NDArray[np.float64]:
        """Convert the values of column ``name`` to SI: scale * (raw - offset), then the unit."""
        source = self.sources[name]
        if name == sensor.POSITION:
            return source.scale * (raw - source.offset)
        others = {sensor.TEMPERATURE: "temperature", sensor.TABLE_RATE: "angular_rate"}
        dimension = others[name] if name in others else sensor.QUANTITIES[sensor.quantity_of(name)]
        factor, zero = find_conversion(source.unit, dimension)
        if source.offset:
            raw = raw - source.offset
        with np.errstate(over="ignore"):  # infinite, and counted as such
            figures = raw * (source.scale * factor)
        # One large value is enough, and is usually the first.
        small = len(figures) and not abs(figures[0]) >= _MIN_MAGNITUDE
        if small and max(np.fmax.reduce(figures), -np.fmin.reduce(figures)) < _MIN_MAGNITUDE:
            figures = np.where(np.isnan(figures), np.nan, 0.0)
        return figures + zero if zero else figures
