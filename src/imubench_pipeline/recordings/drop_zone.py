"""What lies in the folder of the logs: recordings, their files, and the content of these."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from imubench_pipeline.readers import log_files
from imubench_pipeline.settings.validation import cut

PARTIAL = frozenset({".part", ".tmp", ".filepart", ".crdownload"})
"""How the names of files end that are still being transferred."""

COMPRESSED = frozenset({".gz", ".zst", ".xz", ".bz2", ".zip"})
"""How the names of files end that are compressed."""

NO_SENSOR = "(no sensor)"
"""Stands for the sensor of logs that lie beside the folders of the sensors."""

_NOTES = ".yaml"
_NOT_LOGS = {_NOTES, ".yml", ".md"} | PARTIAL
_UNUSABLE_IN_NAMES = re.compile(r"[^\w .+()-]")
_LONGEST_NAME, _MOST_BYTES = 120, 160
"""Letters, and bytes: the name of a page is longer, and systems take 255 bytes."""

_PERIODIC = re.compile(r"(.+?)\1{19,}$")
"""An end that repeats itself: Snakemake ends a run over names that do so twenty times."""


@dataclass(frozen=True)
class Recording:
    """One recording that was found, or is to be simulated."""

    sensor: str
    name: str
    path: Path
    """The log file, or the folder of a recording that has several."""
    notes: Path | None
    """The file of notes beside it."""
    simulated: bool
    error: str | None = None
    """Why the file cannot be used, where its name or its place says so already."""
    held_back: bool = False
    """The log is not read in this run: the results that are there stay."""

    @property
    def files(self) -> list[Path]:
        """What the recording depends on."""
        if self.held_back:
            # No such file, but what would be made of it is there: Snakemake takes that as it is,
            # whatever became of the log, the settings or the code since.
            return [self.path / "held back"]
        if self.error:
            return []
        logs = [self.path] if self.simulated else log_files(self.path)
        return logs + ([self.notes] if self.notes else [])

    @property
    def inputs(self) -> list[Path]:
        """Those of which the date says whether the recording is read again: no log, no notes.

        They stand in the settings of the ingest, by their content. A log has any date: of the
        future, where the clock of its logger was wrong, or of long ago, where it was moved here.
        """
        return self.files if self.held_back or self.simulated else []


def found_logs(logs: Path) -> list[Recording]:
    """Return the recordings of a drop zone, in order; two logs of one name are there twice.

    What nobody can analyse is among them, with the reason: logs that lie in no folder of a sensor,
    and notes of which there is no log. Hidden files, backups of editors (``~``), what is written on
    logs (``.md``) and files that are still being transferred are passed over.
    """
    recordings: list[Recording] = []
    for path in _shown(logs):
        if path.is_dir():
            recordings += _logs_of(path)
        elif _is_log(path):
            fault = _fault(path, _stem(path)) or (
                f"{path.name} lies beside the folders of the sensors; expected it in "
                f"{logs / '<sensor>'}, a folder of the name of its sensor file: move it there"
            )
            recordings.append(_found(NO_SENSOR, path, _stem(path), fault))
    return recordings


def _logs_of(folder: Path) -> Iterator[Recording]:
    """Yield the recordings in the folder of a sensor."""
    sensor = sensor_of(folder)
    used: set[Path] = set()
    paths = [path for path in _shown(folder) if path.is_dir() or _is_log(path)]
    for path in paths:
        name = path.name if path.is_dir() else _stem(path)
        notes, misnamed = folder / f"{name}{_NOTES}", folder / f"{name}.yml"
        used |= {notes, misnamed}
        there = os.path.lexists(notes) and not notes.is_dir()
        fault = _fault(path, name)
        if fault is None and misnamed.is_file():
            fault = f"{misnamed.name}: notes end in {_NOTES}; rename it to {notes.name}"
        yield _found(sensor, path, name, fault, notes if there else None)
    for path in _shown(folder):
        if path.suffix in (_NOTES, ".yml") and path not in used and path not in paths:
            fault = (
                f"{path.name}: notes of no log; expected one of the name {path.stem} beside them: "
                "rename the notes, or bring the log; a sensor file belongs to those of the others"
            )
            yield _found(sensor, path, path.stem, _fault(path, path.stem) or fault)


def _shown(folder: Path) -> list[Path]:
    """Return what lies in a folder, in order, without what is hidden and backups of editors."""
    names = (path for path in folder.iterdir() if not path.name.startswith("."))
    return sorted(path for path in names if not path.name.endswith("~"))


def _is_log(path: Path) -> bool:
    """Tell whether a file of the drop zone is to be a log, by its name."""
    return path.suffix.lower() not in _NOT_LOGS


def _found(
    sensor: str, path: Path, name: str, error: str | None, notes: Path | None = None
) -> Recording:
    return Recording(sensor, _usable(name), path, notes, simulated=False, error=error)


def name_of(file: str) -> str:
    """Return the name of the recording whose log has this file name."""
    return _usable(_stem(Path(file)))


def sensor_of(folder: Path) -> str:
    """Return the name of the sensor whose logs are in a folder of the drop zone."""
    return _usable(folder.name)


def _usable(name: str) -> str:
    short = _UNUSABLE_IN_NAMES.sub("_", name)[:_LONGEST_NAME].encode()[:_MOST_BYTES]
    return _PERIODIC.sub(r"\1", short.decode("utf-8", "ignore"))


def _fault(path: Path, name: str) -> str | None:
    """Return why a file of the drop zone cannot be used, if its name or place says so."""
    shown = ascii(path.name)
    folder = path.parent.name
    for what, name_shown, stem in (("file", shown, name), ("folder", ascii(folder), folder)):
        if _usable(stem) != stem:
            return (
                f"the {what} name {cut(name_shown, str)} cannot be used; expected at most "
                f"{_LONGEST_NAME} letters ({_MOST_BYTES} bytes), digits, spaces and . _ - + ( ) in "
                f"it, and no end that repeats itself: rename the {what}"
            )
    try:
        if not log_files(path):
            return f"the folder {shown} has no files"
        for file in log_files(path):
            if not _is_text(file.name):
                return f"{shown} holds a file of the name {file.name!a}: rename it in UTF-8"
            file.stat()
            with file.open("rb"):
                pass
    except OSError as error:
        return f"{shown} cannot be read ({error.strerror})"
    return None


def _is_text(name: str) -> bool:
    """Return whether a name is text in the encoding of the system."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def _stem(path: Path) -> str:
    name = path.name
    for suffix in path.suffixes[::-1]:
        if suffix.lower() in COMPRESSED:
            name = name[: -len(suffix)]
    return name.rsplit(".", maxsplit=1)[0] if "." in name else name
