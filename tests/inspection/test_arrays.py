"""Files of arrays, written by their libraries, drafted and read as drafted."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet as pq
import pytest

from imubench_pipeline.readers.inspection import inspect
from imubench_pipeline.settings.sensor import CHANNELS
from tests.inspection.drafts import (
    DEG,
    ROWS,
    WRITERS,
    Columns,
    G,
    drafted,
    hdf5,
    matlab_5,
    matlab_73,
    read_as_drafted,
    same,
    sensor_of,
    three,
)
from tests.readers import test_matlab


@pytest.mark.parametrize("kind", WRITERS)
def test_matrices_of_three_columns_beside_a_time(tmp_path: Path, si: Columns, kind: str) -> None:
    held = {"t": si["time"], "gyro": three(si, "gyro", 1 / DEG), "acc": three(si, "accel", 1 / G)}
    WRITERS[kind](tmp_path / "a", held | {"temp": si["temperature"]})
    drafted(tmp_path / "a", si, gyro="deg/s")


@pytest.mark.parametrize("kind", WRITERS)
def test_vectors(tmp_path: Path, si: Columns, kind: str) -> None:
    names = ["time_ms", "wx_deg_s", "wy_deg_s", "wz_deg_s", "ax_g", "ay_g", "az_g"]
    scales = [1e3, *[1 / DEG] * 3, *[1 / G] * 3]
    held = {
        written: si[name] * scale
        for written, name, scale in zip(names, list(si)[:7], scales, strict=True)
    }
    WRITERS[kind](tmp_path / "a", held)
    drafted(tmp_path / "a", dict(list(si.items())[:7]))


@pytest.mark.parametrize("kind", ["v5", "v7.3", "hdf5"])
def test_vectors_in_a_structure_with_a_rate(tmp_path: Path, si: Columns, kind: str) -> None:
    held = {f"gyro_{axis}_radps": si[f"gyro_{axis}"] for axis in "xyz"}
    WRITERS[kind](tmp_path / "a", {"imu": held, "fs": np.array([[100.0]])})
    found = drafted(tmp_path / "a", {f"gyro_{axis}": si[f"gyro_{axis}"] for axis in "xyz"})
    assert "rate: 100 Hz" in found.block


@pytest.mark.parametrize("kind", ["v5", "v7.3"])
def test_a_structure_of_navego(tmp_path: Path, si: Columns, kind: str) -> None:
    imu = {"t": si["time"][:, None], "fb": three(si, "accel"), "wb": three(si, "gyro")}
    held = {"imu1": imu | {"freq": np.array([[100.0]]), "m_psd": np.ones((ROWS, 2))}}
    WRITERS[kind](tmp_path / "a", held)
    truth = dict(list(si.items())[:7])
    found = drafted(tmp_path / "a", truth)
    assert "as NaveGo's wb and fb are" in found.block
    assert "# not taken: imu1/m_psd (no column is named as one of a gyro" in found.block
    # Without its companion the field says no unit.
    WRITERS[kind](tmp_path / "b", {"imu1": {key: imu[key] for key in ("t", "wb")}})
    drafted(tmp_path / "b", {name: truth[name] for name in list(truth)[:4]}, gyro="rad/s")


@pytest.mark.parametrize("kind", WRITERS)
def test_recordings_of_noise_are_measurements(tmp_path: Path, si: Columns, kind: str) -> None:
    held = {"Gyr_noise": three(si, "gyro"), "Acc_noise": three(si, "accel"), "t": si["time"]}
    WRITERS[kind](tmp_path / "a", held)
    drafted(tmp_path / "a", dict(list(si.items())[:7]), gyro="rad/s")
    # Beside the samples they are what a datasheet or a filter says.
    held |= {"gyro": -held["Gyr_noise"], "acc": -held["Acc_noise"]}
    WRITERS[kind](tmp_path / "b", held)
    truth = {name: -values if name != "time" else values for name, values in si.items()}
    drafted(tmp_path / "b", dict(list(truth.items())[:7]), gyro="rad/s")


@pytest.mark.parametrize("kind", WRITERS)
def test_arrays_that_no_name_identifies_are_listed(tmp_path: Path, si: Columns, kind: str) -> None:
    held = {name: three(si, "gyro") for name in ("gyro", "x1", "x2")}
    WRITERS[kind](tmp_path / "a", held)
    found = inspect(tmp_path / "a")
    assert "# not taken: x1, x2 (no column is named as one of a gyro" in found.block
    WRITERS[kind](tmp_path / "b", {name: held[name] for name in ("x1", "x2")})
    found = inspect(tmp_path / "b")
    assert 'gyro_x: {variable: "?", column: "?", unit: "?"}' in found.block


def test_a_timetable_is_named_with_the_way_to_save_its_columns(tmp_path: Path, si: Columns) -> None:
    # Version 5 has the class 17, version 7.3 numbers that refer to hidden objects.
    opaque = test_matlab.element("<", 6, struct.pack("<II", 17, 0))
    for text in (b"tt", b"MCOS", b"timetable"):
        opaque += test_matlab.element("<", 1, text)
    opaque = struct.pack("<II", 14, len(opaque)) + opaque
    gyro = test_matlab.element("<", 9, three(si, "gyro").T.tobytes())
    matrix = test_matlab.variable("<", "gyro", (ROWS, 3), gyro)
    old = test_matlab.by_hand(tmp_path / "old.mat", "<", opaque, matrix)
    matlab_73(tmp_path / "new.mat", {"gyro": three(si, "gyro"), "tt": np.arange(1.0, 7.0)})
    with h5py.File(tmp_path / "new.mat", "r+") as file:
        file["tt"].attrs["MATLAB_class"] = np.bytes_("timetable")
        file["gyro"].attrs["MATLAB_class"] = np.bytes_("double")
    for path in (old, tmp_path / "new.mat"):
        found = inspect(path)
        assert "# not taken: tt (is a table, a timetable or another object" in found.block
        assert "t = seconds(x.Time)" in found.block
        assert "3 channels" in found.proof.said


@pytest.mark.parametrize("kind", WRITERS)
def test_a_time_in_the_first_column_of_each_matrix(tmp_path: Path, si: Columns, kind: str) -> None:
    held = {
        f"{quantity}Buffer": np.column_stack([si["time"], three(si, quantity)])
        for quantity in ("gyro", "accel")
    }
    WRITERS[kind](tmp_path / "a", held)
    drafted(tmp_path / "a", dict(list(si.items())[:7]), gyro="rad/s")


def test_a_folder_of_matlab_files(tmp_path: Path, si: Columns) -> None:
    (tmp_path / "run").mkdir()
    for quantity, name in (("gyro", "gyroscope"), ("accel", "accelerometer")):
        matrix = np.column_stack([si["time"], three(si, quantity)])
        matlab_73(tmp_path / "run" / f"{name}.mat", {f"{name}Buffer": matrix})
    matrix = np.column_stack([si["time"], si["temperature"]])[::10]
    matlab_5(tmp_path / "run" / "temperature.mat", {"temperatureBuffer": matrix})
    found = inspect(tmp_path / "run")
    result = read_as_drafted(tmp_path / "run", sensor_of(found, gyro="rad/s"))
    assert len(result.pop("temperature")) == ROWS / 10
    same(result, si)


def test_structured_npy(tmp_path: Path, si: Columns) -> None:
    kind = np.dtype([("time", "M8[ns]"), ("gyro", "f8", 3), ("accel_mg", "f8", 3)])
    table = np.zeros(ROWS, kind)
    table["time"] = np.datetime64("2024-05-01T10:00") + np.rint(si["time"] * 1e9).astype("m8[ns]")
    table["gyro"], table["accel_mg"] = three(si, "gyro"), three(si, "accel", 1e3 / G)
    np.save(tmp_path / "a.npy", table)
    found = drafted(tmp_path / "a.npy", dict(list(si.items())[:7]), gyro="rad/s")
    assert "from 2024-05-01T10:00:00 on" in found.proof.said


def test_npy_without_names(tmp_path: Path, si: Columns) -> None:
    np.save(tmp_path / "a.npy", np.column_stack([si[name] for name in list(si)[:7]]))
    drafted(tmp_path / "a.npy", dict(list(si.items())[:7]), gyro="rad/s")


@pytest.mark.parametrize("kind", ["parquet", "feather", "pandas"])
def test_tables_of_arrow(tmp_path: Path, si: Columns, kind: str) -> None:
    stamps = np.datetime64("2024-05-01T10:00") + np.rint(si["time"] * 1e9).astype("m8[ns]")
    columns: dict[str, Any] = {"when": stamps}
    columns |= {f"{name} [rad/s]": si[name] for name in CHANNELS[:3]}
    columns |= {f"{name} [m/s^2]": si[name] for name in CHANNELS[3:]}
    path = tmp_path / "a"
    if kind == "pandas":
        pd.DataFrame(columns).set_index("when").to_parquet(path)
    elif kind == "parquet":
        pq.write_table(pa.table(columns), path)
    else:
        pyarrow.feather.write_feather(pa.table(columns), str(path))
    found = drafted(path, dict(list(si.items())[:7]))
    assert "from 2024-05-01T10:00:00 on" in found.proof.said


def test_units_in_the_metadata_of_parquet(tmp_path: Path, si: Columns) -> None:
    units = {"gyro": "deg/s", "accel": "g", "time": "ms"}
    scales = {"gyro": 1 / DEG, "accel": 1 / G, "time": 1e3}
    fields = [
        pa.field(name, pa.float64(), metadata={"units": units[name.split("_")[0]]})
        for name in list(si)[:7]
    ]
    columns = [si[field.name] * scales[field.name.split("_")[0]] for field in fields]
    pq.write_table(pa.table(columns, schema=pa.schema(fields)), tmp_path / "a")
    drafted(tmp_path / "a", dict(list(si.items())[:7]))


@pytest.mark.parametrize("fixed", [True, False])
def test_units_in_attributes_of_hdf5(tmp_path: Path, si: Columns, fixed: bool) -> None:
    held = {"t": si["time"] * 1e3, "gyro": three(si, "gyro", 1 / DEG), "acc": three(si, "accel")}
    hdf5(tmp_path / "a", held)
    with h5py.File(tmp_path / "a", "r+") as file:
        for name, unit in (("t", "ms"), ("gyro", "deg/s"), ("acc", "m/s^2")):
            file[name].attrs["units"] = np.bytes_(unit) if fixed else unit
    drafted(tmp_path / "a", dict(list(si.items())[:7]))


def test_unequal_lengths_are_not_put_together(tmp_path: Path, si: Columns) -> None:
    held = {"gyro": three(si, "gyro"), "accel": three(si, "accel")[::2]}
    hdf5(tmp_path / "a", held)
    found = inspect(tmp_path / "a")
    assert set(found.draft.channels) == {"gyro_x", "gyro_y", "gyro_z"}
    assert "of accel (other records than the channels" in found.block
    assert found.proof.read
