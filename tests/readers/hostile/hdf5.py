"""HDF5."""

from __future__ import annotations

import os
import re
import struct
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from tests.readers.hostile.attack import FIRST, Attack, deflated_zeros

Writes = Callable[[h5py.File], object]


def hdf5(put: Writes) -> Callable[[Path], Path]:
    """Return what writes a file."""

    def write(folder: Path) -> Path:
        path = folder / "log.h5"
        with h5py.File(path, "w", libver="latest") as made:
            put(made)
        return path

    return write


def links(made: h5py.File) -> None:
    made["wx"] = np.ones(100)
    for number in range(20_000):
        made.id.links.create_soft(b"%d" % number, b"/wx")


def deep_groups(made: h5py.File) -> None:
    here = made.id
    for _ in range(5000):
        here = h5py.h5g.create(here, b"g")


def cycle(made: h5py.File) -> None:
    """Write thirty groups that each lead to the next by two names, and the last to the first."""
    here: h5py.Group = made
    for number in range(30):
        below = made.create_group(f"g{number}")
        here["a"], here["b"] = below, below
        here = below
    here["a"] = made["/"]
    made["wx"], made["ax"] = np.ones(100), np.ones(100)


def chunk(made: h5py.File, name: str, said: int, held: int) -> None:
    """Write a data set of one chunk of so many MiB, which unpacks to so many."""
    count = said << 17
    data = made.create_dataset(name, (count,), "f8", chunks=(count,), compression="gzip")
    data.id.write_direct_chunk((0,), deflated_zeros(held))


def two_chunks(mib: int) -> Writes:
    def put(made: h5py.File) -> None:
        for name in ("wx", "ax"):
            chunk(made, name, mib, mib)

    return put


def virtual(folder: Path) -> Path:
    """Write a data set that is as long as one behind a pipe that nobody writes to."""
    pipe, path = folder / ".pipe", folder / "log.h5"
    os.mkfifo(pipe)
    with h5py.File(path, "w") as made:
        layout = h5py.VirtualLayout((100,), "f8", maxshape=(None,))
        source = h5py.VirtualSource(str(pipe), "a", (100,), maxshape=(None,))
        layout[0 : h5py.h5s.UNLIMITED] = source[0 : h5py.h5s.UNLIMITED]
        made.create_virtual_dataset("wx", layout)
        made["ax"] = np.ones(100)
    return path


def external(folder: Path) -> Path:
    pipe, path = folder / ".pipe", folder / "log.h5"
    os.mkfifo(pipe)
    with h5py.File(path, "w") as made:
        made["wx"], made["ax"] = h5py.ExternalLink(str(pipe), "/a"), np.ones(100)
    return path


def long_names(made: h5py.File) -> None:
    """Write names of 5 kB with line breaks and what clears a terminal."""
    for number in range(30):
        made["\n\x1b[2J" * 1000 + str(number)] = np.ones(100)


def one_unit_for_all(folder: Path) -> Path:
    """Write 300 data sets whose units are one text of 10 MB."""
    path, longest, short = folder / "log.h5", 10_000_000, 77
    with h5py.File(path, "w") as made:
        for number in range(300):
            made[f"w{number}"] = np.ones(100)
            made[f"w{number}"].attrs["units"] = "u" * (short if number else longest)
        made["wx"], made["ax"] = np.ones(100), np.ones(100)
    content = path.read_bytes()
    # A reference is the length of a text and its place: that of a heap, below 4 GB, and a number.
    of_longest = content.index(struct.pack("<I", longest))
    reference = content[of_longest : of_longest + 16]
    others = re.compile(re.escape(struct.pack("<I", short)) + rb".{4}\0{4}.{4}", re.DOTALL)
    content, changed = others.subn(lambda _: reference, content)
    assert changed == 299
    path.write_bytes(content)
    return path


HDF5 = {
    "one unit of 10 MB for 300": Attack(one_unit_for_all, "^read: 100$", "^listed: "),
    "names that clear a terminal": Attack(
        hdf5(long_names),
        "no variable or column 'wx' .*; the file has .*; correct 'column'",
        "^listed",
    ),
    "20000 links": Attack(hdf5(links), "more than 20000 objects"),
    "5000 groups deep": Attack(hdf5(deep_groups), "groups are nested 65 deep"),
    "a cycle of groups": Attack(hdf5(cycle), "^read: 100$", "^listed: read so: 2 channels"),
    "chunks of 130 MiB": Attack(
        hdf5(two_chunks(130)), "chunks of 272629760 bytes together", "^listed: "
    ),
    "chunks of 128 MiB": Attack(hdf5(two_chunks(128)), "^read: 16777216$", "^listed: "),
    "a chunk of 2 GiB": Attack(
        hdf5(lambda made: chunk(made, "wx", 2048, 2048)),
        "chunks of 2147483648 bytes",
        channels=FIRST,
    ),
    "a chunk that unpacks to 4 GiB": Attack(
        hdf5(lambda made: chunk(made, "wx", 1, 4096)),
        "corrupt data, or cut short",
        channels=FIRST,
    ),
    "a virtual data set of a pipe": Attack(virtual, "wx .*is stored in other files", "^listed: "),
    "an external link to a pipe": Attack(external, "no variable or column 'wx'", "^listed: "),
}
