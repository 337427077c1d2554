import math
from typing import Any

import pytest

from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.tables.files import build
from imubench_pipeline.words.verdicts import corrected_text
from tests.test_selection import white
from tests.verdicts.budgets import HEADING, about, doubt, gyro, judge, marked, requirement

DEGREES = math.degrees(1.0)
UNIT = [doubt("s", "r", "suspicious_unit", factor=1 / DEGREES)]
UNFIT = about("s", "r", decides=False, doubts=marked("r", "suspicious_unit"))
ALONG = requirement(("position", "10 s", "1 m"), static_window="10 s")


def words(row: dict[str, Any]) -> str:
    return corrected_text(RankingRow.rows_of(build("ranking", [row]))[0])


def test_corrected_verdict_equals_verdict_in_the_right_unit() -> None:
    """The truth is the verdict on the same sensor, logged in the right unit."""
    right = {"gyro_x": white(1e-4), "accel_x": white(1e-3)}
    wrong = right | {"gyro_x": white(1e-4 * DEGREES)}
    asked = {"heading": HEADING, "along": ALONG}
    truth, _ = judge({"s": {"r": right}}, asked)
    rows, _ = judge({"s": {"r": wrong}}, asked, [UNFIT], UNIT)
    for row, true in zip(rows, truth, strict=True):
        assert row["verdict"] == "not_enough_data" and row["rank"] is None
        assert row["corrected_margin"] == pytest.approx(true["margin"], rel=1e-9)
        assert row["corrected_verdict"] == true["verdict"]
        assert row["logged_verdict"] == "fails"
        assert row["logged_margin"] == pytest.approx(true["margin"] / DEGREES, rel=0.1)
        assert row["corrected_units"] == [{"quantity": "gyro", "factor": 1 / DEGREES}]
        outcome = {"fails": "also fails", "meets": "meets the limits"}[true["verdict"]]
        assert words(row) == (
            f"fails (margin {row['logged_margin']:.3g}) as logged; {outcome} "
            f"(margin {true['margin']:.3g}) with the gyro data read as °/s, not as rad/s"
        )
    assert {row["corrected_verdict"] for row in rows} > {"fails"}


def test_verdict_text_has_the_corrected_unit() -> None:
    rows, _ = judge({"s": {"r": gyro(7.5 / DEGREES)}}, {"robot": HEADING}, doubts=UNIT)
    assert rows[0]["verdict"] == "fails"
    expected = "meets the limits (margin 7.5) with the gyro data read as °/s, not as rad/s"
    assert words(rows[0]) == expected
    assert (rows[0]["corrected_verdict"], rows[0]["logged_verdict"]) == ("meets", None)
    quiet = [doubt("s", "r", "suspicious_unit", factor=DEGREES)]
    rows, _ = judge({"s": {"r": gyro(9.0)}}, {"robot": HEADING}, doubts=quiet)
    assert (rows[0]["verdict"], rows[0]["corrected_verdict"]) == ("meets", "fails")


def test_a_failure_that_a_unit_would_lift_may_leave_another_limit_open() -> None:
    both = requirement(("heading", "100 s", "0.1 deg"), ("position", "10 s", "1 m"))
    rows, _ = judge({"s": {"r": gyro(7.5 / DEGREES)}}, {"robot": both}, doubts=UNIT)
    assert (rows[0]["verdict"], rows[0]["corrected_verdict"]) == ("fails", "not_enough_data")
    assert rows[0]["corrected_margin"] is None
    assert rows[0]["corrected_reasons"] == ["the recording has no accelerometer"]
    assert words(rows[0]) == (
        "cannot be judged with the gyro data read as °/s, not as rad/s "
        "(the recording has no accelerometer)"
    )


def test_a_unit_that_turns_nothing_is_not_spoken_of() -> None:
    rows, _ = judge({"s": {"r": gyro(0.01 / DEGREES)}}, {"robot": HEADING}, doubts=UNIT)
    assert words(rows[0]) == "" and rows[0]["corrected_units"] == []


def test_moved_log_has_a_logged_verdict() -> None:
    moved = about("s", "r", decides=False, doubts=marked("r", "motion"))
    rows, steps = judge({"s": {"r": gyro(3.0)}}, {"robot": HEADING}, [moved])
    assert rows[0]["verdict"] == "not_enough_data"
    assert words(rows[0]) == "meets the limits (margin 3) as logged"
    assert rows[0]["corrected_verdict"] is None
    assert steps[0]["action"] == "record_again"
    # Where another recording decides, nothing hangs on the one that was left out.
    logs = {"r": gyro(3.0), "fine": gyro(2.0)}
    rows, _ = judge({"s": logs}, {"robot": HEADING}, [moved, about("s", "fine")])
    assert (rows[0]["verdict"], words(rows[0])) == ("meets", "")


def test_a_turn_on_bias_that_is_stated_keeps_its_size() -> None:
    turn_on = {"gyro": "0.001 deg/s", "accel": "1 mg"}
    asked = requirement(("heading", "100 s", "1 deg"), static_window=None, turn_on=turn_on)
    truth, _ = judge({"s": {"r": {"gyro_x": white(1e-4)}}}, {"robot": asked})
    wrong = {"gyro_x": white(1e-4 * DEGREES)}
    rows, _ = judge({"s": {"r": wrong}}, {"robot": asked}, [UNFIT], UNIT)
    assert rows[0]["corrected_margin"] == pytest.approx(truth[0]["margin"], rel=1e-9)


@pytest.mark.parametrize(
    ("factor", "units"),
    [(9.80665, "g, not as m/s²"), (1 / 9.80665, "m/s², not as g"), (1e-3, "mg, not as g")],
)
def test_corrected_accelerometer_unit_changes_margin_and_text(factor: float, units: str) -> None:
    right = {"gyro_x": white(1e-7), "accel_x": white(1e-2)}
    truth, _ = judge({"s": {"r": right}}, {"along": ALONG})
    wrong = right | {"accel_x": white(1e-2 / factor)}
    unit = [doubt("s", "r", "suspicious_unit", channel="accel_x", factor=factor)]
    rows, _ = judge({"s": {"r": wrong}}, {"along": ALONG}, [UNFIT], unit)
    assert rows[0]["corrected_margin"] == pytest.approx(truth[0]["margin"], rel=1e-9)
    assert words(rows[0]).endswith(f" with the accelerometer data read as {units}")
