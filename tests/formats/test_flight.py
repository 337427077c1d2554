"""Logs of PX4 (ULog) and ArduPilot (DataFlash), compared with the libraries of their makers."""

from __future__ import annotations

import gzip
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pyulog import ULog

from imubench_pipeline.readers import RecordingError, read
from imubench_pipeline.readers.batch import LogFile
from imubench_pipeline.readers.contents import list_contents
from imubench_pipeline.readers.inspection import inspect
from imubench_pipeline.settings.sensor import CHANNELS, LogFormat
from tests.formats import flight_logs as made

ROWS = 1500
Columns = dict[str, np.ndarray]


@pytest.fixture
def figures(rng: np.random.Generator) -> Columns:
    """A log at rest, in digits of float32."""
    found = {name: 0.01 * rng.standard_normal(ROWS) for name in CHANNELS}
    found["accel_z"] += 9.8
    found["temperature"] = 25 + 0.1 * rng.standard_normal(ROWS)
    return {name: values.astype(np.float32).astype(float) for name, values in found.items()}


def written(tmp_path: Path, data: bytes, name: str = "log") -> Path:
    path = tmp_path / name
    path.write_bytes(data)
    return path


def columns(path: Path, **keys: Any) -> tuple[Columns, np.ndarray | None, LogFile]:
    """Read the columns of a kind of message: ``variable``, and a column for each channel."""
    variable, time = keys.pop("variable", None), keys.pop("time", None)
    units = {"gyro": "rad/s", "accel": "m/s^2"}
    channels = {
        name: {"column": column, "unit": units[name[:-2]], "variable": variable}
        for name, column in keys.items()
    }
    log = {"channels": channels} | ({"time": time} if time else {"rate": "250 Hz"})
    (file,) = read(path, LogFormat.model_validate(log))
    batches = list(file.batches())
    joined = {name: np.concatenate([b.columns[name] for b in batches]) for name in keys}
    times = [batch.time for batch in batches if batch.time is not None]
    return joined, np.concatenate(times) if times else None, file


COMBINED = {f"gyro_{axis}": f"gyro_rad[{n}]" for n, axis in enumerate("xyz")} | {
    f"accel_{axis}": f"accelerometer_m_s2[{n}]" for n, axis in enumerate("xyz")
}
IMU = {f"gyro_{axis}": f"Gyr{axis.upper()}" for axis in "xyz"} | {
    f"accel_{axis}": f"Acc{axis.upper()}" for axis in "xyz"
}
STAMP = {"column": "timestamp", "unit": "us"}
TIME_US = {"column": "TimeUS", "unit": "us"}


# ----------------------------------------------------------------------------------- drafts


@pytest.mark.parametrize("packed", [bytes, gzip.compress])
def test_a_log_of_px4_is_drafted_and_read(tmp_path: Path, figures: Columns, packed: Any) -> None:
    path = written(tmp_path, packed(made.ulog(figures)))
    found = inspect(path)
    assert found.complete
    assert "6 channels and temperature, 250 Hz from the stamps" in found.proof.said
    assert "not taken: x, y, z of sensor_gyro_1 (another gyro)" in found.block
    assert "not taken: esc_status_0 (has no samples of a gyro" in found.block
    result, time, file = columns(path, variable="sensor_combined_0", time=STAMP, **COMBINED)
    for name, values in result.items():
        np.testing.assert_array_equal(values, figures[name])
    assert time is not None
    np.testing.assert_allclose(time, np.arange(ROWS) * 4e-3, atol=1e-12)
    assert file.findings == [] and file.contradicted_units() == []


def test_a_log_of_ardupilot_is_drafted_and_read(tmp_path: Path, figures: Columns) -> None:
    path = written(tmp_path, made.dataflash(figures))
    found = inspect(path)
    assert found.complete
    assert "6 channels and temperature, 250 Hz from the stamps" in found.proof.said
    assert "not taken: GyrX, GyrY, GyrZ of IMU_1 (another gyro)" in found.block
    for variable, sign in (("IMU_0", 1), ("IMU_1", -1)):
        result, time, file = columns(path, variable=variable, time=TIME_US, **IMU)
        for name, values in result.items():
            np.testing.assert_array_equal(values, figures[name] * (sign if "gyro" in name else 1))
        assert time is not None and time[-1] == pytest.approx((ROWS - 1) * 4e-3)
        assert file.findings == []


def test_a_unit_that_is_another_than_the_format_has_is_found(
    tmp_path: Path, figures: Columns
) -> None:
    path = written(tmp_path, made.dataflash(figures))
    channel = {"column": "GyrX", "unit": "deg/s", "variable": "IMU_0"}
    log = {"time": TIME_US, "channels": {"gyro_x": channel}}
    (file,) = read(path, LogFormat.model_validate(log))
    list(file.batches())
    (finding,) = file.contradicted_units()
    assert finding.value == pytest.approx(180 / np.pi)


# ----------------------------------------------------------- the same as other libraries read


def test_every_topic_is_as_pyulog_reads_it(tmp_path: Path, figures: Columns) -> None:
    path = written(tmp_path, made.ulog(figures))
    theirs = ULog(str(path))
    assert not theirs.file_corruption
    listed = {table.name: table for table in list_contents(path).tables}
    assert listed.keys() == {f"{data.name}_{data.multi_id}" for data in theirs.data_list}
    for data in theirs.data_list:
        name = f"{data.name}_{data.multi_id}"
        for column, values in data.data.items():
            if column == "armed" or column.startswith("name["):  # a truth value, and text
                continue
            found, _, _ = columns(path, variable=name, gyro_x=column)
            np.testing.assert_array_equal(found["gyro_x"], values.astype(float), err_msg=column)


