"""The answer to a requirement on the start page, with its numbers, data and alternatives."""

from types import SimpleNamespace
from typing import Any

import pytest
from markupsafe import Markup, escape

from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.model.verdicts import Condition, DoubtMark, UnitFactor
from imubench_pipeline.report import start
from imubench_pipeline.report.meaning import format_rankings
from imubench_pipeline.tables.files import build
from tests.report.tables import ROBOT

NAMES = {name: name.upper() for name in "abc"}
LIMIT = (
    "Deciding limit: heading, 100 s. Expected error (1σ) 0.29 ° (0.23 to 0.34); "
    "the limit allows 0.573 ° (1σ)."
)
DATA = "Data: one recording, r (2 h, 1 axis); other specimens may differ."


def row(sensor: str = "a", **values: Any) -> dict[str, Any]:
    plain = {"requirement": "robot", "sensor": sensor, "rank": 1, "verdict": "meets",
             "decides": True, "recording": "r", "error": "heading", "time": 100.0, "limit": 0.01,
             "sigma": 0.005, "lower": 0.004, "upper": 0.006, "unit": "rad", "margin": 2.0,
             "chance": 0.987, "limit_verdict": "meets", "recordings": 1, "specimens": 1,
             "evidence": "strong"}  # fmt: skip
    return plain | values


UNKNOWN = dict.fromkeys(("rank", "sigma", "lower", "upper", "margin", "chance", "recordings"))


def said(*rows: dict[str, Any], simulated: bool = False) -> tuple[str, list[str]]:
    """Return the answer, and the lines below it."""
    table = RankingRow.rows_of(build("ranking", rows))
    of = {(one.sensor, "r"): simulated for one in table}
    ((_, groups),) = format_rankings(table, {"robot": ROBOT}, of, "practical")
    views = [
        SimpleNamespace(sensor=one.sensor, static=True, name="r",
                        row=SimpleNamespace(duration=7200.0), recommended=lambda: ["gyro_x"])
        for one in table
    ]  # fmt: skip
    site: Any = SimpleNamespace(names=NAMES, views=views)
    ranked = [group for group in groups if group.row.rank]
    answer = start._answer(site, groups, ranked)
    lines = list(start._details(site, groups, ranked))
    return answer, [Markup(escape(line)).striptags() for line in lines]


def test_the_best_sensor_is_named_with_the_figure_that_decides_and_its_data() -> None:
    answer, lines = said(row())
    assert answer == "A meets the limits. Only sensor with usable data."
    assert lines == [f"{LIMIT} {DATA}"]


def test_names_of_logs_are_no_markup() -> None:
    _, lines = said(row(left_out=(DoubtMark("<b>q</b>", "motion"),)))
    assert lines == [f"{LIMIT} {DATA} Not used: <b>q</b>: the sensor was moved."]


def test_a_simulated_best_sensor_is_called_so() -> None:
    assert said(row(), simulated=True)[0].startswith("A (simulated) meets the limits.")
    answer, _ = said(row(verdict="fails"), simulated=True)
    assert answer.startswith("No sensor meets the limits. A (simulated) is closest, but fails.")


def test_what_the_decisive_figure_leaves_out_is_said() -> None:
    _, lines = said(row(reasons=["K of gyro_x is not identified"]))
    assert lines == [f"{LIMIT} The error may be larger: K of gyro_x is not identified. {DATA}"]


def test_sensors_that_are_not_worse_are_named() -> None:
    _, lines = said(
        row("a", tied_with=("b", "c"), margin=3.0),
        row("b", tied_with=("a", "c")),
        row("c", tied_with=("a", "b"), verdict="likely_meets", margin=1.0),
    )
    assert lines[1:] == [
        "The difference from B and C is not statistically significant.",
        "Also meets the limits: B.",
        "Likely meets the limits: C.",
    ]


def test_conditions_are_counted_in_the_answer_and_listed_below_it() -> None:
    scale = Condition("scale_factor", None, "gyro", 1.2e-3)
    answer, lines = said(row(verdict="meets_if", conditions=(scale,)))
    assert answer == (
        "No sensor is shown to meet the limits. A meets them if its gyro scale "
        "factor error is below 1200 ppm (1σ). Only sensor with usable data."
    )
    assert lines[1] == "Conditions: its gyro scale factor error is below 1200 ppm (1σ)."


def test_a_verdict_that_a_corrected_unit_changes_is_said() -> None:
    _, lines = said(
        row("a"),
        row("b", verdict="not_enough_data", **UNKNOWN, logged_verdict="fails", logged_margin=0.1,
            corrected_verdict="meets", corrected_margin=7.0, reasons=["no data"],
            corrected_units=(UnitFactor("gyro", 0.017453292519943295),)),
    )  # fmt: skip
    assert lines[1:] == [
        "Not enough data: B (no data).",
        "With its recording in doubt, B fails (margin 0.1) as logged; "
        "meets the limits (margin 7) with the gyro data read as °/s, not as rad/s.",
    ]


def test_where_no_sensor_can_be_ranked_none_is_the_best() -> None:
    excluded = row("a", verdict="excluded", **UNKNOWN)
    answer, lines = said(excluded)
    assert answer == "No sensor has the required properties and usable data."
    assert lines == ["Excluded: A."]
    answer, _ = said(row("b", verdict="not_enough_data", **UNKNOWN), row("a"))
    assert answer == "A meets the limits. Only sensor with usable data."


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"doubts": (DoubtMark("r", "motion"),)}, f"{DATA} Doubts: the sensor was moved."),
        (
            {"left_out": (DoubtMark("q", "suspicious_unit", ("gyro_z",)),)},
            f"{DATA} Not used: q: the unit of measurement of gyro z looks wrong.",
        ),
        (
            {"recordings": 3, "specimens": 2, "spread": 0.1, "spread_of": "specimens",
             "doubts": (DoubtMark("q", "motion"),)},
            "Data: 3 recordings of 2 specimens; r (2 h, 1 axis) is nearest to the prediction. "
            "Spread: 10 % between specimens. Doubts: q: the sensor was moved.",
        ),
    ],
)  # fmt: skip
def test_the_data_of_a_verdict_are_described(values: dict[str, Any], text: str) -> None:
    assert said(row(**values))[1] == [f"{LIMIT} {text}"]
