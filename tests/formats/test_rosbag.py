from __future__ import annotations

import shutil
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from imubench_pipeline.extensions.formats.rosbag import file as bags
from imubench_pipeline.extensions.formats.rosbag.file import RosbagFile
from imubench_pipeline.extensions.formats.rosbag.version_1 import Bag
from imubench_pipeline.readers import RecordingError, bounds, read
from imubench_pipeline.readers.batch import LogFile
from imubench_pipeline.settings.sensor import LogFormat
from tests.readers.damage import examples

IMU, TEMPERATURE = "sensor_msgs/msg/Imu", "sensor_msgs/msg/Temperature"
COLUMNS = {
    "gyro_x": "angular_velocity.x",
    "gyro_z": "angular_velocity.z",
    "accel_y": "linear_acceleration.y",
}
STORES = {1: get_typestore(Stores.ROS1_NOETIC), 2: get_typestore(Stores.ROS2_HUMBLE)}
EPOCH = 1_700_000_000 * 10**9
KINDS = ["ros1", "ros1-bz2", "ros1-lz4", "sqlite", "sqlite-file", "sqlite-message", "mcap"]
KINDS += ["mcap-storage", "mcap-message"]
STAMP, LOGGED = ({"column": name, "unit": "ns"} for name in ("header.stamp", "log_time"))


def log_format(
    columns: dict[str, str] | None = None, variable: str | None = None, **keys: Any
) -> LogFormat:
    where = {"variable": variable} if variable else {}
    units = {"gyro": "rad/s", "accel": "m/s^2"}
    channels = {
        name: {"column": column, "unit": units[name.split("_")[0]]} | where
        for name, column in (columns or COLUMNS).items()
    }
    given = {"rate": None if "time" in keys else "100 Hz"} | keys
    return LogFormat.model_validate({"reader": "rosbag", "channels": channels} | given)


def figures(rows: int, seed: int = 3) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal((rows, 6))


