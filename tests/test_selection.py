import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.navigation.expected_errors import (
    list_error_rows,
    list_requirement_questions,
    list_standard_questions,
)
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.tables.files import build
from imubench_pipeline.words.verdicts import source_text
from tests.ranking import ranking_rows

DEGREE = math.pi / 180
G = 9.80665
NAMES = {"sensor": "s", "recording": "r"}


def known(value: float, share: float = 0.01) -> Parameter:
    return Parameter(value, lower=value * (1 - share), upper=value * (1 + share))


def white(N: float, share: float = 0.01) -> Estimate:
    return Estimate("likelihood", {"N": known(N, share)})


def requirement(*limits: tuple[str, str, str], **keys: Any) -> Requirement:
    listed = [{"error": e, "after": t, "at_most": size} for e, t, size in limits]
    return Requirement.model_validate(
        {"title": "t", "static_window": "1 h", "limits": listed} | keys
    )


def errors_of(
    sensors: dict[str, dict[str, Estimate]], asked: dict[str, Requirement]
) -> Iterator[Any]:
    questions = [q for name, one in asked.items() for q in list_requirement_questions(name, one)]
    for sensor, estimates in sensors.items():
        names = {"sensor": sensor, "recording": "r"}
        rows = list_error_rows(names, estimates, questions, draws=200, seed=1)
        yield from build("error_budget", rows).to_pylist()


def ranking(
    sensors: dict[str, dict[str, Estimate]],
    asked: Requirement,
    price_class: str | None = None,
) -> dict[str, Any]:
    about = {sensor: {"price_class": price_class} for sensor in sensors}
    rows = ranking_rows(errors_of(sensors, {"robot": asked}), {"robot": asked}, about)
    return {row["sensor"]: row for row in build("ranking", rows).to_pylist() if row["decides"]}


def test_white_noise_grows_as_it_must() -> None:
    """The MTi-7: 5.1 m from the gyros' white noise after a minute, 0.26 m from the others'."""
    estimates = {"gyro_x": white(8.4e-5), "accel_x": white(98e-6 * G)}
    questions = list(list_standard_questions([60.0], 1e9, math.pi / 4, ["worst"]))
    rows = build("error_budget", list_error_rows(NAMES, estimates, questions, draws=50, seed=1))
    found = {(r.error, source_text(r)): r.sigma for r in ErrorBudgetRow.rows_of(rows)}
    assert found["heading", "total"] == pytest.approx(8.4e-5 * math.sqrt(60), rel=1e-3)
    assert found["position", "gyro N"] == pytest.approx(5.14, abs=0.01)
    assert found["position", "accel N"] == pytest.approx(0.258, abs=0.001)
    assert found["velocity", "gyro N"] == pytest.approx(G * 8.4e-5 * math.sqrt(60**3 / 3))
    north = 8.4e-5 / math.sqrt(60) / (7.292115e-5 * math.cos(math.pi / 4))
    assert found["north", "total"] == pytest.approx(north)


def test_the_worst_and_the_median_axis_answer() -> None:
    estimates = {
        f"gyro_{axis}": white(N) for axis, N in zip("xyz", (2e-4, 1e-4, 3e-4), strict=True)
    }
    questions = [
        q
        for q in list_standard_questions([1.0], 1e9, 0.0, ["worst", "median"])
        if q.error == "heading"
    ]
    rows = list(list_error_rows(NAMES, estimates, questions, draws=20, seed=1))
    totals = {row["axis"]: row for row in rows if row["source"] == "total"}
    assert (totals["worst"]["gyro"], totals["median"]["gyro"]) == ("gyro_z", "gyro_x")
    assert totals["worst"]["sigma"] == pytest.approx(3e-4, rel=1e-3)


def test_intervals_are_those_of_the_estimates() -> None:
    questions = [
        q for q in list_standard_questions([1.0], 1e9, 0.0, ["worst"]) if q.error == "heading"
    ]
    rows = list(list_error_rows(NAMES, {"gyro_x": white(1e-4, 0.3)}, questions, draws=4000, seed=1))
    assert rows[0]["lower"] == pytest.approx(0.7e-4, rel=0.02)
    assert rows[0]["upper"] == pytest.approx(1.3e-4, rel=0.02)


def test_sensors_are_ranked_with_ties() -> None:
    limit = requirement(("heading", "100 s", "0.1 deg"))
    sensors = {
        "good": {"gyro_x": white(2e-5)},
        "fair": {"gyro_x": white(5e-5, 0.3)},
        "alike": {"gyro_x": white(5.5e-5, 0.3)},
        "poor": {"gyro_x": white(1e-3)},
        "accelerometer": {"accel_x": white(1e-3)},
    }
    found = ranking(sensors, limit)
    ranks = {sensor: row["rank"] for sensor, row in found.items()}
    assert ranks == {"good": 1, "fair": 2, "alike": 2, "poor": 4, "accelerometer": None}
    assert found["fair"]["tied_with"] == ["alike"] and found["good"]["tied_with"] == []
    # 0.1 deg at 95 % is 8.9e-4 rad; N sqrt(100 s) is 2e-4, 5e-4 and 1e-2.
    assert found["good"]["verdict"] == "meets"
    assert found["good"]["at_most"] == pytest.approx(0.1 * DEGREE)
    assert found["good"]["margin"] == pytest.approx(0.1 * DEGREE / 1.959964 / 2e-4, rel=0.03)
    assert found["poor"]["verdict"] == "fails" and found["poor"]["chance"] < 1e-6
    assert found["accelerometer"]["verdict"] == "not_enough_data"
    assert "no gyro" in "; ".join(found["accelerometer"]["reasons"])
    # N^2 (t + t^2 / 3600 s), with the error of the bias from the static hour, is the limit squared.
    squared = (0.1 * DEGREE / 1.959964 / 2e-5) ** 2
    reached = 1800 * (math.sqrt(1 + squared / 900) - 1)
    assert found["good"]["reached_after"] == pytest.approx(reached, rel=1e-6)


