"""Log files -> Parquet in SI, with what was found wrong on the way; memory stays bounded."""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from imubench_pipeline import timebase
from imubench_pipeline.config import QualitySettings
from imubench_pipeline.findings import Finding
from imubench_pipeline.quality import Spread, column_findings
from imubench_pipeline.readers import TEMPERATURE, LogFile, RecordingError, log_files, read
from imubench_pipeline.recording import LogWriter, channel_logs, log_paths
from imubench_pipeline.results import Quality
from imubench_pipeline.sensor import LogFormat, RecordingNotes, UsedPart, quantity_of

_STAMP_BLOCK = 1 << 20


@dataclass
class _Part:
    """One file of the recording, read once into columns and stamps."""

    source: LogFile
    data: Path
    stamps_path: Path
    writer: LogWriter
    rows: int = 0
    not_used: int = 0
    spreads: dict[str, Spread] = field(default_factory=dict)
    stamped: bool = False
    digest: str = ""

    def stamps(self) -> Iterator[NDArray[np.float64]]:
        """Yield the stamps in s, from the disk."""
        for start in range(0, self.rows, _STAMP_BLOCK):
            yield np.fromfile(self.stamps_path, np.float64, _STAMP_BLOCK, offset=8 * start)


@dataclass(frozen=True)
class Ingested:
    """What was kept of a recording.

    Attributes
    ----------
    summary : dict
        A row of the table ``recordings`` without the names.
    findings : list of Finding
    channels : dict
        Rate in Hz, points of the grid and segments of each channel that goes on.
    """

    summary: dict[str, Any]
    findings: list[Finding]
    channels: dict[str, dict[str, Any]] = field(default_factory=dict)

    def quality(self, names: dict[str, Any]) -> Quality:
        """Return what ``quality.json`` says, with the names of the recording."""
        status = "ok" if self.channels else "rejected"
        sensor, recording = names["sensor"], names["recording"]
        return Quality(
            names | {"status": status} | self.summary,
            [dict(finding.row(sensor, recording)) for finding in self.findings],
            self.channels,
        )


def ingest(
    source: Path,
    log: LogFormat,
    notes: RecordingNotes,
    settings: QualitySettings,
    folder: Path,
    provenance: dict[str, Any],
) -> Ingested:
    """Read a recording and keep it as Parquet in ``folder``.

    Parameters
    ----------
    source : Path
        The log file, or the folder of a recording.
    log : LogFormat
    notes : RecordingNotes
        The part to use, and when it started.
    settings : QualitySettings
    folder : Path
        Where the Parquet files go; those of an earlier run are replaced.
    provenance : dict
        Goes into the metadata of every file, as it is.

    Raises
    ------
    RecordingError
        If the recording cannot be used; nothing is left in ``folder`` then.
    """
    folder.mkdir(parents=True, exist_ok=True)
    remove_kept(folder)
    scratch = Path(tempfile.mkdtemp(prefix=".ingest.", suffix=".part", dir=folder))
    try:
        return _ingest(source, log, notes, settings, folder, scratch, provenance)
    finally:
        shutil.rmtree(scratch)


def remove_kept(folder: Path) -> None:
    """Remove the log of an earlier run, and what a killed one left."""
    for path in log_paths(folder):
        path.unlink()
    for path in folder.glob(".ingest.*.part"):
        shutil.rmtree(path, ignore_errors=True)


