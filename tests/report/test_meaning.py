import math
from dataclasses import replace
from typing import Any

import pytest

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.model.comparisons import ErrorBudgetRow, RankingRow
from imubench_pipeline.model.verdicts import DoubtMark
from imubench_pipeline.navigation.expected_errors import (
    list_error_rows,
    list_requirement_questions,
    list_standard_questions,
)
from imubench_pipeline.report.meaning import (
    Group,
    LimitLine,
    SourcedNumber,
    explain_budget,
    format_rankings,
    make_budget_tables,
)
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.tables.files import build
from tests.ranking import ranking_rows
from tests.report.tables import ROBOT

SIMULATED = {("good", "r"): True, ("poor", "r"): False, ("gyro", "r"): False}


def white(N: float) -> Estimate:
    return Estimate("likelihood", {"N": Parameter(N, lower=0.9 * N, upper=1.1 * N)})


def errors() -> list[ErrorBudgetRow]:
    requirement = Requirement.model_validate(ROBOT)
    questions = [*list_standard_questions([60.0], 60.0, math.pi / 4, ["worst"])]
    questions += list_requirement_questions("robot", requirement)
    rows: list[Any] = []
    for sensor, estimates in (
        ("poor", {"gyro_x": white(1e-3), "accel_x": white(1e-3)}),
        ("good", {"gyro_x": white(1e-6), "accel_x": white(1e-5)}),
        ("gyro", {"gyro_x": white(1e-6)}),
    ):
        names = {"sensor": sensor, "recording": "r"}
        rows += list_error_rows(names, estimates, questions, draws=50, seed=1)
    return ErrorBudgetRow.rows_of(build("error_budget", rows))


def test_sensors_stand_in_their_order_with_what_decides() -> None:
    requirements = {"robot": Requirement.model_validate(ROBOT)}
    about = {sensor: {"price_class": None} for sensor, _ in SIMULATED}
    table = RankingRow.rows_of(build("ranking", ranking_rows(errors(), requirements, about)))
    ((_, shown),) = format_rankings(table, {"robot": ROBOT}, SIMULATED, "practical")
    assert [(g.rank, g.sensor, g.stated) for g in shown] == [
        ("1", "good", "meets the limits"),
        ("2", "poor", "fails"),
        ("–", "gyro", "not enough data"),
    ]
    assert [group.simulated for group in shown] == [True, False, False]
    heading, position = shown[1].limits
    assert (heading.sigma.unit, position.allowed.unit) == ("°", "m")
    # The bias from 10 s at rest, held for 100 s: N sqrt(t^2 / W) against N sqrt(t), known to 10 %.
    assert heading.sigma == f"{math.degrees(1e-3 * math.sqrt(100 + 100**2 / 10)):.2g} °"
    assert position.decides and position.source.startswith("gyro N in the static window (")


def test_verdict_groups_have_the_doubts_of_their_logs() -> None:
    requirements = {"robot": Requirement.model_validate(ROBOT)}
    about = {sensor: {"price_class": None} for sensor, _ in SIMULATED}
    table = RankingRow.rows_of(build("ranking", ranking_rows(errors(), requirements, about)))
    marks = (DoubtMark("r", "knocks", ("gyro_x",)),)
    doubted = [replace(row, doubts=marks if row.sensor != "good" else ()) for row in table]
    ((_, shown),) = format_rankings(doubted, {"robot": ROBOT}, SIMULATED, "practical")
    # Of the third nothing is known, and the reason says why.
    assert [group.doubts for group in shown] == ["", "knocks in gyro x", ""]


