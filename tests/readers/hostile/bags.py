"""ROS bags, 1 and 2."""

from __future__ import annotations

import bz2
import os
import sqlite3
import struct
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import lz4.frame
from backports import zstd

from tests.readers.hostile.attack import MIB, Attack, file

IMU = {"gyro_x": {"column": "angular_velocity.x"}}
NOT_READ = "no message of /imu can be read"
EMPTY = "has no message that can be read"
MAGIC = b"\x89MCAP0\r\n"


def record(header: dict[bytes, bytes], data: bytes) -> bytes:
    """Return a record of a ROS 1 bag."""
    fields = b"".join(
        struct.pack("<I", len(key) + 1 + len(value)) + key + b"=" + value
        for key, value in header.items()
    )
    return struct.pack("<I", len(fields)) + fields + struct.pack("<I", len(data)) + data


def bag(*records: bytes) -> bytes:
    head = {b"op": b"\3", b"index_pos": bytes(8), b"conn_count": bytes(4), b"chunk_count": bytes(4)}
    return b"#ROSBAG V2.0\n" + record(head, b"") + b"".join(records)


def connection(number: int = 0, topic: bytes = b"/imu") -> bytes:
    about = b"".join(
        struct.pack("<I", len(part)) + part
        for part in (b"type=sensor_msgs/Imu", b"message_definition=")
    )
    return record({b"op": b"\7", b"conn": struct.pack("<I", number), b"topic": topic}, about)


def message(size: int) -> bytes:
    """Return a message that takes so many bytes with all that is around it."""
    header = {b"op": b"\2", b"conn": bytes(4), b"time": bytes(8)}
    return record(header, bytes(size - len(record(header, b""))))


def chunk(data: bytes, said: int | None = None, method: bytes = b"lz4") -> bytes:
    packed = lz4.frame.compress(data) if method == b"lz4" else bz2.compress(data)
    size = struct.pack("<I", said or len(data))
    return record({b"op": b"\5", b"compression": method, b"size": size}, packed)


def database(statements: str) -> Callable[[Path], Path]:
    def write(folder: Path) -> Path:
        path = folder / "log.db3"
        made = sqlite3.connect(path)
        made.executescript(TOPICS + statements)
        made.close()
        return path

    return write


TOPICS = """
CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT,
 offered_qos_profiles TEXT);
INSERT INTO topics VALUES(1, '/imu', 'sensor_msgs/msg/Imu', 'cdr', '');
"""
GENERATED = """
CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER,
 data BLOB GENERATED ALWAYS AS (zeroblob(900000000)) VIRTUAL);
INSERT INTO messages(topic_id, timestamp) VALUES (1, 1), (1, 2);
"""
ENDLESS = """
CREATE TABLE schema(schema_version INTEGER);
INSERT INTO schema VALUES (4);
CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);
CREATE VIEW message_definitions AS
 WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id + 1 FROM n)
 SELECT id, 'a' AS topic_type, 'ros2msg' AS encoding, '' AS encoded_message_definition,
  '' AS type_description_hash FROM n;
"""


def mcap_record(kind: int, data: bytes) -> bytes:
    return bytes([kind]) + struct.pack("<Q", len(data)) + data


