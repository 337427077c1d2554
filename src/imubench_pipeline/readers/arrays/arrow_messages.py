"""What the record batches of an Arrow file or stream unpack to, asked before they are unpacked.

A message is a FlatBuffers table; see "Encapsulated message format" and ``Message.fbs`` of Arrow.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa

from imubench_pipeline.readers.arrays.table import UnusableError
from imubench_pipeline.readers.bounds import LARGEST_ARROW_BATCH

_FILE_HEAD = 8
"""Bytes of a file before the stream that it holds."""

_HEADER_TYPE, _HEADER = 1, 2
_DICTIONARY_BATCH, _RECORD_BATCH = 2, 3
_DATA_OF_DICTIONARY = 1
_BUFFERS, _COMPRESSION = 2, 3
_SIZE = struct.Struct("<q")
_BUFFER = struct.Struct("<qq")


def check_batches(path: Path, in_file: bool) -> None:
    """Raise where a compressed batch is larger than may be in memory as a whole.

    Parameters
    ----------
    in_file : bool
        The format is that of a file, and not that of a stream.

    Raises
    ------
    UnusableError
        If one is.
    """
    with pa.memory_map(str(path)) as source:
        source.seek(_FILE_HEAD if in_file else 0)
        for message in pa.ipc.MessageReader.open_stream(source):
            unpacked = sum(_unpacked(bytes(message.metadata), message.body))
            if unpacked > LARGEST_ARROW_BATCH:
                raise UnusableError(
                    f"a compressed record batch unpacks to {unpacked} bytes; expected at most "
                    f"{LARGEST_ARROW_BATCH}: write it with pyarrow.feather.write_feather, which "
                    "makes smaller ones"
                )


def _unpacked(metadata: bytes, body: pa.Buffer | None) -> Iterator[int]:
    """Yield to how many bytes each compressed buffer of a message is said to unpack."""
    try:
        table = _Table(metadata, struct.unpack_from("<I", metadata)[0])
        kind = table.byte(_HEADER_TYPE)
        header = table.table(_HEADER)
        if header is not None and kind == _DICTIONARY_BATCH:
            header = header.table(_DATA_OF_DICTIONARY)
        elif kind != _RECORD_BATCH:
            return
        if body is None or header is None or header.table(_COMPRESSION) is None:
            return
        start, count = header.vector(_BUFFERS)
        for number in range(count):
            offset, length = _BUFFER.unpack_from(metadata, start + number * _BUFFER.size)
            if length >= _SIZE.size:
                yield max(0, *_SIZE.unpack(bytes(body[offset : offset + _SIZE.size])))
    except struct.error:
        raise UnusableError("corrupt data: a damaged message; copy the file again") from None


class _Table:
    """A table of FlatBuffers: its fields stand where its list of offsets says."""

    def __init__(self, data: bytes, at: int) -> None:
        self._data = data
        self._at = at
        self._offsets = at - struct.unpack_from("<i", data, at)[0]

    def _place(self, field: int) -> int | None:
        (size,) = struct.unpack_from("<H", self._data, self._offsets)
        at = 4 + 2 * field
        offset = struct.unpack_from("<H", self._data, self._offsets + at)[0] if at < size else 0
        return self._at + offset if offset else None

    def byte(self, field: int) -> int:
        place = self._place(field)
        return 0 if place is None else int(struct.unpack_from("<B", self._data, place)[0])

    def table(self, field: int) -> _Table | None:
        place = self._place(field)
        if place is None:
            return None
        return _Table(self._data, place + struct.unpack_from("<I", self._data, place)[0])

    def vector(self, field: int) -> tuple[int, int]:
        """Return where the elements of a vector begin, and how many there are."""
        place = self._place(field)
        if place is None:
            return 0, 0
        at = place + struct.unpack_from("<I", self._data, place)[0]
        return at + 4, int(struct.unpack_from("<I", self._data, at)[0])
