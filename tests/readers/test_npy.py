import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given

from imubench_pipeline.readers.arrays import file as arrays
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

MATRIX = {"gyro_x": {"column": 2}, "gyro_z": {"column": 4}}
SECONDS = {"column": 1, "unit": "s"}
RECORD = np.dtype(
    [("t", "M8[us]"), ("gyro", ">f4", (3,)), ("imu", [("température", "i2")]), ("note", "U3")]
)


def matrix(rng: np.random.Generator, rows: int) -> np.ndarray:
    values = rng.standard_normal((rows, 4))
    values[:, 0] = 5.0 + np.arange(rows) / 100.0
    return values


def saved(path: Path, array: np.ndarray) -> Path:
    with path.open("wb") as file:
        np.save(file, array, allow_pickle=True)
    return path


def header(**keys: Any) -> bytes:
    """A header of version 1.0 with nothing behind it."""
    given = {"descr": "<f8", "fortran_order": False} | keys
    text = repr(given).encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


@pytest.mark.parametrize("rows_a_block", [7, 1 << 18])
@pytest.mark.parametrize("dtype", ["<f8", ">f4", "<i8", "<u2"])
@pytest.mark.parametrize("layout", ["rows", "columns", "turned", "turned columns"])
def test_a_matrix(
    tmp_path: Path,
    rng: np.random.Generator,
    monkeypatch: pytest.MonkeyPatch,
    rows_a_block: int,
    dtype: str,
    layout: str,
) -> None:
    monkeypatch.setattr(arrays, "_MAX_BLOCK_ROWS", rows_a_block)
    values = np.abs(1000 * matrix(rng, 50)).astype(dtype)
    values[:, 0] = np.arange(50) + 7
    stored = np.asarray(values.T if "turned" in layout else values)
    stored = np.asfortranarray(stored) if "columns" in layout else np.ascontiguousarray(stored)
    for path in (saved(tmp_path / "a.npy", stored), tmp_path / "a.npz"):
        if path.suffix == ".npz":
            np.savez_compressed(path, stored)
        found, time, _ = contents(path, log_format(MATRIX, time=SECONDS))
        np.testing.assert_array_equal(found["gyro_x"], values[:, 1].astype(float))
        np.testing.assert_array_equal(found["gyro_z"], values[:, 3].astype(float))
        np.testing.assert_array_equal(time, np.arange(50.0))


