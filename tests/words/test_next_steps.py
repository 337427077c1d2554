"""Each next step says what to do, and which verdicts it can change."""

from typing import Any, get_args

import pytest

from imubench_pipeline.model.comparisons import NextStepRow
from imubench_pipeline.model.states import Action
from imubench_pipeline.model.verdicts import Condition, DoubtMark
from imubench_pipeline.words.verdicts import next_step_text

FIGURES = (
    Condition("scale_factor", None, "gyro"),
    Condition("g_sensitivity", None, "gyro"),
    Condition(None, "axis", "gyro_x"),
)


def step(action: Action, turned: int = 1, strengthened: int = 0, **values: Any) -> str:
    of_recording = action not in ("find_figures", "add_specimens")
    row = {
        "recording": "night" if of_recording else None,
        "duration": 32400.0,
        "logged": 1800.0,
        "specimens": 3,
        "quantities": ("gyro",),
        "figures": FIGURES,
        "doubts": (DoubtMark("night", "motion", ("gyro_x",)),),
    }
    return next_step_text(
        NextStepRow(sensor="s", requirements=("robot",), action=action, verdicts_turned=turned,
                    verdicts_strengthened=strengthened, **(row | values))
    )  # fmt: skip


def test_a_brief_step_leaves_out_how_to_measure() -> None:
    found = NextStepRow(
        sensor="s",
        requirements=("robot",),
        action="find_figures",
        figures=FIGURES[:1],
        verdicts_turned=2,
        verdicts_strengthened=0,
    )
    expected = "Look up or measure the gyro scale factor error: this decides 2 verdicts"
    assert next_step_text(found, brief=True) == expected


@pytest.mark.parametrize("action", get_args(Action))
def test_a_step_is_a_sentence(action: Action) -> None:
    for counts in ((1, 0), (0, 1), (2, 1)):
        text = step(action, *counts)
        assert text[0].isupper() and "_" not in text and "  " not in text and "()" not in text
        assert any(f": this {effect} " in text for effect in ("would", "could", "decides"))
        assert "0 verdicts" not in text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (step("check_unit"), "Check the gyro unit of night: this could change 1 verdict"),
        (
            step("check_unit", 2, quantities=("gyro", "accel")),
            "Check the gyro and accelerometer units of night: this could change 2 verdicts",
        ),
        (
            step("check_unit", 0, 1, quantities=()),
            "Check the unit of night: this would give 1 verdict stronger evidence",
        ),
        (
            step("find_figures", 2, figures=FIGURES[:1]),
            "Look up or measure the gyro scale factor error (turn the gyro by known angles, or the "
            "accelerometer against gravity): this decides 2 verdicts",
        ),
        (
            step("find_figures", figures=(FIGURES[2], Condition(None, "mass", ""))),
            "Look up the gyro x axis and mass: this decides 1 verdict",
        ),
        (
            step("record_again"),
            "Record night again (the sensor was moved): this could allow 1 verdict",
        ),
        (step("record_again", doubts=()), "Record night again: this could allow 1 verdict"),
        (
            step("add_channels"),
            "Record the gyro too (night has none): this could allow 1 verdict",
        ),
        (
            step("add_channels", 0, 1, quantities=()),
            "Record all three axes (night has fewer): "
            "this would give 1 verdict stronger evidence",
        ),
        (step("log_longer"), "Extend night by 8.5 h to 9 h: this could settle 1 verdict"),
        (
            step("log_longer", 1, 2, duration=90.0, logged=None),
            "Extend night by 1.5 min to 1.5 min: this could settle 1 verdict and "
            "give 2 verdicts stronger evidence",
        ),
        (step("add_specimens"), "Record 3 more specimens: this could settle 1 verdict"),
        (
            step("add_specimens", 0, 1, specimens=1),
            "Record 1 more specimen: this would give 1 verdict stronger evidence",
        ),
    ],
)  # fmt: skip
def test_what_to_do_and_its_effect(text: str, expected: str) -> None:
    assert text == expected
