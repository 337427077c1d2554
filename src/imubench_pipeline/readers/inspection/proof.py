"""Test a drafted sensor file by reading the first records of its log with it."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.readers import LogFile, read
from imubench_pipeline.readers.inspection.clock import typical_step
from imubench_pipeline.readers.inspection.draft import UNKNOWN, Draft, printable
from imubench_pipeline.settings.sensor import CHANNELS, LogFormat, Sensor
from imubench_pipeline.settings.validation import ConfigError, parse
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.units import from_si

_MIN_RECORDS, _MAX_BATCHES = 1000, 8
_STAND_IN_RATE = "1 Hz"
_STAND_IN_UNITS = {"gyro": "rad/s", "acce": "m/s^2", "temp": "degC", "time": "s"}
_QUANTITY_ORDER = ("gyro", "accel", "temperature")
_GRAVITY_TOLERANCE = 0.2


@dataclass(frozen=True)
class Proof:
    """Result of reading the first records with a draft."""

    read: bool
    """The records could be read."""
    said: str
    """One line about the records, or about the reason why they cannot be read."""


@dataclass
class _FirstRecords:
    """The first records of one file of a recording."""

    columns: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    rate: float | None = None
    started: str | None = None


def proof(path: Path, draft: Draft) -> Proof:
    """Read the first records of a recording with a draft.

    Missing units and rates are replaced by arbitrary ones, for this reading only.
    """
    unfilled = draft.unfilled()
    if any(key.endswith(".column") for key in unfilled):
        return Proof(False, f"not read: fill in {_list_keys(unfilled)}")
    try:
        if not unfilled:
            parse(Sensor, draft.sensor(), "the sensor file")
        log = parse(LogFormat, _fill_placeholders(draft.log()), "log")
        files = [_read_first_records(file) for file in read(path, log)]
    except (RecordingError, ConfigError) as error:
        return Proof(False, printable(f"not read so: {error}"))
    names = [name for file in files for name in file.columns]
    count = sum(name in CHANNELS for name in names)
    channels = f"{count} channel" + ("s" if count != 1 else "")
    channels += " and temperature" if len(names) > count else ""
    remarks = [channels, _describe_rate(files, draft), *_describe_vectors(files, unfilled)]
    started = next((file.started for file in files if file.started), None)
    if started is not None:
        remarks.append(f"from {started[:19]} on")
    rest = f"; left to fill in: {_list_keys(unfilled)}" if unfilled else ""
    return Proof(True, "read so: " + ", ".join(remarks) + rest)


def _fill_placeholders(log: dict[str, Any]) -> dict[str, Any]:
    """Return a log format with arbitrary values in place of the missing ones."""
    filled: dict[str, Any] = {
        key: _STAND_IN_RATE if entry == UNKNOWN else entry for key, entry in log.items()
    }
    for holder in (filled, filled["channels"]):
        for key, entry in holder.items():
            if isinstance(entry, dict) and entry.get("unit") == UNKNOWN:
                holder[key] = entry | {"unit": _STAND_IN_UNITS[key[:4]]}
    return filled


def _read_first_records(file: LogFile) -> _FirstRecords:
    """Read the first batches of a file."""
    parts: dict[str, list[NDArray[np.float64]]] = {name: [] for name in file.sources}
    times: list[NDArray[np.float64]] = []
    rows = 0
    for number, batch in enumerate(file.batches(), start=1):
        rows += len(batch)
        for name, values in batch.columns.items():
            parts[name].append(values)
        if batch.time is not None:
            times.append(batch.time)
        if rows >= _MIN_RECORDS or number >= _MAX_BATCHES:
            break
    if not rows:
        raise RecordingError(f"{file.path.name}: no record in its beginning")
    interval = typical_step(np.concatenate(times)) if times else None
    return _FirstRecords(
        {name: np.concatenate(values) for name, values in parts.items()},
        None if interval is None else 1 / interval,
        file.started,
    )


def _describe_rate(files: list[_FirstRecords], draft: Draft) -> str:
    if draft.time is None or draft.rate is not None:
        rate = draft.rate.value if draft.rate is not None else UNKNOWN
        return "no rate" if rate == UNKNOWN else f"{rate} as stated"
    if UNKNOWN in draft.time.value.values():
        return "no rate without the unit of time"
    rates: dict[str, float | None] = {}
    for file in files:
        for name in file.columns:
            rates.setdefault(name.split("_")[0], file.rate)
    if None in rates.values():
        return "stamps that do not advance"
    distinct = {f"{rate:.4g} Hz" for rate in rates.values() if rate is not None}
    if len(distinct) == 1:
        return f"{distinct.pop()} from the stamps"
    each = (f"{name} {rates[name]:.4g} Hz" for name in sorted(rates, key=_QUANTITY_ORDER.index))
    return ", ".join(each) + " from the stamps"


def _describe_vectors(files: list[_FirstRecords], unfilled: list[str]) -> list[str]:
    """Describe the lengths of the mean vectors of gyro and accelerometer."""
    means = {
        name: float(np.nanmean(values)) if np.isfinite(values).any() else np.nan
        for file in files
        for name, values in file.columns.items()
    }
    lengths = []
    for quantity, unit in (("gyro", "deg/s"), ("accel", "m/s^2")):
        axes = [means.get(f"{quantity}_{axis}", np.nan) for axis in "xyz"]
        if any(f".{quantity}_" in f".{key}" for key in unfilled) or not np.isfinite(axes).all():
            continue
        length = float(np.linalg.norm(axes))
        dimension = "angular_rate" if quantity == "gyro" else "acceleration"
        shown = from_si(length, unit, dimension)
        far = quantity == "accel" and abs(length / STANDARD_GRAVITY - 1) > _GRAVITY_TOLERANCE
        wrong = f" (gravity is {STANDARD_GRAVITY:.2f}: is the unit right?)" if far else ""
        lengths.append(f"|{quantity}| = {shown:.3g} {unit}{wrong}")
    return lengths


def _list_keys(keys: list[str]) -> str:
    """Return keys as text, with the axes of one quantity combined."""
    return ", ".join(dict.fromkeys(re.sub(r"_[xyz]\.", "_*.", key) for key in keys))
