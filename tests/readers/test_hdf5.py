from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import given

from imubench_pipeline.readers import bounds
from imubench_pipeline.readers.arrays import file as arrays
from imubench_pipeline.readers.arrays import hdf5
from imubench_pipeline.settings.sensor import LogFormat
from tests.readers.array_files import (
    FIRST,
    STEP,
    Damage,
    contents,
    cut_everywhere,
    damages,
    log_format,
    refused,
    survives,
)
from tests.readers.damage import examples

ROWS = 60
RECORD = np.dtype([("t", "i8"), ("gyro", "f4", (3,)), ("imu", [("temp", "i2")]), ("note", "S3")])

LONG_DOUBLE = pytest.mark.skipif(
    np.dtype(np.longdouble).itemsize == 8, reason="long double is double on this machine"
)


def records() -> np.ndarray:
    made = np.zeros(ROWS, RECORD)
    made["t"] = FIRST.astype(np.int64) + np.arange(ROWS) * STEP
    made["gyro"] = np.arange(3 * ROWS).reshape(ROWS, 3)
    made["imu"]["temp"] = np.arange(ROWS)
    return made


def saved(path: Path, chunked: bool = True, libver: str | None = None) -> Path:
    keys: dict[str, Any] = (
        {"chunks": True, "compression": "gzip", "shuffle": True} if chunked else {}
    )
    with h5py.File(path, "w", libver=libver) as file:
        rows = np.arange(ROWS, dtype=float)
        file.create_dataset("imu/m", data=np.stack([rows, 2 * rows, -rows], axis=1), **keys)
        file.create_dataset("imu/turned", data=np.stack([rows, 2 * rows, -rows]), **keys)
        file.create_dataset("imu/wx", data=np.arange(ROWS, dtype=">i2"), **keys)
        file.create_dataset("imu/column", data=rows.reshape(-1, 1), **keys)
        file.create_dataset("r", data=records(), **keys)
        file.create_dataset("r2", data=records().reshape(1, -1), **keys)
        file.create_dataset("short", data=np.zeros(10), **keys)
        file["square"] = np.arange(9.0).reshape(3, 3)
        file["text"] = ["a"] * ROWS
        file["complex"] = np.zeros(ROWS, complex)
        file["cube"] = np.zeros((2, 3, 4))
        file["rate"] = 100.0
        file["empty"] = np.zeros((0, 3))
        file["null"] = h5py.Empty("f8")
        file["flags"] = np.zeros(ROWS, bool)
        file.create_dataset("records of text", data=np.zeros(ROWS, [("s", "S4")]))
        dates = np.arange(ROWS).astype("M8[ms]") + (FIRST - np.datetime64(0, "ns"))
        dates = dates.astype("M8[us]")
        file["dates"] = dates.astype(h5py.opaque_dtype(dates.dtype))
    return path


def log(channels: dict[str, Any], **keys: Any) -> LogFormat:
    return log_format(channels, **{"reader": "hdf5"} | keys)


@pytest.mark.parametrize("chunked", [False, True])
@pytest.mark.parametrize("rows_a_block", [7, 1 << 18])
def test_vectors_matrices_and_records(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, chunked: bool, rows_a_block: int
) -> None:
    monkeypatch.setattr(arrays, "_MAX_BLOCK_ROWS", rows_a_block)
    path = saved(tmp_path / "a.h5", chunked)
    rows = np.arange(float(ROWS))
    for column, variable, expected in [
        (2, "imu/m", 2 * rows),
        (3, "/imu/turned", -rows),
        (1, "imu/wx", rows),
        ("imu/wx", None, rows),
        ("/imu/wx", None, rows),
        ("wx", "imu", rows),
        ("imu/column", None, rows),
        ("imu/m[2]", None, 2 * rows),
        ("gyro[2]", "r", 3 * rows + 1),
        ("gyro[2]", "r2", 3 * rows + 1),
        ("r/imu.temp", None, rows),
        (5, "r", rows),
    ]:
        channels = {
            "gyro_y": {"column": column, "variable": variable},
            "gyro_x": {"column": 1, "variable": "imu/m"},
        }
        found, time, _ = contents(path, log_format(channels))
        np.testing.assert_array_equal(found["gyro_y"], expected)
        np.testing.assert_array_equal(found["gyro_x"], rows)
        assert time is None