def message(version: int, kind: str, stamp: int, row: Any, **keys: Any) -> bytes:
    store = STORES[version]
    of = store.types
    seconds, nanoseconds = divmod(stamp, 10**9)
    time = of["builtin_interfaces/msg/Time"](seconds, nanoseconds)
    first = {"seq": 7} if version == 1 else {}
    header = of["std_msgs/msg/Header"](stamp=time, frame_id=keys.pop("frame", "imu"), **first)
    if kind == TEMPERATURE:
        built = of[kind](header=header, temperature=float(row[0]), variance=0.0)
    else:
        vector = of["geometry_msgs/msg/Vector3"]
        parts = {
            "orientation": of["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
            "orientation_covariance": np.full(9, -1.0),
            "angular_velocity": vector(*row[:3]),
            "angular_velocity_covariance": np.zeros(9),
            "linear_acceleration": vector(*row[3:]),
            "linear_acceleration_covariance": np.zeros(9),
        }
        built = of[kind](header=header, **(parts | keys))
    if version == 1:
        return bytes(store.serialize_ros1(built, kind))
    return bytes(store.serialize_cdr(built, kind))


def writer_of(folder: Path, kind: str) -> Any:
    """Return a writer of a bag, and where the bag is."""
    name, _, packed = kind.partition("-")
    if name == "ros1":
        writer = Writer1(folder / "a.bag")
        if packed:
            writer.set_compression(Writer1.CompressionFormat[packed.upper()])
        return writer
    plugin = StoragePlugin.SQLITE3 if name == "sqlite" else StoragePlugin.MCAP
    writer2 = Writer2(folder / "a", version=9, storage_plugin=plugin)
    if packed:
        writer2.set_compression(CompressionMode[packed.upper()], CompressionFormat.ZSTD)
    return writer2


def bag(
    folder: Path, kind: str, topics: dict[str, tuple[str, list[tuple[int, int, bytes]]]]
) -> Path:
    """Write messages (stamp of recording, order, bytes) of topics."""
    version = 1 if kind.startswith("ros1") else 2
    with writer_of(folder, kind) as writer:
        all_of_them = []
        for topic, (msgtype, messages) in topics.items():
            connection = writer.add_connection(topic, msgtype, typestore=STORES[version])
            all_of_them += [(time, order, connection, data) for time, order, data in messages]
        for time, _, connection, data in sorted(all_of_them, key=lambda item: item[:2]):
            writer.write(connection, time, data)
    return folder / ("a.bag" if version == 1 else "a")


def imu_topic(
    kind: str, rows: np.ndarray, start: int = EPOCH, **keys: Any
) -> tuple[str, list[tuple[int, int, bytes]]]:
    version = 1 if kind.startswith("ros1") else 2
    return IMU, [
        (start + i * 10**7 + 123, i, message(version, IMU, start + i * 10**7 + i, row, **keys))
        for i, row in enumerate(rows)
    ]


def temperature_topic(kind: str, values: list[float]) -> tuple[str, list[tuple[int, int, bytes]]]:
    version = 1 if kind.startswith("ros1") else 2
    return TEMPERATURE, [
        (EPOCH + i * 10**9, i, message(version, TEMPERATURE, EPOCH + i * 10**9, [value]))
        for i, value in enumerate(values)
    ]


def columns(path: Path, log: LogFormat) -> tuple[dict[str, np.ndarray], np.ndarray | None, LogFile]:
    (file,) = read(path, log)
    return contents(file)


def contents(file: LogFile) -> tuple[dict[str, np.ndarray], np.ndarray | None, LogFile]:
    batches = list(file.batches())
    joined = {name: np.concatenate([b.columns[name] for b in batches]) for name in file.sources}
    times = [b.time for b in batches if b.time is not None]
    return joined, np.concatenate(times) if times else None, file


def counts(file: LogFile) -> dict[str, float]:
    return {finding.finding: finding.value for finding in file.findings}


def same(found: dict[str, np.ndarray], rows: np.ndarray) -> None:
    np.testing.assert_array_equal(found["gyro_x"], rows[:, 0])
    np.testing.assert_array_equal(found["gyro_z"], rows[:, 2])
    np.testing.assert_array_equal(found["accel_y"], rows[:, 4])


# -------------------------------------------------------------------------------- what is right


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_bag(tmp_path: Path, kind: str) -> None:
    rows = figures(500)
    path = bag(tmp_path, kind, {"/imu": imu_topic(kind, rows)})
    found, time, file = columns(path, log_format())
    same(found, rows)
    assert time is None and counts(file) == {}
    found, time, file = columns(path, log_format(time=STAMP, variable="/imu"))
    same(found, rows)
    assert time is not None and file.started == "2023-11-14T22:13:20.000"
    np.testing.assert_allclose(time, np.arange(500) * (10**7 + 1) * 1e-9, rtol=1e-15)
    _, time, _ = columns(path, log_format(time=LOGGED))
    assert time is not None
    np.testing.assert_allclose(time, np.arange(500) / 100, rtol=1e-15)


@pytest.mark.parametrize("kind", ["ros1", "sqlite", "mcap"])
def test_the_figures_are_those_that_the_library_reads(tmp_path: Path, kind: str) -> None:
    path = bag(tmp_path, kind, {"/imu": imu_topic(kind, figures(50))})
    with AnyReader([path]) as reader:
        read_by_library = [
            (time, reader.deserialize(data, connection.msgtype))
            for connection, time, data in reader.messages()
        ]
    found, time, _ = columns(path, log_format(time=LOGGED))
    assert found["gyro_z"].tolist() == [m.angular_velocity.z for _, m in read_by_library]
    assert found["accel_y"].tolist() == [m.linear_acceleration.y for _, m in read_by_library]
    assert time is not None
    first = read_by_library[0][0]
    np.testing.assert_allclose(time, [(t - first) * 1e-9 for t, _ in read_by_library])


@pytest.mark.parametrize("kind", ["sqlite", "mcap", "mcap-storage"])
def test_a_file_alone_whatever_its_name(tmp_path: Path, kind: str) -> None:
    rows = figures(50)
    folder = bag(tmp_path, kind, {"/imu": imu_topic(kind, rows)})
    (file,) = [path for path in folder.iterdir() if path.suffix in (".db3", ".mcap")]
    for name in (file.name, "log"):
        shutil.copy(file, tmp_path / name)
        found, _, _ = columns(tmp_path / name, log_format())
        same(found, rows)


@pytest.mark.parametrize("length", range(9))
@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_frames_of_any_length_and_of_changing_length(
    tmp_path: Path, kind: str, length: int
) -> None:
    rows = figures(30)
    topic = imu_topic(kind, rows[:15], frame="x" * length)[1]
    topic += imu_topic(kind, rows[15:], start=EPOCH + 15 * 10**7, frame="y" * (2 * length + 1))[1]
    found, _, _ = columns(bag(tmp_path, kind, {"/imu": (IMU, topic)}), log_format())
    same(found, rows)


def test_big_endian_messages(tmp_path: Path) -> None:
    rows = figures(5)
    store, topic = STORES[2], imu_topic("mcap", rows)[1]
    big = [
        (
            time,
            order,
            bytes(store.serialize_cdr(store.deserialize_cdr(data, IMU), IMU, little_endian=False)),
        )
        for time, order, data in topic
    ]
    path = bag(tmp_path, "mcap", {"/imu": (IMU, big)})
    found, time, _ = columns(path, log_format(time=STAMP))
    same(found, rows)
    assert time is not None and time[1] == pytest.approx(0.010000001, rel=1e-15)


@pytest.mark.parametrize("kind", ["ros1-lz4", "sqlite", "mcap"])
def test_several_topics(tmp_path: Path, kind: str) -> None:
    rows = [figures(300, 1), figures(200, 2)]
    topics = {
        "/camera/gyro": imu_topic(kind, rows[0]),
        "/camera/accel": imu_topic(kind, rows[1]),
        "/camera/temperature": temperature_topic(kind, [20.5, 21.0, 21.5]),
    }
    path = bag(tmp_path, kind, topics)
    with pytest.raises(RecordingError, match=r"several topics have .*/camera/accel, /camera/gyro"):
        columns(path, log_format())
    with pytest.raises(RecordingError, match=r"no topic /imu with .*found /camera/accel \(sens"):
        columns(path, log_format(variable="/imu"))
    for topic, truth in zip(("camera/gyro", "/camera/accel"), rows, strict=True):
        found, _, _ = columns(path, log_format(variable=topic))
        same(found, truth)
    log = log_format(
        {"gyro_x": "angular_velocity.x"},
        variable="/camera/gyro",
        temperature={"column": "temperature", "unit": "degC"},
        time=STAMP,
    )
    # Each topic has a clock of its own, and is a file of its own.
    temperature, gyro = (contents(file) for file in read(path, log))
    np.testing.assert_array_equal(gyro[0]["gyro_x"], rows[0][:, 0])
    assert temperature[0]["temperature"].tolist() == [20.5, 21.0, 21.5]
    assert temperature[1] is not None and temperature[1].tolist() == [0.0, 1.0, 2.0]


def test_two_topics_have_two_clocks(tmp_path: Path) -> None:
    path = bag(tmp_path, "mcap", {"/imu": imu_topic("mcap", figures(3))})
    channels = {
        "gyro_x": {"column": "angular_velocity.x", "unit": "rad/s", "variable": "/gyro"},
        "accel_x": {"column": "linear_acceleration.x", "unit": "m/s^2", "variable": "/accel"},
    }
    log = LogFormat.model_validate({"reader": "rosbag", "rate": "1 Hz", "channels": channels})
    with pytest.raises(RecordingError, match=r"a: columns of the topics /accel, /gyro cannot be"):
        contents(RosbagFile(path, log, {str(n): source for n, source in log.channels.items()}))


def test_many_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bags, "_BATCH_MESSAGES", 1 << 11)
    rows = np.tile(figures(100), (50, 1))
    data = [message(2, IMU, EPOCH, row) for row in rows[:100]]
    topic = IMU, [(EPOCH + i * 10**7, i, data[i % 100]) for i in range(len(rows))]
    found, time, _ = columns(bag(tmp_path, "mcap", {"/imu": topic}), log_format(time=LOGGED))
    same(found, rows)
    assert time is not None and len(time) == 5000


