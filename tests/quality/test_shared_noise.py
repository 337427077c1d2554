"""Axes that share their noise are told; axes that share what is slow, or little, are not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from imubench_pipeline.recordings.quality.columns import check_columns
from imubench_pipeline.recordings.quality.summary import ColumnSummary
from imubench_pipeline.settings.quality import QualitySettings
from tests.conftest import few

LOW_PASS = butter(2, 0.1)


def told(log: dict[str, np.ndarray]) -> dict[str | None, float]:
    columns = {name: ColumnSummary() for name in log}
    for name, values in log.items():
        columns[name].add(values)
    findings = check_columns(columns, 100.0, QualitySettings(short=0))
    return {f.channel: f.value for f in findings if f.finding == "shared_noise"}


def axes(samples: int, rng: np.random.Generator, quantity: str = "gyro") -> dict[str, np.ndarray]:
    return {f"{quantity}_{axis}": rng.standard_normal(samples) for axis in "xyz"}


@pytest.mark.parametrize("filtered", [False, True])
def test_a_noise_that_is_common_to_two_axes(rng: np.random.Generator, filtered: bool) -> None:
    log = axes(60_000, rng)
    common = rng.standard_normal(60_000)
    log["gyro_x"] = log["gyro_x"] + common
    log["gyro_z"] = log["gyro_z"] - common
    if filtered:
        log = {name: lfilter(*LOW_PASS, values) for name, values in log.items()}
    found = told(log)
    assert found == pytest.approx({"gyro_x": -0.5, "gyro_z": -0.5}, abs=0.05)


def test_a_column_that_is_the_sum_of_all_axes(rng: np.random.Generator) -> None:
    log = axes(20_000, rng, "accel")
    log["accel_z"] = log["accel_x"] + log["accel_y"] + log["accel_z"]
    found = told(log)
    assert found == pytest.approx({f"accel_{axis}": 3**-0.5 for axis in "xyz"}, abs=0.05)


@pytest.mark.parametrize("samples", few([150, 3_000], [60_000]))
def test_axes_with_noise_of_their_own(rng: np.random.Generator, samples: int) -> None:
    for _ in range(5):
        log = axes(samples, rng)
        slow = np.cumsum(rng.standard_normal(samples)) / 30.0  # as a temperature moves them
        for change in (
            lambda values: values,
            lambda values, slow=slow: values + slow,
            lambda values: lfilter(*LOW_PASS, values),
            lambda values: np.round(values / 3.0),
        ):
            assert told({name: change(values) for name, values in log.items()}) == {}


def test_a_gyro_and_an_accelerometer_may_feel_the_same(rng: np.random.Generator) -> None:
    log = axes(20_000, rng)
    assert told({"gyro_x": log["gyro_x"], "accel_x": log["gyro_x"] + 0.5 * log["gyro_y"]}) == {}
