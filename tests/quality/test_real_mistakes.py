"""Real logs with a mistake in them: each is found, and makes them unfit; without it they are fit.

The mistake is in the sensor file, or in the values, the rest is as it was recorded.
"""

from __future__ import annotations

import gzip
import math
from collections.abc import Callable, Mapping
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from imubench_pipeline.datasheets.plausibility import implausible_of
from imubench_pipeline.model.recordings import FindingRow
from imubench_pipeline.recordings.fitness import derive_doubts, judge_fitness
from imubench_pipeline.recordings.ingest import ingest
from imubench_pipeline.recordings.recording import LogNames
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import CHANNELS, RecordingNotes, Sensor
from imubench_pipeline.settings.validation import parse
from tests.conftest import catalogue, few

NAMES = LogNames(sensor="s", device="d", recording="r")
CATALOGUE = catalogue()
ROWS = 30_000

Rows = list[FindingRow]


@cache
def first_rows(path: Path) -> np.ndarray:
    with gzip.open(path, "rt") as file:
        return np.loadtxt(islice(file, 1, ROWS + 1), delimiter=",")


@pytest.fixture
def adis16405(shared: Path) -> np.ndarray:
    """The first five minutes of a real log: three gyros in °/s, three accelerometers in g."""
    return first_rows(shared / "logs/adis16405/imu1.csv.gz").copy()


def written(folder: Path, values: np.ndarray, names: tuple[str, ...] = CHANNELS) -> Path:
    path = folder / "log.csv"
    np.savetxt(path, values, "%.9g", ",", header=",".join(names), comments="")
    return path


def sensor(name: str, **log: Any) -> Sensor:
    """Return a shipped sensor whose log is written otherwise."""
    data = CATALOGUE[name].model_dump(exclude_unset=True)
    data["log"] |= log
    return parse(Sensor, data, name)


def in_units(gyro: str, accel: str) -> dict[str, Any]:
    return {
        name: {"column": name, "unit": gyro if name.startswith("gyro") else accel}
        for name in CHANNELS
    }


def findings(path: Path, of: Sensor, folder: Path) -> Rows:
    """Return what is found of a log, by the ingest and beside the datasheet."""
    kept = ingest(path, of.log, RecordingNotes(), QualitySettings(), folder / "kept", NAMES)
    quality = kept.quality()
    return quality.findings + implausible_of(quality, of)


def unfit(found: Rows) -> dict[str, dict[str | None, float]]:
    """Return channels and factors of the doubts that make a recording unfit, by finding."""
    doubted = list(derive_doubts(found, [], []))
    serious: dict[str, dict[str | None, float]] = {}
    for one in doubted:
        if one.fitness == "unfit":
            serious.setdefault(one.code, {})[one.channel] = one.factor or 0.0
    assert (judge_fitness(doubted) == "unfit") == bool(serious)
    return serious


@pytest.mark.parametrize(
    ("name", "place"), few([("mpu6050", "mpu6050")], [("cats_tag", "cats/day1.csv.gz")])
)
def test_the_logs_as_they_are(shared: Path, tmp_path: Path, name: str, place: str) -> None:
    found = findings(shared / "logs" / place, CATALOGUE[name], tmp_path)
    assert unfit(found) == {}
    assert not {"gravity_norm", "repeated_samples"} & {row["finding"] for row in found}


def test_the_log_without_a_mistake(adis16405: np.ndarray, tmp_path: Path) -> None:
    found = findings(written(tmp_path, adis16405), CATALOGUE["adis16405"], tmp_path)
    assert {row["finding"] for row in found} <= {"quantised", "knocks", "short_recording"}


@pytest.mark.parametrize(("seconds", "motion"), [(0.15, False), (2.0, True)])
def test_a_knock_is_no_motion(
    adis16405: np.ndarray, tmp_path: Path, seconds: float, motion: bool
) -> None:
    samples = np.arange(round(100 * seconds))
    adis16405[9000 : 9000 + len(samples), 0] += 40.0 * np.sin(np.pi * samples / len(samples))
    found = findings(written(tmp_path, adis16405), CATALOGUE["adis16405"], tmp_path)
    codes = {row["finding"] for row in found if row["channel"] == "gyro_x"}
    assert ("motion" in codes) is motion
    assert motion or "knocks" in codes
    assert (unfit(found) != {}) is motion


UNITS = [
    ("rad/s", "g", {"gyro": 180 / math.pi}),
    ("mdeg/s", "g", {"gyro": 1e-3}),
    ("deg/s", "m/s^2", {"accel": 1 / 9.80665}),
    ("deg/s", "mg", {"accel": 1e-3}),
    ("deg/s", "ug", {"accel": 1e-6}),
]


@pytest.mark.parametrize(("gyro", "accel", "factors"), few(UNITS[:1], UNITS[1:]))
def test_a_log_in_another_unit_than_the_sensor_file_states(
    adis16405: np.ndarray, tmp_path: Path, gyro: str, accel: str, factors: Mapping[str, float]
) -> None:
    path = written(tmp_path, adis16405)
    of = sensor("adis16405", channels=in_units(gyro, accel))
    serious = unfit(findings(path, of, tmp_path))
    (quantity, factor), = factors.items()  # fmt: skip
    assert serious == {
        "suspicious_unit": {f"{quantity}_{axis}": pytest.approx(1 / factor) for axis in "xyz"}
    }