def test_stamps_of_a_simulation_are_no_date(tmp_path: Path) -> None:
    path = bag(tmp_path, "ros1", {"/imu": imu_topic("ros1", figures(5), start=10**9)})
    _, _, file = columns(path, log_format(time=STAMP))
    assert file.started is None


# ------------------------------------------------------------------------------ what is damaged


@pytest.mark.parametrize("kind", ["ros1", "sqlite"])
def test_what_a_message_says_it_does_not_measure_is_missing(tmp_path: Path, kind: str) -> None:
    rows = figures(10)
    without = {"linear_acceleration_covariance": np.full(9, -1.0)}
    topic = imu_topic(kind, rows[:4])[1]
    topic += imu_topic(kind, rows[4:], start=EPOCH + 4 * 10**7, **without)[1]
    path = bag(tmp_path, kind, {"/imu": (IMU, topic)})
    found, _, file = columns(path, log_format())
    np.testing.assert_array_equal(found["gyro_x"], rows[:, 0])
    assert np.isnan(found["accel_y"]).tolist() == [False] * 4 + [True] * 6
    assert counts(file) == {"not_measured": 6}
    assert "linear_acceleration" in file.findings[0].detail
    _, _, file = columns(path, log_format({"gyro_x": "angular_velocity.x"}))
    assert counts(file) == {}


