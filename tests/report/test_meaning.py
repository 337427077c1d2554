import math
from typing import Any

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.expected_errors import error_rows, of_requirement, standard
from imubench_pipeline.report.meaning import budget_tables, rankings
from imubench_pipeline.requirements import Requirement
from imubench_pipeline.selection import ranking_rows
from imubench_pipeline.tables import build

ROBOT = {
    "title": "a robot",
    "static_window": "10 s",
    "limits": [
        {"error": "heading", "after": "100 s", "at_most": "1 deg"},
        {"error": "position", "after": "100 s", "at_most": "10 m"},
    ],
}
SIMULATED = {("good", "r"): True, ("poor", "r"): False, ("gyro", "r"): False}


def white(N: float) -> Estimate:
    return Estimate("likelihood", {"N": Parameter(N, lower=0.9 * N, upper=1.1 * N)})


def errors() -> list[dict[str, Any]]:
    requirement = Requirement.model_validate(ROBOT)
    questions = [*standard([60.0], 60.0, math.pi / 4, ["worst"])]
    questions += of_requirement("robot", requirement)
    rows: list[Any] = []
    for sensor, estimates in (
        ("poor", {"gyro_x": white(1e-3), "accel_x": white(1e-3)}),
        ("good", {"gyro_x": white(1e-6), "accel_x": white(1e-5)}),
        ("gyro", {"gyro_x": white(1e-6)}),
    ):
        names = {"sensor": sensor, "recording": "r"}
        rows += error_rows(names, estimates, questions, draws=50, seed=1)
    return build("error_budget", rows).to_pylist()


def test_sensors_stand_in_their_order_with_what_decides() -> None:
    requirements = {"robot": Requirement.model_validate(ROBOT)}
    about = {sensor: {"price_class": None} for sensor, _ in SIMULATED}
    table = build("ranking", ranking_rows(errors(), requirements, about)).to_pylist()
    (shown,) = rankings(table, {"robot": ROBOT}, SIMULATED, "practical")
    assert [(g["rank"], g["sensor"], g["verdict"]) for g in shown["groups"]] == [
        (1, "good", "passes"),
        (2, "poor", "surely fails"),
        ("–", "gyro", "not enough data"),
    ]
    assert [group["simulated"] for group in shown["groups"]] == [True, False, False]
    heading, position = shown["groups"][1]["limits"]
    assert (heading["unit"], position["unit"]) == ("°", "m")
    # The bias from 10 s at rest, held for 100 s: N sqrt(t^2 / W) against N sqrt(t).
    assert heading["sigma"] == f"{math.degrees(1e-3 * math.sqrt(100 + 100**2 / 10)):.3g}"
    assert position["decides"] and position["source"].startswith("gyro N in the static window (")


def test_a_budget_names_its_sources_and_what_is_missing() -> None:
    tables = list(budget_tables(errors(), SIMULATED, "practical"))
    assert [(t["sensor"], t["simulated"]) for t in tables] == [
        ("poor", False), ("good", True), ("gyro", False),
    ]  # fmt: skip
    lines = {line["error"]: line["cells"][0] for line in tables[0]["lines"]}
    assert tables[0]["times"] == ["60 s"]
    assert lines["heading (°)"]["lines"][0] == f"{math.degrees(1e-3 * math.sqrt(120)):.3g}"
    assert "gyro N 50 %" in lines["heading (°)"]["lines"]
    assert lines["north, found at rest (°)"]["lines"][0] == "none"  # 1e-3 rad/s against the Earth's
    assert [line["error"] for line in tables[2]["lines"]] == [
        "heading (°)", "north, found at rest (°)",
    ]  # fmt: skip
    assert "velocity, one axis: no accelerometer in the recording" in tables[2]["missing"]