def _ingest(
    source: Path,
    log: LogFormat,
    notes: RecordingNotes,
    settings: QualitySettings,
    folder: Path,
    scratch: Path,
    provenance: dict[str, Any],
) -> Ingested:
    parts = [
        _read_part(file, notes.use, scratch, number)
        for number, file in enumerate(read(source, log))
    ]
    findings = [finding for part in parts for finding in part.source.findings]
    bases = [_base(part, log, settings) for part in parts]
    for part in parts:
        findings += column_findings(part.spreads, settings.shortest)
    unusable = {finding.channel for finding in findings if finding.severity == "fatal"}
    groups = _shared_bases(parts, bases)
    if len({part.rows for part in parts if not part.stamped}) > 1:
        lengths = ", ".join(f"{part.source.path.name} {part.rows}" for part in parts)
        rows = [part.rows for part in parts]
        findings.append(
            Finding(
                "unequal_length",
                "warning",
                f"files without stamps differ in length ({lengths} samples): the shorter ones may "
                "be cut short",
                max(rows) - min(rows),
            )
        )
    names = _names(parts, groups)
    metadata = provenance | {
        "sources": [
            {"name": path.name, "size": path.stat().st_size, "sha256": _sha256(path)}
            for path in log_files(source)
        ],
        "reader": log.reader,
        "started": notes.started
        or next((p.source.started for p in parts if p.source.started), None),
    }
    written: list[tuple[Path, Path]] = []
    for name, group in zip(names, groups, strict=True):
        base = bases[group[0]]
        findings += [f for f in base.findings if f not in findings]
        chosen = [parts[index] for index in group]
        holes = {
            channel: bool(base.missing or spread.missing or spread.not_finite)
            for part in chosen
            for channel, spread in part.spreads.items()
        }
        about = metadata | {
            "rate": base.rate,
            "rate_from": base.source,
            "rows": base.rows,
            "grid": base.grid,
            "segments": [list(segment) for segment in base.segments],
            "uniform": base.uniform,
            "holes": holes,
            "unusable": sorted(channel for channel in unusable if channel),
        }
        written.append((_assemble(chosen, base, settings, about, scratch / name), folder / name))
    summary = _summary(parts, bases, metadata["started"])
    if all(channel in unusable for channel in log.channels):
        reasons = "; ".join(f.detail for f in findings if f.severity == "fatal")
        raise RecordingError(f"no channel can be used: {reasons}")
    for temporary, final in written:
        temporary.replace(final)
    channels = {
        name: {"rate": kept.rate, "grid": kept.grid, "segments": kept.segments}
        for name, kept in channel_logs(folder).items()
    }
    return Ingested(summary, findings, channels)


def _read_part(file: LogFile, use: UsedPart, scratch: Path, number: int) -> _Part:
    data, stamps_path = scratch / f"part{number}.parquet", scratch / f"part{number}.stamps"
    columns = list(file.sources)
    writer = LogWriter(data, dict.fromkeys(columns, pa.float64()))
    part = _Part(file, data, stamps_path, writer, spreads={name: Spread() for name in columns})
    rate = file.log.rate_hz
    digest = hashlib.blake2b()
    read_rows = 0
    with stamps_path.open("wb") as stamps:
        for batch in file.batches():
            time = batch.time
            if time is None:
                assert rate is not None  # checked with the sensor file
                clock = np.arange(read_rows, read_rows + len(batch)) / rate
            else:
                clock = time
                part.stamped = True
            read_rows += len(batch)
            # A record without a stamp is not known to lie outside.
            keep = ~(clock < use.start)
            if use.end is not None:
                keep &= ~(clock > use.end)
            whole = bool(keep.all())
            part.not_used += len(batch) - int(keep.sum())
            if time is not None:
                kept_time = np.ascontiguousarray(time if whole else time[keep])
                kept_time.tofile(stamps)
                digest.update(kept_time.tobytes())
            kept = {
                name: part.spreads[name].add(values if whole else values[keep])
                for name, values in batch.columns.items()
            }
            part.rows += int(keep.sum())
            writer.write(kept)
    if part.rows == 0:
        raise RecordingError(
            f"{file.path.name}: none of its {read_rows} samples lies in the part to use "
            f"(use: start {use.start} s, end {use.end or 'open'})"
        )
    if part.not_used:
        file.findings.append(
            Finding(
                "not_used",
                "note",
                f"{file.path.name}: {part.not_used} samples lie outside the part to use",
                part.not_used,
            )
        )
    part.digest = digest.hexdigest() if part.stamped else ""
    return part


