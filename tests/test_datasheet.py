import math
from typing import Any

import numpy as np
import pytest

from imubench_pipeline.datasheet import deltas
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.noise import FLOOR, NoiseModel
from imubench_pipeline.sensor import Datasheet

DEG = math.pi / 180
TAU = np.geomspace(0.01, 1e4, 61)


def sheet(**figures: dict[str, Any]) -> Datasheet:
    return Datasheet.model_validate({"gyro": figures})


def estimate(**values: float | None) -> Estimate:
    parameters = dict.fromkeys(("N", "B", "T_B", "K"), Parameter(None, "absent", "no such term"))
    return Estimate("weighted", parameters | {k: Parameter(v) for k, v in values.items()})


def rows(datasheet: Datasheet, found: Estimate, channel: str = "gyro_x") -> dict:
    listed = list(deltas(datasheet, channel, found, TAU, 0.1))
    return {
        (row.statistic if row.quantity == "bias_instability" else row.quantity, row.sidedness): row
        for row in listed
    }


def test_table_4_of_the_first_paper_both_ways() -> None:
    density = {"value": 0.007, "unit": "deg/s/sqrt(Hz)", "sidedness": "unknown"}
    found = rows(sheet(noise_density=density), estimate(N=8.4e-5))
    two, one = found["N", "two-sided"], found["N", "one-sided"]
    assert two.comparable == pytest.approx(1.2217e-4, rel=1e-4)
    assert two.delta == pytest.approx(-0.31, abs=0.01)
    assert two.verdict == "better than typ"
    assert one.comparable == pytest.approx(8.64e-5, rel=1e-3)
    assert one.delta == pytest.approx(-0.03, abs=0.005)
    assert one.verdict == "as printed"
    assert "does not say" in (one.reason or "")


def test_the_accelerometer_of_the_same_table() -> None:
    accel = {"noise_density": {"value": 120, "unit": "ug/sqrt(Hz)"}}
    found = rows(Datasheet.model_validate({"accel": accel}), estimate(N=9.6e-4), "accel_x")
    assert found["N", "one-sided"].delta == pytest.approx(0.15, abs=0.005)
    assert found["N", "two-sided"].delta == pytest.approx(-0.18, abs=0.005)


def test_a_stated_side_gives_one_row() -> None:
    # ADIS16470: 0.008 deg/s/sqrt(Hz) one-sided and 0.34 deg/sqrt(h) are the same N
    density = {"value": 0.008, "unit": "deg/s/sqrt(Hz)", "sidedness": "one-sided"}
    walk = {"value": 0.34, "unit": "deg/sqrt(h)"}
    found = rows(sheet(noise_density=density, random_walk=walk), estimate(N=0.34 / 60 * DEG))
    assert set(found) >= {("N", "one-sided"), ("N", None)}
    assert ("N", "two-sided") not in found
    assert found["N", "one-sided"].comparable == pytest.approx(0.339 / 60 * DEG, rel=2e-3)
    assert found["N", None].delta == pytest.approx(0.0, abs=1e-12)


def test_bias_instability_is_compared_with_the_minimum_of_the_curve() -> None:
    printed = {"value": 10, "unit": "deg/h"}
    plateau = 10 / 3600 * DEG
    found = rows(
        sheet(bias_instability=printed), estimate(N=1e-4, B=plateau / FLOOR, T_B=100.0, K=3e-6)
    )
    model = NoiseModel(N=1e-4, B=plateau / FLOOR, T_B=100.0, K=3e-6)
    minimum = float(np.sqrt(model.allan_variance(TAU)).min())
    assert found["adev_minimum", None].measured == pytest.approx(minimum)
    assert found["adev_minimum", None].delta == pytest.approx(minimum / plateau - 1)
    assert found["plateau", None].measured == pytest.approx(plateau)
    assert found["plateau", None].verdict == "as printed"


def test_a_curve_that_only_falls_has_no_minimum_to_compare() -> None:
    row = rows(sheet(bias_instability={"value": 10, "unit": "deg/h"}), estimate(N=1e-4))[
        "adev_minimum", None
    ]
    assert row.verdict == "not measured"
    assert "no minimum" in (row.reason or "")


def test_what_is_read_from_the_curve_is_its_minimum() -> None:
    read = Estimate("curve", {"N": Parameter(1e-4), "B": Parameter(1e-4), "T_B": Parameter(10.0)})
    read = Estimate("curve", {**read.parameters, "K": Parameter(None, "not_shown", "no slope")})
    row = rows(sheet(bias_instability={"value": 10, "unit": "deg/h"}), read)["adev_minimum", None]
    assert row.measured == pytest.approx(FLOOR * 1e-4)


def test_what_is_not_published_is_listed() -> None:
    found = rows(sheet(), estimate(N=1e-4, B=1e-4, T_B=10.0, K=1e-6))
    assert {key[0] for key in found} == {"N", "adev_minimum", "plateau", "K", "T_B"}
    assert {row.verdict for row in found.values()} == {"not published"}
    assert found["K", None].measured == 1e-6
    assert found["K", None].delta is None
    null = {"value": None, "unit": "deg/h"}
    assert rows(sheet(bias_instability=null), estimate())["plateau", None].verdict == (
        "not published"
    )


def test_what_is_not_measured_has_its_reason() -> None:
    row = rows(sheet(bias_instability={"value": 1, "unit": "deg/h"}), estimate(N=1e-4))[
        "plateau", None
    ]
    assert row.verdict == "not measured"
    assert row.reason == "absent: no such term"
    assert row.delta is None


@pytest.mark.parametrize(
    ("kind", "measured", "verdict"),
    [
        ("typ", 1.2, "worse than typ"),
        ("typ", 1.05, "as printed"),
        ("typ", 0.8, "better than typ"),
        ("max", 1.01, "worse than max"),
        ("max", 0.5, "as printed"),
    ],
)
def test_verdicts(kind: str, measured: float, verdict: str) -> None:
    walk = {"value": 60, "unit": "deg/sqrt(h)", "kind": kind}
    assert rows(sheet(random_walk=walk), estimate(N=measured * DEG))["N", None].verdict == verdict
