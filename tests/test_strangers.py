"""Files of strangers that once ended a run for all: each is one recording's fault."""

from __future__ import annotations

import time
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pytest
import yaml

from imubench_pipeline.readers import log_files
from imubench_pipeline.recordings.drop_zone import found_logs
from imubench_pipeline.run.checking import check
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.settings.sensor import RecordingNotes, Sensor
from imubench_pipeline.settings.validation import ConfigError, parse
from imubench_pipeline.settings.yaml_files import read_yaml
from tests.workflow.project import put_log, put_sensor

STAMPED = {
    "time": {"column": "t", "unit": "s"},
    "channels": {"gyro_x": {"column": "wx", "unit": "rad/s"}},
}


def plan_of(folder: Path) -> Plan:
    put_sensor(folder / "sensors/one.yaml")
    put_sensor(folder / "sensors/two.yaml", log=STAMPED)
    put_log(folder / "logs/one/good.csv", 1, samples=2000)
    return Plan({"logs": str(folder / "logs"), "sensors": str(folder / "sensors"),
                 "results": str(folder / "results"), "simulated": None})  # fmt: skip


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("log: {rate: 0x" + "f" * 5000 + "}", "expected a shorter one"),
        ("use: {start: " + ":".join(["59"] * 600_000) + "}", "expected a shorter one"),
        (
            "log: {" + ",".join(f"{i * (2**61 - 1)}: 1" for i in range(1, 90_000)) + "}",
            "expected a name",
        ),
    ],
    ids=["digits", "base 60", "keys of one hash"],
)
def test_figures_that_take_the_square_of_their_length_are_refused(
    tmp_path: Path, text: str, reason: str
) -> None:
    (tmp_path / "notes.yaml").write_text(text)
    begin = time.process_time()
    with pytest.raises(ConfigError, match=reason) as caught:
        read_yaml(tmp_path / "notes.yaml")
    assert time.process_time() - begin < 10.0
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize(
    "name", ["0" * 26, "abc" * 30, "".join(chr(0x4E00 + i) for i in range(80))]
)
def test_a_name_that_a_run_cannot_bear_is_rejected_under_another(tmp_path: Path, name: str) -> None:
    put_log(tmp_path / f"logs/one/{name}.csv", 1, samples=10)
    (log,) = found_logs(tmp_path / "logs")
    assert log.error is not None and "rename the file" in log.error
    assert len(log.name.encode()) <= 160 and log.name != name


def test_a_file_of_no_text_for_a_name_is_rejected(tmp_path: Path) -> None:
    folder = tmp_path / "logs/one/run"
    folder.mkdir(parents=True)
    Path(f"{folder}/a\udcff.csv").write_text("1\n")
    (log,) = found_logs(tmp_path / "logs")
    assert log.error is not None and "a\\udcff.csv" in log.error


def test_two_logs_of_one_name_are_both_rejected_and_no_other(tmp_path: Path) -> None:
    for ending in ("csv", "txt"):
        put_log(tmp_path / f"logs/one/twice.{ending}", 1, samples=10)
    recordings = plan_of(tmp_path).recordings
    rejected = {name: log.error for (_, name), log in recordings.items() if log.error}
    assert rejected.keys() == {"twice", "twice (2)"}
    assert all("would both be the recording one/twice" in error for error in rejected.values())
    assert recordings["one", "good"].error is None


STAMPS = {
    "denormal": np.arange(20_000) * 5e-324,
    "beyond the age of the world": np.arange(20_000) * 1e303,
    "a hole of 3e9 samples": np.arange(20_000) * 1e-6 + 3000.0 * (np.arange(20_000) > 10_000),
}


@pytest.mark.parametrize("name", STAMPS)
def test_stamps_of_no_clock_are_rejected_with_their_reason(tmp_path: Path, name: str) -> None:
    path = tmp_path / "logs/two/log.csv"
    path.parent.mkdir(parents=True)
    noise = np.random.default_rng(1).standard_normal(20_000)
    lines = (f"{t!r},{w:.5f}\n" for t, w in zip(STAMPS[name].tolist(), noise, strict=True))
    path.write_text("t,wx\n" + "".join(lines))
    said = {recording: quality for _, recording, quality in check(plan_of(tmp_path))}
    assert said["good"].recording["status"] == "ok"
    assert said["log"].recording["status"] == "rejected"
    assert "'unit' of 'time'" in said["log"].recording["reason"]


