"""Load ingested samples; refuse altered ones."""

import contextlib
import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pyarrow as pa
from pydantic import TypeAdapter

from imubench_pipeline.model.recordings import FindingRow, RecordingRow
from imubench_pipeline.recordings.quality.levels import Level
from imubench_pipeline.recordings.quality.rotation import GravityTurn
from imubench_pipeline.recordings.recording import (
    MEND,
    ChannelLog,
    SampleCounts,
    list_log_files,
    locate_samples,
    open_channel_logs,
    read_metadata,
    remove_samples,
    was_at_rest,
)
from imubench_pipeline.tables.failures import Failure
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.tables.parquet import SEAL, is_seal_broken, read_footer
from imubench_pipeline.tables.seals import compute_digest, read_sealed_json, write_sealed_json


@dataclass(frozen=True, kw_only=True)
class AnalysedChannel(Level, SampleCounts):
    """Level, grid and segments of a channel, and its numbers of samples."""

    grid: int
    segments: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class KeptFile:
    """Size in bytes and digests (of the metadata, of the file) of a Parquet file of samples."""

    size: int
    footer: str
    sha256: str

    def is_removed(self, path: Path) -> bool:
        """Return whether a file is the remainder of this one after its samples were removed."""
        try:
            sealed = SEAL in read_footer(path) and not is_seal_broken(path)
            return sealed and read_metadata(path).removed == self.sha256
        except (OSError, ValueError, KeyError, pa.ArrowException):
            return False


@dataclass(frozen=True)
class Quality:
    """``quality.json``: the findings of the ingest, the analysed channels, and a digest at its end.

    It contains the digests of the samples: if they change, the results are computed again.
    """

    recording: RecordingRow
    findings: list[FindingRow]
    channels: Mapping[str, AnalysedChannel]
    kept: Mapping[str, KeptFile] | None = None  # the files of samples; None: not known
    failure: Failure | None = None  # why the ingest failed
    gravity: GravityTurn | None = None  # how gravity turns against the sensor

    @property
    def grids(self) -> dict[str, int]:
        """Number of samples of each analysed channel, including missing ones."""
        return {name: channel.grid for name, channel in self.channels.items()}

    @classmethod
    def read(cls, path: Path) -> "Quality":
        """Read the file that `write` wrote; raise RecordingError if it is damaged."""
        try:
            return _make_adapter().validate_python(read_sealed_json(path))
        except ValueError as error:  # other letters, or other keys
            raise RecordingError(f"{path}: was changed after the ingest: {MEND}") from error

    def has_removed_samples(self, folder: Path) -> bool:
        """Return whether samples in a folder were removed to save space."""
        return any(stated.is_removed(folder / name) for name, stated in (self.kept or {}).items())

    def write(self, path: Path) -> None:
        """Write the file, atomically."""
        write_sealed_json(asdict(self), path)

    def fault(self, folder: Path, *, whole: bool = False) -> str | None:
        """Return the fault of the samples in a folder, or None; ``whole``: read the whole files."""
        for name, stated in (self.kept or {}).items():
            path = locate_samples(folder) / name
            try:
                if path.stat().st_size != stated.size:
                    if stated.is_removed(path):
                        continue
                    wrong = f"has {path.stat().st_size} bytes instead of {stated.size}"
                elif _footer(path) != stated.footer or (
                    whole and compute_digest(path) != stated.sha256
                ):
                    wrong = "was changed after the ingest"
                else:
                    continue
            except FileNotFoundError:
                return f"{path}: is no longer there: run again, and the log is read again"
            except OSError as error:
                wrong = f"cannot be read ({error.strerror})"
            return f"{path}: {wrong}: {MEND}"
        return None


@cache
def _make_adapter() -> TypeAdapter[Quality]:
    return TypeAdapter(Quality)


