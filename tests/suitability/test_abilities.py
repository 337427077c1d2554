"""What a sensor must have, against what its file tells."""

from typing import Any

import pytest

from imubench_pipeline.model.verdicts import Condition, Shortfall
from imubench_pipeline.navigation.suitability import judge, read_abilities
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.sensor import CHANNELS, Sensor
from imubench_pipeline.words.verdicts import shortfall_text, subject_text

FIGURES = {
    "full_scale": {"value": [125, 250], "unit": "deg/s", "kind": "choices"},
    "bandwidth": {"value": {"xy": 80, "z": 60}, "unit": "Hz"},
}
WHOLE: dict[str, Any] = {
    "vendor": "V",
    "model": "M",
    "mass": "20 g",
    "power": "300 mW",
    "temperature_range": ["-40 degC", "85 degC"],
    "log": {
        "rate": "100 Hz",
        "channels": {c: {"column": c, "unit": "deg/s"} for c in CHANNELS[:3]},
    },
    "datasheet": {"gyro": FIGURES},
}
HEADING: dict[str, Any] = {
    "title": "heading",
    "static_window": "10 s",
    "limits": [{"error": "heading", "after": "10 s", "at_most": "1 deg"}],
}


def of_sensor(must: dict[str, Any], **changes: Any) -> tuple[list[Shortfall], list[Condition]]:
    sensor = Sensor.model_validate(WHOLE | changes)
    asked = Requirement.model_validate(HEADING | {"must": must})
    return judge(asked, read_abilities(sensor))


def judged(must: dict[str, Any], **changes: Any) -> tuple[list[str], list[str]]:
    """Return what a sensor lacks and what is not known of it, in words."""
    lacking, unknown = of_sensor(must, **changes)
    return list(map(shortfall_text, lacking)), list(map(subject_text, unknown))


@pytest.mark.parametrize(
    ("must", "lacking"),
    [
        ({"full_scale": {"gyro": "250 deg/s"}}, None),
        (
            {"full_scale": {"gyro": "300 deg/s"}},
            "gyro full scale 250 deg/s, required 300 deg/s",
        ),
        ({"bandwidth": "60 Hz", "axes": ["gyro_xyz"]}, None),
        (
            {"bandwidth": "70 Hz", "axes": ["gyro_xyz"]},
            "gyro bandwidth 60 Hz, required 70 Hz",
        ),
        ({"rate": "100 Hz"}, None),
        ({"temperature": ["-20 degC", "60 degC"]}, None),
        (
            {"temperature": ["-55 degC", "60 degC"]},
            "temperature range -40 to 85 degC, required -55 degC to 60 degC",
        ),
        ({"axes": ["gyro_xyz"]}, None),
        ({"mass": "0.02 kg"}, None),
        ({"mass": "15 g"}, "mass 20 g, required 15 g"),
        ({"power": "0.3 W"}, None),
        ({"power": "0.2 W"}, "power 0.3 W, required 0.2 W"),
    ],
)
def test_what_a_sensor_is_known_to_have(must: dict[str, Any], lacking: str | None) -> None:
    assert judged(must) == ([lacking] if lacking else [], [])


@pytest.mark.parametrize(
    ("must", "unknown"),
    [
        ({"full_scale": {"accel": "8 g"}}, "accelerometer full scale"),
        ({"rate": "200 Hz"}, "sampling rate"),  # The logs are slower, which the sensor need not be.
        ({"axes": ["accel_z"]}, "accel z axis"),
    ],
)
def test_what_nobody_knows(must: dict[str, Any], unknown: str) -> None:
    assert judged(must) == ([], [unknown])


def test_a_shortfall_has_its_figures_in_si() -> None:
    (lacking,), _ = of_sensor({"mass": "15 g"})
    assert (lacking.property, lacking.subject, lacking.asked) == ("mass", "", "15 g")
    assert lacking.has == pytest.approx((0.02,))
    (lacking,), _ = of_sensor({"axes": ["accel_x"]}, datasheet={"gyro": FIGURES, "accel": None})
    assert lacking == Shortfall("quantity", "accel", "accel_x")


@pytest.mark.parametrize("key", ["mass", "power", "temperature_range"])
def test_what_a_sensor_file_leaves_out_is_not_known(key: str) -> None:
    asked = {"mass": "30 g", "power": "1 W", "temperature": ["0 degC", "40 degC"]}
    assert judged(asked, **{key: None}) == ([], [key.replace("_", " ")])


def test_a_sensor_without_a_quantity_lacks_its_axes() -> None:
    lacking, unknown = judged(
        {"axes": ["accel_xyz"], "full_scale": {"accel": "2 g"}},
        datasheet={"gyro": FIGURES, "accel": None},
    )
    assert (lacking, unknown) == (["the sensor has no accelerometer"], [])


def test_the_highest_rate_is_that_of_the_sensor() -> None:
    assert judged({"rate": "400 Hz"}, rate="1 kHz") == ([], [])
    assert judged({"rate": "2 kHz"}, rate="1 kHz") == (
        ["sampling rate 1000 Hz, required 2 kHz"],
        [],
    )


def test_figures_of_other_options_do_not_count() -> None:
    figures = [
        {"value": 250, "unit": "deg/s", "option": "mode A"},
        {"value": 2000, "unit": "deg/s", "option": "mode B"},
    ]
    asked = {"full_scale": {"gyro": "1000 deg/s"}}
    sheet = {"gyro": {"full_scale": figures}}
    assert judged(asked, datasheet=sheet) == ([], [])  # it can be bought as mode B
    lacking, _ = judged(asked, datasheet=sheet | {"options": ["mode A"]})
    assert lacking == ["gyro full scale 250 deg/s, required 1000 deg/s"]


def test_a_sensor_without_a_needed_quantity_lacks_it() -> None:
    position = HEADING | {"limits": [{"error": "position", "after": "9 s", "at_most": "1 m"}]}
    without = WHOLE | {"datasheet": {"gyro": FIGURES, "accel": None}}
    has = read_abilities(Sensor.model_validate(without))
    (lacking,), unknown = judge(Requirement.model_validate(position), has)
    assert shortfall_text(lacking) == "the sensor has no accelerometer" and not unknown
    assert judge(Requirement.model_validate(HEADING), has) == ([], [])
