from typing import Any

from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.words.verdicts import requirement_text


def asked(**changes: Any) -> str:
    given = {
        "title": "t",
        "static_window": "10 s",
        "limits": [{"error": "heading", "after": "60 s", "at_most": "1 deg"}],
    }
    return requirement_text(Requirement.model_validate(given | changes))


def test_a_requirement_states_its_demands() -> None:
    assert asked() == (
        "Limits (95 % of runs, worst axis): heading within 1 deg after 60 s. "
        "Start: biases and tilt estimated over 10 s at rest."
    )
    text = asked(example=True, note="Only indoors.", axis="median", confidence=0.997)
    assert text.startswith("Invented example. Limits (") and text.endswith(". Only indoors.")
    assert "(99.7 % of runs, median axis)" in text
    turn_on = {"gyro": "0.2 deg/s", "accel": "20 mg"}
    text = asked(static_window=None, turn_on=turn_on)
    assert text.endswith(" Start: turn-on biases of 0.2 deg/s and 20 mg, not calibrated.")


def test_use_and_demanded_properties_are_sentences() -> None:
    must = {
        "mass": "30 g",
        "temperature": ["-20 degC", "60 degC"],
        "full_scale": {"gyro": "9 deg/s"},
    }
    text = asked(must=must, environment={"temperature_change": "20 K"})
    assert "In use: temperature change 20 K." in text
    (demanded,) = (part for part in text.split(". ") if part.startswith("A sensor must have: "))
    for part in ("mass 30 g", "temperature -20 degC to 60 degC", "full scale gyro 9 deg/s"):
        assert part in demanded
