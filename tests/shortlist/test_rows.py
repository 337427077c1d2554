"""Rows of the whole catalogue, against closed forms of the growth of errors."""

import math
from collections.abc import Sequence
from typing import Any

import pytest

from imubench_pipeline.datasheets.class_limits import find_limit
from imubench_pipeline.model.comparisons import RankingRow
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.navigation.shortlist import list_shortlist_rows
from imubench_pipeline.noise import FLOOR, Flicker
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
Z = 1.959963984540054
LIMIT = 0.1
N, B, K = 0.01 * DEG, 0.01 * DEG, 1e-6
DENSITY = {"value": 0.01, "unit": "deg/s/sqrt(Hz)", "sidedness": "two-sided"}
FLOOR_PRINTED = {"value": 36, "unit": "deg/h"}
NOISE = {"noise_density": DENSITY, "bias_instability": FLOOR_PRINTED}
WALK = {"rate_random_walk": {"value": K, "unit": "rad/s/sqrt(s)"}}
ENDS = ("margin", "likely_margin", "best_margin")
WALK_TIMES = (500.0, 2000.0, 9000.0)
"""Times, s, after which an unknown walk is as large as B: in use, likely, at best."""


def requirement(at_most: float = LIMIT, **changes: Any) -> Requirement:
    """Return a requirement with a limit of 1 sigma, rad, on the heading."""
    given = {
        "title": "heading",
        "turn_on": {"gyro": "0 deg/s", "accel": "0 mg", "on_time": "1 s"},
        "limits": [{"error": "heading", "after": f"{TIME:g} s", "at_most": f"{at_most * Z} rad"}],
    }
    return Requirement.model_validate(given | changes)


def sensor(price_class: str | None = "consumer, about US$5", **gyro: Any) -> Sensor:
    given = SENSOR | {"price_class": price_class, "grade": "industrial"}
    return parse(Sensor, given | {"datasheet": {"gyro": gyro}}, "s.yaml")


def judged(
    sensors: Sensor | dict[str, Sensor],
    asked: Requirement | None = None,
    ranking: Sequence[RankingRow] = (),
    recordings: Sequence[RecordingRow] = (),
) -> list[dict[str, Any]]:
    named = {"s": sensors} if isinstance(sensors, Sensor) else sensors
    rows = list_shortlist_rows({"r": asked or requirement()}, named, ranking, recordings)
    found: list[dict[str, Any]] = build("shortlist", rows).to_pylist()
    return found


def heading(n: float, b: float, k: float, *others: float) -> float:
    """Return the heading error from noise after a second of warm-up, and other errors, rad."""
    flicker = Flicker(b / FLOOR).growth(0, TIME, Uncalibrated(bias=0.0, on_time=1.0))
    walk = k**2 * (TIME**3 / 3.0 + TIME**2 * 1.0)
    return math.hypot(math.sqrt(n**2 * TIME + flicker + walk), *others)


def walk_of(b: float, time: float) -> float:
    """Return K of a walk that is as large as B at a time: K^2 t / 3 = B^2."""
    return b * math.sqrt(3.0 / time)


def test_a_sensor_that_prints_its_noise_has_one_margin() -> None:
    (row,) = judged(sensor(**NOISE, **WALK))
    expected = LIMIT / heading(N, B, K)
    assert [row[name] for name in (*ENDS, "noise_margin")] == pytest.approx([expected] * 4)
    assert (row["verdict"], row["rank"], row["basis"]) == ("meets", 1, "printed")
    assert (row["conditions"], row["assumed"]) == ([], [])
    assert row["decides"].startswith("heading within")
    assert {part["origin"] for part in row["parts"]} == {"datasheet"}


def test_an_unknown_walk_is_as_large_as_the_bias_instability_after_a_time() -> None:
    (row,) = judged(sensor(**NOISE))
    assert [row[name] for name in ENDS] == pytest.approx(
        [LIMIT / heading(N, B, walk_of(B, time)) for time in WALK_TIMES]
    )
    assert row["assumed"] == ["gyro K: not printed, worst of its class"]


def test_noise_that_is_not_printed_is_that_of_the_class() -> None:
    (row,) = judged(sensor())
    limits = [find_limit("industrial", "gyro", figure) for figure in ("N", "B")]
    for end, name, time in zip(("worst", "median", "best"), ENDS, WALK_TIMES, strict=True):
        n, b = (getattr(limit, end) for limit in limits)
        assert row[name] == pytest.approx(LIMIT / heading(n, b, walk_of(b, time)))
    assert {part["origin"] for part in row["parts"]} == {"class limit"}


TURN = {"environment": {"turns": "180 deg"}}
SCALE = find_limit("industrial", "gyro", "scale_factor")
LINEAR = {"nonlinearity": {"value": 1e-9, "unit": "1"}}
WORST, BEST = (heading(N, B, K, math.pi * size) for size in (SCALE.worst, SCALE.best))


