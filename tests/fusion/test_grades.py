"""How many of a sensor reach what is printed of a better one, with a pocket calculator."""

import math
from typing import Any

import pytest

from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.extensions.fusion.fusion import yield_grade_rows
from imubench_pipeline.navigation.ratios import ComparedChannel
from imubench_pipeline.tables.files import build
from tests.conftest import catalogue

HOUR = math.pi / 180.0 / 3600.0
CATALOGUE = catalogue()


def channel(
    n: float, floor: float | None, axis: str = "x", sensor: str = "cheap", **about: Any
) -> ComparedChannel:
    """N in °/√h, and the lowest point of the curve in °/h."""
    noise = n * 60.0 * HOUR
    own = {"N": Parameter(noise, lower=0.9 * noise, upper=1.1 * noise)}
    lowest = (
        Parameter(None, "not_identified", "too short", 0.0, 0.6 * HOUR)
        if floor is None
        else Parameter(floor * HOUR)
    )
    estimate = Estimate("likelihood", own, curve={"sigma_min": lowest})
    names = {"recording": "r", "channel": f"gyro_{axis}", "simulated": False, "duration": 1e4}
    return ComparedChannel(sensor, estimate=estimate, **(names | about))


def rows_of(*channels: ComparedChannel, grade: str = "stim300") -> dict[tuple[str, str], Any]:
    grades = {grade: CATALOGUE[grade]}
    rows = build("grades", yield_grade_rows(channels, grades)).to_pylist()
    return {(row["option"] or "", row["statistic"]): row for row in rows}


def test_the_number_is_the_ratio_squared() -> None:
    # STIM300: 0.15 °/√h, 0.3 °/h.
    found = rows_of(channel(0.27, 1.5))
    assert found["", "N"]["n"] == pytest.approx((0.27 / 0.15) ** 2)
    assert found["", "N"]["n_upper"] == pytest.approx((1.1 * 0.27 / 0.15) ** 2)
    assert found["", "sigma_min"]["n"] == pytest.approx(25.0)


def test_each_option_has_its_own_number() -> None:
    found = rows_of(channel(0.27, 1.5), grade="hg4930")
    assert {option for option, _ in found} == {"A", "B", "C"}
    assert found["C", "N"]["n"] == pytest.approx((0.27 / 0.04) ** 2)
    assert found["A", "sigma_min"]["n"] == pytest.approx((1.5 / 0.45) ** 2)


def test_what_is_not_printed_or_not_identified_has_no_number() -> None:
    found = rows_of(channel(0.27, 1.5), grade="lsm9ds1")
    assert all(row["n"] is None and row["reason"] for row in found.values())
    row = rows_of(channel(0.27, None))["", "sigma_min"]
    assert row["n"] is None and row["reason"] == "too short" and row["printed"] > 0
    assert row["n_upper"] == pytest.approx((0.6 / 0.3) ** 2)  # by the upper limit


def test_the_middle_axis_answers_and_a_measured_log_before_a_simulated() -> None:
    axes = [channel(n, 1.0, axis) for n, axis in ((0.1, "x"), (0.3, "y"), (0.2, "z"))]
    assert rows_of(*axes)["", "N"]["channel"] == "gyro_z"
    simulated = channel(9.0, 1.0, recording="sim_a", simulated=True)
    assert rows_of(*axes, simulated)["", "N"]["recording"] == "r"


def test_a_grade_is_not_held_against_itself() -> None:
    assert list(yield_grade_rows([channel(0.1, 1.0)], {"cheap": CATALOGUE["stim300"]})) == []