def describe_outcome(results: Path, sensor: str, recording: str) -> str:
    """Return the outcome of a recording in one line: used, with doubts, or rejected."""
    name = f"{sensor}/{recording}"
    try:
        quality = Quality.read(results / "recordings" / sensor / recording / "quality.json")
    except (OSError, RecordingError) as error:
        return f"{name}: {error}"
    about = quality.recording
    if about.status != "ok" or about.duration is None:
        return f"{name}: {about.status}: {about.reason}"
    kinds = dict.fromkeys(
        row.finding.replace("_", " ") for row in quality.findings if row.severity != "note"
    )
    hours = about.duration / 3600.0
    text = f"{name}: {hours:.3g} h at {about.rate:.6g} Hz, {len(quality.channels)} channels"
    return text + (f"; in doubt: {', '.join(kinds)}" if kinds else "")


def identify_files(paths: Iterable[Path]) -> dict[str, KeptFile]:
    """Return size and digests of Parquet files, by name."""
    return {
        path.name: KeptFile(path.stat().st_size, _footer(path), compute_digest(path))
        for path in paths
    }


def _footer(path: Path) -> str:
    return hashlib.sha256(read_footer(path)).hexdigest()


def remove_old_samples(folders: Iterable[Path], keep: int) -> tuple[int, int]:
    """Remove the samples of analysed recordings, except the ``keep`` latest ones of each device.

    Recordings whose notes name no device count together, by sensor. Altered samples are not
    removed. Returns the number of recordings and of bytes that were removed.
    """
    devices: dict[tuple[str, str], list[tuple[str, str, Path, Quality]]] = {}
    for folder in folders:
        with contextlib.suppress(OSError, RecordingError):
            quality = Quality.read(folder / "quality.json")
            about = quality.recording
            device = "" if about.device == about.recording else about.device
            listed = devices.setdefault((about.sensor, device), [])
            listed.append((about.started or "", about.recording, folder, quality))
    number = size = 0
    for listed in devices.values():
        listed.sort(key=lambda one: one[:2])
        for _, _, folder, quality in listed[: max(len(listed) - keep, 0)]:
            present = {
                name: file
                for name, file in (quality.kept or {}).items()
                if not file.is_removed(folder / name)
            }
            if present and not quality.fault(folder):
                for name, file in present.items():
                    remove_samples(folder / name, file.sha256)
                    size += file.size
                number += 1
    return number, size


def load_logs(folder: Path) -> dict[str, ChannelLog]:
    """Return the usable channels of a recording, by name; none of a rejected one.

    Raises RecordingError if files of samples are missing, damaged, or not from the ingest.
    """
    quality = Quality.read(folder / "quality.json")
    if fault := quality.fault(folder):
        raise RecordingError(fault)
    if quality.has_removed_samples(folder):
        raise RecordingError(
            f"{folder}: its samples were removed to save space (samples.keep), and this step needs "
            "them; run again with the log in the drop zone to read it again"
        )
    if quality.kept is not None:
        for path in list_log_files(folder):
            if path.name not in quality.kept:
                raise RecordingError(f"{path}: was not written by the ingest: {MEND}")
    return open_channel_logs(folder)


def load_static_logs(folder: Path) -> dict[str, ChannelLog]:
    """Return the usable channels of a recording (`load_logs`); none if the sensor was turned."""
    logs = load_logs(folder)
    return logs if was_at_rest(folder) else {}


def find_static_recordings(
    folders: Sequence[Path], far: Callable[[RecordingRow], tuple[bool, ...]]
) -> list[tuple[RecordingRow, Path]]:
    """Return usable static recordings, sorted by ``far`` (False first), then the longest first."""

    def order(recording: tuple[RecordingRow, Path]) -> tuple[Any, ...]:
        row = recording[0]
        return *far(row), -(row.duration or 0.0), row.recording

    every = [(Quality.read(folder / "quality.json").recording, folder) for folder in folders]
    usable = [kept for kept in every if (kept[0].kind, kept[0].status) == ("static", "ok")]
    return sorted(usable, key=order)
