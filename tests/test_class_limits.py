"""The limits of classes, against figures by hand, and the command that lists the catalogue."""

import math
from pathlib import Path
from typing import Any

import pytest

from imubench_pipeline.datasheets.class_limits import (
    FIGURES,
    derive_class_limits,
    read_class_limits,
    read_sigma,
    write_class_limits,
)
from imubench_pipeline.run.cli import main
from imubench_pipeline.settings.sensor import Sensor, read_sensors
from tests.conftest import PROJECT

DEG = math.pi / 180.0
LOG = {
    "time": {"column": "t", "unit": "s"},
    "channels": {"gyro_x": {"column": "x", "unit": "deg/s"}},
}
CATALOGUE = read_sensors(PROJECT / "config/sensors")


def sensor(gyro: dict[str, Any] | None = None, **about: Any) -> Sensor:
    sheet = {"document": "a", "source": "primary", "gyro": gyro or {}, "accel": None}
    known = {"vendor": "v", "model": "m", "grade": "consumer", "log": LOG, "datasheet": sheet}
    return Sensor.model_validate(known | about)


@pytest.mark.parametrize(
    ("name", "figure", "sigma"),
    [
        ("offset", {"value": 3, "unit": "deg/s", "kind": "typ"}, 3 * DEG),
        ("offset", {"value": 3, "unit": "deg/s", "kind": "max"}, DEG),
        ("offset", {"value": [-2, 3], "unit": "deg/s", "kind": "range"}, 3 * DEG / math.sqrt(3)),
        ("offset", [{"value": 9, "unit": "deg/s", "kind": "max"},
                    {"value": 1, "unit": "deg/s", "kind": "typ"}], DEG),
        ("offset", {"value": {"xy": 1, "z": 2}, "unit": "deg/s"}, 2 * DEG),
        ("misalignment", {"value": 0.5, "unit": "deg", "kind": "max"}, 0.5 * DEG / 3),
        ("cross_axis", {"value": 2, "unit": "%"}, 0.02),
        ("scale_factor_temperature", {"value": 0.03, "unit": "%/K"}, 3e-4),
        ("rate_random_walk", {"value": None, "place": "table 1"}, None),
    ],
)  # fmt: skip
def test_a_figure_counts_as_one_standard_deviation(
    name: str, figure: Any, sigma: float | None
) -> None:
    found = read_sigma(sensor({name: figure}), "gyro", name)
    assert found is None if sigma is None else found == pytest.approx(sigma)


def test_totals_over_temperature_bound_the_coefficient() -> None:
    total = {"temperature_total": {"value": 3, "unit": "deg/s", "kind": "max"}}
    rms = {"temperature_rms": {"value": 0.1, "unit": "deg/s"}}
    span = {"temperature_range": ["-40 degC", "60 degC"]}
    name = "temperature_coefficient"
    # The maximum of 3 deg/s at 50 K from the middle, of three standard deviations.
    assert read_sigma(sensor(total, **span), "gyro", name) == pytest.approx(DEG / 50)
    assert read_sigma(sensor(rms, **span), "gyro", name) == pytest.approx(
        0.1 * DEG * math.sqrt(12) / 100
    )
    assert read_sigma(sensor(total), "gyro", name) == pytest.approx(2 * DEG / 125)
    own = {"temperature_coefficient": {"value": 0.01, "unit": "deg/s/K"}}
    assert read_sigma(sensor(total | own), "gyro", name) == pytest.approx(0.01 * DEG)


def test_a_density_of_unknown_side_counts_as_one_sided() -> None:
    density = {"noise_density": {"value": 0.01, "unit": "deg/s/sqrt(Hz)"}}
    assert read_sigma(sensor(density), "gyro", "N") == pytest.approx(0.01 * DEG / math.sqrt(2))


def test_limits_are_of_the_sensors_of_a_class_that_are_sold() -> None:
    def of(value: float, **about: Any) -> Sensor:
        return sensor({"offset": {"value": value, "unit": "deg/s"}}, **about)

    sensors = {"a": of(1), "b": of(4), "c": of(2), "board": of(99, sold=False), "silent": sensor()}
    sensors |= {"t": of(0.1, grade="tactical"), "unknown": of(50, grade=None)}
    limits = derive_class_limits(sensors)
    assert [(one.grade, one.figure, one.names) for one in limits] == [
        ("consumer", "offset", ("a", "b", "c")),
        ("tactical", "offset", ("t",)),
    ]
    consumer, tactical = limits
    assert (consumer.median, consumer.worst) == pytest.approx((2 * DEG, 4 * DEG))
    assert consumer.spread == pytest.approx(math.log(2)) and tactical.spread is None
    assert consumer.unit == "rad/s"


def test_the_shipped_limits_are_of_the_shipped_catalogue(tmp_path: Path) -> None:
    file = tmp_path / "limits.csv"
    folder = str(PROJECT / "config/sensors")
    assert main(["sensors", "--sensors", folder, "--class-limits", str(file)]) == 0
    assert read_class_limits(file) == read_class_limits()
    assert file.read_text() == write_class_limits(derive_class_limits(CATALOGUE))
    assert {one.figure for one in read_class_limits()} <= set(FIGURES)


def said(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main(["sensors", *arguments, "--sensors", str(PROJECT / "config/sensors")]) == 0
    return capsys.readouterr().out


def test_the_catalogue_is_listed_and_searched(capsys: pytest.CaptureFixture[str]) -> None:
    every = said(capsys)
    assert all(name in every for name in CATALOGUE) and "°/√h" in every
    assert "rad/s/√Hz" in said(capsys, "--units", "si")
    found = said(capsys, "bmi")
    assert "bmi088" in found and "adis16405" not in found


def test_one_sensor_is_shown_with_units_and_sources(capsys: pytest.CaptureFixture[str]) -> None:
    text = said(capsys, "BMI088")
    assert text.startswith("bmi088: Bosch Sensortec BMI088")
    assert "noise_density: 0.014 deg/s/sqrt(Hz) typ" in text
    assert "bias_instability: not published" in text


def test_a_product_finds_its_sensor_and_a_wrong_name_is_answered(
    capsys: pytest.CaptureFixture[str],
) -> None:
    text = said(capsys, "d435i")  # which was built with several
    assert "bmi055" in text and "bmi088" in text and "adis" not in text
    assert said(capsys, "Mid-360").startswith("icm40609_d: ")
    assert main(["sensors", "no such thing"]) == 2
    assert "no sensor 'no such thing' among" in capsys.readouterr().err
