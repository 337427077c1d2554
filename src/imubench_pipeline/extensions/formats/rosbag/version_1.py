"""Read ROS 1 bags (version 2.0) sequentially.

The index of a bag has an entry for every message, so it grows with the recording, and a bag that
was not closed has no index. Reading the chunks in order needs no index and little memory.
"""

import bz2
import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from imubench_pipeline.readers import bounds
from imubench_pipeline.settings.validation import cut
from imubench_pipeline.tables.findings import RecordingError

_MAGIC = b"#ROSBAG V2.0\n"
_OP_MESSAGE, _OP_BAG, _OP_CHUNK, _OP_CONNECTION = b"\x02", b"\x03", b"\x05", b"\x07"
_UINT32 = struct.Struct("<I")
_TIME_STRUCT = struct.Struct("<II")


class Bag:
    """A ROS 1 bag; ``unclosed``: whether it was not closed, or is cut (known after reading)."""

    ros_1 = True

    def __init__(self, path: Path) -> None:
        self._path = path
        self._connections: dict[int, tuple[str, str]] = {}
        self._left = 0
        self.unclosed = False

    def close(self) -> None:
        """Do nothing: the file is open only while messages are read."""

    def topics(self) -> dict[str, str]:
        """Return topics and types of messages; raise `RecordingError` if the bag is damaged."""
        # The connections are in the index; without an index, the whole bag is read.
        with self._path.open("rb") as file:
            try:
                start = self._start(file)
                if start:
                    file.seek(start)
                    while (record := _read_record(file)) is not None and record[0][
                        b"op"
                    ] == _OP_CONNECTION:
                        self._connect(*record)
            except (ValueError, KeyError, struct.error, OSError, _TruncatedError):
                self._connections.clear()
        if not self._connections:
            for _ in self.messages(""):
                pass
        return dict(self._connections.values())

    def counts(self) -> dict[str, int]:
        """Return an empty dict: the numbers of messages are known only after reading the bag."""
        return {}

    def messages(self, topic: str) -> Iterator[tuple[int, bytes]]:
        """Yield time of recording (ns) and bytes of the messages of a topic (see `topics`)."""
        with self._path.open("rb") as file:
            at = 0
            size = os.fstat(file.fileno()).st_size
            self._left = max(bounds.MIN_CHECKED_EXPANSION, bounds.MAX_EXPANSION_RATIO * size)
            try:
                self.unclosed = not self._start(file)
                while True:
                    at = file.tell()
                    record = _read_record(file)
                    if record is None:
                        break
                    is_chunk = record[0][b"op"] == _OP_CHUNK
                    yield from (self._chunk if is_chunk else self._message)(*record, topic)
            except _TruncatedError:
                self.unclosed = True
            except (ValueError, KeyError, struct.error, OSError, EOFError, RuntimeError) as error:
                if isinstance(error, RecordingError):
                    raise
                why = str(error) or type(error).__name__
                raise RecordingError(
                    f"{self._path.name}: damaged at byte {at} ({why}); "
                    "expected a record of a ROS 1 bag; copy it again, or try 'rosbag reindex' and "
                    "'rosbag fix'"
                ) from None

    def _start(self, file: BinaryIO) -> int:
        """Read the first record; return the position of the index, 0 if there is none."""
        magic = file.read(len(_MAGIC))
        if magic != _MAGIC:
            raise RecordingError(
                f"{self._path.name}: begins with {magic!r}; expected {_MAGIC!r}, a ROS 1 bag of "
                "version 2.0: convert an older one with 'rosbag migrate'"
            )
        record = _read_record(file)
        if record is None or record[0][b"op"] != _OP_BAG:
            raise ValueError("no bag header")
        return int.from_bytes(record[0][b"index_pos"], "little")

    def _chunk(
        self, header: dict[bytes, bytes], data: bytes, topic: str
    ) -> Iterator[tuple[int, bytes]]:
        (size,) = _UINT32.unpack(header[b"size"])
        if size > bounds.MAX_BAG_CHUNK:
            raise ValueError(f"a chunk of {size} bytes, expected at most {bounds.MAX_BAG_CHUNK}")
        self._left -= size
        if self._left < 0:
            raise ValueError(
                f"its chunks expand to more than {bounds.MAX_EXPANSION_RATIO} times its size"
            )
        compression = header[b"compression"].decode("ascii", "replace")
        if compression == "bz2":
            data = bz2.BZ2Decompressor().decompress(data, size + 1)
        elif compression == "lz4":
            import lz4.frame  # type: ignore[import-untyped]  # has no types

            data = lz4.frame.LZ4FrameDecompressor().decompress(data, size + 1)
        elif compression != "none":
            raise RecordingError(
                f"{self._path.name}: a chunk is compressed with {cut(compression)}; expected "
                "bz2 or lz4; write the bag again with 'rosbag compress'"
            )
        if len(data) != size:
            raise ValueError(f"a chunk does not have the {size} bytes that its header states")
        at = 0
        while at < len(data):
            middle = at + 4 + _UINT32.unpack_from(data, at)[0]
            end = middle + 4 + _UINT32.unpack_from(data, middle)[0]
            if end > len(data):
                raise ValueError("a record reaches beyond its chunk")
            fields = _parse_fields(data[at + 4 : middle])
            yield from self._message(fields, data[middle + 4 : end], topic)
            at = end

    def _message(
        self, header: dict[bytes, bytes], data: bytes, topic: str
    ) -> Iterator[tuple[int, bytes]]:
        if header[b"op"] == _OP_MESSAGE:
            if self._connections[_UINT32.unpack(header[b"conn"])[0]][0] == topic:
                seconds, nanoseconds = _TIME_STRUCT.unpack(header[b"time"])
                yield (
                    seconds * 10**9 + nanoseconds,
                    data if len(data) <= bounds.MAX_MESSAGE else b"",
                )
        elif header[b"op"] == _OP_CONNECTION:
            self._connect(header, data)

    def _connect(self, header: dict[bytes, bytes], data: bytes) -> None:
        kind = _parse_fields(data)[b"type"].decode("utf-8", "replace")
        topic = header[b"topic"].decode("utf-8", "replace")
        if max(len(topic), len(kind)) > bounds.MAX_TOPIC_LENGTH:
            raise ValueError(f"a topic or type of more than {bounds.MAX_TOPIC_LENGTH} letters")
        if len(self._connections) >= bounds.MAX_TOPICS:
            raise ValueError(
                f"more than {bounds.MAX_TOPICS} connections, expected the connections of a vehicle"
            )
        # The name of the same type in ROS 2.
        self._connections[_UINT32.unpack(header[b"conn"])[0]] = topic, kind.replace("/", "/msg/", 1)


