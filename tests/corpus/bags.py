"""ROS bags: version 1, and version 2 in SQLite and MCAP."""

from __future__ import annotations

import shutil
from binascii import crc32
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from tests.corpus.entry import Entry, Rejected, Written, file, flipped, kept, part
from tests.corpus.signals import RATE, ROWS, rest
from tests.formats.test_rosbag import EPOCH, IMU, bag, imu_topic, message, temperature_topic

CHANNELS = {
    "gyro_x": {"column": "angular_velocity.x", "unit": "rad/s"},
    "accel_z": {"column": "linear_acceleration.z", "unit": "m/s^2"},
}
STAMPED: dict[str, Any] = {
    "time": {"column": "header.stamp", "unit": "ns"},
    "channels": CHANNELS,
}
UNSTAMPED: dict[str, Any] = {"rate": f"{RATE} Hz", "channels": CHANNELS}
Topics = dict[str, tuple[str, list[tuple[int, int, bytes]]]]


def figures(rows: int = ROWS) -> np.ndarray:
    """Return the six figures of each message."""
    made = 1e-3 * np.random.default_rng(5).standard_normal((rows, 6))
    made[:, 0], made[:, 5] = rest(rows)["wx"], rest(rows)["az"]
    return made


def imu(kind: str, rows: int = ROWS, **keys: Any) -> Topics:
    return {"/imu": imu_topic(kind, figures(rows), **keys)}


def holding(kind: str, topics: Callable[[], Topics]) -> Written:
    """Return what writes a bag of a kind: a file for ROS 1, and else a folder."""

    def write(folder: Path) -> Path:
        return bag(folder, kind, topics())

    return write


def alone(kind: str, change: Callable[[bytes], bytes] = bytes, rows: int = ROWS) -> Written:
    """Return what writes the one file of a bag, perhaps changed."""

    def write(folder: Path) -> Path:
        (folder / ".scratch").mkdir()
        made = bag(folder / ".scratch", kind, imu(kind, rows))
        if made.is_dir():
            (made,) = (path for path in made.iterdir() if path.suffix in (".db3", ".mcap"))
        path = folder / f"log{made.suffix}"
        path.write_bytes(change(made.read_bytes()))
        shutil.rmtree(folder / ".scratch")
        return path

    return write


def changed(kind: str, change: Callable[[Path], object]) -> Written:
    """Return what writes the folder of a bag and then changes it."""

    def write(folder: Path) -> Path:
        path = bag(folder, kind, imu(kind))
        change(path)
        return path

    return write


def checked(data: bytes) -> bytes:
    """Return an MCAP file with the checksum of its first chunk, which may be left out."""
    at = len(b"\x89MCAP0\r\n")
    while data[at] != 6:
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    place = at + 9 + 24
    first = place + 4 + 4 + 8
    size = int.from_bytes(data[first - 8 : first], "little")
    crc = crc32(data[first : first + size]).to_bytes(4, "little")
    return data[:place] + crc + data[place + 4 :]


def damaged_messages() -> Topics:
    msgtype, messages = imu_topic("mcap", figures())
    for number in (100, 500):
        time, order, data = messages[number]
        messages[number] = time, order, data[:-8]
    return {"/imu": (msgtype, messages)}


def without_acceleration() -> Topics:
    return imu("mcap", linear_acceleration_covariance=np.full(9, -1.0))


def two_imus() -> Topics:
    return {"/a": imu_topic("mcap", figures()), "/b": imu_topic("mcap", figures())}


def lost_messages() -> Topics:
    msgtype, messages = imu_topic("sqlite", figures())
    return {"/imu": (msgtype, messages[:300] + messages[320:])}


def turned_back() -> Topics:
    msgtype, messages = imu_topic("ros1", figures())
    again = [
        (time + 10**10, order, message(1, IMU, EPOCH + 10**7 * row, figures()[row]))
        for row, (time, order, _) in enumerate(messages[:200])
    ]
    return {"/imu": (msgtype, messages + again)}


