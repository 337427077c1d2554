"""What the ingest leaves beside the samples that it keeps: ``quality.json``."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from imubench_pipeline.tables import read_json, write_json
from imubench_pipeline.tables.findings import RecordingError
from imubench_pipeline.tables.parquet import end_of

_DIGEST = "digest"
MEND = "remove it, and the next run reads the log again"


@dataclass(frozen=True)
class Quality:
    """``quality.json``: what the ingest found, and the channels that go on.

    With the digests of the samples that were kept, the file is another one whenever they are: what
    stands on them is made again, even if the run that read them was stopped in between. A digest of
    its own stands at its end.
    """

    recording: dict[str, Any]
    findings: list[dict[str, Any]]
    channels: dict[str, dict[str, Any]]
    kept: dict[str, dict[str, Any]] | None = None
    """The files of samples, as `identified` gives them; None: it was not kept what they are."""
    failure: dict[str, Any] | None = None
    """Why the ingest failed (`imubench_pipeline.tables.failures.Failure`)."""
    gravity: dict[str, Any] | None = None
    """How gravity turns against the sensor (`recordings.quality.rotation.GravityTurn`)."""

    @classmethod
    def read(cls, path: Path) -> Quality:
        """Read the file that `write` wrote.

        Raises
        ------
        RecordingError
            If it is damaged.
        """
        try:
            data = read_json(path)
            stated = data.pop(_DIGEST, None)
            if stated is None or stated == _digest(data):
                return cls(**{one.name: data[one.name] for one in fields(cls) if one.name in data})
        except (ValueError, TypeError, AttributeError):
            pass  # no JSON any more, or not of these keys
        raise RecordingError(f"{path}: is not as the ingest wrote it: {MEND}")

    def write(self, path: Path) -> None:
        """Write the file, atomically."""
        data = json.loads(json.dumps(asdict(self), allow_nan=False))
        write_json(data | {_DIGEST: _digest(data)}, path)

    def fault(self, folder: Path, *, whole: bool = False) -> str | None:
        """Return what is wrong with the samples that are kept; None where nothing is seen.

        Parameters
        ----------
        folder : Path
            Where they are.
        whole : bool
            All is read, and not only what the checksums of the pages, which are verified where
            samples are read, leave out: size and metadata.
        """
        for name, stated in (self.kept or {}).items():
            path = folder / name
            try:
                if path.stat().st_size != stated["size"]:
                    found = f"has {path.stat().st_size} bytes instead of {stated['size']}"
                elif _footer(path) != stated["footer"] or (
                    whole and _whole(path) != stated["sha256"]
                ):
                    found = "is not as the ingest wrote it"
                else:
                    continue
            except FileNotFoundError:
                return f"{path}: is no longer there: run again, and the log is read again"
            except OSError as error:
                found = f"cannot be read ({error.strerror})"
            return f"{path}: {found}: {MEND}"
        return None


def identified(paths: Iterable[Path]) -> dict[str, dict[str, Any]]:
    """Return size, digest, and digest of the metadata of Parquet files, by name."""
    return {
        path.name: {
            "size": path.stat().st_size,
            "footer": _footer(path),
            "sha256": _whole(path),
        }
        for path in paths
    }


def _whole(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _footer(path: Path) -> str:
    return hashlib.sha256(end_of(path)).hexdigest()


def _digest(data: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
