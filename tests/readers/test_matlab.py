import struct
import zlib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
import scipy.sparse
from hypothesis import given

from imubench_pipeline.readers import RecordingError
from imubench_pipeline.readers.arrays import file as arrays
from imubench_pipeline.settings.sensor import LogFormat
from tests.readers.array_files import (
    FIRST,
    STEP,
    Damage,
    contents,
    cut_everywhere,
    damages,
    refused,
    survives,
)
from tests.readers.array_files import log_format as any_format
from tests.readers.damage import examples

MATRIX = {"gyro_x": {"column": 2, "unit": "deg/s"}, "gyro_z": {"column": 4, "unit": "deg/s"}}
SECONDS = {"column": 1, "unit": "s"}


def log_format(channels: dict[str, Any], **keys: Any) -> LogFormat:
    return any_format(channels, **{"reader": "matlab"} | keys)


def columns(path: Path, log: LogFormat) -> tuple[dict[str, np.ndarray], np.ndarray | None]:
    return contents(path, log)[:2]


def saved(tmp_path: Path, **variables: np.ndarray) -> Path:
    path = tmp_path / "a.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            file.create_dataset(name.replace("__", "/"), data=value, chunks=True)
    return path


@pytest.mark.parametrize("turned", [False, True])
def test_a_matrix_of_time_and_axes(tmp_path: Path, rng: np.random.Generator, turned: bool) -> None:
    matrix = rng.standard_normal((4, 300_000))
    matrix[0] = 5.0 + np.arange(300_000) / 100.0
    path = saved(tmp_path, data=matrix.T if turned else matrix)
    found, time = columns(path, log_format(MATRIX, time={"column": 1, "unit": "s"}))
    np.testing.assert_allclose(found["gyro_x"], matrix[1] * np.pi / 180)
    np.testing.assert_allclose(found["gyro_z"], matrix[3] * np.pi / 180)
    assert time is not None
    np.testing.assert_allclose(time, np.arange(300_000) / 100.0, atol=1e-9)


def test_vectors_by_name(tmp_path: Path) -> None:
    path = saved(tmp_path, imu__wx=np.arange(5.0), imu__ax=np.ones((1, 5)), other=np.zeros(3))
    channels = {
        "gyro_x": {"column": "imu/wx", "unit": "rad/s"},
        "accel_x": {"column": "imu/ax", "unit": "g"},
    }
    found, _ = columns(path, log_format(channels))
    assert found["gyro_x"].tolist() == [0, 1, 2, 3, 4]
    assert found["accel_x"].tolist() == [9.80665] * 5