def test_a_budget_names_its_sources_and_what_is_missing() -> None:
    tables = list(make_budget_tables(errors(), SIMULATED, "practical"))
    assert [(t["sensor"], t["simulated"]) for t in tables] == [
        ("poor", False), ("good", True), ("gyro", False),
    ]  # fmt: skip
    lines = {line["error"]: line["cells"][0] for line in tables[0]["lines"]}
    assert tables[0]["times"] == ["60 s"]
    assert lines["heading"]["lines"][0] == f"{math.degrees(1e-3 * math.sqrt(120)):.2g} °"
    assert "gyro N 50 %" in lines["heading"]["lines"]
    north = lines["north, found at rest"]["lines"]  # 1e-3 rad/s against the Earth's rate
    assert north[0] == "not determined"
    assert [line["error"] for line in tables[2]["lines"]] == [
        "heading", "north, found at rest",
    ]  # fmt: skip
    assert "velocity, one axis: the recording has no accelerometer" in tables[2]["missing"]


def budget(**changes: Any) -> list[dict[str, Any]]:
    """Rows of one error after two times, for two axes, with one source each."""
    names = {"sensor": "s", "recording": "r", "error": "heading", "unit": "rad"}
    sizes = {60.0: 0.01, 600.0: 0.04}
    return [
        names | {"axis": axis, "time": time, "source": source, "sigma": part * sigma,
                 "quantity": None if source == "total" else "gyro"}
        | ({"lower": sigma / 2, "upper": 2 * sigma} if source == "total" else {}) | changes
        for axis in ("worst", "median")
        for time, sigma in sizes.items()
        for source, part in (("total", 1.0), ("N", 0.8), ("K", 0.6))
    ]  # fmt: skip


def shown(rows: list[dict[str, Any]], system: Any = "practical") -> dict[str, Any]:
    (table,) = make_budget_tables(ErrorBudgetRow.rows_of(build("error_budget", rows)), {}, system)
    return table


def test_budget_merges_worst_and_median_axis_of_one_channel() -> None:
    table = shown(budget())
    assert table["times"] == ["60 s", "10 min"]
    (line,) = table["lines"]
    assert (line["error"], line["axis"]) == ("heading", "worst, median")
    first, last = (cell["lines"] for cell in line["cells"])
    # 0.01 rad are 0.573°, known to 0.4°; 0.8² of the variance are 64 %.
    assert first == ["0.57 °", "0.29 to 1.1", "gyro N 64 %", "gyro K 36 %"]
    assert last[0] == "2.3 °"


def test_axes_that_differ_stand_in_lines_of_their_own() -> None:
    rows = budget()
    for row in rows:
        if row["axis"] == "median":
            row["sigma"] /= 2
    assert [line["axis"] for line in shown(rows)["lines"]] == ["worst", "median"]


def test_a_budget_has_the_units_of_the_settings() -> None:
    (line,) = shown(budget(), "si")["lines"]
    assert line["error"] == "heading"
    assert line["cells"][0]["lines"][:2] == ["0.01 rad", "0.005 to 0.02"]


@pytest.mark.parametrize(
    ("size", "text"),
    [(6.1e-4, "0.61 mm"), (0.0853, "85 mm"), (0.5, "0.5 m"), (950.0, "950 m"), (21500.0, "22 km")],
)
def test_a_length_has_the_prefix_that_is_easily_read(size: float, text: str) -> None:
    ends = {"lower": 0.9 * size, "upper": 1.1 * size}
    rows = [row | ends for row in budget(error="position", unit="m", sigma=size)]
    assert shown(rows)["lines"][0]["cells"][0]["lines"][0] == text


def test_an_error_of_more_than_a_right_angle_is_no_number() -> None:
    (line,) = shown(budget(sigma=2.0))["lines"]
    assert line["cells"][0]["lines"][0] == "over 90 °"
    (line,) = shown(budget(sigma=2.0, error="north"))["lines"]
    assert line["cells"][0]["lines"][0] == "not determined"
    assert not any(" to " in one for one in line["cells"][0]["lines"][1:])
    _, limit = ranked(sigma=2.0, upper=9.0)
    assert (limit.sigma, limit.interval) == ("over 90 °", "–")


