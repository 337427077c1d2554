from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import imubench_pipeline as imu
from imubench_pipeline.noise.simulate import channel_rng, simulate

RATE = 10.0
GYRO = imu.NoiseModel(N=8.7e-5, K=3e-6)
ACCEL = imu.NoiseModel(N=8e-4, B=2e-4)
SENSOR = """
vendor: Example
model: Sensor 1
log:
  time: {column: t, unit: s}
  channels:
    gyro_x: {column: wx, unit: deg/s}
    accel_z: {column: az, unit: g}
"""


@pytest.fixture
def no_screen() -> Iterator[None]:
    import matplotlib as mpl

    mpl.use("agg")
    yield
    from matplotlib import pyplot as plt

    plt.close("all")


@pytest.fixture(scope="session")
def drop_zone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`logs/sensor_1/run.csv` and `sensors/sensor_1.yaml`: an hour, one knock."""
    folder = tmp_path_factory.mktemp("zone")
    samples = 36_000
    gyro, accel = (
        simulate(model, RATE, samples, channel_rng(5, name))
        for name, model in (("gyro", GYRO), ("accel", ACCEL))
    )
    gyro[20_000] += 0.1
    columns = np.arange(samples) / RATE, np.degrees(gyro), (accel + 9.80665) / 9.80665
    (folder / "logs/sensor_1").mkdir(parents=True)
    (folder / "sensors").mkdir()
    (folder / "sensors/sensor_1.yaml").write_text(SENSOR)
    np.savetxt(
        folder / "logs/sensor_1/run.csv",
        np.column_stack(columns),
        fmt="%.10g",
        delimiter=",",
        header="t,wx,az",
        comments="",
    )
    return folder


@pytest.fixture(scope="session")
def log(drop_zone: Path):
    return imu.read_log(
        drop_zone / "logs/sensor_1/run.csv", "sensor_1", sensors=drop_zone / "sensors"
    )


@pytest.fixture(scope="session")
def estimates(log):
    return imu.estimate(log)