@pytest.mark.filterwarnings("ignore:Stored array in format 3.0")  # it is meant to be
def test_records_with_fields(tmp_path: Path) -> None:
    records = np.zeros(5, RECORD)
    records["t"] = FIRST.astype("M8[us]") + np.arange(5) * (STEP // 1000)
    records["t"][3] = np.datetime64("NaT")
    records["gyro"] = np.arange(15).reshape(5, 3)
    records["imu"]["température"] = [20, 21, 22, 23, -24]
    channels = {"gyro_x": {"column": "gyro[2]"}, "gyro_y": {"column": 4}}
    log = log_format(
        channels,
        time={"column": "t", "format": "iso8601"},
        temperature={"column": "imu.température", "unit": "degC"},
    )
    found, time, file = contents(saved(tmp_path / "a.npy", records), log)
    assert found["gyro_x"].tolist() == [1, 4, 7, 10, 13]
    assert found["gyro_y"].tolist() == [2, 5, 8, 11, 14]
    np.testing.assert_allclose(found["temperature"], [20, 21, 22, 23, -24])
    np.testing.assert_allclose(time, [0, 0.01, 0.02, np.nan, 0.04], atol=1e-12)
    assert file.started == "2024-05-01T10:00:00.000"


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_a_vector_a_variable(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, save: Any) -> None:
    monkeypatch.setattr(arrays, "_MAX_BLOCK_ROWS", 1 << 16)
    stamps = FIRST.astype(np.int64) + np.arange(70_000) * STEP
    values = np.arange(70_000.0)
    path = tmp_path / "a.npz"
    save(path, t=stamps, wx=values, m=np.stack([values, -values]), rate=np.array(100.0))
    channels = {"gyro_x": {"column": "wx"}, "gyro_y": {"column": "m[2]"}}
    log = log_format(channels, time={"column": "t", "unit": "ns"})
    found, time, file = contents(path, log)
    np.testing.assert_array_equal(found["gyro_x"], values)
    np.testing.assert_array_equal(found["gyro_y"], -values)
    np.testing.assert_allclose(time, np.arange(70_000) * 0.01, rtol=1e-15)
    assert file.started == "2024-05-01T10:00:00.000"


def test_unsigned_stamps_may_go_back_and_counters_wrap(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    last = np.uint64(2**64 - 2)
    stamps = np.array([last, last - np.uint64(5), last + np.uint64(1)])
    np.savez(path, t=stamps, w=np.arange(3), c=np.array([65534, 65535, 0], np.uint16))
    channels = {"gyro_x": {"column": "w"}}
    _, time, _ = contents(path, log_format(channels, time={"column": "t", "unit": "ns"}))
    np.testing.assert_allclose(time, [0, -5e-9, 1e-9])
    log = log_format(channels, time={"column": "c", "unit": "ms", "wraps": 65536})
    np.testing.assert_allclose(contents(path, log)[1], [0, 1e-3, 2e-3])


def test_missing_stamps_and_samples(tmp_path: Path) -> None:
    values = np.array([[1.0, 2], [np.nan, 3], [np.inf, np.nan], [4, 5], [5, 6]])
    log = log_format({"gyro_x": {"column": 2}}, time=SECONDS)
    found, time, _ = contents(saved(tmp_path / "a.npy", values), log)
    np.testing.assert_array_equal(found["gyro_x"], [2, 3, np.nan, 5, 6])
    np.testing.assert_array_equal(time, [0, np.nan, np.nan, 3, 4])


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.array([1.0, None]), "holds objects; expected numbers"),
        (np.array([1j, 2]), "holds complex numbers; expected numbers"),
        (np.array(["a", "b"]), "holds text; expected numbers"),
        (np.array([b"a", b"b"]), "holds text; expected numbers"),
        (np.array([True, False]), "holds truth values"),
        (np.array(["2024-01-01"], "M8[s]"), "for gyro_x holds dates; expected numbers"),
        (np.zeros((2, 3, 4)), "has 3 dimensions .2 x 3 x 4.; expected a vector, or a matrix"),
        (np.array(3.0), "is a single value; expected a vector or a matrix"),
        (np.zeros(0), "is empty .0.; expected at least one record"),
        (np.zeros((0, 4)), "is empty .0 x 4.; expected at least one record"),
        (np.zeros((2, 2), [("a", "f8")]), "is a matrix of records; expected a vector"),
        (np.zeros(2, [("a", "U2")]), "column 'a' of the table for gyro_x holds text"),
        (np.zeros(2, [("a", "O")]), "holds objects; expected numbers: store the column as numbers"),
        (np.zeros(2, [("a", "f8", (2, 2))]), "column 'a' .* holds raw bytes or arrays"),
    ],
)
def test_what_is_no_numbers_is_refused(tmp_path: Path, array: np.ndarray, message: str) -> None:
    log = log_format({"gyro_x": {"column": 1}})
    refused(saved(tmp_path / "a.npy", array), log, message)
    np.savez(tmp_path / "a.npz", a=array)
    refused(tmp_path / "a.npz", log, message.replace("the table", "a"))


