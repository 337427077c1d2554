import math

import pytest
from scipy import stats

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.navigation.error_budget.in_use import Figure, Figures
from imubench_pipeline.navigation.verdicts.next_steps import count_specimens_needed
from imubench_pipeline.navigation.verdicts.specimens import Expected, Spread
from tests.verdicts.budgets import (
    HEADING,
    about,
    doubt,
    gyro,
    judge,
    marked,
    requirement,
    three_axes,
)

FACTOR = 1 / math.degrees(1.0)


def test_what_turns_most_verdicts_comes_first() -> None:
    asked = {"robot": HEADING, "other": requirement(("heading", "50 s", "0.1 deg"))}
    sensors = {"unit": {"r": gyro(7.5 * FACTOR)}, "fine": {"r": gyro(5.0)}}
    doubts = [doubt("unit", "r", "suspicious_unit", factor=FACTOR)]
    _, (first, *others) = judge(sensors, asked, doubts=doubts)
    assert (first["sensor"], first["recording"], first["action"]) == ("unit", "r", "check_unit")
    assert (first["verdicts_turned"], first["requirements"]) == (2, ["robot", "other"])
    assert first["text"] == "Check the gyro unit of r: this could change 2 verdicts"
    assert all(row["verdicts_turned"] == 0 for row in others)
    (more,) = (row for row in others if row["sensor"] == "fine")
    assert (more["action"], more["specimens"], more["recording"]) == ("add_specimens", 2, None)
    assert more["text"] == ("Record 2 more specimens: this would give 2 verdicts stronger evidence")


@pytest.mark.parametrize("margin", [1.2, 1 / 1.2])
def test_a_log_of_the_length_that_is_advised_settles_the_verdict(margin: float) -> None:
    """White noise is known to a part that falls with the root of the length."""

    def verdict(length: float) -> str:
        (row,), _ = judge({"s": {"r": gyro(margin, 0.35 / math.sqrt(length))}}, {"robot": HEADING})
        return row["verdict"]

    _, steps = judge({"s": {"r": gyro(margin, 0.35)}}, {"robot": HEADING})
    assert steps[0]["action"] == "log_longer" and steps[0]["verdicts_turned"] == 1
    times = steps[0]["duration"] / 36000.0
    assert verdict(1.0).startswith("likely")
    assert verdict(0.7 * times).startswith("likely")
    assert verdict(1.4 * times) in ("meets", "fails")


def test_a_margin_of_one_is_settled_by_no_log() -> None:
    _, steps = judge({"s": {"r": gyro(1.001, 0.3)}}, {"robot": HEADING})
    assert {row["action"] for row in steps} == {"add_specimens"}


def test_so_many_specimens_are_advised_as_it_takes() -> None:
    spread, away = 0.3, math.log(2.5)
    found = Expected(1.0, 0.1, 10.0, 0.9, 2, 2, Spread(spread**2, 1), "specimens")
    more = count_specimens_needed(found, away)
    assert more is not None

    def half(count: int) -> float:
        return float(stats.t.ppf(0.975, count - 1)) * spread * math.sqrt(1 + 1 / count)

    assert half(2 + more) <= away < half(1 + more)
    # t is never below 1.96.
    assert count_specimens_needed(found, 1.9 * spread) is None


def test_a_quantity_that_a_limit_needs_is_to_be_logged() -> None:
    asked = {"along": requirement(("position", "10 s", "1 m"))}
    gyros = [row for row in three_axes("s", "r") if row["channel"].startswith("gyro")]
    _, (step,) = judge({"s": {"r": gyro(3.0)}}, asked, parameters=gyros)
    assert (step["action"], step["verdicts_turned"]) == ("add_channels", 1)
    assert step["text"] == ("Record the accelerometer too (r has none): this could allow 1 verdict")


