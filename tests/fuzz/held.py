"""What is read: the files of a recording, how they are described, and where they are kept."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from imubench_pipeline.settings.sensor import LogFormat

_ABOUT = "input.json"
_FILES = "files"
FAULT = "fault.txt"
"""Name of the file that says what was wrong with an input."""


@dataclass(frozen=True)
class Input:
    """A recording in memory.

    Attributes
    ----------
    files : mapping of str to bytes
        By their paths.
    path : str
        The file or folder that is the recording.
    log : mapping
        As in a sensor file.
    """

    files: Mapping[str, bytes]
    path: str
    log: Mapping[str, Any]

    @property
    def size(self) -> int:
        """Bytes of all files."""
        return sum(map(len, self.files.values()))

    def with_file(self, name: str, data: bytes) -> Input:
        """Return the same recording with another content of one file."""
        return replace(self, files={**self.files, name: data})

    def format(self) -> LogFormat:
        """Return how the files are written."""
        return LogFormat.model_validate(dict(self.log))

    def keep(self, folder: Path, fault: str = "") -> None:
        """Write the files, how they are read and what was wrong, in place of what is there."""
        shutil.rmtree(folder, ignore_errors=True)
        for name, data in self.files.items():
            path = folder / _FILES / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
        about = {"path": self.path, "log": dict(self.log)}
        (folder / _ABOUT).write_text(json.dumps(about, indent=1) + "\n", "utf-8")
        if fault:
            (folder / FAULT).write_text(fault, "utf-8", "backslashreplace")

    @staticmethod
    def kept(folder: Path) -> Input:
        """Return what `keep` wrote."""
        about = json.loads((folder / _ABOUT).read_text("utf-8"))
        return Input(files_in(folder / _FILES), about["path"], about["log"])

    def path_in(self, folder: Path) -> Path:
        """Return the path of the recording where it is kept."""
        return folder / _FILES / self.path


def files_in(folder: Path) -> dict[str, bytes]:
    """Return the files of a folder by their paths in it."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
