"""What an entry of the corpus is: how its files are written, and what must come of them."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

Written = Callable[[Path], Path]
"""Writes the files of a recording into a folder, and returns the file or folder that it is."""


@dataclass(frozen=True)
class Rejected:
    """The recording cannot be used.

    Attributes
    ----------
    reason : str
        Regular expression that is found in what is said of it.
    is_final : bool
        The reason lies in the log; otherwise its ingest fails, and is tried again.
    """

    reason: str
    is_final: bool = True


@dataclass(frozen=True)
class Kept:
    """The recording is used.

    Attributes
    ----------
    samples : int
        Records that have a place in the time of the recording.
    findings : frozenset of str
        The names of what is found wrong with it: these, and no other.
    """

    samples: int
    findings: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Cut:
    """A log that is cut short: read as far as it goes, which is found, or rejected."""


@dataclass(frozen=True)
class Entry:
    """A recording of the corpus.

    Attributes
    ----------
    name : str
        Also that of its sensor, whose logs are written so.
    write : callable
    log : mapping
        As in a sensor file.
    expected : Rejected, Kept or Cut
    skip : str or None
        Why it cannot be tried here.
    """

    name: str
    write: Written
    log: Mapping[str, Any]
    expected: Rejected | Kept | Cut
    skip: str | None = None

    def place(self, logs: Path, sensors: Path) -> Path:
        """Write the log and its sensor file where a run looks for them.

        Parameters
        ----------
        logs, sensors : Path
            The drop zone and the folder of sensor files.
        """
        sensors.mkdir(parents=True, exist_ok=True)
        sensor = {"vendor": "none", "model": self.name, "log": dict(self.log)}
        (sensors / f"{self.name}.yaml").write_text(yaml.safe_dump(sensor), "utf-8")
        folder = logs / self.name
        folder.mkdir(parents=True)
        return self.write(folder)


def kept(samples: int, *findings: str) -> Kept:
    """Return what is expected of a recording that is used, with the findings about it."""
    return Kept(samples, frozenset(findings))


def file(data: bytes | str | Callable[[], bytes], name: str = "log.csv") -> Written:
    """Return what writes one file; a callable makes its content only then."""

    def write(folder: Path) -> Path:
        content = data() if callable(data) else data
        path = folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return write


def folder_of(files: Mapping[str, bytes | str], name: str = "log") -> Written:
    """Return what writes a folder of files."""

    def write(folder: Path) -> Path:
        for inside, content in files.items():
            path = folder / name / inside
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        return folder / name

    return write


def changed(write: Written, change: Callable[[bytes], bytes]) -> Written:
    """Return what writes a file and then changes its bytes."""

    def then(folder: Path) -> Path:
        path = write(folder)
        path.write_bytes(change(path.read_bytes()))
        return path

    return then


def archive(files: Mapping[str, bytes | str], method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """Return a zip archive of files."""
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", method) as packed:
        for name, content in files.items():
            packed.writestr(name, content)
    return held.getvalue()


def flipped(data: bytes, place: float) -> bytes:
    """Return data with one bit flipped, at a part of their length."""
    changed = bytearray(data)
    changed[int(place * len(changed))] ^= 1
    return bytes(changed)


def part(data: bytes, kept: float) -> bytes:
    """Return the first part of data."""
    return data[: int(kept * len(data))]