def test_a_log_of_which_nothing_is_known_is_to_be_longer() -> None:
    silent = {"gyro_x": Estimate("likelihood", {"N": Parameter(None, "not_shown", "too short")})}
    rows = [row | {"value": None} for row in three_axes("s", "r")]
    for duration, actions in ((60.0, ["log_longer"]), (9.1 * 3600, [])):
        logs = [about("s", "r", duration=duration)]
        _, steps = judge({"s": {"r": silent}}, {"robot": HEADING}, logs, parameters=rows)
        assert [step["action"] for step in steps] == actions


def test_a_doubt_of_a_unit_that_turns_nothing_is_one_of_evidence() -> None:
    doubts = [doubt("s", "r", "unusual_figure", factor=FACTOR), doubt("s", "r", "knocks")]
    _, steps = judge({"s": {"r": gyro(0.01 * FACTOR)}}, {"robot": HEADING}, doubts=doubts)
    found = {row["action"]: (row["verdicts_turned"], row["verdicts_strengthened"]) for row in steps}
    assert found == {"check_unit": (0, 1), "record_again": (0, 1), "add_specimens": (0, 1)}


def test_a_short_log_is_to_be_as_long_as_it_takes() -> None:
    logs = [about("s", name, duration=600.0 * i) for i, name in enumerate("abc", start=1)]
    sensors = {"s": {name: gyro(3.0, 0.05) for name in "abc"}}
    _, (step,) = judge(sensors, {"robot": HEADING}, logs)
    assert (step["action"], step["recording"], step["duration"]) == ("log_longer", "c", 9 * 3600)
    assert step["text"] == ("Extend c by 8.5 h to 9 h: this would give 1 verdict stronger evidence")


def test_the_unknown_figure_with_the_largest_error_is_to_be_found() -> None:
    turns = {"environment": {"turns": "360 deg", "temperature_change": "2 K"}}
    asked = {"robot": requirement(("heading", "100 s", "0.1 deg"), **turns)}
    small, large = (
        Figure(sigma=sigma, likely=1e-6, best=1e-6, origin="class limit") for sigma in (0.1, 9.0)
    )
    figures: Figures = {
        "nonlinearity": Figure(sigma=1e-6, origin="datasheet"),
        "temperature": small,  # 0.1 times 2 K over 100 s, and half of it on average
        "scale_factor": large,  # 9 times 360 deg
    }
    (row,), steps = judge({"s": {"r": gyro(5.0)}}, asked, figures={"gyro_x": figures})
    assert row["verdict"] == "meets_if" and len(row["conditions"]) == 2
    (step,) = (one for one in steps if one["action"] == "find_figures")
    (figure,) = step["figures"]
    assert (figure["figure"], figure["subject"], figure["largest"]) == (
        *("scale_factor", "gyro"),
        None,
    )
    assert (step["verdicts_turned"], step["verdicts_strengthened"]) == (1, 0)
    assert step["text"].startswith("Look up or measure the gyro scale factor error (")
    assert step["text"].endswith("): this decides 1 verdict")


def test_excluded_sensor_has_no_next_steps() -> None:
    must = {"full_scale": {"gyro": "300 deg/s"}}
    asked = {"robot": requirement(("heading", "100 s", "0.1 deg"), must=must)}
    (row,), steps = judge({"s": {"r": gyro(1.1)}}, asked, abilities={"full_scale": {"gyro": 1.0}})
    assert row["verdict"] == "excluded" and steps == []


def test_a_unit_that_changes_no_verdict_turns_none() -> None:
    doubts = [doubt("s", "r", "suspicious_unit", factor=FACTOR)]
    recordings = [about("s", "r", decides=False, doubts=marked("r", "suspicious_unit"))]
    for margin, turned in ((0.5 * FACTOR, 0), (5.0 * FACTOR, 1)):
        (row,), steps = judge({"s": {"r": gyro(margin)}}, {"robot": HEADING}, recordings, doubts)
        assert row["logged_verdict"] == "fails"
        (first,) = (one for one in steps if one["action"] == "check_unit")
        assert first["verdicts_turned"] == turned
