"""Load ingested samples; refuse altered ones."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from imubench_pipeline.model.recordings import FindingRow, RecordingRow
from imubench_pipeline.recordings.recording import (
    MEND,
    ChannelLog,
    list_log_files,
    open_channel_logs,
    was_at_rest,
)
from imubench_pipeline.tables.digests import compute_digest, read_sealed_json, write_sealed_json
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.tables.parquet import read_footer


@dataclass(frozen=True)
class Quality:
    """``quality.json``: the findings of the ingest, the analysed channels, and a digest at its end.

    It has the digests of the samples, so that the results are computed again where these change.
    """

    recording: dict[str, Any]
    findings: list[FindingRow]
    channels: dict[str, dict[str, Any]]
    kept: dict[str, dict[str, Any]] | None = None  # samples, as `identify_files` gives them
    failure: dict[str, Any] | None = None  # why the ingest failed (`tables.failures.Failure`)
    gravity: dict[str, Any] | None = None  # how gravity turns (`quality.rotation.GravityTurn`)

    @property
    def row(self) -> RecordingRow:
        """The row of the table ``recordings``."""
        return RecordingRow(**self.recording)

    @property
    def grids(self) -> dict[str, int]:
        """Number of samples of each analysed channel, including missing ones."""
        return {channel: int(about["grid"]) for channel, about in self.channels.items()}

    @classmethod
    def read(cls, path: Path) -> Quality:
        """Read the file that `write` wrote; raise RecordingError if it is damaged."""
        try:
            content = read_sealed_json(path)
            content["findings"] = [FindingRow.from_json(row) for row in content.get("findings", ())]
            return cls(**content)
        except (ValueError, TypeError) as error:  # other letters, or other keys
            raise RecordingError(f"{path}: was changed after the ingest: {MEND}") from error

    def write(self, path: Path) -> None:
        """Write the file, atomically."""
        write_sealed_json(asdict(self), path)

    def fault(self, folder: Path, *, whole: bool = False) -> str | None:
        """Return the fault of the samples kept in a folder; None where nothing is seen.

        With ``whole`` all is read, otherwise size and metadata only: pages have checksums of their
        own.
        """
        for name, stated in (self.kept or {}).items():
            path = folder / name
            try:
                if path.stat().st_size != stated["size"]:
                    wrong = f"has {path.stat().st_size} bytes instead of {stated['size']}"
                elif _footer(path) != stated["footer"] or (
                    whole and compute_digest(path) != stated["sha256"]
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


def describe_outcome(results: Path, sensor: str, recording: str) -> str:
    """Return the outcome of a recording in one line: used, with doubts, or rejected."""
    name = f"{sensor}/{recording}"
    try:
        quality = Quality.read(results / "recordings" / sensor / recording / "quality.json")
    except (OSError, RecordingError) as error:
        return f"{name}: {error}"
    about = quality.row
    if about.status != "ok" or about.duration is None:
        return f"{name}: {about.status}: {about.reason}"
    kinds = dict.fromkeys(
        row.finding.replace("_", " ") for row in quality.findings if row.severity != "note"
    )
    hours = about.duration / 3600.0
    told = f"{name}: {hours:.3g} h at {about.rate:.6g} Hz, {len(quality.channels)} channels"
    return told + (f"; in doubt: {', '.join(kinds)}" if kinds else "")


def identify_files(paths: Iterable[Path]) -> dict[str, dict[str, Any]]:
    """Return size, digest, and digest of the metadata of Parquet files, by name."""
    return {
        path.name: {
            "size": path.stat().st_size,
            "footer": _footer(path),
            "sha256": compute_digest(path),
        }
        for path in paths
    }


def _footer(path: Path) -> str:
    return hashlib.sha256(read_footer(path)).hexdigest()


def load_logs(folder: Path) -> dict[str, ChannelLog]:
    """Return the usable channels of a recording, by name; none of a rejected one.

    ``folder`` contains its ``quality.json``. Raises RecordingError if files of samples are not
    there, are not those that the ingest left, or are damaged.
    """
    quality = Quality.read(folder / "quality.json")
    if fault := quality.fault(folder):
        raise RecordingError(fault)
    if quality.kept is not None:
        for path in list_log_files(folder):
            if path.name not in quality.kept:
                raise RecordingError(f"{path}: was not written by the ingest: {MEND}")
    return open_channel_logs(folder)


def load_static_logs(folder: Path) -> dict[str, ChannelLog]:
    """Return `load_logs` of a sensor at rest; empty for a turned sensor."""
    logs = load_logs(folder)
    return logs if was_at_rest(folder) else {}
