"""One path of judgement: the library, `imubench analyse` and a run say the same of a log.

That a run has the numbers of `imubench analyse`: tests/workflow.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import imubench_pipeline as imu
from imubench_pipeline.model.recordings import DoubtRow, FindingRow
from imubench_pipeline.run.analysis.chain import Analysis
from imubench_pipeline.run.analysis.compilation import Compilation
from imubench_pipeline.run.analysis.project import Stated, lay_out
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.typing import Array
from tests.conftest import few

RATE, SAMPLES = 50.0, 30_000
SENSOR = {
    "vendor": "Example",
    "model": "Sensor 1",
    "log": {
        "reader": "csv",
        "rate": f"{RATE:g} Hz",
        "channels": {"gyro_x": {"column": "wx", "unit": "rad/s"}},
    },
    "datasheet": {"gyro": {"noise_density": {"value": 0.005, "unit": "deg/s/sqrt(Hz)"}}},
}


def white(rng: np.random.Generator) -> Array:
    return np.asarray(1e-4 * np.sqrt(RATE) * rng.standard_normal(SAMPLES))


def walk(rng: np.random.Generator) -> Array:
    return np.asarray(white(rng) + np.cumsum(3e-5 / np.sqrt(RATE) * rng.standard_normal(SAMPLES)))


def sine(rng: np.random.Generator) -> Array:
    return np.asarray(white(rng) + 2e-3 * np.sin(2 * np.pi * 3.1 * np.arange(SAMPLES) / RATE))


def step(rng: np.random.Generator) -> Array:
    return np.asarray(white(rng) + 3e-4 * (np.arange(SAMPLES) > SAMPLES // 2))


def knocks(rng: np.random.Generator) -> Array:
    samples = white(rng)
    samples[[5_000, 17_000]] += 0.1
    return samples


def smoothed(rng: np.random.Generator) -> Array:
    return np.asarray(np.convolve(white(rng), np.ones(4) / 4, "same"))


def held(rng: np.random.Generator) -> Array:
    return np.repeat(white(rng)[::5], 5)


def coarse(rng: np.random.Generator) -> Array:
    return np.asarray(np.round(white(rng) / 1e-3) * 1e-3)


def growing(rng: np.random.Generator) -> Array:
    return np.asarray(white(rng) * np.linspace(1.0, 1.5, SAMPLES))


def in_another_unit(rng: np.random.Generator) -> Array:
    return np.asarray(walk(rng) * 180.0 / np.pi + 3.0)


LOGS: Mapping[str, Callable[[np.random.Generator], Array]] = {
    make.__name__: make
    for make in (sine, in_another_unit, smoothed, white, walk, step, knocks, held, coarse, growing)
}


def written(folder: Path, name: str) -> Path:
    path = folder / f"{name}.csv"
    samples = LOGS[name](np.random.default_rng(len(name)))
    np.savetxt(path, samples, fmt="%.17g", header="wx", comments="")
    return path


@pytest.mark.parametrize("name", few(list(LOGS)[:1], list(LOGS)[1:]))
def test_the_library_says_of_a_log_what_analyse_says(tmp_path: Path, name: str) -> None:
    log = written(tmp_path, name)
    sensor = tmp_path / "sensor_1.yaml"
    sensor.write_text(yaml.safe_dump(SENSOR))
    project = tmp_path / "project"
    project.mkdir()
    plan = Plan(lay_out([log], sensor, Stated(), [tmp_path], project))
    with Compilation(print) as compiling:
        tables = Analysis(plan, compiling, 1, print).estimates()
    drop_zone = tmp_path / "sensor_1"  # the folder of a log names its sensor
    drop_zone.mkdir()
    read = imu.read_log(log.rename(drop_zone / log.name), sensor=sensor)
    estimates = imu.estimate(read)

    recommended = [row for row in tables["parameters"].to_pylist() if row["recommended"]]
    assert estimates.to_pandas().replace({np.nan: None}).to_dict("records") == [
        {key: value for key, value in row.items() if key != "recommended"} for row in recommended
    ]
    names = [field.name for field in fields(Finding)]
    assert [{key: getattr(f, key) for key in names} for f in estimates.findings] == [
        {key: row[key] for key in names} for row in FindingRow.rows_of(tables["findings"])
    ]
    assert list(estimates.doubts) == DoubtRow.rows_of(tables["doubts"])


def test_copies_of_a_log_have_the_same_limits(tmp_path: Path) -> None:
    log = written(tmp_path, "walk")
    copy = log.with_name("another name.csv")
    copy.write_bytes(log.read_bytes())
    form = SENSOR["log"]
    first, second = (imu.estimate(imu.read_log(path, sensor=form)) for path in (log, copy))
    one, two = (each.to_pandas().drop(columns="recording") for each in (first, second))
    assert one.equals(two)


@pytest.mark.release
def test_two_seeds_give_the_same_limits() -> None:
    samples = walk(np.random.default_rng(4))
    first, second = (imu.estimate(samples, RATE, seed=seed)["gyro_x"] for seed in (1, 2))
    for (_, name, one), (_, _, two) in zip(first.components(), second.components(), strict=True):
        assert one.status == two.status, name
        for limit in ("value", "lower", "upper"):
            a, b = getattr(one, limit), getattr(two, limit)
            assert (a is None) == (b is None)
            if a is not None:
                assert a == pytest.approx(b, rel=0.06), (name, limit)  # of random draws


@pytest.mark.parametrize("channels", few([["gyro_y"]], [None, "gyro", "accel", "accel_z"]))
def test_an_array_of_one_dimension_is_one_channel(channels: Any) -> None:
    estimates = imu.estimate(white(np.random.default_rng(1)), rate=RATE, channels=channels)
    names = {None: "gyro_x", "gyro": "gyro_x", "accel": "accel_x"}
    expected = names.get(channels, channels) if not isinstance(channels, list) else channels[0]
    assert list(estimates) == [expected]
    assert estimates[expected]["N"].value == pytest.approx(1e-4, rel=0.03)
