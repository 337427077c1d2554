"""Inspect a log and draft a sensor file for it: `imubench inspect`."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.earth import STANDARD_GRAVITY
from imubench_pipeline.readers import LogFile, read
from imubench_pipeline.readers.contents import Contents, list_contents
from imubench_pipeline.readers.file_format import LogTable
from imubench_pipeline.readers.inspection.clock import estimate_step
from imubench_pipeline.readers.inspection.draft import (
    UNKNOWN,
    Draft,
    Entry,
    format_draft,
    make_printable,
)
from imubench_pipeline.readers.inspection.drafting import draft_sensor_file
from imubench_pipeline.readers.inspection.names import interpret_label
from imubench_pipeline.readers.stated_units import find_bracketed
from imubench_pipeline.settings.sensor import CHANNELS, LogFormat, Sensor
from imubench_pipeline.settings.validation import ConfigError, parse
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.units import convert_from_si

__all__ = ["Draft", "Inspection", "Proof", "inspect"]


@dataclass(frozen=True)
class Inspection:
    """Contents of a recording, and the drafted sensor file."""

    listing: str  # the contents as text
    block: str  # the sensor file as YAML
    draft: Draft  # the sensor file as values
    proof: "Proof"  # result of reading the first records with it

    @property
    def complete(self) -> bool:
        """Whether the draft has no gaps and the log can be read with it."""
        return self.proof.read and not self.draft.unfilled()


def inspect(path: Path, model: str | None = None, topics: Sequence[str] = ()) -> Inspection:
    """Inspect a recording (file, folder, zip archive or ROS 2 bag) and draft a sensor file for it.

    Only the beginning of each file is read. ``model``: name of the sensor; None: the name of the
    log. ``topics``: topics of a bag to use; empty: all. Raises `RecordingError` if the recording
    cannot be read, lacks one of the topics, or has no column of numbers.
    """
    # Numbers in a damaged file may overflow.
    with np.errstate(all="ignore"):
        log = list_contents(path)
        if topics:
            log = _select_topics(log, topics)
        drafted = draft_sensor_file(log, model)
        return Inspection(
            format_contents(log),
            format_draft(drafted, path.name),
            drafted,
            check_draft(path, drafted),
        )


def _select_topics(log: Contents, topics: Sequence[str]) -> Contents:
    wanted = {topic.strip("/") for topic in topics}
    present = {table.name.strip("/"): table for table in log.tables}
    if missing := sorted(wanted - set(present)):
        names = ", ".join(table.name for table in log.tables if table.name) or "none"
        raise RecordingError(f"{log.path.name}: no topic {missing[0]}; name one of {names}")
    return replace(log, tables=tuple(present[name] for name in present if name in wanted))


_MAX_LINES = 40  # largest number of tables, and of columns of a table, that are listed
_MAX_NAME_WIDTH, _MAX_VALUES_WIDTH = 44, 60
_NOT_STATED = "-"


def format_contents(contents: Contents) -> str:
    """Return the tables of a recording with their columns, as text."""
    lines = [f"{make_printable(contents.path.name)}: {make_printable(contents.about)}"]
    stated: set[object] = set()
    for table in contents.tables[:_MAX_LINES]:
        rate = (table.file, table.rate)
        lines += _list_table(table, rate not in stated)
        stated.add(rate)
    if len(contents.tables) > _MAX_LINES:
        lines.append(f"... and {len(contents.tables) - _MAX_LINES} more")
    if contents.files > len({table.file for table in contents.tables}):
        lines.append(f"... of {contents.files} files")
    return "\n".join(lines) + "\n"


def _list_table(table: LogTable, with_rate: bool) -> Iterator[str]:
    title = " ".join(make_printable(text) for text in (table.file, table.name) if text)
    about = [table.about] if table.about else []
    if table.rows is not None and " x " not in table.about:
        about.append(f"{table.rows} records")
    if table.rate is not None and with_rate:
        about.append(f"states {table.rate:.6g} Hz")
    if table.started is not None:
        about.append(f"started {table.started}")
    if table.fault is not None:
        about = [table.fault]
    yield "  " + ": ".join(text for text in (title, make_printable("; ".join(about))) if text)
    for note in table.notes:
        yield f"    | {make_printable(note)}"
    rows = []
    for column in table.columns[:_MAX_LINES]:
        name = make_printable(column.label) or f"column {column.source}"
        meant = interpret_label(column.label)
        in_name = (meant and meant.unit) or ", ".join(find_bracketed(column.label))
        unit = _shorten(make_printable(column.unit or in_name or _NOT_STATED), 12)
        values = _shorten(", ".join(map(make_printable, column.first)), _MAX_VALUES_WIDTH)
        rows.append((_shorten(name, _MAX_NAME_WIDTH), column.kind, unit, values))
    widths = [max((len(row[place]) for row in rows), default=0) for place in range(3)]
    for row in rows:
        cells = (cell.ljust(width) for cell, width in zip(row, [*widths, 0], strict=True))
        yield ("    " + "  ".join(cells)).rstrip()
    if len(table.columns) > _MAX_LINES:
        yield f"    ... and {len(table.columns) - _MAX_LINES} more"


def _shorten(text: str, longest: int) -> str:
    return text if len(text) <= longest else text[: longest - 3] + "..."


_MIN_RECORDS, _MAX_BATCHES = 1000, 8
_STAND_IN_RATE = "1 Hz"
_STAND_IN_UNITS = {"gyro": "rad/s", "acce": "m/s^2", "temp": "degC", "time": "s"}
_QUANTITY_ORDER = ("gyro", "accel", "temperature")
_GRAVITY_TOLERANCE = 0.2


@dataclass(frozen=True)
class Proof:
    """Result of reading the first records with a draft."""

    read: bool  # the records could be read
    said: str  # one line about the records, or about the reason why they cannot be read


@dataclass
class _FirstRecords:
    columns: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    rate: float | None = None
    started: str | None = None


def check_draft(path: Path, draft: Draft) -> Proof:
    """Try to read the first records with a draft; missing units and rates are set arbitrarily."""
    unfilled = draft.unfilled()
    if any(key.endswith(".column") for key in unfilled):
        return Proof(False, f"not read: fill in {_list_keys(unfilled)}")
    try:
        if not unfilled:
            parse(Sensor, draft.sensor(), "the sensor file")
        filled = draft.with_units(
            lambda key, unit: _STAND_IN_UNITS[key[:4]] if unit == UNKNOWN else None
        )
        if draft.rate is not None and draft.rate.value == UNKNOWN:
            filled.rate = Entry(_STAND_IN_RATE)
        log = parse(LogFormat, filled.log(), "log")
        files = [_read_first_records(file) for file in read(path, log)]
    except (RecordingError, ConfigError) as error:
        return Proof(False, make_printable(f"not read so: {error}"))
    names = [name for file in files for name in file.columns]
    count = sum(name in CHANNELS for name in names)
    channels = f"{count} channel" + ("s" if count != 1 else "")
    channels += " and temperature" if len(names) > count else ""
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
        shown = convert_from_si(length, unit, dimension)
        far = quantity == "accel" and abs(length / STANDARD_GRAVITY - 1) > _GRAVITY_TOLERANCE
        wrong = f" (gravity is {STANDARD_GRAVITY:.2f}: is the unit right?)" if far else ""
        lengths.append(f"|{quantity}| = {shown:.3g} {unit}{wrong}")
    remarks = [channels, _describe_rate(files, draft), *lengths]
    started = next((file.started for file in files if file.started), None)
    if started is not None:
        remarks.append(f"from {started[:19]} on")
    rest = f"; left to fill in: {_list_keys(unfilled)}" if unfilled else ""
    return Proof(True, "read so: " + ", ".join(remarks) + rest)


def _read_first_records(file: LogFile) -> _FirstRecords:
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
        raise RecordingError(f"{file.path.name}: no record at its beginning; expected some")
    interval = estimate_step(np.concatenate(times)) if times else None
    return _FirstRecords(
        {name: np.concatenate(values) for name, values in parts.items()},
        None if interval is None else 1 / interval,
        file.started,
    )


def _describe_rate(files: list[_FirstRecords], draft: Draft) -> str:
    if draft.time is None or draft.rate is not None:
        rate = draft.rate.value if draft.rate is not None else UNKNOWN
        return "no rate" if rate == UNKNOWN else f"{rate} as stated"
    if draft.time.value.unit == UNKNOWN:
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


def _list_keys(keys: list[str]) -> str:
    return ", ".join(dict.fromkeys(re.sub(r"_[xyz]\.", "_*.", key) for key in keys))