@pytest.mark.release
def test_every_message_is_as_pymavlink_reads_it(tmp_path: Path, figures: Columns) -> None:
    from pymavlink.DFReader import DFReader_binary

    path = written(tmp_path, made.dataflash(figures))
    theirs: dict[str, dict[str, list[Any]]] = {}
    log = DFReader_binary(str(path))
    log.filehandle.close()  # it has a map of the file
    while (message := log.recv_msg()) is not None:
        fields = message.to_dict()
        name = fields.pop("mavpackettype")
        name += f"_{fields['I']}" if "I" in fields else ""
        for column, value in fields.items():
            theirs.setdefault(name, {}).setdefault(column, []).append(value)
    assert {"IMU_0", "IMU_1", "BAT"} < theirs.keys()
    for name in ("IMU_0", "IMU_1", "BAT"):
        for column, values in theirs[name].items():
            found, _, _ = columns(path, variable=name, gyro_x=column)
            np.testing.assert_allclose(found["gyro_x"], values, rtol=1e-12, err_msg=column)


# ------------------------------------------------------------------------------------ damage


def test_damage_in_a_ulog_costs_the_messages_up_to_the_next_mark(
    tmp_path: Path, figures: Columns
) -> None:
    data = made.ulog(figures)
    for place in (9_000, 40_000):
        path = written(tmp_path, data[:place] + b"\xff" * 200 + data[place + 200 :])
        result, time, file = columns(path, variable="sensor_combined_0", time=STAMP, **COMBINED)
        assert time is not None
        row = np.rint(time / 4e-3).astype(int)
        assert ROWS - 102 <= len(row) < ROWS
        np.testing.assert_array_equal(result["gyro_y"], figures["gyro_y"][row])
        assert {finding.finding for finding in file.findings} == {"damaged_bytes"}


def test_damage_in_a_dataflash_log_costs_few_messages(tmp_path: Path, figures: Columns) -> None:
    data = made.dataflash(figures)
    path = written(tmp_path, data[:40_000] + b"\xa3\x95\xff" * 60 + data[40_000:])
    result, time, file = columns(path, variable="IMU_0", time=TIME_US, **IMU)
    assert time is not None
    row = np.rint(time / 4e-3).astype(int)
    assert ROWS - 2 <= len(row) <= ROWS
    np.testing.assert_array_equal(result["accel_x"], figures["accel_x"][row])
    assert {finding.finding for finding in file.findings} == {"damaged_bytes"}


def test_a_log_that_ends_within_a_message(tmp_path: Path, figures: Columns) -> None:
    for data, keys in (
        (made.ulog(figures), {"variable": "sensor_combined_0", "time": STAMP, **COMBINED}),
        (made.dataflash(figures), {"variable": "IMU_0", "time": TIME_US, **IMU}),
    ):
        path = written(tmp_path, data[: len(data) // 2 - 3])
        result, _, file = columns(path, **keys)
        count = len(result["gyro_x"])
        assert 0.4 * ROWS < count < 0.6 * ROWS
        np.testing.assert_array_equal(result["gyro_x"], figures["gyro_x"][:count])
        assert [finding.finding for finding in file.findings] == ["incomplete_last_record"]
        assert "cut short by the end of the log" in file.findings[0].detail


def test_data_that_are_appended_to_a_ulog_begin_where_it_says(
    tmp_path: Path, figures: Columns
) -> None:
    # A crash dump: the part before it ends within a message.
    body = made.ulog(figures)[len(made.ulog_header()) :]
    cut = len(made.ulog_header()) + len(body) - 20
    tail = made.data(0, made.combined(5_000_000 + ROWS * 4000, (1, 2, 3), (4, 5, 6)))
    path = written(tmp_path, (made.ulog_header([cut]) + body)[:cut] + tail)
    result, _, file = columns(path, variable="sensor_combined_0", time=STAMP, **COMBINED)
    assert [result[name][-1] for name in COMBINED] == [1, 2, 3, 4, 5, 6]
    assert file.findings == []


# -------------------------------------------------------------------------------- what is said


def test_a_log_of_a_header_is_named(tmp_path: Path) -> None:
    for data, title in (
        (made.ulog_header() + made.definitions(), "PX4 ULog"),
        (bytes(made.DataFlash()), "ArduPilot DataFlash log"),
    ):
        with pytest.raises(RecordingError, match=f"the {title} has no message of numbers"):
            inspect(written(tmp_path, data))


def test_the_kind_of_message_is_asked_for(tmp_path: Path, figures: Columns) -> None:
    path = written(tmp_path, made.ulog(figures))
    with pytest.raises(
        RecordingError, match=r"one kind of message with .*sensor_gyro_0, sensor_gy"
    ):
        columns(path, time=STAMP, gyro_x="x")
    with pytest.raises(
        RecordingError, match=r"called sensor_gyro_0; found timestamp, .*error_count"
    ):
        columns(path, variable="sensor_gyro_0", time=STAMP, gyro_x="gyro_rad[0]")
    path = written(tmp_path, made.dataflash(figures))
    with pytest.raises(
        RecordingError, match=r"called IMU_7; found IMU_0, IMU_1, PARM, BAT; correct"
    ):
        columns(path, variable="IMU_7", time=TIME_US, gyro_x="GyrX")


def test_a_batch_sampler_is_not_taken(tmp_path: Path, rng: np.random.Generator) -> None:
    counts = rng.integers(-900, 900, (1024, 3))
    path = written(tmp_path, made.batch_sampler(counts, multiplier=16, rate=1000.0, first=10))
    with pytest.raises(RecordingError, match=r"ISBD.* several in each message"):
        inspect(path)