@pytest.mark.parametrize("kind", ["ros1", "sqlite", "mcap"])
@pytest.mark.parametrize("damage", ["cut", "long", "frame", "second", "empty"])
def test_a_damaged_message_is_a_missing_sample(tmp_path: Path, kind: str, damage: str) -> None:
    rows = figures(9)
    msgtype, topic = imu_topic(kind, rows)
    at = 12
    damaged = {
        "cut": lambda data: data[:-8],
        "long": lambda data: data + bytes(8),
        "frame": lambda data: data[:at] + b"\xff" + data[at + 1 :],
        "second": lambda data: data[: at - 4] + b"\xff" * 4 + data[at:],
        "empty": lambda _: b"",
    }[damage]
    topic[4] = (topic[4][0], topic[4][1], damaged(topic[4][2]))
    path = bag(tmp_path, kind, {"/imu": (msgtype, topic)})
    found, _, file = columns(path, log_format())
    rows[4] = np.nan
    same(found, rows)
    assert counts(file) == {"damaged_message": 1}
    found, time, _ = columns(path, log_format(time=STAMP))
    assert time is not None and len(time) == len(found["gyro_x"]) == 8


def test_a_ros_1_bag_cut_short_is_read_as_far_as_it_goes(tmp_path: Path) -> None:
    rows = figures(3000)
    whole = bag(tmp_path, "ros1", {"/imu": imu_topic("ros1", rows)}).read_bytes()
    path = tmp_path / "cut.bag"
    path.write_bytes(whole[: int(0.95 * len(whole))])
    found, _, file = columns(path, log_format(time=STAMP))
    assert 1500 < len(found["gyro_x"]) < 3000
    same(found, rows[: len(found["gyro_x"])])
    assert counts(file) == {"truncated_file": 1}
    path.write_bytes(whole[: whole.rindex(b"topic=/imu") - 50])
    found, _, file = columns(path, log_format())
    same(found, rows)
    assert counts(file) == {"truncated_file": 1}


@pytest.mark.parametrize("kind", ["ros1-bz2", "ros1-lz4"])
def test_a_bag_that_expands_too_far_is_rejected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    path = bag(tmp_path, kind, {"/imu": imu_topic(kind, np.zeros((500, 6)))})
    monkeypatch.setattr(bounds, "MIN_CHECKED_EXPANSION", 1000)
    assert len(columns(path, log_format())[0]["gyro_x"]) == 500
    monkeypatch.setattr(bounds, "MAX_EXPANSION_RATIO", 1)
    with pytest.raises(RecordingError, match="its chunks expand to more than 1 times its size"):
        columns(path, log_format())


def test_records_that_are_not_merged_are_told(tmp_path: Path) -> None:
    folder = bag(tmp_path, "sqlite", {"/imu": imu_topic("sqlite", figures(5))})
    (folder / "a.db3-wal").write_bytes(b"x")
    _, _, file = columns(folder, log_format())
    assert counts(file) == {"truncated_file": 1} and "a.db3-wal" in file.findings[0].detail


@pytest.mark.parametrize("kind", ["sqlite", "mcap"])
def test_a_ros_2_bag_cut_short_is_rejected(tmp_path: Path, kind: str) -> None:
    folder = bag(tmp_path, kind, {"/imu": imu_topic(kind, figures(500))})
    (file,) = [path for path in folder.iterdir() if path.suffix in (".db3", ".mcap")]
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    for path in (folder, file):
        message = {
            "sqlite": r"a\.db3: cut short: \d+ of \d+ bytes; .*'\.recover' of sqlite3",
            "mcap": r"corrupt, or cut short .*mcap recover",
        }[kind]
        with pytest.raises(RecordingError, match=message):
            columns(path, log_format())
    file.unlink()
    with pytest.raises(RecordingError, match=r"a: corrupt, or cut short \(Some database files"):
        columns(folder, log_format())


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", r"a\.bag: begins with b''; expected b'#ROSBAG V2\.0"),
        (b"#ROSBAG V1.2\n" + bytes(100), "'rosbag migrate'"),
        (b"#ROSBAG V2.0\n", r"a\.bag: damaged at byte 0 \(no bag header\); .*rosbag reindex"),
        (b"#ROSBAG V2.0\n" + b"\xff" * 99, r"no topic with .*; found none \(the bag is cut short"),
        (b"\x89MCAP0\r\n" + bytes(100), "corrupt, or cut short"),
        (b"SQLite format 3\0" + bytes(2000), "corrupt, or cut short"),
        (b"SQLite format 3\0\x10\0" + bytes(10) + b"\0\0\0\1" + bytes(80), "112 of 4096 bytes"),
        (b"wx,wy\n1,2\n", "begins with b'wx,wy"),
    ],
)
def test_other_files_are_rejected(tmp_path: Path, data: bytes, message: str) -> None:
    path = tmp_path / "a.bag"
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=message):
        columns(path, log_format())


