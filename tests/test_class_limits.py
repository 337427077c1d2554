"""The limits of classes, against figures by hand, and the command that lists the catalogue."""

import math
from pathlib import Path
from typing import Any

import pytest

from imubench_pipeline.datasheets.class_limits import (
    FIGURES,
    count_sensors_within,
    derive_class_limits,
    find_limit,
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


TYPICAL = {"value": 2, "unit": "deg/s", "kind": "typ"}
LARGEST = {"value": 9, "unit": "deg/s", "kind": "max"}


@pytest.mark.parametrize(
    ("cause", "figures", "sigma"),
    [
        ("turn_on_bias", {"offset": {"value": 3, "unit": "deg/s", "kind": "typ"}}, 3 * DEG),
        ("turn_on_bias", {"offset": {"value": 3, "unit": "deg/s", "kind": "max"}}, DEG),
        (
            "turn_on_bias",
            {"offset": {"value": [-2, 3], "unit": "deg/s", "kind": "range"}},
            3 * DEG / math.sqrt(3),
        ),
        # The least statement counts: a further one never makes a sensor worse.
        ("turn_on_bias", {"offset": [LARGEST, TYPICAL]}, 2 * DEG),
        ("turn_on_bias", {"offset": [LARGEST | {"value": 3}, TYPICAL]}, DEG),
        ("turn_on_bias", {"offset": TYPICAL, "bias_repeatability": LARGEST | {"value": 3}}, DEG),
        ("turn_on_bias", {"offset": {"value": {"xy": 1, "z": 2}, "unit": "deg/s"}}, 2 * DEG),
        ("turn_on_bias", {"offset": {"value": {"xy": 1}, "unit": "deg/s"}}, None),
        ("turn_on_bias", {"offset": {"value": 1, "unit": "deg/s", "kind": "min"}}, None),
        # Of options that are not chosen, the best: another one is another statement.
        (
            "turn_on_bias",
            {"offset": [TYPICAL | {"option": "A", "value": 5}, TYPICAL | {"option": "B"}]},
            2 * DEG,
        ),
        ("misalignment", {"misalignment": {"value": 0.5, "unit": "deg", "kind": "max"}}, DEG / 6),
        ("misalignment", {"cross_axis": {"value": 2, "unit": "%"}}, 0.02),
        (
            "scale_factor_temperature",
            {"scale_factor_temperature": {"value": 0.03, "unit": "%/K"}},
            3e-4,
        ),
        (
            "vibration_rectification",
            {"vibration_rectification": {"value": 2, "unit": "deg/h/g^2"}},
            2 * DEG / 3600 / 9.80665**2,
        ),
        ("K", {"rate_random_walk": {"value": None, "place": "table 1"}}, None),
    ],
)
def test_a_figure_counts_as_one_standard_deviation(
    cause: str, figures: Any, sigma: float | None
) -> None:
    found = read_sigma(sensor(figures), "gyro", cause)
    assert found is None if sigma is None else found == pytest.approx(sigma)
    assert read_sigma(sensor(figures), "accel", cause) is None  # the sensor has none


def test_totals_over_temperature_bound_the_coefficient() -> None:
    total = {"temperature_total": {"value": 3, "unit": "deg/s", "kind": "max"}}
    rms = {"temperature_rms": {"value": 0.1, "unit": "deg/s"}}
    span = {"temperature_range": ["-40 degC", "60 degC"]}

    def coefficient(sheet: dict[str, Any], **about: Any) -> float | None:
        return read_sigma(sensor(sheet, **about), "gyro", "temperature")

    # The maximum of 3 deg/s at 50 K from the middle, of three standard deviations.
    assert coefficient(total, **span) == pytest.approx(DEG / 50)
    assert coefficient(rms, **span) == pytest.approx(0.1 * DEG * math.sqrt(12) / 100)
    # A range that is not known counts as 50 K.
    assert coefficient(total) == pytest.approx(2 * DEG / 50)
    own = {"temperature_coefficient": {"value": 0.01, "unit": "deg/s/K"}}
    assert coefficient(total | own, **span) == pytest.approx(0.01 * DEG)


def test_a_density_of_unknown_sidedness_has_the_larger_noise() -> None:
    def noise(**sided: str) -> float | None:
        density = {"value": 0.01, "unit": "deg/s/sqrt(Hz)"} | sided
        return read_sigma(sensor({"noise_density": density}), "gyro", "N")

    assert noise() == noise(sidedness="two-sided") == pytest.approx(0.01 * DEG)
    assert noise(sidedness="one-sided") == pytest.approx(0.01 * DEG / math.sqrt(2))


def test_limits_are_of_the_sensors_of_a_class_that_are_sold() -> None:
    def of(value: float, **about: Any) -> Sensor:
        return sensor({"offset": {"value": value, "unit": "deg/s"}}, **about)

    sensors = {"a": of(1), "b": of(4), "c": of(2), "board": of(99, sold=False), "silent": sensor()}
    sensors |= {"t": of(0.1, grade="tactical"), "unknown": of(50, grade=None)}
    consumer, tactical = derive_class_limits(sensors)
    assert (consumer.grade, consumer.figure, tactical.grade) == (
        *("consumer", "turn_on_bias"),
        "tactical",
    )
    expected = {"a": DEG, "b": 4 * DEG, "c": 2 * DEG}
    assert dict(consumer.sensors) == pytest.approx(expected, rel=1e-3)
    # Rounded up: a sensor that prints nothing is no better than the worst.
    assert all(consumer.sensors[name] >= value for name, value in expected.items())
    assert (consumer.best, consumer.median, consumer.worst) == pytest.approx(
        (DEG, 2 * DEG, 4 * DEG), rel=1e-3
    )
    assert consumer.spread == pytest.approx(math.log(2), rel=1e-3) and tactical.spread is None
    assert consumer.unit == "rad/s"


@pytest.mark.parametrize(
    ("grade", "quantity", "figure", "worst"),
    [
        # The worst of four industrial sensors: the ISM330DHCX and the IIM-42652, 0.005 %/K.
        ("industrial", "gyro", "scale_factor_temperature", 5e-5),
        # A class that does not print it has the limit of the class below.
        ("tactical", "gyro", "scale_factor_temperature", 5e-5),
        ("navigation", "gyro", "scale_factor_temperature", 5e-5),
        # The one consumer sensor is not taken to be better than the ADIS16405, 0.007 deg/s.
        ("consumer", "gyro", "B", 0.007 * DEG),
        (None, "gyro", "B", 0.007 * DEG),
        # None is below the consumer sensors: the class above counts, with the ADIS16448, 0.25 mg.
        ("consumer", "accel", "B", 0.25e-3 * 9.80665),
    ],
)
def test_what_no_sensor_of_a_class_prints_has_a_limit(
    grade: str | None, quantity: str, figure: str, worst: float
) -> None:
    assert find_limit(grade, quantity, figure).worst == pytest.approx(worst, rel=1e-3)


def test_sensors_within_a_figure_are_counted() -> None:
    values = [
        value
        for limit in read_class_limits()
        if (limit.quantity, limit.figure) == ("gyro", "g_sensitivity")
        for value in limit.sensors.values()
    ]
    assert count_sensors_within("gyro", "g_sensitivity", 0.0) == (0, len(values))
    assert count_sensors_within("gyro", "g_sensitivity", max(values)) == (len(values),) * 2
    assert count_sensors_within("gyro", "g_sensitivity", min(values))[0] == values.count(
        min(values)
    )


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
