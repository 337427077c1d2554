"""NumPy, MATLAB 5 and Feather."""

from __future__ import annotations

import os
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

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


def batch(folder: Path, rows: int, said: int | None = None) -> Path:
    """Write a batch of zeros; ``said``: MiB that its one buffer is said to unpack to."""
    path = folder / "log.arrow"
    table = pa.record_batch({"wx": np.zeros(rows)})
    options = pa.ipc.IpcWriteOptions(compression="zstd")
    with pa.ipc.new_file(str(path), table.schema, options=options) as out:
        out.write_batch(table)
    if said is not None:
        data, true = path.read_bytes(), (8 * rows).to_bytes(8, "little")
        assert data.count(true) == 1
        path.write_bytes(data.replace(true, (said * MIB).to_bytes(8, "little")))
    return path


_PAGES_HAVE_A_LIMIT = int(pa.__version__.partition(".")[0]) >= 23
"""And one of 20,000 rows, where nothing is said."""


def parquet(*groups: int, rows_of_page: int = 1 << 30) -> Callable[[Path], Path]:
    """Return what writes zeros, in row groups of so many, each of one page."""

    def write(folder: Path) -> Path:
        path = folder / "log.parquet"
        schema = pa.schema([("wx", pa.float64())])
        with pq.ParquetWriter(
            path, schema, compression="zstd", use_dictionary=False, write_statistics=False,
            # Whether a page is full is asked after each batch.
            write_batch_size=min(rows_of_page, max(groups)),
            data_page_size=1 if rows_of_page < max(groups) else (1 << 31) - 1,
            **({"max_rows_per_page": rows_of_page} if _PAGES_HAVE_A_LIMIT else {}),
        ) as out:  # fmt: skip
            for rows in groups:
                out.write_table(pa.table({"wx": np.zeros(rows)}), row_group_size=rows)
        return path

    return write


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
        r"corrupt data: sides \(9, 9",
        channels=FIRST,
    ),
    "11000 cells": Attack(
        file("a.mat", lambda: matlab(*(matrix(CELL, b"%d" % n) for n in range(11_000)))),
        "more than 10000 arrays",
        "is a cell array",
        FIRST,
    ),
    "a batch that is said to have 8 GiB": Attack(
        lambda folder: batch(folder, 1_000_000, 8192),
        "a compressed record batch unpacks to 8589934592 bytes",
        channels=FIRST,
    ),
    "a page of 256 MiB after a short one": Attack(
        parquet(1000, 256 << 17),
        "pages unpack to 268435465 bytes together; expected at most 268435456",
        channels=FIRST,
    ),
    "131073 pages": Attack(
        parquet((1 << 17) + 1, rows_of_page=1), "more than 131072 pages", channels=FIRST
    ),
    "a batch of 256 MiB": Attack(
        lambda folder: batch(folder, 32 * MIB), "^read: 33554432$", "^listed: ", FIRST
    ),
    "a batch of more": Attack(
        lambda folder: batch(folder, 32 * MIB + 1),
        "a compressed record batch unpacks to 268435464 bytes",
        channels=FIRST,
    ),
}