@pytest.mark.parametrize(
    ("channels", "message"),
    [
        (
            {"gyro_x": {"column": 5, "unit": "rad/s", "variable": "m"}},
            "no column 5 for gyro_x; m has 4",
        ),
        ({"gyro_x": {"column": 1, "unit": "rad/s"}}, "several variables .m, v.; name the one"),
        ({"gyro_x": {"column": 1, "unit": "rad/s", "variable": "w"}}, "no variable 'w'.*has m, v"),
        ({"gyro_x": {"column": "m", "unit": "rad/s"}}, "'m' for gyro_x is a matrix of 4 columns"),
        (
            {
                "gyro_x": {"column": "v", "unit": "rad/s"},
                "gyro_y": {"column": 1, "variable": "m", "unit": "rad/s"},
            },
            "unequal length",
        ),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, channels: dict, message: str) -> None:
    path = saved(tmp_path, m=np.zeros((4, 100)), v=np.zeros(50))
    with pytest.raises(RecordingError, match=message):
        columns(path, log_format(channels))


def test_what_is_no_matlab_file(tmp_path: Path) -> None:
    path = tmp_path / "a.mat"
    path.write_bytes(b"MATLAB 5.0 MAT-file" + bytes(200))
    with pytest.raises(RecordingError, match=r"save it with -v7\.3"):
        columns(path, log_format(MATRIX))


def test_fuzzed_files_never_crash(tmp_path: Path, rng: np.random.Generator) -> None:
    whole = saved(tmp_path, data=rng.standard_normal((4, 3000))).read_bytes()
    path = tmp_path / "b.mat"
    rejected = 0
    for _ in range(60):
        data = bytearray(whole)
        for place in rng.integers(512, 6000, 8):
            data[place] = rng.integers(256)
        path.write_bytes(data)
        try:
            columns(path, log_format(MATRIX))
        except RecordingError:
            rejected += 1
    assert rejected > 6


def test_corrupt_inside(tmp_path: Path, rng: np.random.Generator) -> None:
    path = tmp_path / "a.mat"
    with h5py.File(path, "w") as file:
        file.create_dataset(
            "m", data=rng.standard_normal((4, 200_000)), chunks=(4, 1000), compression="gzip"
        )
    data = bytearray(path.read_bytes())
    data[len(data) // 2 : len(data) // 2 + 4000] = bytes(4000)
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=r"a\.mat: corrupt data"):
        columns(path, log_format(MATRIX))


# ------------------------------------------------------------------------- attributes of 7.3


def test_what_matlab_says_of_a_variable(tmp_path: Path) -> None:
    path = saved(tmp_path, text=np.full((1, 5), 97, np.uint16), none=np.zeros(2), m=np.eye(3))
    with h5py.File(path, "r+") as file:
        file["text"].attrs["MATLAB_class"] = np.bytes_("char")
        file["none"].attrs["MATLAB_empty"] = np.uint8(1)
        file["m"].attrs["MATLAB_class"] = np.bytes_("double")
        file["odd"] = np.zeros(3)
        file["odd"].attrs["MATLAB_class"] = "double"  # of variable length, as MATLAB never does
        file["complex"] = np.zeros(3, [("real", "f8"), ("imag", "f8")])
        file["sparse/data"] = np.zeros(3)
        file["sparse"].attrs["MATLAB_sparse"] = np.uint64(3)
        file["#refs#/a"] = np.zeros(3)
    for name, message in [
        ("text", "text for gyro_x holds text; expected numbers"),
        ("none", "none for gyro_x is empty"),
        ("odd", "odd for gyro_x has a damaged class"),
        ("complex", r"complex numbers; expected real numbers: save real\(\) of it"),
        ("sparse/data", "no variable 'sparse/data' for gyro_x; the file has m"),
        ("#refs#/a", "no variable '#refs#/a' for gyro_x; the file has m"),
    ]:
        refused(path, log_format({"gyro_x": {"column": 1, "variable": name}}), message)


def test_a_square_lies_as_matlab_shows_it(tmp_path: Path) -> None:
    square = np.arange(9.0).reshape(3, 3)
    log = log_format({"gyro_x": {"column": 2, "variable": "m"}})
    found, _ = columns(saved(tmp_path, m=square.T), log)
    assert found["gyro_x"].tolist() == [1, 4, 7]
    scipy.io.savemat(tmp_path / "b.mat", {"m": square})
    found, _ = columns(tmp_path / "b.mat", log)
    assert found["gyro_x"].tolist() == [1, 4, 7]


# ------------------------------------------------------------------------------- version 5


def variables(rng: np.random.Generator, rows: int) -> dict[str, Any]:
    matrix = rng.standard_normal((rows, 4))
    matrix[:, 0] = 5.0 + np.arange(rows) / 100.0
    return {
        "text": "some text",
        "m": matrix,
        "turned": matrix.T.astype(np.float32),
        "counts": np.arange(rows, dtype=np.int16),
        "imu": {"wx": np.arange(float(rows)), "raw": {"m": matrix[:, :2]}, "name": "x"},
        "t": FIRST.astype(np.int64) + np.arange(rows) * STEP,
        "rate": 100.0,
        "complex": np.array([1j, 2]),
        "cell": np.array([1, "a"], object),
        "cube": np.zeros((2, 3, 4)),
        "sparse": scipy.sparse.csc_array(np.eye(5)),
        "none": np.zeros((0, 0)),
        "several": np.zeros(3, [("x", "f8")]),
        "short": np.zeros(7),
    }


def version_5(path: Path, made: dict[str, Any], compressed: bool = False) -> Path:
    with path.open("wb") as file:
        scipy.io.savemat(file, made, do_compression=compressed)
    return path


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("rows_a_block", [7, 1 << 18])
def test_version_5(
    tmp_path: Path,
    rng: np.random.Generator,
    monkeypatch: pytest.MonkeyPatch,
    compressed: bool,
    rows_a_block: int,
) -> None:
    monkeypatch.setattr(arrays, "_MAX_BLOCK_ROWS", rows_a_block)
    made = variables(rng, 60)
    path = version_5(tmp_path / "a.mat", made, compressed)
    truth = scipy.io.loadmat(path)
    np.testing.assert_array_equal(truth["m"], made["m"])
    for column, variable, expected in [
        (2, "m", made["m"][:, 1]),
        (4, "turned", made["turned"][3]),
        ("counts", None, np.arange(60)),
        ("m[3]", None, made["m"][:, 2]),
        ("wx", "imu", np.arange(60)),
        ("imu/wx", None, np.arange(60)),
        (2, "imu/raw/m", made["m"][:, 1]),
    ]:
        channels = {
            "gyro_x": {"column": column, "variable": variable},
            "gyro_y": {"column": 4, "variable": "m"},
        }
        found, _ = columns(path, log_format(channels, reader=None))
        np.testing.assert_array_equal(found["gyro_x"], expected)
        np.testing.assert_array_equal(found["gyro_y"], made["m"][:, 3])


@pytest.mark.parametrize("compressed", [False, True])
def test_version_5_time(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator, compressed: bool
) -> None:
    monkeypatch.setattr(arrays, "_MAX_BLOCK_ROWS", 1 << 16)
    path = version_5(tmp_path / "a.mat", variables(rng, 70_000), compressed)
    channels = {"gyro_x": {"column": 2, "variable": "m"}, "gyro_y": {"column": 3, "variable": "m"}}
    _, time = columns(path, log_format(channels, time=SECONDS))
    np.testing.assert_allclose(time, np.arange(70_000) / 100.0, atol=1e-9)
    _, time, file = contents(path, log_format(channels, time={"column": "t", "unit": "ns"}))
    np.testing.assert_allclose(time, np.arange(70_000) / 100.0, rtol=1e-15)
    assert file.started == "2024-05-01T10:00:00.000"


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize(
    ("source", "message"),
    [
        ({"variable": "text"}, "text for gyro_x holds text; expected numbers"),
        ({"variable": "complex"}, "complex for gyro_x holds complex numbers"),
        ({"variable": "cell"}, "cell for gyro_x is a cell array; .* save cell2mat of it"),
        ({"variable": "cube"}, "cube for gyro_x has 3 dimensions .2 x 3 x 4."),
        ({"variable": "sparse"}, "sparse for gyro_x is sparse; .* save full.. of it"),
        ({"variable": "none"}, "none for gyro_x is empty .0 x 0.; expected at least one record"),
        ({"variable": "several"}, "several for gyro_x is an array of structures; expected one"),
        ({"variable": "imu"}, "no variable 'imu' for gyro_x; .*has m, turned, counts, imu/wx, im"),
        ({"variable": "imu/name"}, "imu/name for gyro_x holds text"),
        ({"variable": "m", "column": 5}, "no column 5 for gyro_x; m has 4 columns of 60 samples"),
        ({"column": "m"}, "'m' for gyro_x is a matrix of 4 columns; name one"),
        ({}, r"several variables \(m, turned, counts, imu/wx, imu/raw/m, t, short\); name the one"),
        ({"variable": "short"}, r"unequal length: \{'gyro_x': 7, 'gyro_y': 60\}"),
    ],
)
def test_what_is_wrong_in_version_5_is_named(
    tmp_path: Path,
    rng: np.random.Generator,
    compressed: bool,
    source: dict[str, Any],
    message: str,
) -> None:
    path = version_5(tmp_path / "a.mat", variables(rng, 60), compressed)
    channels = {"gyro_x": {"column": 1} | source, "gyro_y": {"column": 1, "variable": "m"}}
    refused(path, log_format(channels), message)


def element(order: str, kind: int, data: bytes) -> bytes:
    if 0 < len(data) <= 4:
        small = (kind, len(data)) if order == "<" else (len(data), kind)
        return struct.pack(f"{order}HH", *small) + data.ljust(4, b"\0")
    padded = data.ljust(-(-len(data) // 8) * 8, b"\0")
    return struct.pack(f"{order}II", kind, len(data)) + padded


def variable(
    order: str,
    name: str,
    sides: tuple[int, ...],
    values: bytes,
    kind: int = 6,
    flags: int = 0,
) -> bytes:
    """A variable as "MAT-File Format" describes it; its class is double unless said."""
    inside = element(order, 6, struct.pack(f"{order}II", kind | flags, 0))
    inside += element(order, 5, struct.pack(f"{order}{len(sides)}i", *sides))
    inside += element(order, 1, name.encode()) + values
    return struct.pack(f"{order}II", 14, len(inside)) + inside


def by_hand(path: Path, order: str, *parts: bytes) -> Path:
    mark = b"IM" if order == "<" else b"MI"
    header = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack(f"{order}H", 0x0100) + mark
    path.write_bytes(header + b"".join(parts))
    return path


@pytest.mark.parametrize("order", ["<", ">"])
def test_doubles_kept_as_small_integers_in_either_order(tmp_path: Path, order: str) -> None:
    wide = np.arange(10).astype(f"{order}u2")
    path = by_hand(
        tmp_path / "a.mat",
        order,
        variable(order, "m", (5, 2), element(order, 4, wide.tobytes())),
        variable(order, "a_longer_name", (3, 1), element(order, 2, b"\1\2\3")),
    )
    found, _ = columns(path, log_format({"gyro_x": {"column": 2, "variable": "m"}}))
    assert found["gyro_x"].tolist() == [5, 6, 7, 8, 9]
    found, _ = columns(path, log_format({"gyro_x": {"column": "a_longer_name"}}))
    assert found["gyro_x"].tolist() == [1, 2, 3]
    if order == "<":
        np.testing.assert_array_equal(scipy.io.loadmat(path)["m"], wide.reshape(2, 5).T)


def nested(levels: int) -> bytes:
    """A structure in a structure, and so on."""
    inside = variable("<", "", (1, 1), element("<", 9, bytes(8)))
    for _ in range(levels):
        fields = element("<", 5, struct.pack("<i", 2)) + element("<", 1, b"a\0")
        inside = variable("<", "m", (1, 1), fields + inside, kind=2)
    return inside


@pytest.mark.parametrize(
    ("part", "message"),
    [
        (variable("<", "m", (10**9, 10**6), element("<", 9, bytes(64))), "promises 1000000000 x 1"),
        (variable("<", "m", (-1, 4), element("<", 9, bytes(64))), r"dimensions \(-1, 4\)"),
        (variable("<", "m", (8, 1), element("<", 9, bytes(64))) + bytes(16), "of type 0 at byte"),
        (variable("<", "m", (8, 1), element("<", 99, bytes(64))), "an element of type 99 at"),
        (variable("<", "m", (8, 1), b""), "an element of 8 bytes with 0 left"),
        (variable("<", "m", (8, 1), bytes(8), kind=17), "corrupt data"),
        (variable("<", "m", (8, 1), bytes(8), kind=99), "m for gyro_x is of the unknown class 99"),
        (struct.pack("<II", 14, 2**31) + bytes(64), "cut short: a variable ends at byte"),
        (struct.pack("<II", 15, 8) + bytes(8), "corrupt data, or cut short .Error -3"),
        (nested(1000), "lies 16 structures deep"),
        (b"", "no numeric array for gyro_x; the file has none"),
        (
            variable("<", "m", (1, 1), element("<", 9, bytes(8))) * 2,
            "m occurs twice; expected one array of that name",
        ),
    ],
)
def test_absurd_variables(tmp_path: Path, part: bytes, message: str) -> None:
    path = by_hand(tmp_path / "a.mat", "<", part)
    refused(path, log_format({"gyro_x": {"column": 1}}), message)


def test_compressed_variables_that_expand_beyond_reason(tmp_path: Path) -> None:
    made = variable("<", "m", (10**8, 1), b"")
    length = len(made) - 8 + 8 + 8 * 10**8
    made = struct.pack("<II", 14, length) + made[8:] + struct.pack("<II", 9, 8 * 10**8)
    packed = zlib.compress(made + bytes(10**4))
    path = by_hand(tmp_path / "a.mat", "<", struct.pack("<II", 15, len(packed)) + packed)
    refused(path, log_format({"gyro_x": {"column": 1}}), "an element of 8000000.. bytes with")


def test_a_checksum_of_version_5_is_compared(tmp_path: Path, rng: np.random.Generator) -> None:
    path = version_5(tmp_path / "a.mat", {"m": rng.standard_normal((500, 4))}, compressed=True)
    data = path.read_bytes()
    path.write_bytes(data[:-1] + bytes([data[-1] ^ 1]))
    refused(path, log_format({"gyro_x": {"column": 1}}), "corrupt data.*incorrect data check")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("matlab")
    made = variables(np.random.default_rng(1), 60)
    path = folder / "c.mat"
    with h5py.File(path, "w", userblock_size=512) as file:
        keys: dict[str, Any] = {"chunks": (4, 20), "compression": "gzip"}
        file.create_dataset("m", data=made["m"].T, **keys)
        file.create_dataset("imu/raw/m", data=made["m"][:, :2].T)
        file["m"].attrs["MATLAB_class"] = np.bytes_("double")
    return [
        version_5(folder / "a.mat", made),
        version_5(folder / "b.mat", made, compressed=True),
        path,
    ]


EVERY = {
    "gyro_x": {"column": 2, "variable": "imu/raw/m"},
    "gyro_y": {"column": 3, "variable": "m"},
}
STAMPED = {"column": "m[1]", "unit": "s"}


def test_cut_files_are_refused(whole: list[Path]) -> None:
    log = log_format(EVERY, time=STAMPED)
    plain, compressed, hdf5 = whole
    # Version 5 says nowhere how many variables there are: it may be cut between two.
    assert cut_everywhere(plain, log) <= 2
    assert cut_everywhere(compressed, log) <= 2
    assert cut_everywhere(hdf5, log) == 0


@examples(50)
@given(damage=damages)
def test_damaged_files_never_crash(whole: list[Path], damage: Damage) -> None:
    for path in whole:
        data = damage(path.read_bytes())
        survives(path.with_name("damaged"), data, log_format(EVERY, time=STAMPED))
