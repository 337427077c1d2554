"""NumPy and MATLAB 5."""

from __future__ import annotations

import os
import struct
import zipfile
import zlib
from pathlib import Path

from tests.readers.hostile.attack import FIRST, MIB, Attack, file

STRUCTURE, CELL, DOUBLE = 2, 1, 6


def npy(header: bytes, length: int | None = None, version: int = 1) -> bytes:
    size = len(header) if length is None else length
    width = 2 if version == 1 else 4
    return b"\x93NUMPY" + bytes([version, 0]) + size.to_bytes(width, "little") + header


def long_header(folder: Path) -> Path:
    """Write a header of 800 MB of spaces, packed."""
    path = folder / "log.npz"
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("a.npy", "w") as member,
    ):
        member.write(npy(b"", 800 * MIB, 2))
        for _ in range(800):
            member.write(b" " * MIB)
    return path


def literal(text: str) -> bytes:
    return npy(text.encode().ljust(9000))


def wide_records() -> bytes:
    """Return one record of 400 fields, each a vector of a thousand."""
    descr = ",".join(f"('{number}','f8',(1000,))" for number in range(400))
    header = f"{{'descr': [{descr}], 'fortran_order': False, 'shape': (1,)}}"
    return npy(header.encode().ljust(9990)) + bytes(400 * 8000)


def long_record(folder: Path) -> Path:
    """Write a record of 100 MB, of which the file system keeps none."""
    descr = "[('wx','f8'),('rest','V100000000')]"
    header = npy(f"{{'descr': {descr}, 'fortran_order': False, 'shape': (1,)}}".encode().ljust(180))
    path = folder / "log.npy"
    path.write_bytes(header)
    os.truncate(path, len(header) + 100_000_008)
    return path


def element(kind: int, data: bytes) -> bytes:
    return struct.pack("<II", kind, len(data)) + data + bytes(-len(data) % 8)


def matrix(kind: int, name: bytes, body: bytes = b"", sides: tuple[int, ...] = (1, 1)) -> bytes:
    flags = element(6, struct.pack("<II", kind, 0))
    shape = element(5, struct.pack(f"<{len(sides)}i", *sides))
    return element(14, flags + shape + element(1, name) + body)


def fields(width: int, names: bytes, body: bytes) -> bytes:
    return struct.pack("<HHI", 5, 4, width) + element(1, names) + body


def matlab(*elements: bytes) -> bytes:
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x100) + b"IM"
    packed = map(zlib.compress, elements)
    return head + b"".join(struct.pack("<II", 15, len(data)) + data for data in packed)


def long_names() -> bytes:
    """Return structures within each other, fields named by 60 kB; 60000 fields in the last."""
    body = matrix(STRUCTURE, b"", fields(1, b"a" * 60_000, element(14, b"") * 60_000))
    for _ in range(14):
        body = matrix(STRUCTURE, b"", fields(60_000, b"n" * 60_000, body))
    return matlab(matrix(STRUCTURE, b"s", fields(60_000, b"n" * 60_000, body)))


CORRUPT = "corrupt data, or cut short"
ARRAYS = {
    "a header of 800 MB": Attack(
        long_header, "a has a header of 838860800 bytes; expected at most 10000", channels=FIRST
    ),
    "8000 brackets": Attack(file("a.npy", lambda: literal("(" * 8000)), CORRUPT, channels=FIRST),
    "8000 signs": Attack(file("a.npy", lambda: literal("-" * 8000 + "1")), CORRUPT, channels=FIRST),
    "400000 fields": Attack(
        file("a.npy", wide_records), "has more than 16384 columns", channels=FIRST
    ),
    "a record of 100 MB": Attack(
        long_record, "one record takes 100000008 bytes; expected at most", channels=FIRST
    ),
    "names of 60 kB": Attack(
        file("a.mat", long_names), "names of fields of 60000 bytes", channels=FIRST
    ),
    "15000 sides": Attack(
        file("a.mat", lambda: matlab(matrix(DOUBLE, b"a", sides=(9,) * 15_000))),
        r"corrupt data: dimensions \(9, 9",
        channels=FIRST,
    ),
    "11000 cells": Attack(
        file("a.mat", lambda: matlab(*(matrix(CELL, b"%d" % n) for n in range(11_000)))),
        "more than 10000 arrays",
        "is a cell array",
        FIRST,
    ),
}
