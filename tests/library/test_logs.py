"""Logs that are read as the workflow reads them."""

import gc
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import imubench_pipeline as imu
from imubench_pipeline.settings.validation import ConfigError
from imubench_pipeline.tables.findings import RecordingError
from tests.library.conftest import RATE, SENSOR


def test_a_log_is_in_si_on_its_grid(log, drop_zone: Path) -> None:
    written = np.loadtxt(drop_zone / "logs/sensor_1/run.csv", delimiter=",", skiprows=1)
    assert (log.name, log.channels, log.rate) == ("sensor_1/run", ("gyro_x", "accel_z"), RATE)
    assert log.duration == 3600.0
    np.testing.assert_allclose(log["accel_z"], written[:, 2] * 9.80665)
    present = np.isfinite(log["gyro_x"])
    assert not present[20_000] and present.sum() > 35_900
    np.testing.assert_allclose(log["gyro_x"][present], np.radians(written[present, 1]))
    knock = next(finding for finding in log.findings if finding.finding == "knocks")
    assert knock.channel == "gyro_x" and knock.start <= 2000.0 <= knock.end
    with pytest.raises(KeyError, match="no channel 'gyro_y' in sensor_1/run; it has gyro_x"):
        log["gyro_y"]


def test_a_log_is_shown_and_given_as_a_table(log, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "2 findings in all" in repr(log) and "warning" not in repr(log)
    knocks = [replace(one, severity="warning") for one in log.findings if one.finding == "knocks"]
    monkeypatch.setattr(log, "findings", tuple(knocks))
    assert "warning: knocks: gyro x has 1 knock," in repr(log) and len(repr(log)) < 1000
    monkeypatch.undo()
    table = log.to_pandas()
    assert list(table.columns) == ["gyro_x [rad/s]", "accel_z [m/s^2]"]
    assert table.index[-1] == pytest.approx(3599.9) and table.index.name == "time [s]"
    again = imu.allan_variance(table)
    expected = imu.allan_variance(log)
    for name in log.channels:
        np.testing.assert_allclose(again[name].variance, expected[name].variance, rtol=1e-9)


@pytest.mark.release
def test_a_sensor_is_a_file_a_name_a_mapping_or_a_draft(drop_zone: Path, log) -> None:
    run = drop_zone / "logs/sensor_1/run.csv"
    columns = {"gyro_x": {"column": "wx", "unit": "deg/s"}}
    stated = {"time": {"column": "t", "unit": "s"}, "channels": columns}
    for read in (
        imu.read_log(str(run), drop_zone / "sensors/sensor_1.yaml"),
        imu.read_log(run, {"vendor": "Example", "model": "1", "log": stated}),
        imu.read_log(run, units={"gyro": "deg/s", "accel": "g"}),
    ):
        assert read.name == "sensor_1/run"
        np.testing.assert_array_equal(read["gyro_x"], log["gyro_x"])


def test_the_unit_of_a_gyro_is_never_guessed(drop_zone: Path) -> None:
    run = drop_zone / "logs/sensor_1/run.csv"
    with pytest.raises(ValueError, match=r"does not state channels\.gyro_x\.unit") as error:
        imu.read_log(run)
    assert "units={'gyro': 'deg/s'}" in str(error.value)
    assert 'gyro_x: {column: wx, unit: "?"}' in str(error.value)
    with pytest.raises(ConfigError, match="'m' is no unit of angular rate"):
        imu.read_log(run, units={"gyro": "m", "accel": "g"})
    with pytest.raises(ValueError, match="units= has the key 'gyros'"):
        imu.read_log(run, units={"gyros": "deg/s"})


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ({"sensor": "sensor_2"}, "did you mean 'sensor_1'"),
        ({"sensor": "none.yaml"}, "none.yaml: no such file"),
        ({"sensor": {"channels": {}}}, "sensor: log: expected 'rate'|channels"),
        ({"sensor": "sensor_1", "units": {"gyro": "deg/s"}}, "rate= and units= complete a draft"),
        ({"path": "none.csv"}, "none.csv: no such file"),
        ({"sensor": "sensor_1", "quality": {"shortest": 100_000}}, "gyro x has 36000 samples"),
        ({"sensor": "sensor_1", "quality": {"knocks": 1}}, "did you mean 'knock'"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_says_why(drop_zone: Path, arguments: dict, expected: str) -> None:
    known = {"path": drop_zone / "logs/sensor_1/run.csv", "sensors": drop_zone / "sensors"}
    with pytest.raises(ValueError, match=expected):
        imu.read_log(**known | arguments)


@pytest.mark.release
def test_notes_beside_a_log_hold(tmp_path: Path) -> None:
    table = np.random.default_rng(1).normal(0.0, 0.1, (2000, 3))
    table[:, 0] = np.arange(2000) / 100.0
    (tmp_path / "mine.yaml").write_text(SENSOR)
    header = "t,wx,az"
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header=header, comments="")
    (tmp_path / "run.yaml").write_text("use: {start: 5}\nlog: {channels: {accel_z: null}}\n")
    log = imu.read_log(tmp_path / "run.csv", tmp_path / "mine.yaml")
    assert (log.channels, log.duration) == (("gyro_x",), pytest.approx(15.0))
    (tmp_path / "run.yaml").write_text(
        "two_position: {channel: gyro_x, latitude: 45 deg, dwell: 5 s}\n"
    )
    turned = imu.read_log(tmp_path / "run.csv", tmp_path / "mine.yaml")
    assert turned["gyro_x"].shape == (2000,)
    with pytest.raises(ValueError, match=r"the sensor was turned \(two_position\)"):
        imu.estimate(turned)


def test_what_is_kept_goes_with_the_log(drop_zone: Path) -> None:
    run = drop_zone / "logs/sensor_1/run.csv"
    log = imu.read_log(run, "sensor_1", sensors=drop_zone / "sensors")
    kept = next(iter(log.chosen().values())).path
    assert kept.is_file()
    del log
    gc.collect()
    assert not kept.parent.exists()


def test_an_array_without_a_channel_that_can_be_used_is_refused() -> None:
    with pytest.raises(RecordingError, match="gyro x never changes"):
        imu.estimate(np.zeros(1000), 100.0, channels="gyro_x")