def test_figures_too_small_for_their_squares_are_those_of_a_dead_channel(tmp_path: Path) -> None:
    path = tmp_path / "logs/two/log.csv"
    path.parent.mkdir(parents=True)
    noise = np.random.default_rng(1).standard_normal(20_000) * 1e-310
    lines = (f"{0.01 * i:.2f},{w!r}\n" for i, w in enumerate(noise.tolist()))
    path.write_text("t,wx\n" + "".join(lines))
    said = {recording: quality for _, recording, quality in check(plan_of(tmp_path))}
    assert "gyro_x never changes" in said["log"].recording["reason"]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("b\x1b[2J", r"holds U\+001B"),
        ("b\u202e", r"holds U\+202E"),
        ("b" * 1001, "1001 letters; expected at most 1000"),
    ],
)
def test_a_text_that_cannot_stand_on_a_page_is_refused(
    tmp_path: Path, text: str, reason: str
) -> None:
    sensor = {"vendor": "A", "model": "B", "log": STAMPED}
    parse(RecordingNotes, {"device": "b" * 1000}, "notes")
    with pytest.raises(ConfigError, match=f"notes: device: .*{reason}"):
        parse(RecordingNotes, {"device": text}, "notes")
    for key in ("vendor", "model", "price_class", "interface"):
        with pytest.raises(ConfigError, match=f"sensor: {key}: .*{reason}") as caught:
            parse(Sensor, sensor | {key: text}, "sensor")
        assert str(caught.value).isprintable() and len(str(caught.value)) < 300


@pytest.mark.parametrize("rate", ["1e300 Hz", "1e-300 Hz"])
def test_a_rate_of_no_sensor_is_refused(tmp_path: Path, rate: str) -> None:
    put_log(tmp_path / "logs/one/fast.csv", 1, samples=10)
    (tmp_path / "logs/one/fast.yaml").write_text(yaml.safe_dump({"log": {"rate": rate}}))
    said = {recording: quality for _, recording, quality in check(plan_of(tmp_path))}
    assert said["good"].recording["status"] == "ok"
    assert "expected 1e-06 to 1e+09 Hz" in said["fast"].recording["reason"]


def nulls(path: Path) -> None:
    """394 bytes that say that they hold 67 million samples."""
    table = pa.table({"ax": pa.nulls(1 << 26), "wx": pa.nulls(1 << 26)})
    with pa.ipc.new_file(path, table.schema) as writer:
        writer.write_table(table)


def empty_chunks(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name in ("t", "wx"):
            file.create_dataset(name, data=np.arange(140_000.0), chunks=(1,))


def zeros(path: Path) -> None:
    with h5py.File(path, "w") as file:
        for name in ("t", "wx"):
            file.create_dataset(name, (60_000_000,), "i4", chunks=(1 << 22,), compression=9)
            packed = file[name]
            packed[: 1 << 22] = 1
            for place in range(1 << 22, 60_000_000, 1 << 22):
                _, chunk = packed.id.read_direct_chunk((0,))
                packed.id.write_direct_chunk((place,), chunk)


@pytest.mark.parametrize(
    ("make", "log", "reason"),
    [
        (nulls, "one/log.arrow", "expected figures that take at most 800 times"),
        (empty_chunks, "two/log.h5", "lies in 140000 chunks"),
        (zeros, "two/log.h5", "expected figures that take at most 800 times"),
    ],
)
def test_rows_that_take_no_room_are_no_log(tmp_path: Path, make, log: str, reason: str) -> None:
    path = tmp_path / "logs" / log
    path.parent.mkdir(parents=True)
    make(path)
    assert log_files(path)
    begin = time.process_time()
    said = {recording: quality for _, recording, quality in check(plan_of(tmp_path))}
    assert time.process_time() - begin < 10.0
    assert said["log"].recording["status"] == "rejected"
    assert reason in said["log"].recording["reason"]
    assert said["good"].recording["status"] == "ok"