def test_time(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.h5")
    channels = {"gyro_x": {"column": "gyro[1]", "variable": "r"}}
    for column in ("t", "r/t", 1):
        _, time, file = contents(path, log(channels, time={"column": column, "unit": "ns"}))
        np.testing.assert_allclose(time, np.arange(ROWS) * 0.01, rtol=1e-15)
        assert file.started == "2024-05-01T10:00:00.000"
    _, time, file = contents(path, log(channels, time={"column": "dates", "format": "iso8601"}))
    np.testing.assert_allclose(time, np.arange(ROWS) * 0.001, rtol=1e-12)
    assert file.started == "2024-05-01T10:00:00.000"


def test_a_square_has_time_downwards(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.h5")
    found, _, _ = contents(path, log({"gyro_x": {"column": 2, "variable": "square"}}))
    assert found["gyro_x"].tolist() == [1, 4, 7]


@pytest.mark.parametrize(
    ("source", "message"),
    [
        ({"variable": "text"}, "text for gyro_x holds objects; expected numbers"),
        ({"variable": "complex"}, "complex for gyro_x holds complex numbers"),
        ({"variable": "cube"}, "cube for gyro_x has 3 dimensions .2 x 3 x 4."),
        ({"variable": "rate"}, "rate for gyro_x is a single value; expected a vector"),
        ({"variable": "empty"}, "empty for gyro_x is empty .0 x 3.; expected at least one record"),
        ({"variable": "null"}, "null for gyro_x is empty"),
        ({"variable": "flags"}, "flags for gyro_x holds truth values"),
        ({"variable": "records of text"}, "column 's' of records of text for gyro_x holds text"),
        ({"variable": "imu"}, "no variable 'imu' for gyro_x; the file has dates, imu/column, imu/"),
        ({"variable": "imu/m", "column": 4}, "no column 4 for gyro_x; imu/m has 3 columns of 60"),
        ({"variable": "r", "column": "q"}, r"no column 'q' for gyro_x; r has t, gyro\[1\], gyro"),
        ({"column": "imu/m"}, "'imu/m' for gyro_x is a matrix of 3 columns"),
        ({"column": "t"}, r"'t' for gyro_x is in several variables \(r, r2\); .*'column: r/t'"),
        ({}, "several variables .* name the one of gyro_x with 'variable:'"),
        ({"variable": "short"}, r"unequal length: \{'gyro_x': 10, 'gyro_y': 60\}"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, source: dict[str, Any], message: str) -> None:
    channels = {
        "gyro_x": {"column": 1} | source,
        "gyro_y": {"column": 1, "variable": "imu/m"},
    }
    refused(saved(tmp_path / "a.h5"), log(channels), message)


def test_what_was_never_written_is_no_zero(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("none", (10**15, 4), "f8")
        file.create_dataset("chunks", (10**12, 4), "f8", chunks=(1000, 4))
        part = file.create_dataset("part", (10_000,), "f8", chunks=(1000,))
        part[:5000] = 1.0
    for name, message in [
        ("none", "none was never written; expected 4000000000000000 values"),
        ("chunks", "0 of 1000000000 chunks of chunks were written"),
        ("part", "5 of 10 chunks of part were written, the others would read as zeros"),
    ]:
        refused(path, log({"gyro_x": {"column": 1, "variable": name}}), message)


def test_what_cannot_be_read_in_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = saved(tmp_path / "a.h5")
    channels = {"gyro_x": {"column": 1, "variable": "imu/m"}}
    monkeypatch.setattr(bounds, "MAX_CHUNK_BYTES", 100)
    refused(path, log(channels), "imu/m has chunks of 1440 bytes; expected at most 100: repack")
    monkeypatch.setattr(bounds, "MAX_CHUNK_BYTES", 1500)
    monkeypatch.setattr(arrays, "MAX_CHUNK_BYTES", 1500)
    contents(path, log(channels))
    channels["gyro_y"] = {"column": "imu/wx"}
    refused(path, log(channels), "the columns are in chunks of 1560 bytes together; expected at mo")


def test_what_is_elsewhere_is_not_followed(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    (tmp_path / "secret").write_bytes(bytes(800))
    saved(tmp_path / "b.h5")
    layout = h5py.VirtualLayout((ROWS, 3), "f8")
    layout[:] = h5py.VirtualSource(str(tmp_path / "b.h5"), "imu/m", (ROWS, 3))
    with h5py.File(path, "w") as file:
        file.create_dataset("outer", (100,), "f8", external=str(tmp_path / "secret"))
        file.create_virtual_dataset("virtual", layout)
        file["link"] = h5py.ExternalLink(str(tmp_path / "b.h5"), "imu/m")
    for name in ("outer", "virtual"):
        refused(
            path,
            log({"gyro_x": {"column": 1, "variable": name}}),
            f"{name}( for gyro_x)? is stored in other files; expected one file",
        )
    refused(path, log({"gyro_x": {"column": 1, "variable": "link"}}), "no variable 'link'")


def test_a_compression_that_is_not_here(tmp_path: Path) -> None:
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file.create_dataset("m", data=np.zeros(ROWS), chunks=(10,), compression="gzip")
    # The number of the filter is where its name follows.
    data = path.read_bytes()
    place = data.index(b"deflate") - 8
    path.write_bytes(data[:place] + (32001).to_bytes(2, "little") + data[place + 2 :])
    message = (
        r"m is compressed with filter 32001 \(deflate\), which is not installed; expected gzip"
    )
    refused(path, log({"gyro_x": {"column": 1}}), message)


@pytest.mark.parametrize(
    "dtype",
    [
        np.dtype({"names": ["a", "b"], "formats": ["f8", "i4"], "offsets": [0, 4], "itemsize": 12}),
        pytest.param(np.dtype([("a", np.longdouble)]), marks=LONG_DOUBLE),
        pytest.param(np.dtype(np.longdouble), marks=LONG_DOUBLE),
    ],
)
def test_types_that_harm_the_library_are_refused(dtype: np.dtype) -> None:
    assert not hdf5._is_sound(dtype)


@pytest.mark.parametrize("data", [b"", b"text", b"\x89HDF\r\n\x1a\n" + bytes(200)])
def test_what_is_no_such_file(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "a.h5"
    path.write_bytes(data)
    refused(path, log({"gyro_x": {"column": 1}}), "not an HDF5 file|is empty|corrupt data")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("hdf5")
    return [
        saved(folder / "a.h5"),
        saved(folder / "b.h5", chunked=False),
        saved(folder / "c.h5", libver="latest"),
    ]


EVERY = {
    "gyro_x": {"column": "gyro[2]", "variable": "r"},
    "gyro_y": {"column": 2, "variable": "imu/turned"},
    "gyro_z": {"column": "imu/wx"},
}
STAMPED = {"column": "r/t", "unit": "ns"}


def test_cut_files_are_refused(whole: list[Path]) -> None:
    for path in whole:
        assert cut_everywhere(path, log(EVERY, time=STAMPED), 40) == 0


@examples(40)
@given(damage=damages)
def test_damaged_files_never_crash(whole: list[Path], damage: Damage) -> None:
    for path in whole:
        data = damage(path.read_bytes())
        survives(path.with_name("damaged"), data, log(EVERY, time=STAMPED))