class _TruncatedError(Exception):
    """The file ends within a record."""


def _read_record(file: BinaryIO) -> tuple[dict[bytes, bytes], bytes] | None:
    size = file.read(4)
    if not size:
        return None
    header = _read_exactly(file, size)
    if not header:
        # A power cut leaves an empty header in a growing file.
        raise _TruncatedError
    return _parse_fields(header), _read_exactly(file, file.read(4))


def _read_exactly(file: BinaryIO, size: bytes) -> bytes:
    if len(size) < 4:
        raise _TruncatedError
    (count,) = _UINT32.unpack(size)
    # Checked before reading, since a damaged size may exceed the memory.
    if count > os.fstat(file.fileno()).st_size - file.tell():
        raise _TruncatedError
    if count > bounds.MAX_BAG_CHUNK:
        raise ValueError(f"a record of {count} bytes, expected at most {bounds.MAX_BAG_CHUNK}")
    return file.read(count)


def _parse_fields(header: bytes) -> dict[bytes, bytes]:
    fields: dict[bytes, bytes] = {}
    at = 0
    while at < len(header):
        end = at + 4 + _UINT32.unpack_from(header, at)[0]
        name, sign, value = header[at + 4 : end].partition(b"=")
        if not sign or end > len(header):
            raise ValueError("a record without a valid header")
        fields[name] = value
        at = end
    return fields