@pytest.mark.parametrize(
    ("channels", "keys", "message"),
    [
        ({"gyro_x": {"column": 5, "variable": "m"}}, {}, "no column 5 for gyro_x; m has 4 columns"),
        ({"gyro_x": {"column": 1}}, {}, r"several variables \(m, v, r\); name the one of gyro_x"),
        ({"gyro_x": {"column": 1, "variable": "w"}}, {}, "no variable 'w'.*has m, v, r; correct"),
        ({"gyro_x": {"column": "m"}}, {}, "'m' for gyro_x is a matrix of 4 columns; name one"),
        ({"gyro_x": {"column": "m[5]"}}, {}, "no column 5 for gyro_x; m has 4 columns"),
        ({"gyro_x": {"column": "q"}}, {}, "no variable or column 'q' .* has m, v, r, column a, "),
        ({"gyro_x": {"column": "q", "variable": "r"}}, {}, "no column 'q' for gyro_x; r has a, t"),
        ({"gyro_x": {"column": "q", "variable": "m"}}, {}, "m has 4 columns without names"),
        (
            {"gyro_x": {"column": "v"}, "gyro_y": {"column": 1, "variable": "m"}},
            {},
            r"unequal length: \{'gyro_x': 50, 'gyro_y': 100\}; expected one length",
        ),
        (
            {"gyro_x": {"column": "v"}, "gyro_y": {"column": 2, "variable": "m"}},
            {"time": SECONDS},
            r"'time' is column 1, but .* several variables .*'column: name\[1\]'",
        ),
        (
            {"gyro_x": {"column": "a"}},
            {"time": {"column": "t", "unit": "s"}},
            "'t' of r for time holds dates; expected numbers: give 'format: iso8601'",
        ),
        (
            {"gyro_x": {"column": "v"}},
            {"time": {"column": "v", "format": "iso8601"}},
            "v for time holds numbers; expected dates: give 'unit'",
        ),
        (
            {"gyro_x": {"column": "a"}},
            {"time": {"column": "t", "format": "%H:%M:%S"}},
            "found format '%H:%M:%S' .* expected 'format: iso8601'",
        ),
        (
            {"gyro_x": {"column": "a"}},
            {"time": {"column": "t", "format": "iso8601", "date": 1}},
            "'date' of 'time' is for text logs; drop it",
        ),
    ],
)
def test_what_is_wrong_is_named(
    tmp_path: Path, channels: dict[str, Any], keys: dict[str, Any], message: str
) -> None:
    path = tmp_path / "a.npz"
    records = np.zeros(50, [("a", "f8"), ("t", "M8[s]")])
    np.savez(path, m=np.zeros((100, 4)), v=np.zeros(50), r=records, x=np.array(["text"] * 50))
    refused(path, log_format(channels, **keys), message)


def test_wrong_stamps(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    dates = np.array([2**62, 1], "M8[s]")
    nat = np.array(["NaT", "NaT"], "M8[s]")
    np.savez(path, d=dates, n=nat, m=np.array(["2024-01", "2024-02"], "M8[M]"), w=np.zeros(2))
    for column, message in [
        ("d", "dates before 1678 or after 2262"),
        ("n", "no time stamp in the first 2 records; correct 'column'"),
        ("m", "dates in units of M; expected D, h, m, s, ms, us, ns"),
    ]:
        time = {"column": column, "format": "iso8601"}
        refused(path, log_format({"gyro_x": {"column": "w"}}, time=time), message)


def test_a_named_array_of_one_without_a_name(tmp_path: Path) -> None:
    path = saved(tmp_path / "a.npy", np.zeros((9, 3)))
    refused(path, log_format({"gyro_x": {"column": 1, "variable": "m"}}), "drop 'variable:'")
    refused(path, log_format({"gyro_x": {"column": "wx"}}), "has 3 columns without names")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (header(shape=(10**15, 4)), "promises 1000000000000000 x 4 values of 8 bytes, 3200000000"),
        (header(shape=(10**30,)), "promises 1000000000000000000000000000000 values of 8 bytes"),
        (header(shape=(-4, 4)) + bytes(128), "corrupt data, or cut short|promises -4 x 4"),
        (
            header(shape=(4,)) + bytes(64),
            "32 bytes follow after the table .4 values.; expected one",
        ),
        (header(shape=(4,), descr="<f8" * 5000), "a header of 15053 bytes; expected at most 10000"),
        (header(shape=(4,), descr="|O") + b"cos\nsystem\n(S'false'\ntR.", "holds objects"),
        (header(shape=(4,), descr="|V0"), "holds raw bytes"),
        (b"\x93NUMPY\x09\x00" + bytes(100), "corrupt data|format version"),
        (b"\x93NUMPY", "corrupt data"),
        (b"", "the file is empty"),
        (b"plain text", "not a NumPy file"),
        (b"PK\x03\x04", "corrupt data, or cut short"),
    ],
)
def test_absurd_and_damaged_files(tmp_path: Path, data: bytes, message: str) -> None:
    path = tmp_path / "a.npy"
    path.write_bytes(data)
    refused(path, log_format({"gyro_x": {"column": 1}}, reader="numpy"), message)


