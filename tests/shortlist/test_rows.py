"""Margins from datasheets alone, held against closed forms of the error's growth."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, get_args

import pytest

from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.model.states import ShortlistVerdict
from imubench_pipeline.navigation.shortlist import (
    MeasuredRanges,
    collect_measured_ranges,
    collect_printed_ranges,
    list_shortlist_rows,
)
from imubench_pipeline.noise import FLOOR, Flicker, GaussMarkov
from imubench_pipeline.noise.growth import Uncalibrated
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.sensor import Sensor
from imubench_pipeline.settings.validation import parse
from imubench_pipeline.tables.files import build
from tests.conftest import catalogue
from tests.rows import typed
from tests.test_configuration import SENSOR

DEG = math.pi / 180
TIME = 100.0
AT_MOST = 2.0 * DEG
NOTHING = MeasuredRanges({}, {})
DENSITY = {"value": 0.01, "unit": "deg/s/sqrt(Hz)", "sidedness": "one-sided"}
N = 0.01 * DEG / math.sqrt(2)


def requirement(**changes: Any) -> Requirement:
    given = {
        "title": "heading",
        "turn_on": {"gyro": "0 deg/s", "accel": "0 mg", "on_time": "1 s"},
        "limits": [{"error": "heading", "after": f"{TIME:g} s", "at_most": "2 deg"}],
    }
    return Requirement.model_validate(given | changes)


def sensor(price_class: str | None = "consumer, about US$5", **gyro: Any) -> Sensor:
    given = SENSOR | {"price_class": price_class, "datasheet": {"gyro": gyro}}
    return parse(Sensor, given, "s.yaml")


def judged(
    sensors: Sensor | dict[str, Sensor],
    ranges: MeasuredRanges = NOTHING,
    asked: Requirement | None = None,
    ranking: Sequence[RankingRow] = (),
    recordings: Sequence[RecordingRow] = (),
) -> list[dict[str, Any]]:
    named = {"s": sensors} if isinstance(sensors, Sensor) else sensors
    rows = list_shortlist_rows({"r": asked or requirement()}, named, ranges, ranking, recordings)
    found: list[dict[str, Any]] = build("shortlist", rows).to_pylist()
    return found


def margin(variance_at_time: float) -> float:
    """The limit at 95 %, as a standard deviation, over an error."""
    return AT_MOST / 1.959963985 / math.sqrt(variance_at_time)


def of_class(**figures: tuple[float, float]) -> MeasuredRanges:
    of_sensor = {("m", "gyro", name): ends for name, ends in figures.items()}
    return MeasuredRanges(of_sensor, {"m": "consumer"})


def test_white_noise_alone_grows_with_the_root_of_the_time() -> None:
    (row,) = judged(sensor(noise_density=DENSITY))
    assert row["best_margin"] == pytest.approx(margin(N**2 * TIME), rel=1e-8)
    # neither B nor K is published, and no sensor is measured
    assert row["worst_margin"] is None and row["verdict"] == "worth_logging"
    assert "gyro B, K and T_B: not published, and not measured of any sensor" in "; ".join(
        row["assumed"]
    )
    assert row["decides"] == "heading within 2 deg after 100 s"


def test_a_side_that_is_not_stated_is_both() -> None:
    figures = {"B": (0.0, 0.0), "K": (0.0, 0.0)}
    (row,) = judged(sensor(noise_density=DENSITY | {"sidedness": "unknown"}), of_class(**figures))
    assert row["best_margin"] == pytest.approx(margin(N**2 * TIME), rel=1e-8)
    assert row["worst_margin"] == pytest.approx(row["best_margin"] / math.sqrt(2), rel=1e-8)
    assert "one- or two-sided, so both are considered" in "; ".join(row["assumed"])


def test_a_printed_bias_instability_is_b_or_the_minimum() -> None:
    printed = {"value": 36, "unit": "deg/h"}
    (row,) = judged(
        sensor(noise_density=DENSITY, bias_instability=printed), of_class(K=(0.0, 1e-6))
    )
    start = Uncalibrated(bias=0.0, on_time=1.0)
    floor = Flicker(0.01 * DEG).growth(0, TIME, start)
    white = N**2 * TIME
    walk = 1e-12 * (TIME**3 / 3.0 + TIME**2 * 1.0)
    assert row["best_margin"] == pytest.approx(margin(white + floor), rel=1e-8)
    assert row["worst_margin"] == pytest.approx(margin(white + floor / FLOOR**2 + walk), rel=1e-8)


def test_the_worst_correlation_time_of_the_class_counts() -> None:
    printed = {"value": 36, "unit": "deg/h"}
    known = of_class(K=(0.0, 0.0), T_B=(10.0, 400.0))
    (row,) = judged(sensor(noise_density=DENSITY, bias_instability=printed), known)
    start = Uncalibrated(bias=0.0, on_time=1.0)

    def of_process(B: float) -> list[float]:
        terms = [Flicker(B), *(GaussMarkov(B, T_B) for T_B in (10.0, math.sqrt(4000.0), 400.0))]
        return [term.growth(0, TIME, start) for term in terms]

    B = 0.01 * DEG
    assert row["best_margin"] == pytest.approx(margin(N**2 * TIME + min(of_process(B))))
    assert row["worst_margin"] == pytest.approx(margin(N**2 * TIME + max(of_process(B / FLOOR))))
    assert "as in measured sensors of class consumer (m)" in "; ".join(row["assumed"])


def test_what_fails_at_its_best_cannot_meet_the_limits() -> None:
    none = {"B": (0.0, 0.0), "K": (0.0, 0.0)}
    for factor, verdict in ((1.01, "meets_at_worst"), (0.99, "cannot_meet")):
        limit = 1.959963985 * N * math.sqrt(TIME) * factor
        asked = requirement(
            limits=[{"error": "heading", "after": "100 s", "at_most": f"{limit} rad"}]
        )
        (row,) = judged(sensor(noise_density=DENSITY), of_class(**none), asked)
        assert row["verdict"] == verdict


def test_unpublished_b_is_taken_from_datasheets_of_the_class() -> None:
    printed = {"value": 36, "unit": "deg/h"}
    silent, other = sensor(noise_density=DENSITY), sensor(bias_instability=printed)
    classes = {"s": "consumer", "o": "consumer"}
    ranges = MeasuredRanges({}, classes, collect_printed_ranges({"s": silent, "o": other}))
    assert ranges.printed == {("o", "gyro"): pytest.approx((0.01 * DEG, 0.01 * DEG / FLOOR))}
    (row,) = judged(silent, ranges)
    start = Uncalibrated(bias=0.0, on_time=1.0)
    floor = Flicker(0.01 * DEG).growth(0, TIME, start)
    assert row["best_margin"] == pytest.approx(margin(N**2 * TIME + floor), rel=1e-8)
    assert "as in data sheets of class consumer (o)" in "; ".join(row["assumed"])


def test_options_are_all_there_to_buy_unless_one_is_stated() -> None:
    graded = [DENSITY | {"option": "A"}, DENSITY | {"value": 0.03, "option": "B"}]
    none = of_class(B=(0.0, 0.0), K=(0.0, 0.0))
    (row,) = judged(sensor(noise_density=graded), none)
    assert row["best_margin"] / row["worst_margin"] == pytest.approx(3.0)
    assert "gyro: any of the options A, B" in "; ".join(row["assumed"])


def test_what_is_not_judged_says_why() -> None:
    (row,) = judged(sensor(bias_instability={"value": 3, "unit": "deg/h"}))
    assert row["verdict"] == "not_judged" and "no noise density of the gyro" in "; ".join(
        row["reasons"]
    )
    (row,) = judged(sensor(noise_density=DENSITY), asked=requirement(price_class=["tactical"]))
    assert (row["verdict"], row["reasons"]) == ("not_judged", [])
    (price,) = row["shortfalls"]
    assert (price["property"], price["asked"]) == ("price_class", "tactical")
    assert price["subject"] == row["price_class"]
    assert row["best_margin"] is not None


def test_what_is_measured_stands_beside_it() -> None:
    standing = {"requirement": "r", "sensor": "s", "recording": "a", "decides": True,
                "margin": 1.5, "verdict": "meets"}  # fmt: skip
    for simulated, words in ((True, "simulated logs"), (False, "logs")):
        (row,) = judged(
            sensor(noise_density=DENSITY),
            ranking=typed(RankingRow, [standing]),
            recordings=typed(
                RecordingRow, [{"sensor": "s", "recording": "a", "simulated": simulated}]
            ),
        )
        assert (row["measured_margin"], row["measured_margin_of"]) == (1.5, words)
        assert row["measured_verdict"] == "meets"


def parameter(name: str, status: str, value: float | None, **limits: Any) -> ParameterRow:
    row = {"sensor": "m", "recording": "a", "channel": "gyro_x", "recommended": True,
            "component": 1, "parameter": name, "status": status, "value": value,
            "lower": None, "upper": None} | limits  # fmt: skip
    return typed(ParameterRow, [row])[0]


def test_ranges_are_those_of_real_logs_that_decide() -> None:
    rows = [
        parameter("B_curve", "ok", 2.0, lower=1.0, upper=3.0),
        parameter("K", "absent", None, upper=5.0),
        parameter("T_B", "not_identified", None, lower=1.0, upper=1e4),
    ]
    row = {"sensor": "m", "recording": "a", "simulated": False, "status": "ok",
           "decides": True}  # fmt: skip
    (about,) = typed(RecordingRow, [row])
    found = collect_measured_ranges(rows, [about], {"m": "consumer"})
    assert found.of_sensor == {("m", "gyro", "B"): (1.0, 3.0), ("m", "gyro", "K"): (0.0, 5.0)}
    other = found.span("tactical", "gyro", "B")
    assert other is not None and "of any class" in other.words
    assert found.span("consumer", "gyro", "T_B") is None
    shown = [*rows, replace(parameter("K", "ok", 2.0, lower=1.5, upper=2.5), recording="b")]
    both = collect_measured_ranges(shown, [about, replace(about, recording="b")], {"m": "consumer"})
    assert both.of_sensor["m", "gyro", "K"] == (0.0, 2.5)
    for change in ({"simulated": True}, {"decides": False}):
        assert collect_measured_ranges(rows, [replace(about, **change)], {}).of_sensor == {}


def test_the_whole_catalogue_is_judged() -> None:
    sensors = catalogue()
    drone = Requirement.model_validate(
        {"title": "t", "static_window": "5 s",
         "limits": [{"error": "position", "after": "10 s", "at_most": "3 m"}]}
    )  # fmt: skip
    rows = judged(sensors, asked=drone)
    assert {row["sensor"] for row in rows} == set(sensors)
    assert {row["verdict"] for row in rows} <= set(get_args(ShortlistVerdict))
    margins = [row["best_margin"] for row in rows if row["best_margin"] is not None]
    assert len(margins) > 20 and margins == sorted(margins, reverse=True)
    assert all(
        row["worst_margin"] is None or row["worst_margin"] <= row["best_margin"]
        for row in rows
        if row["best_margin"] is not None
    )