@pytest.mark.parametrize("kind", ["ros1", "sqlite", "mcap"])
def test_what_is_wrong_is_named(tmp_path: Path, kind: str) -> None:
    path = bag(tmp_path, kind, {"/t": temperature_topic(kind, [1.0])})
    for log, text in (
        (log_format(), r"no topic with angular_velocity\.x.*found /t \(sensor_msgs/msg/Temp"),
        (log_format({"gyro_x": "wx"}), "no topic with wx; .*expected a topic of sensor_msgs/msg/I"),
        (log_format(time={"column": "t", "unit": "ns"}), "no time column 't'"),
        (log_format(time={"column": "log_time", "unit": "s"}), "log_time is s .*'unit: ns'"),
        (log_format(time={"column": "log_time", "format": "iso8601"}), "log_time is iso8601"),
    ):
        with pytest.raises(RecordingError, match=text):
            columns(path, log)


def test_a_topic_whose_messages_are_of_another_kind(tmp_path: Path) -> None:
    path = bag(tmp_path, "mcap", {"/imu": (IMU, [(EPOCH, 0, b"\x28\xb5\x2f\xfd" + bytes(400))])})
    with pytest.raises(RecordingError, match=r"no message of /imu can be read, 1 do not match"):
        columns(path, log_format())


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    log = log_format()
    sources = {str(name): source for name, source in log.channels.items()}
    with pytest.raises(RecordingError, match=r"none\.bag: cannot be opened \(No such file"):
        list(RosbagFile(tmp_path / "none.bag", log, sources).batches())


@cache
def bytes_of(kind: str) -> bytes:
    """Return the one file of a bag."""
    with TemporaryDirectory() as folder:
        path = bag(Path(folder), kind, {"/imu": imu_topic(kind, figures(20))})
        if path.is_dir():
            (path,) = [file for file in path.iterdir() if file.suffix in (".db3", ".mcap")]
        return path.read_bytes()


@given(
    st.sampled_from(["ros1", "ros1-lz4", "ros1-bz2", "sqlite", "mcap", "mcap-storage"]),
    st.floats(0, 1) | st.just(1.0),
    st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(1, 255)), max_size=5),
    st.booleans(),
)
@examples(200)
def test_no_damage_gives_another_error(
    tmp_path: Path,
    kind: str,
    cut: float,
    flips: list[tuple[float, int]],
    stamped: bool,
) -> None:
    damaged = bytearray(bytes_of(kind))
    for place, bits in flips:
        damaged[int(place * len(damaged))] ^= bits
    path = tmp_path / "a"
    path.write_bytes(bytes(damaged[: round(cut * len(damaged))]))
    log = log_format(time=STAMP) if stamped else log_format()
    sources = {str(name): source for name, source in log.channels.items()}
    try:
        found, _, _ = contents(RosbagFile(path, log, sources))
    except RecordingError as error:
        assert str(error).startswith("a: ")
        return
    if not flips:
        same(found, figures(20)[: len(found["gyro_x"])])


@given(st.binary(max_size=300), st.sampled_from(["", "#ROSBAG V2.0\n", "whole"]))
@examples(100)
def test_any_bytes_give_no_other_error(tmp_path: Path, data: bytes, begin: str) -> None:
    path = tmp_path / "a"
    before = bytes_of("ros1") if begin == "whole" else begin.encode()
    path.write_bytes(before + data)
    try:
        list(Bag(path).messages("/imu"))
    except RecordingError as error:
        assert str(error).startswith("a: ")


@given(st.text(max_size=300))
@examples(60)
def test_any_metadata_gives_no_other_error(tmp_path: Path, text: str) -> None:
    folder = tmp_path / "a"
    folder.mkdir(exist_ok=True)
    (folder / "metadata.yaml").write_text(text, "utf-8", "surrogatepass")
    log = log_format()
    with pytest.raises(RecordingError, match=r"^a: corrupt"):
        contents(RosbagFile(folder, log, {"gyro_x": log.channels["gyro_x"]}))