@pytest.mark.parametrize(
    ("N", "verdict"),
    [(5e-5, "meets"), (8e-5, "likely_meets"), (1e-4, "likely_fails"), (2e-4, "fails")],
)
def test_verdicts_follow_the_chance(N: float, verdict: str) -> None:
    found = ranking({"s": {"gyro_x": white(N, 0.3)}}, requirement(("heading", "100 s", "0.1 deg")))
    assert found["s"]["verdict"] == verdict


def test_what_the_log_does_not_tell_is_not_enough_data() -> None:
    vague = Estimate(
        "likelihood",
        {"N": known(1e-6), "K": Parameter(None, "not_identified", "x", 1e-7, 1e-4, None, 3e-6)},
    )
    found = ranking({"s": {"gyro_x": vague}}, requirement(("heading", "100 s", "0.3 deg")))
    assert found["s"]["verdict"] == "not_enough_data"
    assert "K of gyro x is not determined" in "; ".join(found["s"]["reasons"])


def test_a_log_of_which_nothing_is_known_is_no_sensor_without_noise() -> None:
    silent = Estimate("likelihood", {"N": Parameter(None, "not_shown", "too short a log")})
    asked = requirement(("heading", "100 s", "0.3 deg"))
    found = ranking({"mute": {"gyro_x": silent}, "s": {"gyro_x": white(1e-5)}}, asked)
    assert found["mute"]["verdict"] == "not_enough_data"
    assert found["mute"]["sigma"] is None
    assert "the noise of gyro x is not known: too short a log" in "; ".join(
        found["mute"]["reasons"]
    )
    assert (found["s"]["rank"], found["mute"]["rank"]) == (1, None)
    # One axis of several: the others answer, and it is said.
    found = ranking({"s": {"gyro_x": white(1e-5), "gyro_y": silent}}, asked)
    assert found["s"]["sigma"] is not None
    assert "gyro y is not used" in "; ".join(found["s"]["reasons"])


def test_the_limit_with_the_least_margin_decides_and_the_source_is_named() -> None:
    asked = requirement(("heading", "100 s", "0.1 deg"), ("position", "100 s", "1 km"))
    sensor = {"gyro_x": white(5e-5), "accel_x": white(1e-3)}
    rows = list(
        ranking_rows(
            errors_of({"s": sensor}, {"robot": asked}),
            {"robot": asked},
            {"s": {"price_class": None}},
        )
    )
    assert [(row["error"], row["decides"]) for row in rows] == [
        ("heading", True),
        ("position", False),
    ]
    assert rows[0]["source"] == "N" and rows[0]["share"] == pytest.approx(1.0, abs=0.05)


@pytest.mark.parametrize(
    ("N", "verdict", "rank"), [(1e-3, "fails", 1), (1e-6, "not_enough_data", None)]
)
def test_what_surely_fails_fails_whatever_else_is_not_known(
    N: float, verdict: str, rank: int | None
) -> None:
    asked = requirement(("heading", "100 s", "0.1 deg"), ("position", "100 s", "1 m"))
    found = ranking({"s": {"gyro_x": white(N)}}, asked)
    assert (found["s"]["verdict"], found["s"]["rank"]) == (verdict, rank)


def test_a_sensor_outside_the_price_class_is_not_ranked() -> None:
    asked = requirement(("heading", "100 s", "0.1 deg"), price_class=["chip"])
    found = ranking({"s": {"gyro_x": white(5e-5)}}, asked, "tactical")
    assert found["s"]["rank"] is None and found["s"]["verdict"] == "excluded"
    expected = {"property": "price_class", "subject": "tactical", "asked": "chip", "has": []}
    assert found["s"]["shortfalls"] == [expected]
    found = ranking({"s": {"gyro_x": white(5e-5)}}, asked, None)
    assert found["s"]["verdict"] == "excluded"
    assert found["s"]["shortfalls"] == [expected | {"subject": ""}]


def test_ties_are_stable(rng: np.random.Generator) -> None:
    """Sensors that are the same are tied, however their estimates scatter."""
    asked = requirement(("heading", "100 s", "0.1 deg"))
    for _ in range(20):
        # Three estimates of one truth, with the interval that belongs to their scatter.
        scatter = 5e-5 * np.exp(0.05 * rng.standard_normal(3).clip(-1.9, 1.9))
        sensors = {f"s{i}": {"gyro_x": white(float(N), 0.1)} for i, N in enumerate(scatter)}
        assert {row["rank"] for row in ranking(sensors, asked).values()} == {1}
