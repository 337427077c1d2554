"""Read ROS 2 bags with the library, with limits on the sizes that are unpacked."""

import heapq
import sqlite3
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any
from urllib.parse import quote

import lz4.frame  # type: ignore[import-untyped]  # has no types
from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader, storage_mcap
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from imubench_pipeline.readers import bounds
from imubench_pipeline.readers.compressed import open_bytes, unpack_zstd
from imubench_pipeline.settings.validation import cut
from imubench_pipeline.tables.findings import RecordingError

_DATABASE_TABLES = ("messages", "topics", "message_definitions", "schema", "metadata")
_READ_BLOCK = 1 << 20


def _check_chunk_size(size: int) -> int:
    if size > bounds.MAX_BAG_CHUNK:
        raise ValueError(f"a chunk of {size} bytes, expected at most {bounds.MAX_BAG_CHUNK}")
    return size


# The decompressors of the library unpack a chunk before they check its size.
storage_mcap.DECOMPRESSORS.update(
    {
        "lz4": lambda data, size: lz4.frame.LZ4FrameDecompressor().decompress(
            data, _check_chunk_size(size) + 1
        ),
        "zstd": lambda data, size: unpack_zstd(data, _check_chunk_size(size) + 1),
    }
)


_Reader = Reader | McapReader | Sqlite3Reader


class Bag2:
    """A ROS 2 bag; ``reader``: of the library, not yet opened."""

    ros_1 = False
    unclosed = False

    def __init__(self, reader: _Reader) -> None:
        self._reader = reader
        reader.open()
        try:
            self._connections: list[Connection] = list(reader.connections)
            if len(self._connections) > bounds.MAX_TOPICS:
                raise ValueError(
                    f"more than {bounds.MAX_TOPICS} topics, expected the topics of a vehicle"
                )
            if any(
                len(str(c.topic) + str(c.msgtype)) > bounds.MAX_TOPIC_LENGTH
                for c in self._connections
            ):
                raise ValueError(f"a topic or type of more than {bounds.MAX_TOPIC_LENGTH} letters")
            storages = _list_storages(reader)
            if len({storage.path for storage in storages}) < len(storages):
                raise ValueError("metadata.yaml names a file twice, expected each once")
            for storage in storages:
                if isinstance(storage, McapReader):
                    _check_index(storage)
        except BaseException:
            self.close()
            raise

    def topics(self) -> dict[str, str]:
        """Return the topics, and the type of message of each."""
        return {str(connection.topic): str(connection.msgtype) for connection in self._connections}

    def counts(self) -> dict[str, int]:
        """Return the number of messages of each topic."""
        counts: Counter[str] = Counter()
        for connection in self._connections:
            counts[str(connection.topic)] += connection.msgcount
        return counts

    def messages(self, topic: str) -> Iterator[tuple[int, bytes]]:
        """Yield time of recording (ns) and bytes of the messages of a topic."""
        packed = isinstance(self._reader, Reader) and self._reader.compression_mode == "message"
        # The library would unpack packed messages without a limit.
        for reader in _list_storages(self._reader) if packed else [self._reader]:
            wanted = [connection for connection in reader.connections if connection.topic == topic]
            for _, time, message in reader.messages(wanted) if wanted else ():
                # A damaged database may contain any type.
                data = message if isinstance(message, bytes) else b""
                if packed:
                    data = unpack_zstd(data, bounds.MAX_MESSAGE + 1)
                yield time, data if len(data) <= bounds.MAX_MESSAGE else b""

    def close(self) -> None:
        """Close the bag."""
        self._reader.close()


def _list_storages(reader: _Reader) -> list[Any]:
    if not isinstance(reader, Reader):
        return [reader]
    storage = reader.storage
    return list(storage.storages) if isinstance(storage, DirectoryReader) else [storage]


def _check_index(storage: McapReader) -> None:
    """Raise if the chunks expand too far or overlap in time; a damaged index may repeat one."""
    size_of_file = Path(str(storage.path)).stat().st_size
    expanded = sum(chunk.uncompressed_size for chunk in storage.chunks)
    if expanded > max(bounds.MIN_CHECKED_EXPANSION, bounds.MAX_EXPANSION_RATIO * size_of_file):
        raise ValueError(
            f"its chunks expand to more than {bounds.MAX_EXPANSION_RATIO} times its size"
        )
    open_until: list[tuple[int, int]] = []
    size = 0
    for chunk in sorted(storage.chunks, key=lambda chunk: chunk.message_start_time):
        while open_until and open_until[0][0] < chunk.message_start_time:
            size -= heapq.heappop(open_until)[1]
        heapq.heappush(open_until, (chunk.message_end_time, chunk.uncompressed_size))
        size += chunk.uncompressed_size
        if size > bounds.MAX_BAG_OVERLAP:
            raise ValueError(
                f"chunks that overlap have {size} bytes, expected at most {bounds.MAX_BAG_OVERLAP}"
            )


def check_folder(path: Path) -> None:
    """Raise RecordingError for a device or pipe, long metadata, or a file that expands too far."""
    for file in sorted(path.iterdir()):
        if not file.is_file() and not file.is_dir():
            raise RecordingError(
                f"{path.name}: {cut(file.name)} is a device or named pipe; expected the files of a "
                "ROS 2 bag: copy the bag again"
            )
    size = (path / "metadata.yaml").stat().st_size
    if size > bounds.MAX_METADATA:
        raise RecordingError(
            f"{path.name}: metadata.yaml has {size} bytes; expected at most {bounds.MAX_METADATA}: "
            "copy the bag again"
        )
    for packed in sorted(path.glob("*.zstd")):
        # The library unpacks the whole file to the disk.
        with closing(open_bytes(packed)) as stream:
            while stream.read(_READ_BLOCK):
                pass


def check_database(path: Path) -> None:
    """Raise RecordingError if a database is truncated, or has views or computed columns."""
    # SQLite would read the missing part of a truncated file as zeros. Old libraries do not update
    # the number of pages; then the two counters differ.
    with path.open("rb") as file:
        header = file.read(100)
    page = int.from_bytes(header[16:18], "big")
    expected = (1 << 16 if page == 1 else page) * int.from_bytes(header[28:32], "big")
    size = path.stat().st_size
    if header[24:28] == header[92:96] and size < expected:
        raise RecordingError(
            f"{path.name}: cut short: {size} of {expected} bytes; copy it again, or repair it with "
            "'.recover' of sqlite3"
        )
    location = f"file:{quote(str(path.resolve()))}?mode=ro&immutable=1"
    with closing(sqlite3.connect(location, uri=True)) as database:
        for name in _DATABASE_TABLES:
            kinds = database.execute(
                "SELECT type, rootpage FROM sqlite_master WHERE lower(name) = ?", (name,)
            ).fetchall()
            if not kinds and name in _DATABASE_TABLES[:2]:
                raise RecordingError(
                    f"{path.name}: the database has no table {name!r}; expected a ROS 2 bag, or "
                    "CSV: sqlite3 -header -csv FILE 'select * from TABLE' > log.csv"
                )
            columns = database.execute(f"PRAGMA table_xinfo({name})").fetchall()
            if any(kind != "table" or not page for kind, page in kinds) or any(
                column[-1] for column in columns
            ):
                raise RecordingError(
                    f"{path.name}: {name} is computed, not recorded; expected a table of a ROS 2 "
                    "bag: record it again"
                )
