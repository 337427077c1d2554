"""Text logs that are compressed, or in an archive: well, cut, corrupt, or not what they seem."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import stat
import struct
import zipfile
import zlib
from collections.abc import Callable
from functools import partial

from backports import zstd

from tests.corpus.entry import Entry, Rejected, archive, file, flipped, kept, part
from tests.corpus.signals import ROWS, STAMPED, log

TEXT = log().encode()
GIB = 1 << 30
WAYS: dict[str, Callable[[bytes], bytes]] = {
    "gz": gzip.compress,
    "zst": partial(zstd.compress, options={zstd.CompressionParameter.checksum_flag: 1}),
    "xz": lzma.compress,
    "bz2": bz2.compress,
    "zip": lambda text: archive({"log.csv": text}),
}


def cut_samples(packed: bytes, way: str) -> int:
    """Return the records of a compressed log that can be read before it is cut."""
    if way == "xz":
        return lzma.LZMADecompressor().decompress(packed).count(b"\n") - 1
    bare = packed[30 + len("log.csv") :] if way == "zip" else packed
    return zlib.decompressobj(-15 if way == "zip" else 31).decompress(bare).count(b"\n") - 1


def deflated_zeros(size: int) -> bytes:
    """Return a raw deflate stream of a log and many zeros, made of equal pieces."""
    piece_size = 1 << 24
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    log = packer.compress(TEXT) + packer.flush(zlib.Z_FULL_FLUSH)
    piece = packer.compress(bytes(piece_size)) + packer.flush(zlib.Z_FULL_FLUSH)
    return log + piece * (size // piece_size) + packer.flush()


def zip_bomb() -> bytes:
    """Return an archive of a log with 3 GiB of zeros at its end."""
    data = deflated_zeros(3 * GIB)
    name = b"log.csv"
    sizes = struct.pack("<III", 0, len(data), len(TEXT) + 3 * GIB)
    local = b"PK\3\4" + struct.pack("<HHHHH", 20, 0, 8, 0, 0) + sizes
    local += struct.pack("<HH", len(name), 0) + name
    entry = b"PK\1\2" + struct.pack("<HHHHHH", 20, 20, 0, 8, 0, 0) + sizes
    entry += struct.pack("<HHHHHII", len(name), 0, 0, 0, 0, 0, 0) + name
    end = b"PK\5\6" + struct.pack("<HHHHIIH", 0, 0, 1, 1, len(entry), len(local) + len(data), 0)
    return local + data + entry + end


def thousands() -> bytes:
    """Return an archive of a log among thousands of files that are none."""
    pictures: dict[str, bytes | str] = {f"{n}.jpg": b"\xff\xd8\0\0" for n in range(2000)}
    return archive(pictures | {"log.csv": TEXT})


def encrypted() -> bytes:
    """Return an archive whose one file says that it is encrypted."""
    packed = bytearray(archive({"log.csv": TEXT}))
    for place in (6, packed.index(b"PK\1\2") + 8):
        packed[place] |= 1
    return bytes(packed)


def linked() -> bytes:
    """Return an archive of a symbolic link."""
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w") as packed:
        info = zipfile.ZipInfo("log.csv")
        info.external_attr = (stat.S_IFLNK | 0o777) << 16
        packed.writestr(info, "/etc/passwd")
    return held.getvalue()


def with_method(method: int) -> bytes:
    """Return an archive whose one file says that it is packed so."""
    packed = bytearray(archive({"log.csv": TEXT}))
    for place in (8, packed.index(b"PK\1\2") + 10):
        packed[place] = method
    return bytes(packed)


WELL = [
    Entry(f"csv in {way}", file(pack(TEXT), f"log.csv.{way}"), STAMPED, kept(ROWS))
    for way, pack in WAYS.items()
]
CORRUPT = [
    Entry(
        f"csv in {way} with a flipped bit",
        file(lambda pack=pack: flipped(pack(TEXT), 0.5), f"log.csv.{way}"),
        STAMPED,
        Rejected(r"log\.csv.*: corrupt compressed data .*copy it again"),
    )
    for way, pack in WAYS.items()
]
CHECKSUMS = [
    Entry(
        f"csv in {way} with a wrong checksum",
        file(pack(TEXT)[:place] + b"\xaa\x55" + pack(TEXT)[place + 2 :], f"log.csv.{way}"),
        STAMPED,
        Rejected(r"log\.csv.*: corrupt compressed data"),
    )
    for way, pack, place in (("gz", gzip.compress, -8), ("zst", WAYS["zst"], -4))
]
CUT = [
    Entry(
        f"csv in {way} cut short",
        file(lambda pack=pack: part(pack(TEXT), 0.7), f"log.csv.{way}"),
        STAMPED,
        kept(cut_samples(part(pack(TEXT), 0.7), way), "truncated_file", "incomplete_last_record"),
    )
    for way, pack in WAYS.items()
    if way in ("gz", "xz", "zip")
]
ODD = [
    Entry(
        "gzip of nothing", file(lambda: gzip.compress(b"")), STAMPED, Rejected("the file is empty")
    ),
    Entry(
        "gzip cut in its header",
        file(lambda: gzip.compress(TEXT)[:7]),
        STAMPED,
        Rejected("compressed data end before any text"),
    ),
    Entry(
        "gzip in gzip",
        file(lambda: gzip.compress(gzip.compress(TEXT)), "log.csv.gz.gz"),
        STAMPED,
        Rejected(r"log\.csv\.gz\.gz: is compressed twice, by gzip and inside by gzip"),
    ),
    Entry(
        "gzip with more behind it",
        file(lambda: gzip.compress(TEXT) + b"more"),
        STAMPED,
        Rejected(r"corrupt compressed data"),
    ),
    Entry(
        "gzip in a zip archive",
        file(lambda: archive({"log.csv.gz": gzip.compress(TEXT)}), "log.zip"),
        STAMPED,
        Rejected(r"log\.csv\.gz: is compressed twice, by zip and inside by gzip"),
    ),
    Entry(
        "zip in a zip archive",
        file(lambda: archive({"log.zip": archive({"log.csv": TEXT})}), "log.zip"),
        STAMPED,
        Rejected(r"log\.zip: is compressed twice, by zip and inside by zip"),
    ),
    Entry(
        "zip archive of nothing",
        file(lambda: archive({}), "log.zip"),
        STAMPED,
        Rejected(r"log\.zip: .*no file"),
    ),
    Entry(
        "zip archive of several logs",
        file(lambda: archive({"a.csv": TEXT, "b.csv": TEXT}), "log.zip"),
        STAMPED,
        Rejected(r"log\.zip: expected one file, the archive has a\.csv, b\.csv"),
    ),
    Entry(
        "zip archive with a file without a name",
        file(
            lambda: archive({"log.csv": TEXT, "xname": b"1"}).replace(b"xname", b"\0name"),
            "log.zip",
        ),
        STAMPED,
        kept(ROWS),
    ),
    Entry(
        "zip archive of thousands of logs",
        file(lambda: archive({f"{number}.csv": TEXT[:99] for number in range(2000)}), "log.zip"),
        STAMPED,
        Rejected(r"log\.zip: expected one file, the archive has 0\.csv, 1\.csv, 10\.csv"),
    ),
    Entry(
        "zip archive of thousands of pictures and a log",
        file(thousands, "log.zip"),
        STAMPED,
        kept(ROWS),
    ),
    Entry(
        "zip archive of a log and a picture",
        file(lambda: archive({"a.csv": TEXT, "b.jpg": b"\xff\xd8\0\0" * 99}), "log.zip"),
        STAMPED,
        kept(ROWS),
    ),
    Entry(
        "zip archive without its directory",
        file(lambda: archive({"log.csv": TEXT}).split(b"PK\1\2")[0], "log.zip"),
        STAMPED,
        kept(ROWS),
    ),
    Entry(
        "zip archive that is encrypted",
        file(encrypted(), "log.zip"),
        STAMPED,
        Rejected(r"log\.zip/log\.csv: is encrypted; unpack the archive with its password"),
    ),
    Entry(
        "zip archive packed by bzip2",
        file(lambda: archive({"log.csv": TEXT}, zipfile.ZIP_BZIP2), "log.zip"),
        STAMPED,
        Rejected(r"log\.zip/log\.csv: is packed by method 12 \(bzip2\); .*unpack the archive"),
    ),
    Entry(
        "zip archive packed by LZMA",
        file(lambda: archive({"log.csv": TEXT}, zipfile.ZIP_LZMA), "log.zip"),
        STAMPED,
        Rejected(r"is packed by method 14 \(LZMA\); .*unpack the archive"),
    ),
    Entry(
        "zip archive packed by deflate64",
        file(with_method(9), "log.zip"),
        STAMPED,
        Rejected(r"is packed by method 9 \(deflate64\); .*unpack the archive"),
    ),
    Entry(
        "zip archive of a link",
        file(linked(), "log.zip"),
        STAMPED,
        Rejected(r"log\.zip/log\.csv: is a link; expected the log itself"),
    ),
    Entry(
        "7z archive",
        file(b"7z\xbc\xaf\x27\x1c" + bytes(100), "log.7z"),
        STAMPED,
        Rejected("is compressed with 7z; expected gzip"),
    ),
    Entry(
        "zip bomb",
        file(zip_bomb, "log.zip"),
        STAMPED,
        Rejected("expands to more than 800 times its size"),
    ),
    Entry(
        "gzip bomb",
        file(lambda: gzip.compress(TEXT) + gzip.compress(bytes(1 << 24)) * 40, "log.csv.gz"),
        STAMPED,
        Rejected("expands to more than 800 times its size"),
    ),
    Entry(
        "bzip2 bomb",
        file(lambda: bz2.compress(TEXT) + bz2.compress(bytes(1 << 22)) * 800, "log.csv.bz2"),
        STAMPED,
        Rejected("expands to more than 800 times its size"),
    ),
    Entry(
        "zstd bomb",
        file(lambda: zstd.compress(TEXT) + zstd.compress(bytes(1 << 26)) * 48, "log.csv.zst"),
        STAMPED,
        Rejected("expands to more than 800 times its size"),
    ),
    Entry(
        "xz bomb",
        file(lambda: lzma.compress(TEXT) + lzma.compress(bytes(1 << 25)) * 90, "log.csv.xz"),
        STAMPED,
        Rejected("expands to more than 800 times its size"),
    ),
]

ENTRIES = [*WELL, *CORRUPT, *CHECKSUMS, *CUT, *ODD]
