"""What is read first: logs of the corpus. A worker, which is handed them, need not import that."""

from __future__ import annotations

import gzip
import io
import tempfile
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path

from tests.corpus import arrays, bags, exports, packed, scientific, stamps, streams, text
from tests.corpus.entry import Entry, Kept, archive, kept
from tests.formats.test_rosbag import KINDS
from tests.fuzz.held import Input, files_in

_LARGEST = 300_000
_LINES, _BYTES, _MESSAGES = 60, 8000, 30
"""Of a text log, a log of a receiver, and a bag: what is short is read often."""

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
    "vectornav": [
        *(entry for entry in streams.TEXTS if not entry.name.startswith("novatel")),
        *streams.PACKED,
    ],
    "ubx": streams.RECEIVERS,
    "novatel": [entry for entry in streams.TEXTS if entry.name.startswith("novatel")],
    "ulog": [entry for entry in streams.FLIGHT if entry.name.startswith("ulog")],
    "dataflash": [entry for entry in streams.FLIGHT if entry.name.startswith("dataflash")],
    "rosbag": _BAGS,
    "matlab": scientific.MATLAB,
    "numpy": arrays.NUMPY,
    "arrow": arrays.ARROW,
    "hdf5": scientific.HDF5,
    "excel": scientific.EXCEL,
}
READERS = tuple(_SEEDS)
"""The readers that there are inputs for."""


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
            files = {name: _shortened(data) for name, data in files_in(folder).items()}
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
    if data.startswith((b"\xb5\x62", b"ULog", b"\xa3\x95")):
        return data[:_BYTES]
    lines = data.splitlines(keepends=True)
    return b"".join(lines[:_LINES]) if b"\0" not in data else data