def test_budget_notes_are_grouped_by_error() -> None:
    note = "K of gyro_x is not identified"
    rows = budget(reasons=[note]) + budget(reasons=[note], error="attitude")
    rows += budget(error="position", unit="m")
    assert shown(rows)["notes"] == [f"Heading, attitude: {note}"]


def test_what_requirements_ask_for_is_no_part_of_a_budget() -> None:
    rows = ErrorBudgetRow.rows_of(build("error_budget", budget(requirement="x")))
    assert list(make_budget_tables(rows, {}, "si")) == []


def test_budget_text_has_static_window_and_latitude() -> None:
    words = explain_budget({"static_window": "60 s", "latitude": "45 deg"})
    assert "over 60 s at rest right before" in words and "a latitude of 45 deg" in words


def ranked(**changes: Any) -> tuple[Group, LimitLine]:
    row = {"requirement": "robot", "sensor": "s", "rank": 1, "verdict": "meets", "decides": True,
           "recording": "r", "error": "heading", "time": 100.0, "limit": 0.01, "sigma": 0.005,
           "lower": 0.004, "upper": 0.006, "unit": "rad", "margin": 2.0, "chance": 0.987,
           "limit_verdict": "meets", "source": "N", "share": 0.75,
           "parts": [{"source": "N", "quantity": "gyro", "share": 0.75}],
           "reached_after": 7200.0}  # fmt: skip
    rows = RankingRow.rows_of(build("ranking", [row | changes]))
    ((_, groups),) = format_rankings(rows, {"robot": ROBOT}, {("s", "r"): True}, "practical")
    (group,) = groups
    (limit,) = group.limits
    return group, limit


def test_a_limit_is_told_with_what_it_comes_of() -> None:
    group, limit = ranked()
    assert limit.limit == "heading, 100 s"
    assert (limit.allowed, limit.sigma) == ("0.573 °", "0.29 °")
    assert isinstance(limit.sigma, SourcedNumber)
    assert limit.sigma.source == "ranking/robot/s/heading/100/sigma"
    assert limit.interval == "0.23 to 0.34"
    assert (limit.margin, limit.chance) == ("2", "99 %")
    # 0.01 over 0.006 and 0.004.
    assert limit.margins == "1.7 to 2.5"
    assert (limit.source, limit.reached) == ("gyro N (75 %)", "2 h")
    assert group.simulated is True


def test_a_limit_that_is_not_known_is_dashes_and_its_reason() -> None:
    nothing = dict.fromkeys(
        ("rank", "sigma", "lower", "upper", "margin", "chance", "source", "share", "reached_after")
    )
    group, limit = ranked(**nothing, parts=[], reasons=["no gyro"], verdict="not_enough_data")
    dashes = {group.rank, limit.sigma, limit.interval, limit.margin, limit.chance, limit.source}
    assert dashes == {"–"} and (limit.reached, limit.parts) == ("–", ["–"])
    assert limit.reason == "no gyro"


@pytest.mark.parametrize("margins", [[3.0, 2.0, 1.0], [1.0, 3.0, 2.0]])
def test_tied_sensors_stand_in_the_order_of_their_margins(margins: list[float]) -> None:
    rows = [
        {"requirement": "robot", "sensor": f"s{margin:g}", "rank": 1, "verdict": "meets",
         "decides": True, "error": "heading", "time": 1.0, "unit": "rad", "margin": margin,
         "limit_verdict": "meets", "limit": 1.0, "sigma": 1 / margin, "chance": 1.0}
        for margin in margins
    ]  # fmt: skip
    ((_, groups),) = format_rankings(
        [RankingRow(**row) for row in rows], {"robot": ROBOT}, {}, "si"
    )
    assert [group.sensor for group in groups] == ["s3", "s2", "s1"]


def test_a_requirement_that_nothing_answers_has_no_groups() -> None:
    ((name, groups),) = format_rankings([], {"robot": ROBOT}, {}, "si")
    assert (name, groups) == ("robot", [])
