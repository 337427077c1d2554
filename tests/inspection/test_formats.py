"""Exports of programs, and formats of receivers and ROS, drafted and read as drafted."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import yaml

from imubench_pipeline.extensions.formats.vectornav import FIELDS
from imubench_pipeline.readers.inspection import inspect
from imubench_pipeline.settings.sensor import CHANNELS, Sensor
from imubench_pipeline.settings.validation import parse
from tests.conftest import few
from tests.formats import test_rosbag, test_ubx, test_vectornav
from tests.inspection.drafts import (
    NAMED,
    ROWS,
    Columns,
    drafted,
    logged,
    read_as_drafted,
    same,
    saved,
    sensor_of,
)
from tests.readers import test_phone, test_xsens


@pytest.mark.parametrize("ticked", [True, False])
def test_an_export_of_xsens(tmp_path: Path, si: Columns, ticked: bool) -> None:
    data = np.column_stack([si[name] for name in (*CHANNELS[3:], *CHANNELS[:3])])
    counts = 65_400 + np.arange(ROWS)
    ticks = (2**32 - 20_000 + 100 * np.arange(ROWS)) % 2**32 if ticked else None
    exported = test_xsens.export(test_xsens.SHORT, "\t", counts, data, ticks)
    path = saved(tmp_path, exported, "MT_00B42D4B.txt")
    truth = {name: si[name] for name in ("time", *CHANNELS)}
    found = drafted(path, truth, gyro="rad/s")
    column = "SampleTimeFine" if ticked else "PacketCounter"
    stated = test_xsens.TICKS if ticked else test_xsens.COUNTER
    assert found.draft.log()["time"] == stated | {"column": column}
    assert "states 100 Hz" in found.listing


WAYS = list(test_phone.SIGNS)


@pytest.mark.parametrize(
    ("way", "packed"),
    few(
        [(way, place % 2 == 0) for place, way in enumerate(WAYS)],
        [(way, place % 2 == 1) for place, way in enumerate(WAYS)],
    ),
)
def test_phyphox(tmp_path: Path, si: Columns, way: str, packed: bool) -> None:
    gyro, accel = (
        np.column_stack([si["time"], *(si[f"{quantity}_{axis}"] for axis in "xyz")])
        for quantity in ("gyro", "accel")
    )
    files = test_phone.phyphox(gyro, accel[::2], *test_phone.SIGNS[way])
    path = test_phone.placed(tmp_path, files, packed)
    truth = dict(list(si.items())[:7])
    found = inspect(path)
    result = read_as_drafted(path, sensor_of(found))
    assert found.complete and len(result) == 7
    assert "gyro 100 Hz, accel 50 Hz from the stamps" in found.proof.said
    for name, values in result.items():
        step = 2 if name.startswith("accel") or len(values) < ROWS else 1
        expected = truth[name][::step]
        start = expected[0] if name == "time" else 0
        np.testing.assert_allclose(values, expected - start, rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("packed", [True, False])
def test_sensor_logger(tmp_path: Path, si: Columns, packed: bool) -> None:
    gyro, accel = (
        np.column_stack([si["time"], *(si[f"{quantity}_{axis}"] for axis in "xyz")])
        for quantity in ("gyro", "accel")
    )
    files = test_phone.sensor_logger(gyro, accel)
    still = test_phone.sensor_logger(gyro, accel * [1, 0.001, 0.001, 0.001])
    files["Accelerometer.csv"] = still["TotalAcceleration.csv"]
    path = test_phone.placed(tmp_path, files, packed)
    found = drafted(path, dict(list(si.items())[:7]), gyro="rad/s")
    assert found.draft.log()["channels"]["accel_x"]["file"] == "TotalAcceleration.csv"
    assert "not taken: z, y, x of Accelerometer.csv" in found.block.replace("x, y, z", "z, y, x")
    assert "from 2024-09-29T08:53:20 on" in found.proof.said


def test_a_folder_of_one_log(tmp_path: Path, si: Columns) -> None:
    names, scales = NAMED["an x-io logger"]
    (tmp_path / "run" / "meta").mkdir(parents=True)
    (tmp_path / "run" / "meta" / "readme.txt").write_text("nothing")
    saved(tmp_path / "run", logged(si, names, scales))
    found = drafted(tmp_path / "run", dict(list(si.items())[:7]))
    assert "file:" not in found.block


def test_vectornav_as_published(tmp_path: Path) -> None:
    lines = [test_vectornav.IMU] * 30
    path = saved(tmp_path, test_vectornav.logged(lines), "a.txt")
    found = inspect(path)
    assert found.draft.unfilled() == ["rate"]
    data = yaml.safe_load(found.block)
    data["log"]["rate"] = "40 Hz"
    assert data["vendor"] == "VectorNav"
    result = read_as_drafted(path, parse(Sensor, data, "drafted"))
    figures = dict(zip(CHANNELS, test_vectornav.PUBLISHED[1][1], strict=True))
    for name, value in (figures | {"temperature": 20.7}).items():
        assert result[name].tolist() == [value] * 30


@pytest.mark.parametrize("packed", [bytes, gzip.compress])
@pytest.mark.parametrize("stamp", ["{:.3f} ", "{:.0f} ns,"])
def test_vectornav_with_stamps_of_a_host(
    tmp_path: Path, si: Columns, stamp: str, packed: Callable[[bytes], bytes]
) -> None:
    scale = 1e9 if "ns" in stamp else 1
    fields = np.column_stack([np.zeros((ROWS, 6)), *(si[name] for name in CHANNELS[3:])])
    fields = np.column_stack([fields, *(si[name] for name in CHANNELS[:3])])
    lines = [
        stamp.replace(" ns", "").format((1.7e9 + at) * scale).encode()
        + test_vectornav.sentence("VNYMR", list(row))
        for at, row in zip(si["time"], fields, strict=True)
    ]
    path = saved(tmp_path, packed(test_vectornav.logged(lines)), "a.txt")
    found = inspect(path)
    assert found.complete, found.block
    result = read_as_drafted(path, sensor_of(found))
    np.testing.assert_allclose(result.pop("time"), si["time"], atol=1e-6)
    same(result, si)
    assert len(result) == 6


def test_every_sentence_of_vectornav(tmp_path: Path) -> None:
    for kind, fields in FIELDS.items():
        rows = test_vectornav.ramp(kind, 50)
        lines = [test_vectornav.sentence(kind, list(row)) for row in rows]
        path = saved(tmp_path, test_vectornav.logged(lines), f"{kind}.txt")
        found = inspect(path)
        taken = found.draft.channels | ({"": found.draft.temperature} if found.draft.temperature
                                        else {})  # fmt: skip
        assert {entry.value.column for entry in taken.values()} == {
            name for name in fields if name in CHANNELS or name == "temperature"
        }
        assert found.proof.read and found.draft.unfilled() == ["rate"]


def test_two_sentences_of_vectornav(tmp_path: Path, si: Columns) -> None:
    lines = []
    for n in range(ROWS):
        accel, gyro = ([si[f"{q}_{axis}"][n] for axis in "xyz"] for q in ("accel", "gyro"))
        lines.append(test_vectornav.sentence("VNYBA", [1, 2, 3, 0, 0, 0, *gyro]))
        lines.append(test_vectornav.sentence("VNIMU", [0, 0, 0, *accel, *gyro, 20.5, 100]))
    path = saved(tmp_path, test_vectornav.logged(lines), "a.txt")
    found = inspect(path)
    assert {entry["column"] for entry in found.draft.log()["channels"].values()} == {
        f"VNIMU.{name}" for name in CHANNELS
    }


@pytest.mark.parametrize("way", ["ESF-MEAS", "ESF-RAW", "both"])
def test_a_log_of_u_blox(tmp_path: Path, way: str) -> None:
    counts = np.random.default_rng(5).integers(-2000, 2000, (ROWS, 6))
    counts[:, 5] += 9 << 10
    tags = 1000 + np.arange(ROWS) * 256
    samples = test_ubx.samples(counts, tags)
    raw = b"".join(test_ubx.raw(samples[n : n + 4]) for n in range(0, ROWS, 4))
    meas = b"".join(test_ubx.meas(10 * n, held) for n, (_, held) in enumerate(samples))
    data = {"ESF-MEAS": meas, "ESF-RAW": raw, "both": meas + raw}[way]
    path = saved(tmp_path, b"$GNRMC,1*22\r\n" + data, "a.ubx")
    found = inspect(path)
    assert found.complete, found.block
    assert found.draft.vendor.value == "u-blox"
    result = read_as_drafted(path, sensor_of(found))
    np.testing.assert_allclose(result["time"], np.arange(ROWS) / 100, atol=1e-9)
    for name in CHANNELS:
        np.testing.assert_allclose(result[name], test_ubx.expected(name, counts), rtol=1e-12)
    assert np.all(result["temperature"] == 25.0)
    assert ("ESF-MEAS (another gyro)" in found.block) == (way == "both")


@pytest.mark.parametrize("kind", test_rosbag.KINDS)
def test_ros_bags(tmp_path: Path, kind: str) -> None:
    rows = test_rosbag.figures(200) * 0.01 + [0, 0, 0, 0, 0, 9.8]
    topics = {
        "/imu": test_rosbag.imu_topic(kind, rows),
        "/temperature": test_rosbag.temperature_topic(kind, [20.5, 21.5]),
    }
    path = test_rosbag.bag(tmp_path, kind, topics)
    found = inspect(path)
    assert found.complete, found.block
    result = read_as_drafted(path, sensor_of(found))
    for place, name in enumerate(CHANNELS):
        np.testing.assert_array_equal(result[name], rows[:, place])
    assert result["temperature"].tolist() == [20.5, 21.5]
    assert "sensor_msgs/msg/Imu" in found.listing
    assert "from 2023-11-14T22:13:20 on" in found.proof.said


def test_what_ros_calls_linear_acceleration_is_measured(tmp_path: Path) -> None:
    rows = test_rosbag.figures(50) * 0.01
    path = test_rosbag.bag(tmp_path, "ros1", {"/imu": test_rosbag.imu_topic("ros1", rows)})
    found = inspect(path)
    assert set(found.draft.channels) == set(CHANNELS)
    assert "m/s^2, which is not gravity" in found.block
    assert "gravity is 9.81: is the unit right?" in found.proof.said


@pytest.mark.parametrize("order", [("/camera/accel", "/camera/gyro"), ("/a_gyro", "/b_accel")])
def test_a_gyro_and_an_accelerometer_in_topics_of_their_own(
    tmp_path: Path, order: tuple[str, str]
) -> None:
    # Cameras write the message of an IMU for each, with zeros for what the other one has.
    rows = test_rosbag.figures(400) * 0.01 + [0, 0, 0, 0, 0, 9.8]
    of = {
        name: rows * ([1] * 3 + [0] * 3 if "gyro" in name else [0] * 3 + [1] * 3) for name in order
    }
    topics = {
        name: test_rosbag.imu_topic("mcap", one[:: 1 + ("accel" in name)])
        for name, one in of.items()
    }
    path = test_rosbag.bag(tmp_path, "mcap", topics)
    found = inspect(path)
    taken = found.draft.log()["channels"]
    assert set(taken) == set(CHANNELS)
    assert all(entry["variable"].endswith(name.split("_")[0]) for name, entry in taken.items())
    assert "constant in the first records" in found.block
    assert found.complete, found.block


def test_a_gyro_that_nobody_wrote_is_not_drafted(tmp_path: Path) -> None:
    rows = test_rosbag.figures(50) * [0, 0, 0, 0.01, 0.01, 0.01] + [0, 0, 0, 0, 0, 9.8]
    path = test_rosbag.bag(tmp_path, "ros1", {"/imu": test_rosbag.imu_topic("ros1", rows)})
    found = inspect(path)
    assert set(found.draft.channels) == {"accel_x", "accel_y", "accel_z"}
    assert "constant in the first records" in found.block


def test_two_imus_in_a_bag(tmp_path: Path) -> None:
    rows = test_rosbag.figures(50) * 0.01 + [0, 0, 0, 0, 0, 9.8]
    topics = {name: test_rosbag.imu_topic("mcap", rows) for name in ("/b/imu", "/a/imu")}
    found = inspect(test_rosbag.bag(tmp_path, "mcap", topics))
    taken = found.draft.log()["channels"].values()
    assert {entry["variable"] for entry in taken} == {"/a/imu"}
    assert "of /b/imu (another gyro)" in found.block
