from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from imubench_pipeline.readers import RecordingError, read
from imubench_pipeline.sensor import LogFormat

MATRIX = {"gyro_x": {"column": 2, "unit": "deg/s"}, "gyro_z": {"column": 4, "unit": "deg/s"}}


def log_format(channels: dict[str, Any], **keys: Any) -> LogFormat:
    given = {"reader": "matlab", "rate": None if "time" in keys else "100 Hz"} | keys
    return LogFormat.model_validate({"channels": channels} | given)


def columns(path: Path, log: LogFormat) -> tuple[dict[str, np.ndarray], np.ndarray | None]:
    (file,) = read(path, log)
    batches = list(file.batches())
    joined = {name: np.concatenate([b.columns[name] for b in batches]) for name in file.sources}
    times = [b.time for b in batches if b.time is not None]
    return joined, np.concatenate(times) if times else None


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
    for _ in range(200):
        data = bytearray(whole)
        for place in rng.integers(512, 6000, 8):
            data[place] = rng.integers(256)
        path.write_bytes(data)
        try:
            columns(path, log_format(MATRIX))
        except RecordingError:
            rejected += 1
    assert rejected > 20


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
