"""Text logs, drafted from names, units and stamps, and read as drafted."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from backports import zstd

from imubench_pipeline.readers import RecordingError
from imubench_pipeline.readers.inspection import Inspection, inspect
from imubench_pipeline.settings.sensor import CHANNELS, LogFormat
from imubench_pipeline.settings.validation import ConfigError
from tests.conftest import few
from tests.inspection.drafts import (
    DEG,
    NAMED,
    ROWS,
    Columns,
    G,
    drafted,
    logged,
    read_as_drafted,
    same,
    saved,
    sensor_of,
    text,
    three,
)
from tests.readers import text_logs


@pytest.mark.parametrize("way", NAMED)
def test_a_log_whose_names_say_all_is_complete(tmp_path: Path, si: Columns, way: str) -> None:
    names, scales = NAMED[way]
    truth = dict(list(si.items())[: len(names)])
    path = saved(tmp_path, logged(si, names, scales))
    found = inspect(path)
    assert found.complete, found.block
    same(read_as_drafted(path, sensor_of(found)), truth, 1e-9)
    assert "100 Hz from the stamps" in found.proof.said
    assert "|accel| = 9.79 m/s^2" in found.proof.said


WITHOUT_UNIT = [
    [f"{form}{axis}" for form in forms for axis in axes]
    for forms, axes in [
        (("w", "a"), "xyz"), (("W", "A"), "xyz"), (("g", "a"), "xyz"), (("Gyr", "Acc"), "XYZ"),
        (("Gyr_", "Acc_"), "XYZ"), (("gyro_", "acc_"), "xyz"), (("gyro", "accel"), "xyz"),
        (("AngularVelocity", "LinearAcceleration"), "XYZ"), (("rate_", "accel_"), "xyz"),
        (("imu.angular_velocity.", "imu.linear_acceleration."), "xyz"), (("omega_", "f_"), "xyz"),
        (("imu.gyro[", "imu.accel["), ("1]", "2]", "3]")), (("gyro_", "acc_"), "012"),
        (("IMU Rate ", "IMU Acceleration "), "XYZ"), (("GYRO_", "ACCEL_"), "XYZ"),
    ]
]  # fmt: skip
TELLING, OTHERS = WITHOUT_UNIT[::3], WITHOUT_UNIT[1::3] + WITHOUT_UNIT[2::3]
"""Every day `test_names.py` has what each name means."""


@pytest.mark.parametrize("names", few(TELLING, OTHERS), ids=lambda names: names[0])
def test_a_gyro_without_a_unit_is_never_given_one(
    tmp_path: Path, si: Columns, names: list[str]
) -> None:
    path = saved(tmp_path, logged(si, ["t", *names], {"gyro": 1 / DEG}))
    found = inspect(path)
    data = yaml.safe_load(found.block)["log"]["channels"]
    assert [data[f"gyro_{axis}"]["unit"] for axis in "xyz"] == ["?"] * 3
    assert "deg/s or rad/s?" in found.block
    assert not found.complete and "left to fill in: channels.gyro_*.unit" in found.proof.said
    with pytest.raises(
        ConfigError, match=r"gyro_x.unit: the unit '\?' is left to fill in; expected"
    ):
        sensor_of(found)
    truth = {name: si[name] for name in ("time", *CHANNELS)}
    same(read_as_drafted(path, sensor_of(found, gyro="deg/s")), truth)


def test_p_q_and_r_without_a_unit_are_not_given_one(tmp_path: Path, si: Columns) -> None:
    names = ["t", "p", "q", "r", "ax", "ay", "az"]
    drafted(saved(tmp_path, logged(si, names)), dict(list(si.items())[:7]), gyro="rad/s")


@pytest.mark.parametrize(("unit", "scale"), [("m/s^2", 1.0), ("g", 1 / G), ("mg", 1e3 / G)])
def test_gravity_tells_the_unit_of_the_accelerometer(
    tmp_path: Path, si: Columns, unit: str, scale: float
) -> None:
    names = ["t", "gx (rad/s)", "gy (rad/s)", "gz (rad/s)", "ax", "ay", "az"]
    path = saved(tmp_path, logged(si, names, {"accel": scale}))
    found = drafted(path, dict(list(si.items())[:7]))
    assert f"unit: {unit}}}  # guessed: the length of the mean is" in found.block


def test_counts_are_not_taken_for_a_unit(tmp_path: Path, si: Columns) -> None:
    counts = [np.rint(si[f"accel_{axis}"] / G * 16384).astype(int).tolist() for axis in "xyz"]
    rates = [np.rint(si[f"gyro_{axis}"] / DEG * 131).astype(int).tolist() for axis in "xyz"]
    path = saved(tmp_path, text(["ax", "ay", "az", "gx", "gy", "gz"], counts + rates))
    found = inspect(path)
    assert sorted(found.draft.unfilled()) == sorted(
        ["rate", *(f"channels.{name}.unit" for name in CHANNELS)]
    )
    assert "counts of g/16384?" in found.block and "whole numbers may be counts" in found.block


def test_one_axis_alone_tells_no_unit(tmp_path: Path, si: Columns) -> None:
    found = inspect(saved(tmp_path, text(["az"], [si["accel_z"].tolist()])))
    assert set(found.draft.unfilled()) == {"rate", "channels.accel_z.unit"}


SPLITS = {
    "semicolon, decimal comma": (";", ","),
    "tabulator": ("\t", "."),
    "tabulator, decimal comma": ("\t", ","),
    "spaces": (" ", "."),
    "bar": ("|", "."),
}


@pytest.mark.parametrize("way", SPLITS)
def test_units_in_a_line_of_their_own(tmp_path: Path, si: Columns, way: str) -> None:
    sign, decimal = SPLITS[way]
    names = ["Time", "Wx", "Wy", "Wz", "Ax", "Ay", "Az", "Temp"]
    units = ["[ms]", "[deg/s]", "[deg/s]", "[deg/s]", "[m/s2]", "[m/s2]", "[m/s2]", "[°C]"]
    columns = [(si["time"] * 1000).tolist()]
    columns += [(si[name] / (DEG if "gyro" in name else 1)).tolist() for name in list(si)[1:]]
    body = text([], columns, sign, decimal)
    head = sign.join(names) + "\n" + sign.join(units) + "\n"
    found = drafted(saved(tmp_path, "A logger, serial 12\n\n" + head + body), si)
    assert "A logger, serial 12" in found.listing


@pytest.mark.parametrize(
    "packed",
    [gzip.compress, bz2.compress, lzma.compress, zstd.compress],
)
def test_compressed(tmp_path: Path, si: Columns, packed: Callable[[bytes], bytes]) -> None:
    names, scales = NAMED["an x-io logger"]
    data = packed(logged(si, names, scales).encode())
    drafted(saved(tmp_path, data, "a.csv.x"), dict(list(si.items())[:7]))


def test_names_in_a_comment(tmp_path: Path, si: Columns) -> None:
    held = io.StringIO()
    table = np.column_stack([si[name] for name in list(si)[:7]])
    header = "a test\nt wx wy wz ax ay az\ns rad/s rad/s rad/s m/s^2 m/s^2 m/s^2"
    np.savetxt(held, table, header=header)
    drafted(saved(tmp_path, held.getvalue()), dict(list(si.items())[:7]))


def test_pandas_index_and_two_sensors(tmp_path: Path, si: Columns) -> None:
    stamps = 1_700_000_000.5 + si["time"]
    frame = pd.DataFrame({"timestamp": stamps})
    for sensor, sign in (("imu1", 1), ("imu2", -1)):
        for name in CHANNELS:
            unit = "rad/s" if name.startswith("gyro") else "m/s^2"
            frame[f"{sensor}_{name} [{unit}]"] = sign * si[name]
    frame.to_csv(tmp_path / "a.csv")
    truth = {"time": stamps} | {name: si[name] for name in CHANNELS}
    found = inspect(tmp_path / "a.csv")
    result = read_as_drafted(tmp_path / "a.csv", sensor_of(found))
    np.testing.assert_allclose(result.pop("time"), si["time"], atol=1e-6)
    same(result, truth)
    assert "# not taken: imu2_gyro_x [rad/s]" in found.block and "another gyro" in found.block
    assert "since 1970 it is 2023-11-14T22:13" in found.block


@pytest.mark.parametrize(
    "form",
    [
        *("%Y-%m-%dT%H:%M:%S.%f", "%Y-%m-%d %H:%M:%S.%f", "%d.%m.%Y %H:%M:%S.%f"),
        *("%m/%d/%Y %H:%M:%S.%f", "%d/%m/%Y %I:%M:%S.%f %p", "%d-%b-%Y %H:%M:%S.%f"),
    ],
)
def test_dates(tmp_path: Path, si: Columns, form: str) -> None:
    stamps = pd.Timestamp("2024-06-05T23:59:59") + pd.to_timedelta(si["time"], unit="s")
    names = ["when", *(f"g{axis} (rad/s)" for axis in "xyz")]
    columns = [list(stamps.strftime(form)), *(si[f"gyro_{axis}"].tolist() for axis in "xyz")]
    found = drafted(
        saved(tmp_path, text(names, columns)), {name: si[name] for name in list(si)[:4]}
    )
    assert "from 2024-06-05T23:59:59 on" in found.proof.said


def test_a_day_that_may_be_a_month(tmp_path: Path, si: Columns) -> None:
    stamps = pd.Timestamp("2024-06-05T12:00") + pd.to_timedelta(si["time"], unit="s")
    columns = [list(stamps.strftime("%m/%d/%Y %H:%M:%S.%f")), si["gyro_x"].tolist()]
    found = inspect(saved(tmp_path, text(["when", "gx (rad/s)"], columns)))
    assert "or %m/%d/%Y %H:%M:%S.%f? '06/05/2024 12:00:00.000000' does not tell" in found.block


def test_a_date_and_a_time_of_day(tmp_path: Path, si: Columns) -> None:
    stamps = pd.Timestamp("2024-06-25T23:59:59") + pd.to_timedelta(si["time"], unit="s")
    names = ["Date", "Time", *(f"Rate_{axis} (deg/s)" for axis in "XYZ")]
    columns = [list(stamps.strftime("%d/%m/%Y")), list(stamps.strftime("%H:%M:%S.%f"))]
    columns += [(si[f"gyro_{axis}"] / DEG).tolist() for axis in "xyz"]
    found = drafted(
        saved(tmp_path, text(names, columns)), {name: si[name] for name in list(si)[:4]}
    )
    assert "from 2024-06-25T23:59:59 on" in found.proof.said


@pytest.mark.parametrize(
    ("scale", "start", "unit"),
    [(1, 0, "s"), (1e3, 0, "ms"), (1e6, 77, "us"), (1e9, 0, "ns"), (1e3, 1.7e12, "ms")],
)
def test_the_stamps_tell_their_unit(
    tmp_path: Path, si: Columns, scale: float, start: float, unit: str
) -> None:
    stamps = (start + np.rint(si["time"] * scale * 1000) / 1000).tolist()
    names = ["timestamp", *(f"g{axis} (rad/s)" for axis in "xyz")]
    columns = [stamps, *(si[f"gyro_{axis}"].tolist() for axis in "xyz")]
    found = drafted(
        saved(tmp_path, text(names, columns)), {name: si[name] for name in list(si)[:4]}
    )
    assert f"{{column: timestamp, unit: {unit}}}  # guessed: " in found.block


def test_stamps_of_arrival_in_a_host(tmp_path: Path, si: Columns) -> None:
    bursts = np.floor(np.arange(ROWS) / 8) * 0.08 + np.arange(ROWS) % 8 * 0.0002
    columns = [bursts.tolist(), si["gyro_x"].tolist()]
    found = inspect(saved(tmp_path, text(["t", "gx (rad/s)"], columns)))
    assert found.complete
    assert float(found.proof.said.split(", ")[1].split()[0]) == pytest.approx(100, rel=0.05)


def test_stamps_that_do_not_tell_their_unit(tmp_path: Path, si: Columns) -> None:
    names = ["time", *(f"g{axis} (rad/s)" for axis in "xyz")]
    columns = [list(range(ROWS)), *(si[f"gyro_{axis}"].tolist() for axis in "xyz")]
    found = inspect(saved(tmp_path, text(names, columns)))
    assert found.draft.unfilled() == ["time.unit"]
    with pytest.raises(ConfigError, match=r"time.unit: found '\?'; .*'s', 'ms', 'us', 'ns'"):
        sensor_of(found)


def test_without_time_the_rate_is_asked_for(tmp_path: Path, si: Columns) -> None:
    names, scales = NAMED["an x-io logger"]
    lines = [line.partition(",")[2] for line in logged(si, names, scales).splitlines()]
    path = saved(tmp_path, "\n".join(lines) + "\n")
    found = inspect(path)
    assert found.draft.unfilled() == ["rate"]
    with pytest.raises(ConfigError, match=r"log.rate: found '\?'; .* written like '100 Hz'"):
        sensor_of(found)
    path = saved(tmp_path, "# Sample rate: 100 Hz\n" + "\n".join(lines) + "\n")
    found = drafted(path, {name: si[name] for name in CHANNELS})
    assert "rate: 100 Hz" in found.block


def test_a_counter_of_samples(tmp_path: Path, si: Columns) -> None:
    counts = [(65_400 + n) % 65_536 for n in range(ROWS)]
    names = ["counter", *(f"g{axis} (rad/s)" for axis in "xyz")]
    columns = [counts, *(si[f"gyro_{axis}"].tolist() for axis in "xyz")]
    path = saved(tmp_path, "% Output rate: 100 Hz\n" + text(names, columns))
    found = drafted(path, {name: si[name] for name in list(si)[:4]})
    assert found.draft.log()["time"] == {"column": "counter", "unit": "samples", "wraps": 65_536}


def test_stamps_that_start_again(tmp_path: Path, si: Columns) -> None:
    stamps = (2**32 - 2_000_000 + np.rint(si["time"] * 1e6).astype(int)) % 2**32
    columns = [stamps.tolist(), *(si[f"gyro_{axis}"].tolist() for axis in "xyz")]
    names = ["micros", *(f"g{axis} (rad/s)" for axis in "xyz")]
    path = saved(tmp_path, text(names, columns))
    found = drafted(path, {name: si[name] for name in list(si)[:4]})
    assert found.draft.log()["time"] == {"column": "micros", "unit": "us", "wraps": 2**32}


def test_columns_without_names(tmp_path: Path, si: Columns) -> None:
    path = saved(tmp_path, text([], [si[name].tolist() for name in list(si)[:7]]))
    found = drafted(path, dict(list(si.items())[:7]), gyro="rad/s")
    assert "no names: guessed by its place" in found.block


def test_columns_that_nothing_tells_are_left_to_the_user(tmp_path: Path) -> None:
    rows = np.random.default_rng(3).standard_normal((100, 5)).tolist()
    path = saved(tmp_path, text(["a1", "b7", "u", "v", "kk"], np.transpose(rows).tolist()))
    found = inspect(path)
    assert not found.complete
    assert "not recognised: a1, b7, u, v, kk" in found.block
    with pytest.raises(ConfigError):
        sensor_of(found)


def test_acceleration_without_gravity_is_not_the_accelerometer(tmp_path: Path, si: Columns) -> None:
    still = [(0.001 * si[f"gyro_{axis}"]).tolist() for axis in "xyz"]
    true = [si[f"accel_{axis}"].tolist() for axis in "xyz"]
    names = [f"LINEAR ACCELERATION {axis} (m/s²)" for axis in "XYZ"]
    names += [f"FreeAcc_{axis}" for axis in "XYZ"]
    names += [f"GRAVITY {axis} (m/s²)" for axis in "XYZ"]
    names += [f"ACCELEROMETER {axis} (m/s²)" for axis in "XYZ"]
    columns = still + still + true + true
    found = inspect(saved(tmp_path, text(names, columns)))
    taken = found.draft.log()["channels"]
    assert {entry["column"] for entry in taken.values()} == set(names[9:])
    assert "LINEAR ACCELERATION X (m/s²)" in found.block and "without gravity" in found.block
    assert "not taken: FreeAcc_X" in found.block
    alone = inspect(saved(tmp_path, text(names[:3], still), "b.csv"))
    assert alone.draft.log()["channels"]["accel_x"]["column"] == "?"


def test_names_that_yaml_would_misread(tmp_path: Path, si: Columns) -> None:
    names = ["time: ms", "no", "gyro x, [deg/s]", "#gyro 'y' (deg/s)", 'gyro "z" (deg/s)']
    columns = [(si["time"] * 1e3).tolist(), [1] * ROWS]
    columns += [(si[f"gyro_{axis}"] / DEG).tolist() for axis in "xyz"]
    path = saved(tmp_path, text([name.replace("\n", " ") for name in names], columns, "\t"))
    drafted(path, {name: si[name] for name in list(si)[:4]})


LABELLED = {
    "a plotter": "gx:{:.6f},gy:{:.6f},gz:{:.6f},ax:{:.6f},ay:{:.6f},az:{:.6f}",
    "tabs": "gx:{:.6f}\tgy:{:.6f}\tgz:{:.6f}\tax:{:.6f}\tay:{:.6f}\taz:{:.6f}\t",
    "spaces and words": "Gyro X: {:.6f} Gyro Y: {:.6f} Gyro Z: {:.6f} Acc X: {:.6f} Acc Y: {:.6f} "
    "Acc Z: {:.6f}",
    "signs of equality": "wx={:.6f}, wy={:.6f}, wz={:.6f}, ax={:.6f}, ay={:.6f}, az={:.6f}",
    "units": "gx(rad/s):{:.6f};gy(rad/s):{:.6f};gz(rad/s):{:.6f};ax:{:e};ay:{:e};az:{:e}",
}


@pytest.mark.parametrize("way", LABELLED)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_labels_before_the_values(tmp_path: Path, si: Columns, way: str, end: str) -> None:
    rows = np.column_stack([si[name] for name in list(si)[1:7]])
    lines = [LABELLED[way].format(*row) for row in rows]
    stated = {} if way == "units" else {"gyro": "rad/s"}
    path = saved(tmp_path, end.join(["MPU6050 Found!", lines[0][-20:], *lines, ""]), "a.txt")
    found = inspect(path)
    assert set(found.draft.unfilled()) <= {
        "rate",
        *(f"channels.gyro_{axis}.unit" for axis in "xyz"),
    }
    assert "with a label before each value" in found.listing
    sensor = sensor_of(replace_rate(found), **stated)
    same(read_as_drafted(path, sensor), dict(list(si.items())[1:7]), 1e-6)


def replace_rate(found: Inspection) -> Inspection:
    return replace(found, block=found.block.replace('rate: "?"', "rate: 100 Hz"))


def test_labels_behind_a_stamp_of_the_monitor(tmp_path: Path, si: Columns) -> None:
    lines = []
    for row, (time, gyro, accel) in enumerate(
        zip(si["time"], si["gyro_x"], si["accel_z"], strict=True)
    ):
        stamp = f"23:59:{58 + int(time):02d}.{row % 100 * 10:03d}"
        if time >= 2:
            stamp = f"00:00:{int(time) - 2:02d}.{row % 100 * 10:03d}"
        lines.append(f"{stamp} -> gyro_x:{gyro:.6f},accel_z:{accel:.6f}")
    path = saved(tmp_path, "\n".join(lines) + "\n", "a.txt")
    truth = {name: si[name] for name in ("time", "gyro_x", "accel_z")}
    found = inspect(path)
    assert "time: {column: time, format: '%H:%M:%S.%f'}" in found.block
    assert "100 Hz from the stamps" in found.proof.said
    log = LogFormat.model_validate(
        {
            "time": {"column": "time", "format": "%H:%M:%S.%f"},
            "channels": {
                "gyro_x": {"column": "gyro_x", "unit": "rad/s"},
                "accel_z": {"column": "accel_z", "unit": "m/s^2"},
            },
        }
    )
    result, time, _ = text_logs.columns(path, log)
    assert time is not None
    same(result | {"time": time}, truth, 1e-6)


def test_a_line_with_other_labels_is_found(tmp_path: Path) -> None:
    lines = ["gx:1.5,ax:2.5"] * 900 + ["ax:2.5,gx:1.5"] + ["gx:1.5,ax:2.5"] * 100
    path = saved(tmp_path, "\n".join(lines) + "\n", "a.txt")
    channels = {"gyro_x": {"column": "gx", "unit": "rad/s"}}
    log = LogFormat.model_validate({"rate": "100 Hz", "channels": channels})
    with pytest.raises(RecordingError, match=r"line 901, column 'gx': found 'ax:2.5', expected"):
        text_logs.columns(path, log)


def test_text_for_people_is_named_with_the_way_to_print_columns(tmp_path: Path) -> None:
    record = (
        "Acceleration X: 0.03, Y: -0.02, Z: 9.78 m/s^2\nRotation X: 0.0019, Y: 0.0038, Z: 0.0060 "
        "rad/s\nTemperature: 24.10 degC\n\n"
    )
    begin = "MPU6050 Found!\nAccelerometer range set to: +-8G\n\n"
    stamped = "".join(f"12:00:00.000 -> {line}\n" for line in record.splitlines())
    for lines in (begin + record * 50, begin + stamped * 50):
        path = saved(tmp_path, lines, "a.txt")
        with pytest.raises(RecordingError, match=r"'.*Temperature: 24\.10 degC'.*Serial\.print\("):
            inspect(path)


def test_decoded_logs_of_betaflight(tmp_path: Path, si: Columns) -> None:
    names = ["loopIteration", " time (us)", " axisP[0]"]
    names += [f" gyroADC[{axis}]" for axis in range(3)] + [
        f" accSmooth[{axis}]" for axis in range(3)
    ]
    counts = np.rint(np.column_stack([si[n] / DEG for n in CHANNELS[:3]])).astype(int)
    counts = np.column_stack([counts, np.rint(three(si, "accel", 2048 / G)).astype(int)])
    lines = [
        f"{row}, {row * 10_000}, 3, {', '.join(map(str, each))}"
        for row, each in enumerate(counts.tolist())
    ]
    path = saved(tmp_path, "\n".join([",".join(names), *lines, ""]))
    found = inspect(path)
    assert set(found.draft.unfilled()) == {f"channels.{name}.unit" for name in CHANNELS}
    assert "with blackbox_high_resolution" in found.block
    assert "then 'unit: g, scale: 0.00048828125'" in found.block
    names = [f"{name} (deg/s)" if "gyro" in name else name for name in names]
    path = saved(tmp_path, "\n".join([",".join(names), *lines, ""]))
    assert inspect(path).draft.log()["channels"]["gyro_x"]["unit"] == "deg/s"
