"""Compressed text and archives."""

from __future__ import annotations

import bz2
import gzip
import lzma
import struct
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path

from backports import zstd

from tests.readers.hostile.attack import MIB, RECORDS, Attack, file

PARTS = r"10000 compressed parts have 0 bytes"
LOCAL = struct.Struct("<4sHHHHHIIIHH")


def xz_of_a_large_dictionary() -> bytes:
    """Say, in the header of a block, that 3 GiB of dictionary are needed."""
    chain = [{"id": lzma.FILTER_LZMA2, "dict_size": 4096, "preset": 0}]
    data = bytearray(lzma.compress(RECORDS, filters=chain))
    at = data.index(b"\x21\x01\x00", 12)
    data[at + 2] = 39
    end = 12 + (data[12] + 1) * 4
    data[end - 4 : end] = zlib.crc32(data[12 : end - 4]).to_bytes(4, "little")
    return bytes(data)


def archive(folder: Path, members: Iterator[tuple[str, bytes]]) -> Path:
    path = folder / "log.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as made:
        for name, data in members:
            made.writestr(name, data)
    return path


def directory_of(count: int) -> bytes:
    """Return an archive whose directory names one member of no bytes again and again."""
    local = LOCAL.pack(b"PK\3\4", 20, 0, 0, 0, 0x21, 0, 0, 0, 8, 0) + b"00000000"
    central = struct.Struct("<4sHHHHHHIIIHHHHHII")
    head = (b"PK\1\2", 20, 20, 0, 0, 0, 0x21, 0, 0, 0, 8, 0, 0, 0, 0, 0, 0)
    entries = b"".join(central.pack(*head) + b"%08d" % number for number in range(count))
    end_64 = struct.pack(
        "<4sQHHIIQQQQ", b"PK\6\6", 44, 45, 45, 0, 0, count, count, len(entries), len(local)
    )
    locator = struct.pack("<4sIQI", b"PK\6\7", 0, len(local) + len(entries), 1)
    end = struct.pack("<4sHHHHIIH", b"PK\5\6", 0, 0, 65535, 65535, 2**32 - 1, 2**32 - 1, 0)
    return local + entries + end_64 + locator + end


def local_headers(count: int) -> bytes:
    """Return the headers of members, without a directory."""
    one = LOCAL.pack(b"PK\3\4", 20, 0, 0, 0, 0x21, 0, 0, 0, 8, 0)
    return b"".join(one + b"%08d" % number for number in range(count))


def lying_archive(folder: Path) -> Path:
    """Write a member that is longer than the directory says."""
    path = archive(folder, iter([("log.csv", RECORDS * 100)]))
    data = bytearray(path.read_bytes())
    at = data.index(b"PK\1\2")
    data[at + 24 : at + 28] = (100).to_bytes(4, "little")
    path.write_bytes(data)
    return path


def nested_archives(folder: Path) -> Path:
    inner, name = RECORDS, "log.csv"
    for _ in range(3):
        path = archive(folder, iter([(name, inner)]))
        inner, name = path.read_bytes(), "log.zip"
    return path


PACKED = {
    "a sentence of 2 MB": Attack(
        file("log.txt", lambda: b"$VNYMR,1*00\n$VNYMR," + b"1," * MIB),
        "no line break in 1048576 bytes",
        channels={"gyro_x": {"column": "gyro_x"}},
    ),
    "empty gzip members": Attack(file("log.csv.gz", lambda: gzip.compress(b"") * 1_000_000), PARTS),
    "empty zstd frames": Attack(file("log.csv.zst", lambda: zstd.compress(b"") * 1_000_000), PARTS),
    "empty bzip2 streams": Attack(
        file("log.csv.bz2", lambda: bz2.compress(b"") * 1_000_000), PARTS
    ),
    "empty xz streams": Attack(file("log.csv.xz", lambda: lzma.compress(b"") * 1_000_000), PARTS),
    "a dictionary of 3 GiB": Attack(
        file("log.csv.xz", xz_of_a_large_dictionary), "Memory usage limit exceeded"
    ),
    "20 GB of zeros": Attack(
        file("log.csv.gz", lambda: gzip.compress(bytes(16 * MIB), 1) * 1280),
        "the file has zero bytes and no text",
    ),
    "6 GB of comments": Attack(
        file("log.csv.gz", lambda: gzip.compress((b"#" + b"x" * MIB + b"\n") * 16, 1) * 400),
        r"no record in the first \d\d lines, which are blank or comments",
    ),
    "a directory of 100000 members": Attack(
        file("log.zip", lambda: directory_of(100_000)),
        "the directory of the archive has 5400000 bytes",
    ),
    "a directory just small enough": Attack(
        file("log.zip", lambda: directory_of((1 << 21) // 54)),
        "expected one file, the archive has",
        "has no column of numbers",
    ),
    "100000 members and no directory": Attack(
        file("log.zip", lambda: local_headers(100_000)), "cut short and has more than"
    ),
    "a member that is longer than is said": Attack(
        lying_archive, "more data than stated in the directory"
    ),
    "an archive in an archive in an archive": Attack(nested_archives, "is compressed twice"),
}