@pytest.mark.parametrize(
    ("limit", "verdict"),
    [
        (1.01 * WORST, "meets"),
        (0.99 * WORST, "meets_if"),
        (1.01 * BEST, "meets_if"),
        (0.99 * BEST, "cannot_meet"),
    ],
)
def test_the_verdict_follows_from_the_ends_of_the_class(limit: float, verdict: str) -> None:
    (row,) = judged(sensor(**NOISE, **WALK, **LINEAR), requirement(limit, **TURN))
    assert row["margin"] == pytest.approx(limit / WORST, rel=1e-6)
    assert row["best_margin"] == pytest.approx(limit / BEST, rel=1e-6)
    assert row["noise_margin"] == pytest.approx(limit / heading(N, B, K))
    assert row["verdict"] == verdict and row["rank"] == 1
    sizes = [(each["figure"], each["subject"]) for each in row["conditions"]]
    assert sizes == [("scale_factor", "gyro")] * (verdict == "meets_if")
    for each in row["conditions"]:
        room = math.sqrt(limit**2 - heading(N, B, K) ** 2)
        assert each["largest"] == pytest.approx(room / math.pi, rel=1e-6)


def test_noise_that_decides_is_for_a_log() -> None:
    ends = [heading(N, B, walk_of(B, time)) for time in WALK_TIMES]
    (row,) = judged(sensor(**NOISE), requirement(math.sqrt(ends[0] * ends[2])))
    assert (row["verdict"], row["conditions"]) == ("not_enough_data", [])
    assert row["reasons"] == ["its datasheet does not print all noise parameters: a log is needed"]
    # It is ranked among those that fail.
    assert row["rank"] == 1


def test_a_sensor_that_lacks_something_is_excluded_and_not_ranked() -> None:
    (row,) = judged(sensor(**NOISE), requirement(price_class=["tactical"]))
    (price,) = row["shortfalls"]
    assert (row["verdict"], row["rank"], price["property"]) == ("excluded", None, "price_class")
    assert (price["subject"], price["asked"]) == (row["price_class"], "tactical")
    assert row["margin"] is not None
    # A property that is not known is a condition.
    (row,) = judged(sensor(**NOISE, **WALK), requirement(must={"mass": "30 g"}))
    assert (row["verdict"], row["rank"]) == ("meets_if", None)
    assert [each["property"] for each in row["conditions"]] == ["mass"]
    alone = {"datasheet": {"gyro": NOISE, "accel": None}}
    position = [{"error": "position", "after": "10 s", "at_most": "1 m"}]
    (row,) = judged(parse(Sensor, SENSOR | alone, "s.yaml"), requirement(limits=position))
    assert (row["verdict"], row["margin"]) == ("excluded", None)
    assert [each["subject"] for each in row["shortfalls"]] == ["accel"]


@pytest.mark.parametrize(("simulated", "basis"), [(True, "simulated logs"), (False, "logs")])
def test_a_sensor_with_logs_has_its_row_of_the_ranking(simulated: bool, basis: str) -> None:
    standing = {"requirement": "r", "sensor": "s", "recording": "a", "decides": True,
                "error": "heading", "time": TIME, "margin": 0.4, "noise_margin": 4.0,
                "likely_margin": 0.7, "verdict": "fails"}  # fmt: skip
    rows = judged(
        {"s": sensor(**NOISE, **WALK), "other": sensor(**NOISE, **WALK)},
        ranking=typed(RankingRow, [standing]),
        recordings=typed(RecordingRow, [{"sensor": "s", "recording": "a", "simulated": simulated}]),
    )
    other, row = rows
    assert [other["sensor"], other["rank"], row["rank"]] == ["other", 1, 2]
    assert (row["margin"], row["noise_margin"], row["likely_margin"]) == (0.4, 4.0, 0.7)
    assert (row["basis"], row["verdict"]) == (basis, "fails")
    assert row["decides"] == other["decides"]
    # A log without a figure does not replace the datasheet.
    unknown = typed(RankingRow, [standing | {"margin": None, "verdict": "not_enough_data"}])
    (row,) = judged(sensor(**NOISE, **WALK), ranking=unknown)
    assert (row["basis"], row["verdict"]) == ("printed", "meets")


def test_the_whole_catalogue_is_judged_in_one_order() -> None:
    sensors = catalogue()
    asked = Requirement.model_validate(
        {"title": "t", "static_window": "5 s", "environment": {"temperature_change": "5 K"},
         "limits": [{"error": "position", "after": "10 s", "at_most": "3 m"}]}
    )  # fmt: skip
    rows = judged(sensors, asked)
    assert {row["sensor"] for row in rows} == set(sensors)
    ranked = [row for row in rows if row["rank"]]
    assert [row["rank"] for row in ranked] == list(range(1, len(ranked) + 1))
    assert all(row["verdict"] == "excluded" for row in rows if not row["rank"])
    margins = [row["margin"] for row in ranked]
    assert len(margins) > 20 and margins == sorted(margins, reverse=True)
    for row in ranked:
        assert row["margin"] <= row["likely_margin"] * (1 + 1e-9)
        assert row["likely_margin"] <= row["best_margin"] * (1 + 1e-9)
        assert row["margin"] <= row["noise_margin"] * (1 + 1e-9)
        expected = (row["margin"] >= 1.0, row["best_margin"] < 1.0)
        assert expected == (row["verdict"] == "meets", row["verdict"] == "cannot_meet")
