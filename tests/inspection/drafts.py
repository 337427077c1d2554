"""What the tests of drafted sensor files share: logs, and what is read of them as drafted."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io
import yaml

from imubench_pipeline.readers import read
from imubench_pipeline.readers.inspection import Inspection, inspect
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.settings.validation import parse

DEG, G = np.pi / 180, 9.80665
ROWS = 240
Columns = dict[str, np.ndarray]


def text(names: list[str], columns: list[Any], sign: str = ",", decimal: str = ".") -> str:
    lines = [sign.join(names)] if names else []
    for row in zip(*columns, strict=True):
        lines.append(sign.join(cell if isinstance(cell, str) else repr(cell) for cell in row))
    joined = "\n".join(lines) + "\n"
    return joined.replace(".", decimal) if decimal != "." else joined


def logged(si: Columns, names: list[str], scales: dict[str, float] | None = None) -> str:
    """Write time, channels and temperature under these names, each times its scale."""
    scales = scales or {}
    columns = [(si[name] * scales.get(name.split("_")[0], 1)).tolist() for name in si]
    return text(names, columns[: len(names)])


def saved(tmp_path: Path, data: str | bytes, name: str = "a.csv") -> Path:
    path = tmp_path / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return path


def sensor_of(found: Inspection, **gyro: str) -> Sensor:
    """Return the sensor file, with the unit of the gyros filled in."""
    data = yaml.safe_load(found.block)
    for name, entry in data["log"]["channels"].items():
        if name.startswith("gyro") and gyro:
            assert entry["unit"] == "?"
            entry["unit"] = gyro["gyro"]
    return parse(Sensor, data, "drafted")


def read_as_drafted(path: Path, sensor: Sensor) -> Columns:
    """Read a recording with a sensor file; the time is that of the first file."""
    found: Columns = {}
    for file in read(path, sensor.log):
        batches = list(file.batches())
        for name in file.sources:
            found[name] = np.concatenate([batch.columns[name] for batch in batches])
        if batches[0].time is not None:
            stamps = np.concatenate([batch.time for batch in batches if batch.time is not None])
            found.setdefault("time", stamps)
    return found


def same(found: Columns, truth: Columns, rtol: float = 1e-9) -> None:
    for name, values in found.items():
        expected = truth[name] - truth[name][0] if name == "time" else truth[name]
        atol = 1e-9 if name == "time" else 1e-12
        np.testing.assert_allclose(values, expected, rtol=rtol, atol=atol, err_msg=name)


def drafted(path: Path, truth: Columns, *, exactly: bool = True, **gyro: str) -> Inspection:
    """Inspect, read as drafted, and compare with what was written; all of it, or what is there."""
    found = inspect(path)
    assert found.complete is not bool(gyro)
    result = read_as_drafted(path, sensor_of(found, **gyro))
    same(result, truth)
    if exactly:
        assert set(result) == set(truth)
    return found


NAMED = {
    "an x-io logger": (
        ["Time (s)", *(f"Gyroscope {a} (deg/s)" for a in "XYZ"),
         *(f"Accelerometer {a} (g)" for a in "XYZ")],
        {"gyro": 1 / DEG, "accel": 1 / G},
    ),
    "words and units with underscores": (
        ["time_ms", *(f"gyro_{a}_mrad_s" for a in "xyz"), *(f"accel_{a}_m_s2" for a in "xyz"),
         "temperature_degC"],
        {"time": 1e3, "gyro": 1e3},
    ),
    "units in names, short": (
        ["t_us", *(f"gyr_{a}_dps" for a in "xyz"), *(f"acc_{a}_mg" for a in "xyz"), "temp_c"],
        {"time": 1e6, "gyro": 1 / DEG, "accel": 1e3 / G},
    ),
    "a wireless sensor": (
        ["t [ms]", *(f"AngVel{a}(°/s)" for a in "XYZ"), *(f"Acc{a}(g)" for a in "XYZ"), "T(°C)"],
        {"time": 1e3, "gyro": 1 / DEG, "accel": 1 / G},
    ),
    "frames in names": (
        ["#timestamp [ns]", *(f"w_RS_S_{a} [rad s^-1]" for a in "xyz"),
         *(f"a_RS_S_{a} [m s^-2]" for a in "xyz")],
        {"time": 1e9},
    ),
    "p, q and r": (
        ["Time [s]", "p [rad/s]", "q [rad/s]", "r [rad/s]", "fx [m/s^2]", "fy [m/s^2]",
         "fz [m/s^2]"],
        {},
    ),
    "counts of a vendor": (
        ["seconds_elapsed", *(f"{a}GYRO_OUT (deg/sec)" for a in "XYZ"),
         *(f"{a}ACCL_OUT (mg)" for a in "XYZ"), "TEMP_OUT (°C)"],
        {"gyro": 1 / DEG, "accel": 1e3 / G},
    ),
    "roll, pitch and yaw rates": (
        ["time_s", "roll rate [deg/s]", "pitch rate [deg/s]", "yaw rate [deg/s]",
         *(f"specific force {a} [m/s²]" for a in "xyz")],
        {"gyro": 1 / DEG},
    ),
}  # fmt: skip


def matlab_5(path: Path, held: dict[str, Any]) -> None:
    scipy.io.savemat(path, held, do_compression=True, oned_as="column")


def matlab_73(path: Path, held: dict[str, Any]) -> None:
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in held.items():
            if isinstance(value, dict):
                for field, values in value.items():
                    file[f"{name}/{field}"] = np.atleast_2d(values)
            else:
                file[name] = np.atleast_2d(np.asarray(value).T)
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\0\2IM")


def npz(path: Path, held: dict[str, Any]) -> None:
    with path.open("wb") as file:
        np.savez(file, **held)


def hdf5(path: Path, held: dict[str, Any]) -> None:
    with h5py.File(path, "w") as file:
        for name, value in held.items():
            if isinstance(value, dict):
                for field, values in value.items():
                    file[f"{name}/{field}"] = values
            else:
                file[name] = value


WRITERS = {"v5": matlab_5, "v7.3": matlab_73, "npz": npz, "hdf5": hdf5}


def three(si: Columns, quantity: str, scale: float = 1.0) -> np.ndarray:
    return np.column_stack([si[f"{quantity}_{axis}"] * scale for axis in "xyz"])