def mcap_text(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


def mcap_channel(number: int = 1, topic: bytes = b"/imu") -> bytes:
    about = mcap_text(topic) + mcap_text(b"cdr") + mcap_text(b"")
    return mcap_record(4, struct.pack("<HH", number, 1) + about)


def mcap_chunk(packed: bytes, said: int) -> bytes:
    about = struct.pack("<QQQI", 0, 1, said, 0) + mcap_text(b"zstd")
    return mcap_record(6, about + struct.pack("<Q", len(packed)) + packed)


def mcap_message(data: bytes) -> bytes:
    return mcap_record(5, struct.pack("<HIQQ", 1, 0, 0, 0) + data)


SCHEMA = mcap_record(
    3,
    struct.pack("<H", 1)
    + mcap_text(b"sensor_msgs/msg/Imu")
    + mcap_text(b"ros2msg")
    + mcap_text(b""),
)


def mcap(*records: bytes, summary: bytes = b"") -> bytes:
    data = MAGIC + mcap_record(1, mcap_text(b"ros2") + mcap_text(b"")) + SCHEMA
    data += b"".join(records)
    start = len(data) if summary else 0
    return data + summary + mcap_record(2, struct.pack("<QQI", start, 0, 0)) + MAGIC


def indexed(size: int, times: Sequence[int]) -> bytes:
    """Return a bag whose index has one chunk of so many bytes again and again, at these times."""
    index = b""
    for time in times:
        one = struct.pack("<QQQQ", time, time + 1, 0, 100) + struct.pack("<IHQ", 10, 1, 100)
        one += struct.pack("<Q", 100) + mcap_text(b"zstd") + struct.pack("<QQ", 10, size)
        index += mcap_record(8, one)
    return mcap(summary=SCHEMA + mcap_channel() + index)


def packed_zeros(count: int) -> bytes:
    """Return so many MiB of zeros."""
    return zstd.compress(bytes(64 * MIB), level=1) * (count // 64)


@cache
def one_frame(count: int) -> bytes:
    """Return so many MiB of zeros in one frame."""
    compress = zstd.ZstdCompressor(level=1)
    return b"".join(compress.compress(bytes(MIB)) for _ in range(count)) + compress.flush()


METADATA = """
rosbag2_bagfile_information:
  version: 4
  storage_identifier: mcap
  relative_file_paths: [{name}]
  duration: {{nanoseconds: 1}}
  starting_time: {{nanoseconds_since_epoch: 0}}
  message_count: 1
  compression_format: zstd
  compression_mode: {mode}
  topics_with_message_count:
    - topic_metadata: {{name: /imu, type: sensor_msgs/msg/Imu, serialization_format: cdr,
        offered_qos_profiles: ''}}
      message_count: 1
"""


def folder_of(
    mode: str, data: Callable[[], bytes], more: str = "", names: int = 1, pipe: bool = False
) -> Callable[[Path], Path]:
    """Return what writes the folder of a bag whose file or messages are packed."""

    def write(folder: Path) -> Path:
        path, name = folder / "log", "a.mcap" + ".zstd" * (mode == "file")
        path.mkdir()
        (path / name).write_bytes(data())
        if pipe:
            os.mkfifo(path / ".pipe")
            name = ".pipe"
        text = METADATA.format(name=", ".join([name] * names), mode=mode)
        (path / "metadata.yaml").write_text(text + more)
        return path

    return write


BAGS = {
    "a chunk of 128 MiB": Attack(
        file("a.bag", lambda: bag(connection(), chunk(message(128 * MIB)))), NOT_READ, EMPTY, IMU
    ),
    "a chunk of more": Attack(
        file("a.bag", lambda: bag(connection(), chunk(message(128 * MIB + 1)))),
        "a chunk of 134217729 bytes, expected at most 134217728",
        channels=IMU,
    ),
    "three chunks of 100 MB": Attack(
        file("a.bag", lambda: bag(connection(), *[chunk(message(10**8), method=b"bz2")] * 3)),
        "expand to more than 800 times",
        channels=IMU,
    ),
    "a chunk that is longer than it says": Attack(
        file("a.bag", lambda: bag(connection(), chunk(bytes(200 * MIB), 1000))),
        "a chunk does not have the 1000 bytes that its header states",
        channels=IMU,
    ),
    "10001 connections": Attack(
        file("a.bag", lambda: bag(*(connection(n, b"/%d" % n) for n in range(10_001)))),
        "more than 10000 connections",
        channels=IMU,
    ),
    "a topic of 10 MB": Attack(
        file("a.bag", lambda: bag(connection(topic=b"/" * 10**7))),
        "a topic or type of more than 1024 letters",
        channels=IMU,
    ),
    "messages that are generated": Attack(
        database(GENERATED), "messages is computed, not recorded", channels=IMU
    ),
    "definitions without end": Attack(
        database(ENDLESS), "message_definitions is computed, not recorded", channels=IMU
    ),
    "an MCAP chunk that is longer than it says": Attack(
        file("a.mcap", lambda: mcap(mcap_channel(), mcap_chunk(one_frame(1000), 1000))),
        "expected 1000 bytes, got 1001",
        channels=IMU,
    ),
    "an MCAP chunk of 128 MiB": Attack(
        file(
            "a.mcap",
            lambda: mcap(
                mcap_channel(),
                mcap_chunk(zstd.compress(mcap_message(bytes(128 * MIB - 31))), 128 * MIB),
            ),
        ),
        NOT_READ,
        EMPTY,
        IMU,
    ),
    "MCAP chunks of one time": Attack(
        file("a.mcap", lambda: indexed(33 * MIB, [0, 0, 0])),
        "chunks that overlap have 103809024 bytes",
        channels=IMU,
    ),
    "an MCAP index of one chunk for all times": Attack(
        file("a.mcap", lambda: indexed(7 * MIB, range(0, 3000, 2))),
        "its chunks expand to more than 800 times its size",
        channels=IMU,
    ),
    "10001 channels": Attack(
        file("a.mcap", lambda: mcap(*(mcap_channel(n, b"/%d" % n) for n in range(10_001)))),
        "more than 10000 topics",
        channels=IMU,
    ),
    "a packed file of 5 GiB": Attack(
        folder_of("file", lambda: packed_zeros(5 << 10)), "expands to more than 800", channels=IMU
    ),
    "a packed message of 1 GiB": Attack(
        folder_of("message", lambda: mcap(mcap_channel(), mcap_message(one_frame(1000)))),
        NOT_READ,
        EMPTY,
        IMU,
    ),
    "a file that is named a hundred times": Attack(
        folder_of("message", mcap, names=100), "names a file twice", channels=IMU
    ),
    "a pipe for a file": Attack(
        folder_of("message", mcap, pipe=True), "'.pipe' is a device or named pipe", channels=IMU
    ),
    "a connection whose number has 1 MB": Attack(
        file("a.bag", lambda: bag(record({b"op": b"\2", b"conn": b"\xff" * MIB}, b""))),
        "damaged at byte 90 .unpack requires",
        channels=IMU,
    ),
    "a compression whose name has 1 MB": Attack(
        file(
            "a.bag",
            lambda: bag(record({b"op": b"\5", b"compression": b"x" * MIB, b"size": bytes(4)}, b"")),
        ),
        r"is compressed with 'x+\.\.\.x+'; expected bz2",
        channels=IMU,
    ),
    "metadata of 2 MB": Attack(
        folder_of("message", mcap, "#" * 2 * MIB), "metadata.yaml has", channels=IMU
    ),
}
