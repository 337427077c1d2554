"""The exports of phone apps: an archive or a folder of one CSV file a sensor."""

from __future__ import annotations

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.readers import LogFile, read
from tests.readers.text_logs import log_format

EPOCH = 1_727_600_000_000_000_000
SIGNS = {
    "comma, decimal point": (",", "."),
    "tabulator, decimal point": ("\t", "."),
    "semicolon, decimal point": (";", "."),
    "tabulator, decimal comma": ("\t", ","),
    "semicolon, decimal comma": (";", ","),
}
"""The ways of writing CSV that phyphox offers."""


def scientific(figure: float) -> str:
    """Write a figure as phyphox does: 1.234500000E-2."""
    mantissa, exponent = f"{figure:.9e}".split("e")
    return f"{mantissa}E{int(exponent)}"


def phyphox(
    gyro: np.ndarray, accel: np.ndarray, delimiter: str = ",", decimal: str = "."
) -> dict[str, str]:
    files = {}
    for name, title, unit, data in (
        ("Accelerometer", "Acceleration", "m/s^2", accel),
        ("Gyroscope", "Gyroscope", "rad/s", gyro),
    ):
        heads = ['"Time (s)"', *(f'"{title} {axis} ({unit})"' for axis in "xyz")]
        lines = [delimiter.join(heads)]
        for row in data:
            lines.append(delimiter.join(scientific(x).replace(".", decimal) for x in row))
        files[f"{name}.csv"] = "\n".join(lines) + "\n"
    files["meta/device.csv"] = '"property","value"\n"version","1.2.0"\n'
    files["meta/time.csv"] = (
        '"event","experiment time","system time","system time text"\n'
        '"START",0.000000000E0,1759650000.000,"2025-10-05 10:20:00.000 UTC+02:00"\n'
    )
    return files


def sensor_logger(gyro: np.ndarray, accel: np.ndarray) -> dict[str, str]:
    files = {"Metadata.csv": "version,device name\n3,Phone\n", "Annotation.csv": "time,text\n"}
    for name, data in (("TotalAcceleration", accel), ("Gyroscope", gyro)):
        lines = ["time,seconds_elapsed,z,y,x"]
        for t, x, y, z in data:
            stamp = EPOCH + round(t * 1e9)
            lines.append(f"{stamp},{float(t)!r},{float(z)!r},{float(y)!r},{float(x)!r}")
        files[f"{name}.csv"] = "\n".join(lines) + "\n"
    return files


def placed(tmp_path: Path, files: dict[str, str], packed: bool) -> Path:
    if not packed:
        for name, text in files.items():
            path = tmp_path / "run" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        return tmp_path / "run"
    held = io.BytesIO()
    with zipfile.ZipFile(held, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    (tmp_path / "run.zip").write_bytes(held.getvalue())
    return tmp_path / "run.zip"


def channels(files: dict[str, str], form: str) -> dict[str, Any]:
    return {
        f"{quantity}_{axis}": {
            "column": form.format(title=title, axis=axis, unit=unit),
            "unit": unit,
            "file": files[quantity],
        }
        for quantity, title, unit in (
            ("gyro", "Gyroscope", "rad/s"),
            ("accel", "Acceleration", "m/s^2"),
        )
        for axis in "xyz"
    }


def check(file: LogFile, quantity: str, truth: np.ndarray, rtol: float) -> None:
    batches = list(file.batches())
    time = np.concatenate([batch.time for batch in batches if batch.time is not None])
    np.testing.assert_allclose(time, truth[:, 0] - truth[0, 0], rtol=1e-9, atol=2e-9)
    for column, axis in enumerate("xyz", start=1):
        found = np.concatenate([batch.columns[f"{quantity}_{axis}"] for batch in batches])
        np.testing.assert_allclose(found, truth[:, column], rtol=rtol)
    assert file.findings == []


@pytest.fixture
def truth(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Time and three axes of gyro and accelerometer, which phones sample at different rates."""
    gyro = np.column_stack([0.0135 + np.arange(300) * 0.0025, rng.standard_normal((300, 3))])
    accel = np.column_stack([0.0142 + np.arange(200) * 0.005, rng.standard_normal((200, 3))])
    return gyro, accel


@pytest.mark.parametrize("packed", [True, False])
@pytest.mark.parametrize("way", SIGNS)
def test_phyphox(
    tmp_path: Path, truth: tuple[np.ndarray, np.ndarray], way: str, packed: bool
) -> None:
    path = placed(tmp_path, phyphox(*truth, *SIGNS[way]), packed)
    names = {"gyro": "Gyroscope.csv", "accel": "Accelerometer.csv"}
    log = log_format(
        channels(names, "{title} {axis} ({unit})"), time={"column": "Time (s)", "unit": "s"}
    )
    accel, gyro = read(path, log)
    check(gyro, "gyro", truth[0], 1e-9)
    check(accel, "accel", truth[1], 1e-9)


@pytest.mark.parametrize("packed", [True, False])
def test_phyphox_with_one_sensor_needs_no_file_name(
    tmp_path: Path, truth: tuple[np.ndarray, np.ndarray], packed: bool
) -> None:
    files = phyphox(*truth)
    files["Raw Data.csv"] = files.pop("Gyroscope.csv")
    del files["Accelerometer.csv"]
    wanted = {
        f"gyro_{axis}": {"column": f"Gyroscope {axis} (rad/s)", "unit": "rad/s"} for axis in "xyz"
    }
    log = log_format(wanted, time={"column": "Time (s)", "unit": "s"})
    (gyro,) = read(placed(tmp_path, files, packed), log)
    assert gyro.path.name == "Raw Data.csv"
    check(gyro, "gyro", truth[0], 1e-9)


@pytest.mark.parametrize("packed", [True, False])
@pytest.mark.parametrize("within", ["", "2024-09-29_08-53-20/"])
@pytest.mark.parametrize("column", ["time", "seconds_elapsed"])
def test_sensor_logger(
    tmp_path: Path, truth: tuple[np.ndarray, np.ndarray], column: str, within: str, packed: bool
) -> None:
    files = {within + name: text for name, text in sensor_logger(*truth).items()}
    path = placed(tmp_path, files, packed)
    names = {"gyro": "Gyroscope.csv", "accel": "TotalAcceleration.csv"}
    time = {"column": column, "unit": "ns" if column == "time" else "s"}
    gyro, accel = read(path, log_format(channels(names, "{axis}"), time=time))
    check(gyro, "gyro", truth[0], 1e-15)
    check(accel, "accel", truth[1], 1e-15)
    assert gyro.started == ("2024-09-29T08:53:20.013" if column == "time" else None)