@pytest.mark.release  # the test before this has the same doubt every day
def test_a_log_in_radians_that_the_sensor_file_takes_for_degrees(
    adis16405: np.ndarray, tmp_path: Path
) -> None:
    path = written(tmp_path, adis16405 * ([math.radians(1)] * 3 + [1] * 3))
    serious = unfit(findings(path, CATALOGUE["adis16405"], tmp_path))
    assert serious == {
        "suspicious_unit": {f"gyro_{axis}": pytest.approx(57.29578) for axis in "xyz"}
    }


@pytest.mark.release
def test_a_log_on_a_slow_turntable(adis16405: np.ndarray, tmp_path: Path) -> None:
    adis16405[:, 2] -= 15.0  # °/s about the vertical
    path = written(tmp_path, adis16405)
    serious = unfit(findings(path, CATALOGUE["adis16405"], tmp_path))
    assert set(serious) == {"turning"} and set(serious["turning"]) == {"gyro_z"}


@pytest.mark.release
def test_a_log_that_tilts_steadily(adis16405: np.ndarray, tmp_path: Path) -> None:
    speed = math.radians(0.1)
    angle = speed * np.arange(len(adis16405)) / 100.0
    values = adis16405.copy()  # it turns about y, by less than the offset of the gyro there
    values[:, 3] = adis16405[:, 3] * np.cos(angle) - adis16405[:, 5] * np.sin(angle)
    values[:, 5] = adis16405[:, 5] * np.cos(angle) + adis16405[:, 3] * np.sin(angle)
    found = findings(written(tmp_path, values), CATALOGUE["adis16405"], tmp_path)
    assert set(unfit(found)) == {"turning", "motion"}
    (turn,) = (row for row in found if row["finding"] == "turning")
    assert turn["value"] == pytest.approx(speed, rel=0.05)
    assert turn["detail"].startswith("Gravity turns relative to the sensor by ")
    assert "°, steadily at 0.1 °/s" in turn["detail"]


@pytest.mark.release
@pytest.mark.parametrize("unit", few(["ms"], ["us", "ns"]))
def test_stamps_in_another_unit_than_the_sensor_file_states(
    shared: Path, tmp_path: Path, unit: str
) -> None:
    data = CATALOGUE["mpu6050"].model_dump(exclude_unset=True)["log"]
    of = sensor("mpu6050", time=data["time"] | {"unit": unit})
    found = findings(shared / "logs/mpu6050", of, tmp_path)
    assert set(unfit(found)) == {"rate_implausible"}
    factor = {"ms": 1e3, "us": 1e6, "ns": 1e9}[unit]
    (row,) = (row for row in found if row["finding"] == "rate_implausible")
    assert row["value"] == factor
    (of_noise,) = (one for one in derive_doubts([row], [], []) if "N" in one.parameters)
    assert of_noise.factor == pytest.approx(math.sqrt(factor))


@pytest.mark.release
@pytest.mark.parametrize("clock", few(["held_samples"], ["repeated_samples"]))
def test_a_log_that_is_read_faster_than_it_samples(
    adis16405: np.ndarray, tmp_path: Path, rng: np.random.Generator, clock: str
) -> None:
    # Its accelerometers have steps as large as their noise, and repeat a quarter by chance.
    regular = (np.arange(ROWS) * 0.75).astype(int)
    at_random = np.sort(rng.integers(0, ROWS, ROWS))
    rows = regular if clock == "held_samples" else at_random
    path = written(tmp_path, adis16405[rows])
    found = findings(path, CATALOGUE["adis16405"], tmp_path)
    repeated = {row["channel"] for row in found if row["finding"] == clock}
    assert repeated == set(CHANNELS)
    assert unfit(found) == {}


# ---------------------------------------------------------------------- units in the log


def of_header(folder: Path, values: np.ndarray) -> tuple[Path, dict[str, Any]]:
    names = tuple(f"{name} ({'rad/s' if name[0] == 'g' else 'g'})" for name in CHANNELS)
    channels = in_units("deg/s", "g")
    for place, source in enumerate(channels.values()):
        source["column"] = place + 1
    return written(folder, values, names), {"channels": channels}


def of_attribute(folder: Path, values: np.ndarray) -> tuple[Path, dict[str, Any]]:
    path = folder / "log.h5"
    channels = in_units("deg/s", "g")
    with h5py.File(path, "w") as file:
        for place, quantity in enumerate(("gyro", "accel")):
            file[quantity] = values[:, 3 * place : 3 * place + 3]
            file[quantity].attrs["units"] = ("rad/s", "g")[place]
    for place, source in enumerate(channels.values()):
        source |= {"column": place % 3 + 1, "variable": ("gyro", "accel")[place // 3]}
    return path, {"reader": "hdf5", "channels": channels}


@pytest.mark.parametrize(
    ("writing", "where"),
    few(
        [(of_header, "(the name 'gyro_x (rad/s)')")],
        [(of_attribute, "(an attribute of gyro)")],
    ),
)
def test_a_unit_in_the_log_that_the_sensor_file_contradicts(
    adis16405: np.ndarray, tmp_path: Path, writing: Callable[..., Any], where: str
) -> None:
    path, log = writing(tmp_path, adis16405)
    found = findings(path, sensor("adis16405", **log), tmp_path)
    # The figures are in °/s, as the sensor file says: what is doubted is only what is said.
    assert unfit(found) == {
        "unit_contradicts": {f"gyro_{axis}": pytest.approx(57.29578) for axis in "xyz"}
    }
    first = next(row["detail"] for row in found if row["finding"] == "unit_contradicts")
    assert f"states rad/s for gyro x {where}" in first
    assert "The sensor file states deg/s (log.channels.gyro_x.unit)" in first
