"""Spread of turn-on biases against the printed repeatability."""

import math
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.model.estimates import FixedBiasRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.navigation.repeatability import repeatability_rows
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.settings.validation import parse
from imubench_pipeline.tables.files import build
from tests.rows import typed
from tests.test_configuration import SENSOR

HOUR = math.pi / 180 / 3600
PRINTED = {"value": 4, "unit": "deg/h", "kind": "typ"}
SENSORS = {
    "s": parse(
        Sensor,
        SENSOR
        | {"datasheet": {"gyro": {"bias_repeatability": PRINTED},
                         "accel": {"bias_repeatability": {"value": 1, "unit": "mg"}}}},
        "s.yaml",
    )
}  # fmt: skip


def rows(
    biases: list[float], cycled: list[bool | None], channel: str = "gyro_x", **about: Any
) -> list[dict[str, Any]]:
    names = [f"r{number}" for number in range(len(biases))]
    recordings = [
        {"sensor": "s", "recording": name, "device": "1", "decides": True, "power_cycled": one}
        | about
        for name, one in zip(names, cycled, strict=True)
    ]
    fixed = [
        {"sensor": "s", "recording": name, "channel": channel, "value": bias, "unit": "rad/s"}
        for name, bias in zip(names, biases, strict=True)
    ]
    fixed_biases, turn_ons = typed(FixedBiasRow, fixed), typed(RecordingRow, recordings)
    found = list(repeatability_rows(fixed_biases, turn_ons, SENSORS, 0.1))
    made: list[dict[str, Any]] = build("repeatability", found).to_pylist()
    return made


def test_the_spread_of_turn_ons_is_compared() -> None:
    # 1, 3 and 5 °/h: s = 2 °/h, and chi-squared of 2 degrees of freedom is 7.378 and 0.0506
    (row,) = rows([1 * HOUR, 3 * HOUR, 5 * HOUR], [None, True, True])
    assert row["measured"] == pytest.approx(2 * HOUR)
    assert row["lower"] == pytest.approx(2 * HOUR * math.sqrt(2 / 7.37776), rel=1e-5)
    assert row["upper"] == pytest.approx(2 * HOUR * math.sqrt(2 / 0.0506356), rel=1e-5)
    assert (row["printed"], row["delta"]) == (4.0, pytest.approx(-0.5))
    assert (row["power_cycled"], row["recordings"], row["verdict"]) == ("yes", 3, "not sure")
    assert "power" not in "; ".join(row["reasons"])
    many = np.random.default_rng(1).normal(0.0, 10 * HOUR, 60).tolist()
    (row,) = rows(many, [True] * 60)
    assert row["verdict"] == "worse than typ"


def test_what_is_not_known_of_the_power_is_a_condition() -> None:
    (row,) = rows([0.0, HOUR, 2 * HOUR], [True, True, None])
    assert row["power_cycled"] == "yes"  # the first recording may be the one not known
    (row,) = rows([0.0, HOUR, 2 * HOUR], [None, True, None])
    assert row["power_cycled"] == "unknown"
    assert "assumes that the power was off between" in "; ".join(row["reasons"])


def test_recordings_of_one_turn_on_do_not_count_twice() -> None:
    (row,) = rows([0.0, 50 * HOUR, 2 * HOUR], [None, False, True])
    assert row["recordings"] == 2
    assert row["measured"] == pytest.approx(math.sqrt(2) * HOUR)
    assert rows([0.0, HOUR], [None, False]) == []


def test_unfit_recordings_and_other_devices_are_left_out() -> None:
    assert rows([0.0, HOUR], [None, True], decides=False) == []
    (row,) = rows([9.8, 9.9], [None, True], channel="accel_z")
    assert row["measured"] is None and row["verdict"] == "not measured"
    assert "gravity" in "; ".join(row["reasons"])
