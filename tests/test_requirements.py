from pathlib import Path

import numpy as np
import pytest
import yaml

from imubench_pipeline.settings.requirements import Requirement, read_requirements
from imubench_pipeline.settings.validation import ConfigError

from .conftest import PROJECT

WHOLE = {
    "title": "a robot",
    "static_window": "10 s",
    "limits": [{"error": "heading", "after": "1 min", "at_most": "1 deg"}],
}


def written(folder: Path, **changes: object) -> Path:
    (folder / "robot.yaml").write_text(yaml.safe_dump(WHOLE | changes))
    return folder


def test_limits_are_in_si(tmp_path: Path) -> None:
    (limit,) = read_requirements(written(tmp_path))["robot"].limits
    assert limit.seconds == 60.0
    assert limit.size == pytest.approx(np.pi / 180)
    assert limit.text == "heading within 1 deg after 1 min"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"limits": [{"error": "heading", "after": "60 s", "at_most": "1 m"}]}, "no unit of angle"),
        ({"limits": [{"error": "position", "after": "60 s", "at_most": "5"}]}, "not a number with"),
        ({"limits": [{"error": "position", "after": "60", "at_most": "5 m"}]}, "limits.0.after"),
        ({"limits": [{"error": "position", "after": "-1 s", "at_most": "5 m"}]}, "above zero"),
        ({"limits": [{"error": "position", "after": "1 s", "at_most": "0 m"}]}, "more than zero"),
        ({"limits": [{"error": "roll", "after": "1 s", "at_most": "1 deg"}]}, "'attitude'"),
        ({"limits": []}, "limits"),
        ({"limits": [{"error": "north", "after": "1 s", "at_most": "1 deg"}]}, "needs 'latitude'"),
        ({"static_window": None}, "either 'static_window' or 'turn_on'"),
        ({"turn_on": {"gyro": "1 deg/s", "accel": "1 mg"}}, "either 'static_window' or 'turn_on'"),
        (
            {"static_window": None, "turn_on": {"gyro": "-1 deg/s"}},
            "a standard deviation, 0 or more",
        ),
        ({"latitude": "91 deg"}, "between the poles: at a pole, a gyro"),
        ({"environment": {"temperature_change": "-20 K"}}, "a difference above zero"),
        ({"environment": {"turns": "10 m"}}, "environment.turns"),
        ({"environment": {"speed_chang": "10 m/s"}}, "did you mean 'speed_change'?"),
        ({"must": {"axes": ["gyro_xyw"]}}, "such as gyro_xyz or accel_z"),
        ({"must": {"mass": "30 m"}}, "no unit of mass"),
        ({"must": {"temperature": ["60 degC", "-20 degC"]}}, "the lower temperature first"),
        ({"must": {"full_scale": {"gyro": "8 g"}}}, "must.full_scale.gyro"),
        ({"axes": "worst"}, "did you mean 'axis'?"),
    ],
)
def test_a_fault_names_file_and_key(tmp_path: Path, changes: dict, said: str) -> None:
    with pytest.raises(ConfigError, match=r"robot\.yaml: ") as caught:
        read_requirements(written(tmp_path, **changes))
    assert said in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such folder"):
        read_requirements(tmp_path / "none")
    assert read_requirements(None) == {}


def test_the_price_class_is_told_by_its_words() -> None:
    requirement = Requirement.model_validate(WHOLE | {"price_class": ["Consumer", "module"]})
    assert requirement.admits("consumer chip") and requirement.admits("industrial module")
    assert not requirement.admits("tactical") and not requirement.admits(None)
    assert Requirement.model_validate(WHOLE).admits(None)


def test_those_that_ship_are_marked_as_examples() -> None:
    shipped = read_requirements(PROJECT / "config/requirements")
    assert len(shipped) >= 3
    assert all(requirement.example for requirement in shipped.values())
