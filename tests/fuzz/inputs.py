"""What is read: the files of a recording, how they are described, and where they are kept."""

from __future__ import annotations

import gzip
import io
import json
import shutil
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from imubench_pipeline.settings.sensor import LogFormat
from tests.corpus import arrays, bags, exports, packed, scientific, stamps, streams, text
from tests.corpus.entry import Entry, Kept, archive, kept
from tests.readers.test_rosbag import KINDS

_LARGEST = 300_000
_LINES, _BYTES, _MESSAGES = 60, 8000, 30
"""Of a text log, a log of a receiver, and a bag: what is short is read often."""

_ABOUT = "input.json"
_FILES = "files"
FAULT = "fault.txt"
"""Name of the file that says what was wrong with an input."""

_BAGS = [
    *(
        Entry(kind, bags.holding(kind, partial(bags.imu, kind, _MESSAGES)), bags.STAMPED, kept(1))
        for kind in KINDS
    ),
    Entry("sqlite", bags.alone("sqlite", rows=_MESSAGES), bags.STAMPED, kept(1)),
    Entry("mcap", bags.alone("mcap", rows=_MESSAGES), bags.UNSTAMPED, kept(1)),
]
_SEEDS: Mapping[str, list[Entry]] = {
    "csv": [*text.ENTRIES, *stamps.ENTRIES, *exports.TEXTS, *exports.FOLDERS, *packed.ENTRIES],
    "vectornav": [*streams.TEXTS, *streams.PACKED],
    "ubx": streams.RECEIVERS,
    "rosbag": _BAGS,
    "matlab": scientific.MATLAB,
    "numpy": arrays.NUMPY,
    "arrow": arrays.ARROW,
    "hdf5": scientific.HDF5,
}
READERS = tuple(_SEEDS)
"""The readers that there are inputs for."""


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
        return Input(_files_in(folder / _FILES), about["path"], about["log"])

    def path_in(self, folder: Path) -> Path:
        """Return the path of the recording where it is kept."""
        return folder / _FILES / self.path


def seeds(reader: str) -> Iterator[Input]:
    """Yield the logs of the corpus that a reader reads, without the largest.

    Parameters
    ----------
    reader : str
        One of `READERS`.
    """
    for entry in _SEEDS[reader]:
        if not isinstance(entry.expected, Kept):
            continue
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            path = entry.write(folder)
            files = {name: _shortened(data) for name, data in _files_in(folder).items()}
            seed = Input(files, path.relative_to(folder).as_posix(), entry.log)
        if seed.size <= _LARGEST:
            yield seed
            # What no longer looks like its format is read as such all the same.
            yield replace(seed, log={**seed.log, "reader": reader})


def _shortened(data: bytes) -> bytes:
    if data.startswith(b"\x1f\x8b"):
        with suppress(EOFError, OSError):
            return gzip.compress(_shortened(gzip.decompress(data)))
    if data.startswith(b"PK\3\4"):
        with suppress(zipfile.BadZipFile), zipfile.ZipFile(io.BytesIO(data)) as packed:
            # What writes archives takes no empty name.
            names = [name for name in packed.namelist() if name]
            return archive({name: _shortened(packed.read(name)) for name in names})
    if data.startswith(b"\xb5\x62"):
        return data[:_BYTES]
    lines = data.splitlines(keepends=True)
    return b"".join(lines[:_LINES]) if b"\0" not in data else data


def _files_in(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }
