"""What the file of a sensor may say of its datasheet, and what is wrong with it."""

import json
import re
from typing import Any

import pytest

from imubench_pipeline.settings.printed import FIGURE_DIMENSIONS, Datasheet, QuantityDatasheet
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.settings.validation import ConfigError, parse
from tests.test_configuration import SENSOR, with_change

DENSITY = {"value": 0.01, "unit": "deg/s/sqrt(Hz)"}


def test_one_figure_or_several() -> None:
    gyro = QuantityDatasheet.model_validate(
        {"noise_density": DENSITY, "offset": [{"value": 1, "unit": "deg/s"}, {"value": None}]}
    )
    assert [figure.value for figure in gyro.printed("noise_density")] == [0.01]
    assert [figure.value for figure in gyro.printed("offset")] == [1.0]
    assert gyro.printed("random_walk") == ()


def test_looked_up_is_true_for_null_and_false_for_missing_figures() -> None:
    gyro = QuantityDatasheet.model_validate({"noise_density": None, "offset": {"value": None}})
    assert gyro.looked_up("noise_density") and gyro.looked_up("offset")
    assert not gyro.looked_up("random_walk")


def test_a_datasheet_survives_json() -> None:
    given = Datasheet.model_validate(
        {
            "document": "A",
            "revision": 1.3,
            "options": ["10 g"],
            "gyro": {
                "noise_density": [DENSITY, DENSITY | {"value": {"XY": 0.01, "z": 0.02}}],
                "offset": {"value": [-250, 250], "unit": "deg/h", "kind": "range"},
                "bias_instability": None,
            },
            "accel": None,
        }
    )
    again = Datasheet.model_validate(json.loads(given.model_dump_json()))
    assert again == given
    assert again.gyro is not None and again.gyro.model_fields_set == given.gyro.model_fields_set
    assert again.gyro.printed("offset")[0].value == (-250.0, 250.0)


def test_a_figure_by_axis() -> None:
    figure = QuantityDatasheet.model_validate(
        {"offset": {"value": {"XY": 60, "z": 80}, "unit": "mg"}}
    ).printed("offset")[0]
    assert [figure.on_axis(axis) for axis in "xyz"] == [60.0, 60.0, 80.0]
    alone = figure.model_copy(update={"value": {"z": 80.0}})
    assert alone.on_axis("x") is None


def test_numbers_that_yaml_reads_as_text() -> None:
    figure = QuantityDatasheet.model_validate({"noise_density": DENSITY | {"value": "5e-3"}})
    assert figure.printed("noise_density")[0].value == 0.005


def test_every_key_has_a_dimension() -> None:
    assert set(FIGURE_DIMENSIONS["gyro"]) == set(QuantityDatasheet.model_fields)
    assert set(FIGURE_DIMENSIONS["accel"]) == set(FIGURE_DIMENSIONS["gyro"]) - {"g_sensitivity"}


@pytest.mark.parametrize(
    ("key", "change", "expected"),
    [
        ("noise_density", {"value": "much"}, r"gyro\.noise_density\.value: found 'much'; expected"),
        ("noise_density", {"value": True}, r"value: found True; expected a number, one for each"),
        ("noise_density", {"value": {"w": 1}}, r"value: found {'w': 1}; expected .*xy: 60"),
        ("noise_density", {"value": {"xy": 1, "y": 2}}, r"found {'xy': 1, 'y': 2}; expected"),
        ("noise_density", {"value": -1}, r"gyro\.noise_density: value -1\.0; expected .* above 0"),
        ("noise_density", {"unit": None}, r"gyro\.noise_density: 'unit' is missing; expected"),
        ("noise_density", {"unit": "deg/h"}, r"density\.unit: 'deg/h' is no unit of gyro density"),
        ("noise_density", {"unit": "mdps/ Hz"}, r"root was lost, write 'mdps/sqrt\(Hz\)'"),
        ("noise_density", {"kind": "mean"}, r"gyro\.noise_density\.kind: found 'mean'; input"),
        ("noise_density", {"side": "one"}, r"noise_density\.side: unknown key; did you mean 'sid"),
        (
            "noise_density",
            {"value": [1, 2]},
            r"value \[1\.0, 2\.0\] with kind 'typ'; expected kind",
        ),
        (
            "noise_density",
            {"kind": "range"},
            r"value 0\.01 with kind 'range'; expected \[low, high",
        ),
        ("noise_density", {"bandwidth": "wide"}, r"noise_density\.bandwidth: found 'wide'"),
        (
            "noise_density",
            {"tau": "600"},
            r"noise_density\.tau: found '600'; '600' is not a number",
        ),
        ("noise_densty", {}, r"gyro\.noise_densty: unknown key; did you mean 'noise_density'"),
    ],
)
def test_faults_name_file_key_value_and_what_was_expected(
    key: str, change: dict[str, Any], expected: str
) -> None:
    sensor = with_change(f"datasheet.gyro.{key}", DENSITY | change)
    with pytest.raises(ConfigError) as error:
        parse(Sensor, sensor, "config/sensors/s.yaml")
    assert str(error.value).startswith("config/sensors/s.yaml: datasheet")
    assert re.search(expected, str(error.value)), str(error.value)


def test_a_fault_in_one_of_several_figures_has_its_number() -> None:
    figures = [DENSITY, DENSITY | {"sidedness": "both"}]
    with pytest.raises(ConfigError, match=r"gyro\.noise_density\.1\.sidedness: found 'both'"):
        parse(Sensor, with_change("datasheet.gyro.noise_density", figures), "s.yaml")
    figures = [DENSITY, DENSITY | {"unit": "g"}]
    with pytest.raises(ConfigError, match=r"gyro\.noise_density\.1\.unit: 'g' is no unit of gyro"):
        parse(Sensor, with_change("datasheet.gyro.noise_density", figures), "s.yaml")


@pytest.mark.parametrize("wrong", [5, "0.01 deg/s/sqrt(Hz)", [5]])
def test_what_is_no_figure(wrong: object) -> None:
    with pytest.raises(ConfigError) as error:
        parse(Sensor, with_change("datasheet.gyro.noise_density", wrong), "s.yaml")
    assert f"noise_density: found {wrong!r}; expected a figure such as" in str(error.value)


@pytest.mark.parametrize("name", ["noise_density", "bias_instability"])
def test_the_sign_of_micro_that_a_document_lost(name: str) -> None:
    unit = {"noise_density": "g/√Hz", "bias_instability": "g"}[name]
    lost = with_change(f"datasheet.accel.{name}", {"value": 400, "unit": unit})
    with pytest.raises(
        ConfigError, match=rf"accel\.{name}: found 400 {unit}, .*such as 400 u{unit}"
    ):
        parse(Sensor, lost, "s.yaml")


def test_an_accelerometer_has_no_g_sensitivity() -> None:
    wrong = with_change("datasheet.accel.g_sensitivity", {"value": 1, "unit": "deg/s/g"})
    with pytest.raises(ConfigError, match=r"accel\.g_sensitivity: found under accel; expected"):
        parse(Sensor, wrong, "s.yaml")


def test_counts_by_unit_are_no_resolution() -> None:
    wrong = with_change("datasheet.gyro.resolution", {"value": 131, "unit": "LSB/(deg/s)"})
    with pytest.raises(ConfigError, match=r"gyro\.resolution\.unit: .* is the 'sensitivity'"):
        parse(Sensor, wrong, "s.yaml")
    both = {"value": 131, "unit": "LSB/(deg/s)"}, {"value": 7.6, "unit": "mdps/LSB"}
    sheet = parse(Sensor, with_change("datasheet.gyro.sensitivity", list(both)), "s.yaml").datasheet
    assert sheet.gyro is not None and len(sheet.gyro.printed("sensitivity")) == 2


def test_a_file_of_the_old_form_is_read() -> None:
    sheet = parse(Sensor, SENSOR, "s.yaml").datasheet
    assert sheet.gyro is not None
    assert [figure.value for figure in sheet.gyro.printed("noise_density")] == [0.01]