def test_absent_file(tmp_path: Path) -> None:
    log = log_format({"gyro_x": {"column": 1}}, reader="numpy")
    refused(tmp_path / "none.npy", log, r"cannot be opened \(No such file")


def test_archives_in_archives_and_bombs(tmp_path: Path) -> None:
    inner, path = io.BytesIO(), tmp_path / "a.npz"
    with zipfile.ZipFile(inner, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("zeros", bytes(10**6))
    log = log_format({"gyro_x": {"column": 1}}, reader="numpy")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.npy", inner.getvalue())
    refused(path, log, "corrupt data, or cut short")
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.zip", inner.getvalue())
    refused(path, log, "no numeric array for gyro_x; the file has none")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", header(shape=(10**15,)) + bytes(10**6))
    refused(path, log, "promises 1000000000000000 values")
    data = path.read_bytes()
    size = (10**6 + 128).to_bytes(4, "little")
    path.write_bytes(data.replace(size, b"\xf0\xff\xff\xff"))
    refused(path, log, "a is stated to have 4294967280 bytes, which cannot result from")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_BZIP2) as archive:
        archive.writestr("a.npy", header(shape=(4,)) + bytes(32))
    refused(path, log, "a is packed by method 12; expected stored or deflated")


def test_a_checksum_is_compared(tmp_path: Path, rng: np.random.Generator) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, m=matrix(rng, 500))
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    refused(path, log_format({"gyro_x": {"column": 2}}), "corrupt data.*CRC")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Path, Any]]:
    folder = tmp_path_factory.mktemp("npy")
    values = matrix(np.random.default_rng(1), 60)
    log = log_format(MATRIX, time=SECONDS, reader="numpy")
    named = {name: source | {"variable": "m"} for name, source in MATRIX.items()}
    members = log_format(named, time={"column": "t", "unit": "ns"}, reader="numpy")
    stamps = np.arange(60) * STEP
    np.savez(folder / "b.npz", m=values, t=stamps)
    np.savez_compressed(folder / "c.npz", m=np.asfortranarray(values), t=stamps)
    records = np.zeros(60, [("t", "i8"), ("w", "f4", (4,))])
    fields = {"gyro_x": {"column": "w[2]"}}
    by_field = log_format(fields, time={"column": "t", "unit": "ns"}, reader="numpy")
    return [
        (saved(folder / "a.npy", values), log),
        (folder / "b.npz", members),
        (folder / "c.npz", members),
        (saved(folder / "d.npy", records), by_field),
    ]


def test_cut_files_are_refused(whole: list[tuple[Path, Any]]) -> None:
    for path, log in whole:
        assert cut_everywhere(path, log) == 0


@examples(60)
@given(damage=damages)
def test_damaged_files_never_crash(whole: list[tuple[Path, Any]], damage: Damage) -> None:
    for path, log in whole:
        survives(path.with_name("damaged"), damage(path.read_bytes()), log)