CUT = r"corrupt, or cut short"
ENTRIES = [
    Entry("ros 1 bag", alone("ros1"), STAMPED, kept(ROWS)),
    Entry("ros 1 bag in lz4", alone("ros1-lz4"), STAMPED, kept(ROWS)),
    Entry("ros 1 bag in bz2", alone("ros1-bz2"), UNSTAMPED, kept(ROWS)),
    Entry(
        "ros 1 bag cut short",
        alone("ros1", lambda data: part(data, 0.95), rows=3 * ROWS),
        STAMPED,
        kept(2903, "truncated_file"),
    ),
    Entry(
        "ros 1 bag cut in its first chunk",
        alone("ros1", lambda data: part(data, 0.7)),
        STAMPED,
        Rejected(r"log\.bag: no topic with .*found none \(the bag is cut short"),
    ),
    Entry(
        "ros 1 bag with a flipped bit in lz4",
        alone("ros1-lz4", lambda data: flipped(data, 0.5)),
        STAMPED,
        Rejected(r"log\.bag: damaged at byte \d+"),
    ),
    Entry(
        "ros 1 bag of a header",
        alone("ros1", lambda data: data[:13]),
        STAMPED,
        Rejected(r"log\.bag: damaged at byte 0 \(no bag header\)"),
    ),
    Entry(
        "ros 1 bag of another version",
        file(b"#ROSBAG V1.2\n" + bytes(99), "log.bag"),
        STAMPED,
        Rejected(r"rosbag migrate"),
    ),
    Entry(
        "ros 1 bag whose clock was set back",
        holding("ros1", turned_back),
        STAMPED,
        kept(ROWS + 200, "segments", "log_twice"),
    ),
    Entry("ros 2 bag in sqlite", holding("sqlite", lambda: imu("sqlite")), STAMPED, kept(ROWS)),
    Entry("ros 2 bag in sqlite alone", alone("sqlite"), STAMPED, kept(ROWS)),
    Entry("ros 2 bag in mcap", holding("mcap", lambda: imu("mcap")), STAMPED, kept(ROWS)),
    Entry("ros 2 bag in mcap alone", alone("mcap"), STAMPED, kept(ROWS)),
    Entry("ros 2 bag in packed mcap", alone("mcap-storage"), STAMPED, kept(ROWS)),
    Entry(
        "sqlite cut short",
        alone("sqlite", lambda data: part(data, 0.6)),
        STAMPED,
        Rejected(r"log\.db3: cut short: \d+ of \d+ bytes; .*'\.recover' of sqlite3"),
    ),
    Entry(
        "sqlite of zeros from the middle on",
        alone("sqlite", lambda data: part(data, 0.6) + bytes(len(data) - int(0.6 * len(data)))),
        STAMPED,
        Rejected(rf"log\.db3: {CUT}"),
    ),
    Entry(
        "sqlite with a journal that is not merged",
        changed("sqlite", lambda path: (path / "a.db3-wal").write_bytes(b"x" * 99)),
        STAMPED,
        kept(ROWS, "truncated_file"),
    ),
    Entry(
        "sqlite of another program",
        alone(
            "sqlite",
            lambda data: data.replace(b"topics", b"tropes").replace(b"messages", b"messaged"),
        ),
        STAMPED,
        Rejected(r"log\.db3: the database has no table 'messages'; .* or CSV: sqlite3"),
    ),
    Entry(
        "mcap cut short",
        alone("mcap", lambda data: part(data, 0.7)),
        STAMPED,
        Rejected(rf"log\.mcap: {CUT}.*mcap recover"),
    ),
    Entry("mcap with a checksum", alone("mcap", checked), STAMPED, kept(ROWS)),
    Entry(
        "mcap with a wrong checksum",
        alone("mcap", lambda data: flipped(checked(data), 0.4)),
        STAMPED,
        Rejected(rf"log\.mcap: {CUT}.*checksum"),
    ),
    Entry(
        "mcap of a beginning",
        file(b"\x89MCAP0\r\n", "log.mcap"),
        STAMPED,
        Rejected(rf"log\.mcap: {CUT}"),
    ),
    Entry(
        "ros 2 bag without its file",
        changed("mcap", lambda path: (path / "a.mcap").unlink()),
        STAMPED,
        Rejected(r"a: corrupt, or cut short .Some database files"),
    ),
    Entry(
        "ros 2 bag with broken metadata",
        changed(
            "mcap",
            lambda path: (path / "metadata.yaml").write_text("rosbag2_bagfile_information: ["),
        ),
        STAMPED,
        Rejected(rf"a: {CUT}"),
    ),
    Entry(
        "ros 2 bag without metadata",
        changed("mcap", lambda path: (path / "metadata.yaml").unlink()),
        STAMPED,
        kept(ROWS),
    ),
    Entry(
        "ros 2 bag with damaged messages",
        holding("mcap", damaged_messages),
        STAMPED,
        kept(ROWS - 2, "damaged_message", "missing_samples"),
    ),
    Entry(
        "ros 2 bag with lost messages",
        holding("sqlite", lost_messages),
        STAMPED,
        kept(ROWS - 20, "missing_samples"),
    ),
    Entry(
        "ros 2 bag without acceleration",
        holding("mcap", without_acceleration),
        STAMPED,
        kept(ROWS, "not_measured", "no_samples", "empty_cells"),
    ),
    Entry(
        "ros 2 bag of two sensors",
        holding("mcap", two_imus),
        STAMPED,
        Rejected(r"a: several topics have .*: /a, /b; name one with 'variable:'"),
    ),
    Entry(
        "ros 2 bag of temperatures",
        holding("mcap", lambda: {"/t": temperature_topic("mcap", [20.0] * 200)}),
        STAMPED,
        Rejected(r"a: no topic with .*found /t \(sensor_msgs/msg/Temp"),
    ),
    Entry(
        "ros 2 bag without a message",
        holding("sqlite", lambda: {"/imu": (IMU, [])}),
        STAMPED,
        Rejected(r"a: no message of /imu can be read, 0 do not match"),
    ),
]
