"""Decompress gzip, zstd, xz and bzip2 block by block, in bounded memory."""

from __future__ import annotations

import bz2
import lzma
import re
import sys
import zlib
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from imubench_pipeline.readers.bounds import MAX_UNCHECKED_PARTS, MAX_WINDOW, MIN_MEAN_PART
from imubench_pipeline.readers.holes import FileWithoutHoles

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

_READ_BLOCK = 1 << 16


class _CompressedParts:
    """The decompressed bytes of one or several consecutive compressed parts.

    Nearly empty parts take time but few bytes of the file: the libraries skip millions of them
    before they return. Their number is therefore limited.

    ``new`` creates the decompressor of one part. Only zeros may follow a part.
    """

    def __init__(self, file: FileWithoutHoles, new: Callable[[], Any]) -> None:
        self._file = file
        self._new = new
        self._part = new()
        self._parts = 1
        self._size = 0

    def read1(self, size: int) -> bytes:
        while True:
            begins = self._part.eof
            packed = self._part.unused_data if begins else b""
            if not packed and (begins or self._part.needs_input):
                packed = self._file.read(_READ_BLOCK)
            if begins:
                while packed and not (packed := packed.lstrip(b"\0")):
                    packed = self._file.read(_READ_BLOCK)
                if not packed:
                    return b""
                self._part = self._new()
                if self._parts >= MAX_UNCHECKED_PARTS and self._size < MIN_MEAN_PART * self._parts:
                    raise OSError(
                        f"{self._parts} compressed parts hold {self._size} bytes, expected more "
                        f"than {MIN_MEAN_PART} a part"
                    )
                self._parts += 1
            try:
                block: bytes = self._part.decompress(packed, size)
            except (OSError, EOFError, lzma.LZMAError, zlib.error, zstd.ZstdError) as error:
                why = "what follows the compressed data is not compressed" if begins else error
                raise OSError(str(why)) from None
            if block:
                self._size += len(block)
                return block
            if not packed and not self._part.eof:
                raise EOFError

    def close(self) -> None:
        self._file.close()


class _GzipDecompressor:
    """Decompressor of one member of gzip, with the interface of bz2 and lzma."""

    def __init__(self) -> None:
        self._inflate = zlib.decompressobj(zlib.MAX_WBITS | 16)

    @property
    def eof(self) -> bool:
        return self._inflate.eof

    @property
    def unused_data(self) -> bytes:
        return self._inflate.unused_data

    @property
    def needs_input(self) -> bool:
        return not self._inflate.unconsumed_tail

    def decompress(self, packed: bytes, most: int) -> bytes:
        return self._inflate.decompress(self._inflate.unconsumed_tail + packed, most)


def unpacked_zstd(data: bytes, most: int) -> bytes:
    """Return the first decompressed bytes of a frame of zstd.

    ``most``: largest number of bytes to decompress.
    Raise `ValueError` if the data are corrupt.
    """
    try:
        return _create_zstd().decompress(data, most)
    except zstd.ZstdError as error:
        raise ValueError(str(error)) from None


def _create_zstd() -> zstd.ZstdDecompressor:
    largest: dict[int, int] = {
        zstd.DecompressionParameter.window_log_max: MAX_WINDOW.bit_length() - 1
    }
    return zstd.ZstdDecompressor(options=largest)


DECOMPRESSORS: Mapping[str, Callable[[FileWithoutHoles], Any]] = {
    "gzip": lambda file: _CompressedParts(file, _GzipDecompressor),
    "zstd": lambda file: _CompressedParts(file, _create_zstd),
    # The memory for the dictionary that a file requests is allocated before the first byte.
    "xz": lambda file: _CompressedParts(file, partial(lzma.LZMADecompressor, memlimit=MAX_WINDOW)),
    "bzip2": lambda file: _CompressedParts(file, bz2.BZ2Decompressor),
}
"""Function that opens a compressed file, by compression."""

_MAGIC = re.compile(
    rb"(?P<gzip>\x1f\x8b\x08[\0-\x1f])|(?P<zstd>\x28\xb5\x2f\xfd)|(?P<xz>\xfd7zXZ\0)"
    rb"|(?P<bzip2>BZh[1-9](?:1AY&SY|\x17rE8P\x90|.{0,5}\Z))",
    re.DOTALL,
)
MAX_MAGIC_LENGTH = 10
"""Signatures of compressed files. A shorter signature would match random bytes."""


def compression_of(begin: bytes) -> str:
    """Return the compression (a key of `DECOMPRESSORS`) by the first bytes; empty if none."""
    magic = _MAGIC.match(begin[:MAX_MAGIC_LENGTH])
    return "" if magic is None else magic.lastgroup or ""