def _base(part: _Part, log: LogFormat, settings: QualitySettings) -> timebase.TimeBase:
    if not part.stamped:
        assert log.rate_hz is not None  # checked with the sensor file
        return timebase.without_stamps(part.rows, log.rate_hz)
    try:
        return timebase.from_stamps(part.stamps, log.rate_hz, settings)
    except RecordingError as error:
        raise RecordingError(f"{part.source.path.name}: {error}") from None


def _shared_bases(parts: list[_Part], bases: list[timebase.TimeBase]) -> list[list[int]]:
    """Group the files that have the same clock: the same stamps, or as many samples and none."""
    groups: dict[tuple[object, ...], list[int]] = {}
    for index, (part, base) in enumerate(zip(parts, bases, strict=True)):
        groups.setdefault((part.digest, part.rows, base.rate), []).append(index)
    return list(groups.values())


def _names(parts: list[_Part], groups: list[list[int]]) -> list[str]:
    """Name the Parquet file of each clock after the quantity or the channels it holds."""
    if len(groups) == 1:
        return ["log.parquet"]
    contents = [[name for index in group for name in parts[index].spreads] for group in groups]
    quantities = [sorted({quantity_of(name) for name in names}) for names in contents]
    names = []
    for held, kinds in zip(contents, quantities, strict=True):
        alone = len(kinds) == 1 and quantities.count(kinds) == 1
        names.append(f"log.{kinds[0] if alone else '+'.join(held)}.parquet")
    return names


def _assemble(
    parts: list[_Part],
    base: timebase.TimeBase,
    settings: QualitySettings,
    metadata: dict[str, Any],
    path: Path,
) -> Path:
    """Close the columns of files that share a clock into one Parquet file."""
    for part in parts:
        part.writer.finish(metadata)
        part.writer.__exit__(None, None, None)
    if len(parts) == 1 and base.uniform:
        return parts[0].data
    columns: dict[str, pa.DataType] = {}
    if not base.uniform:
        columns["time"] = pa.float64()
    if base.stamped and not base.uniform:
        columns["sample"] = pa.int64()
    for part in parts:
        columns |= dict.fromkeys(part.spreads, pa.float64())
    blocks = _columns_of(parts)
    with LogWriter(path, columns) as writer:
        if base.uniform:
            for block in blocks:
                writer.write(block)
        else:
            first = None
            places = timebase.positions(base, parts[0].stamps, settings)
            for block, stamps, points in zip(blocks, parts[0].stamps(), places, strict=True):
                first = stamps[0] if first is None else first
                block["time"] = stamps - first
                if base.stamped:
                    block["sample"] = points
                keep = points >= 0
                writer.write({name: values[keep] for name, values in block.items()})
        writer.finish(metadata)
    return path


def _columns_of(parts: list[_Part]) -> Iterator[dict[str, NDArray[Any]]]:
    """Yield the columns of several files side by side, a row group at a time."""
    files = [pq.ParquetFile(part.data) for part in parts]
    try:
        for group in range(files[0].num_row_groups):
            block: dict[str, NDArray[Any]] = {}
            for file in files:
                table = file.read_row_group(group, use_threads=False)
                block |= {name: table.column(name).to_numpy() for name in table.column_names}
            yield block
    finally:
        for file in files:
            file.close()


def _summary(
    parts: list[_Part], bases: list[timebase.TimeBase], started: str | None
) -> dict[str, Any]:
    measured = [i for i, part in enumerate(parts) if set(part.spreads) != {TEMPERATURE}]
    longest = max(measured, key=lambda index: bases[index].rows)
    base = bases[longest]
    temperature = next(
        (part.spreads[TEMPERATURE] for part in parts if TEMPERATURE in part.spreads), Spread()
    )
    known = temperature.present > 0
    return {
        "started": started,
        "rate": base.rate,
        "samples": base.samples,
        "duration": base.grid / base.rate,
        "temperature_min": temperature.low if known else None,
        "temperature_max": temperature.high if known else None,
    }


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def rejected(error: RecordingError, notes: RecordingNotes) -> Ingested:
    """Return what is recorded of a recording that cannot be used."""
    summary = {"started": notes.started, "reason": str(error)}
    return Ingested(summary, [Finding("rejected", "fatal", str(error), 1)])
