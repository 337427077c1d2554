"""What decompresses gzip, zstd, xz and bzip2, block by block and in bounded memory."""

from __future__ import annotations

import bz2
import lzma
import re
import sys
import zlib
from collections.abc import Callable, Mapping
from typing import Any, Protocol

from imubench_pipeline.readers.bounds import LARGEST_WINDOW, LEAST_IN_PART, MOST_PARTS

if sys.version_info >= (3, 14):
    from compression import zstd
else:
    from backports import zstd

_READ = 1 << 16


class Source(Protocol):
    """What compressed bytes are read from."""

    def read(self, size: int, /) -> bytes:
        """Return the next bytes; none at the end."""

    def close(self) -> None:
        """Close it."""


class _Parts:
    """The decompressed bytes of what may be several compressed parts, one behind another.

    Parts that hold next to nothing cost time and no bytes of the file to speak of: the libraries
    pass over them by the million before they return.

    ``new`` makes what decompresses one part. Zeros may follow a part, and nothing else.
    """

    def __init__(self, file: Source, new: Callable[[], Any]) -> None:
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
                packed = self._file.read(_READ)
            if begins:
                while packed and not (packed := packed.lstrip(b"\0")):
                    packed = self._file.read(_READ)
                if not packed:
                    return b""
                self._part = self._new()
                self._parts = _counted(self._parts, self._size)
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


def _counted(parts: int, size: int) -> int:
    """Return one part more than there were; raise if they are many that hold next to nothing."""
    if parts >= MOST_PARTS and size < LEAST_IN_PART * parts:
        raise OSError(
            f"{parts} compressed parts hold {size} bytes, expected more than {LEAST_IN_PART} a part"
        )
    return parts + 1


class _Gunzip:
    """One member of gzip, as bz2 and lzma have it of their streams."""

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
    """Return the first bytes of what is compressed in a frame of zstd.

    ``most``: that are unpacked at most.

    Raises
    ------
    ValueError
        If the data are corrupt.
    """
    try:
        return _unzstd().decompress(data, most)
    except zstd.ZstdError as error:
        raise ValueError(str(error)) from None


def _unzstd() -> zstd.ZstdDecompressor:
    largest: dict[int, int] = {
        zstd.DecompressionParameter.window_log_max: LARGEST_WINDOW.bit_length() - 1
    }
    return zstd.ZstdDecompressor(options=largest)


def _unxz() -> lzma.LZMADecompressor:
    # The dictionary that a file asks for is taken from memory before the first byte.
    return lzma.LZMADecompressor(memlimit=LARGEST_WINDOW)


OPENED: Mapping[str, Callable[[Source], Any]] = {
    "gzip": lambda file: _Parts(file, _Gunzip),
    "zstd": lambda file: _Parts(file, _unzstd),
    "xz": lambda file: _Parts(file, _unxz),
    "bzip2": lambda file: _Parts(file, bz2.BZ2Decompressor),
}
"""How a file is opened that is compressed so."""

_MAGIC = re.compile(
    rb"(?P<gzip>\x1f\x8b\x08[\0-\x1f])|(?P<zstd>\x28\xb5\x2f\xfd)|(?P<xz>\xfd7zXZ\0)"
    rb"|(?P<bzip2>BZh[1-9](?:1AY&SY|\x17rE8P\x90|.{0,5}\Z))",
    re.DOTALL,
)
LONGEST_MAGIC = 10
"""Signatures of compressed files. A shorter signature would match random bytes."""


def compression_of(begin: bytes) -> str:
    """Return how a file is compressed that begins so, as `OPENED` calls it; empty: it is not."""
    magic = _MAGIC.match(begin[:LONGEST_MAGIC])
    return "" if magic is None else magic.lastgroup or ""
