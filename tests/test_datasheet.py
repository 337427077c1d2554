import math
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.datasheets.comparable import read_comparables
from imubench_pipeline.datasheets.deltas import (
    Delta,
    bias_deltas,
    compute_fixed_bias,
    compute_sensitivity,
    curve_rms,
    deltas,
)
from imubench_pipeline.estimators import curve as reading
from imubench_pipeline.estimators.curve_bias import compute_curve_figures
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.model.estimates import TemperatureRow
from imubench_pipeline.noise import FLOOR, NoiseModel
from imubench_pipeline.settings.printed import Datasheet
from tests.conftest import catalogue
from tests.rows import DATASHEET_VERDICTS, typed

DEG = math.pi / 180
G = 9.80665
TAU = np.geomspace(0.01, 1e4, 61)


def sheet(**figures: dict[str, Any]) -> Datasheet:
    return Datasheet.model_validate({"gyro": figures})


def estimate(**values: float | None) -> Estimate:
    parameters = dict.fromkeys(("N", "B", "T_B", "K"), Parameter(None, "absent", "no such term"))
    found = Estimate("weighted", parameters | {k: Parameter(v) for k, v in values.items()})
    curve = compute_curve_figures(found.model, TAU) | {"B_curve": found.parameters["B"]}
    return replace(found, curve=curve)


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
    assert "assumed, as the datasheet does not state it" in "; ".join(one.reasons)


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
    fine = np.geomspace(TAU[0], TAU[-1], 3001)
    minimum = float(np.sqrt(model.allan_variance(fine)).min())
    assert found["adev_minimum", None].measured == pytest.approx(minimum, rel=1e-3)
    assert found["adev_minimum", None].delta == pytest.approx(minimum / plateau - 1, abs=1e-3)
    assert found["plateau", None].measured == pytest.approx(plateau)
    assert found["plateau", None].verdict == "as printed"


def test_a_curve_that_only_falls_has_no_minimum_to_compare() -> None:
    row = rows(sheet(bias_instability={"value": 10, "unit": "deg/h"}), estimate(N=1e-4))[
        "adev_minimum", None
    ]
    assert row.verdict == "not measured"
    assert "no minimum" in "; ".join(row.reasons)


def test_what_is_read_from_the_curve_is_its_minimum() -> None:
    model = NoiseModel(N=1e-4, B=1e-4, T_B=10.0, K=1e-5)
    sizes = np.unique(np.geomspace(1, 40_000, 60).round().astype(np.int64))
    read = reading.read(
        AllanCurve(
            sizes / 10.0,
            sizes,
            model.allan_variance(sizes / 10.0),
            360_000 / sizes,
            360_000,
        )
    )
    row = rows(sheet(bias_instability={"value": 10, "unit": "deg/h"}), read)["adev_minimum", None]
    minimum = float(np.sqrt(model.allan_variance(sizes / 10.0)).min())
    assert row.measured == pytest.approx(minimum)


def test_what_is_not_published_or_not_looked_up_is_listed() -> None:
    found = rows(sheet(), estimate(N=1e-4, B=1e-4, T_B=10.0, K=1e-6))
    assert {key[0] for key in found} == {"N", "adev_minimum", "plateau", "K", "T_B"}
    assert {row.verdict for row in found.values()} == {"not looked up"}
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
    assert row.reasons == ("not in the model: no such term",)
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


def paper_tables(shared: Path, paper: str) -> dict[str, Any]:
    papers = yaml.safe_load((shared / "facts/paper_tables.yaml").read_text())["papers"]
    return next(entry for entry in papers if entry["id"] == paper)


def test_table_4_of_the_first_paper_as_printed_and_with_the_root_of_two(shared: Path) -> None:
    """The manufacturer's column is the density taken for N; one-sided it is √2 too large."""
    sensor = catalogue()["mti_7"]
    table = paper_tables(shared, "000")["table_4"]["rows"]
    expected = {"gyro": (-0.30, -0.03), "acc": (-0.20, 0.15)}
    for row in (row for row in table if row["quantity"] == "N"):
        channel = {"gyro": "gyro_x", "acc": "accel_x"}[row["sensor"]]
        found = rows(sensor.datasheet, estimate(N=row["optimised"]), channel)
        assert found["N", "two-sided"].comparable == pytest.approx(row["manufacturer"], rel=0.02)
        two_sided, one_sided = expected[row["sensor"]]
        assert row["optimised"] / row["manufacturer"] - 1 == pytest.approx(two_sided, abs=0.005)
        assert found["N", "two-sided"].delta == pytest.approx(two_sided, abs=0.02)
        assert found["N", "one-sided"].delta == pytest.approx(one_sided, abs=0.005)
    for row in (row for row in table if row["quantity"] == "B"):
        channel = {"gyro": "gyro_x", "acc": "accel_x"}[row["sensor"]]
        found = rows(sensor.datasheet, estimate(B=row["optimised"], T_B=90.0), channel)
        # the paper sets B itself beside the printed minimum; what compares is 0.664 B
        assert found["plateau", None].comparable == pytest.approx(row["manufacturer"], rel=0.025)
        assert found["plateau", None].measured == pytest.approx(0.664 * row["optimised"], rel=1e-3)


# sensor, table of the means, statistic of the printed offset, and per axis |mean| / printed - 1
OFFSETS = [
    ("scc2130", "table_2", "max", {"x": (-0.9019, "as printed")}),
    (
        "mpu9250",
        "table_3",
        "typ",
        {
            "x": (0.0348, "as printed"),
            "y": (-0.33208, "better than typ"),
            "z": (0.21868, "worse than typ"),
        },
    ),
    (
        "bno055",
        "table_4",
        "max",
        {
            "x": (0.790867, "worse than max"),
            "y": (0.694100, "worse than max"),
            "z": (1.121333, "worse than max"),
        },
    ),
]


@pytest.mark.parametrize(("name", "table", "kind", "expected"), OFFSETS)
def test_offsets_of_the_second_paper(
    shared: Path, name: str, table: str, kind: str, expected: dict[str, tuple[float, str]]
) -> None:
    sensor = catalogue()[name]
    printed = paper_tables(shared, "001")[table]["rows"]
    means = {f"gyro_{row['axis']}": row["fixed_drift"] * DEG for row in printed}
    assert len(means) == len(expected)
    for axis, (delta, verdict) in expected.items():
        listed = list(bias_deltas(sensor.datasheet, f"gyro_{axis}", means, 0.1))
        row = next(row for row in listed if row.quantity == "offset" and row.kind == kind)
        assert (row.delta, row.verdict) == (pytest.approx(delta, abs=1e-6), verdict)


@pytest.mark.parametrize(
    ("kind", "lower", "upper", "verdict"),
    [
        ("typ", 1.11, 1.3, "worse than typ"),
        ("typ", 1.09, 1.3, "not sure"),
        ("typ", 0.95, 1.05, "as printed"),
        ("typ", 0.5, 0.89, "better than typ"),
        ("typ", 0.5, 0.91, "not sure"),
        ("max", 1.01, 1.2, "worse than max"),
        ("max", 0.99, 1.2, "not sure"),
        ("max", 0.3, 0.99, "as printed"),
    ],
)
def test_a_verdict_takes_the_whole_interval(
    kind: str, lower: float, upper: float, verdict: str
) -> None:
    value = (lower + upper) / 2 * DEG
    known = estimate()
    white = Parameter(value, lower=lower * DEG, upper=upper * DEG)
    found = replace(known, parameters=known.parameters | {"N": white})
    walk = {"value": 60, "unit": "deg/sqrt(h)", "kind": kind}
    row = rows(sheet(random_walk=walk), found)["N", None]
    assert row.verdict == verdict and row.verdict in DATASHEET_VERDICTS
    assert row.delta_lower == pytest.approx(lower - 1) and row.delta_upper == pytest.approx(
        upper - 1
    )
    assert ("the 95 % interval extends from" in "; ".join(row.reasons)) == (verdict == "not sure")


def test_limits_decide_where_there_is_no_value() -> None:
    printed = {"value": 60, "unit": "deg/sqrt(h)"}
    for upper, verdict in ((0.5, "better than typ"), (1.0, "not measured"), (2.0, "not measured")):
        absent = Parameter(None, "absent", "too small to see", 0.0, upper * DEG)
        known = estimate()
        found = replace(known, parameters=known.parameters | {"N": absent})
        row = rows(sheet(random_walk=printed), found)["N", None]
        assert row.verdict == verdict
        assert "; ".join(row.reasons).startswith("not in the model: too small to see")


def all_rows(datasheet: Datasheet, found: Estimate, channel: str = "gyro_x") -> list[Delta]:
    return list(deltas(datasheet, channel, found, TAU, 0.1))


def test_typical_and_maximum_are_two_rows_with_the_printed_interval() -> None:
    printed = [
        {"value": 60, "unit": "deg/sqrt(h)", "kind": "typ"},
        {"value": 90, "unit": "deg/sqrt(h)", "kind": "max"},
    ]
    sensor = Datasheet.model_validate({"gyro": {"random_walk": printed}})
    known = estimate()
    white = Parameter(1.2 * DEG, lower=1.15 * DEG, upper=1.25 * DEG)
    found = replace(known, parameters=known.parameters | {"N": white})
    typical, largest = (row for row in all_rows(sensor, found) if row.statistic == "N")
    assert (typical.verdict, largest.verdict) == ("worse than typ", "as printed")
    for row in (typical, largest):
        assert row.comparable_lower == pytest.approx(DEG)
        assert row.comparable_upper == pytest.approx(1.5 * DEG)
        assert row.delta_lower == pytest.approx(1.15 / 1.5 - 1)
        assert row.delta_upper == pytest.approx(0.25)


@pytest.mark.parametrize(
    ("measured", "verdict"),
    [(0.5, "better than typ"), (1.2, "as printed"), (1.6, "worse than max")],
)
def test_a_printed_range(measured: float, verdict: str) -> None:
    printed = {"value": [60, 90], "unit": "deg/sqrt(h)", "kind": "range"}
    row = rows(sheet(random_walk=printed), estimate(N=measured * DEG))["N", None]
    assert row.verdict == verdict
    assert (row.printed, row.comparable) == (90.0, pytest.approx(1.5 * DEG))
    assert row.delta == pytest.approx(measured / 1.5 - 1)


def test_figures_of_an_option_are_compared_where_the_logs_have_it() -> None:
    figures = [
        {"value": v, "unit": "deg/sqrt(h)", "option": grade} for grade, v in (("A", 60), ("B", 30))
    ]
    given = {"gyro": {"random_walk": figures}}

    def noise(*options: str) -> list[Delta]:
        sensor = Datasheet.model_validate(given | {"options": options})
        return [row for row in all_rows(sensor, estimate(N=1.0 * DEG)) if row.statistic == "N"]

    (of_grade,) = noise("A")
    assert (of_grade.printed, of_grade.verdict) == (60.0, "as printed")
    for options, said in (
        ((), ". State the options of the logged sensor"),
        (("C",), ", but the sensor file states C"),
    ):
        for row, grade in zip(noise(*options), "AB", strict=True):
            assert row.verdict == "not comparable (condition)"
            assert row.comparable is None and row.delta is None
            assert f"printed for the option {grade}{said}" in "; ".join(row.reasons)
            assert row.measured == pytest.approx(DEG)


@pytest.mark.parametrize(
    ("name", "figure", "reason"),
    [
        ("random_walk", {"value": 60, "unit": "deg/sqrt(h)", "kind": "min"}, "only a minimum"),
        ("rms_noise", {"value": 0.1, "unit": "deg/s rms"}, "without its bandwidth"),
        ("allan_deviation", {"value": 1, "unit": "deg/h"}, "without its averaging time"),
    ],
)
def test_what_no_static_log_can_be_compared_with(
    name: str, figure: dict[str, Any], reason: str
) -> None:
    row = next(r for r in all_rows(sheet(**{name: figure}), estimate(N=1.0)) if r.printed)
    assert row.verdict == "not comparable (condition)"
    assert reason in "; ".join(row.reasons)


def test_a_figure_by_axis_holds_for_its_axis() -> None:
    printed = {"value": {"x": 60, "yz": 90}, "unit": "deg/sqrt(h)"}
    found = estimate(N=1.0 * DEG)
    for channel, comparable in (("gyro_x", 1.0), ("gyro_y", 1.5), ("gyro_z", 1.5)):
        row = rows(sheet(random_walk=printed), found, channel)["N", None]
        assert row.comparable == pytest.approx(comparable * DEG)
    alone = {"value": {"x": 60}, "unit": "deg/sqrt(h)"}
    assert rows(sheet(random_walk=alone), found, "gyro_z")["N", None].verdict == "not published"


def test_an_rms_over_a_bandwidth_is_compared_as_density() -> None:
    # 0.1 / √(2 * 47) = 0.010314 °/s/√Hz; with a filter of first order 0.1 / √(2 * 73.827)
    stated = {"value": 0.1, "unit": "deg/s rms", "bandwidth": "47 Hz"}
    for figure, N in ((stated, 0.010314212), (stated | {"filter": "first-order"}, 0.00822955)):
        row = rows(sheet(rms_noise=figure), estimate(N=N * DEG))["N", "one-sided"]
        assert row.comparable == pytest.approx(N * DEG, rel=1e-6)
        assert (row.verdict, row.unit) == ("as printed", "deg/s rms")


def test_a_power_density_is_compared_by_its_root() -> None:
    figure = {"value": 4e-6, "unit": "(deg/s)^2/Hz", "sidedness": "two-sided"}
    row = rows(sheet(noise_density=figure), estimate(N=2e-3 * DEG))["N", "two-sided"]
    assert row.delta == pytest.approx(0.0, abs=1e-12)


def test_an_allan_deviation_is_compared_at_its_averaging_time() -> None:
    printed = {"value": 0.5, "unit": "deg/h", "tau": "600 s"}
    value = math.sqrt(600.0) * 0.5 / 3600 * DEG  # N / √600 = 0.5 °/h
    row = next(r for r in all_rows(sheet(allan_deviation=printed), estimate(N=value)) if r.printed)
    assert (row.statistic, row.verdict) == ("adev", "as printed")
    assert row.delta == pytest.approx(0.0, abs=1e-9)
    beyond = printed | {"tau": "20000 s"}
    row = next(r for r in all_rows(sheet(allan_deviation=beyond), estimate(N=value)) if r.printed)
    assert row.verdict == "not measured"


def test_a_correlation_time_with_the_limit_0_leaves_the_other_terms_at_that_end() -> None:
    printed = {"value": 0.5, "unit": "deg/h", "tau": "600 s"}
    parameters = {
        "N": Parameter(1e-4, lower=9e-5, upper=1.1e-4),
        "B": Parameter(1e-5, lower=9e-6, upper=1.1e-5),
        "T_B": Parameter(None, "not_identified", lower=0.0, upper=1000.0, fitted=100.0),
    }
    found = estimate()
    known = replace(found, parameters={**found.parameters, **parameters})
    row = next(r for r in all_rows(sheet(allan_deviation=printed), known) if r.printed)
    assert row.lower == pytest.approx(9e-5 / math.sqrt(600.0))


def test_minimum_and_plateau_have_the_limits_of_the_curve() -> None:
    known = estimate(N=1e-4, B=7e-5, T_B=100.0, K=3e-6)
    curve = {
        "B_curve": Parameter(7e-5, lower=6e-5, upper=8e-5),
        "sigma_min": Parameter(5e-5, lower=4.5e-5, upper=5.6e-5),
    }
    found = rows(
        sheet(bias_instability={"value": 10, "unit": "deg/h"}), replace(known, curve=curve)
    )
    row = found["adev_minimum", None]
    assert (row.measured, row.lower, row.upper) == (5e-5, 4.5e-5, 5.6e-5)
    row = found["plateau", None]
    assert (row.measured, row.lower, row.upper) == pytest.approx(
        (FLOOR * 7e-5, FLOOR * 6e-5, FLOOR * 8e-5)
    )


def bias_rows(sensor: Datasheet, channel: str, means: dict[str, float]) -> dict[str, Delta]:
    return {row.quantity: row for row in bias_deltas(sensor, channel, means, 0.1)}


def test_the_rotation_of_the_earth_is_not_an_offset() -> None:
    # 20 °/h measured against 10 °/h at most: up to 15 °/h of it may be the Earth's
    sensor = sheet(offset={"value": 10, "unit": "deg/h", "kind": "max"})
    row = bias_rows(sensor, "gyro_x", {"gyro_x": -20 / 3600 * DEG})["offset"]
    assert row.measured == pytest.approx(20 / 3600 * DEG)
    assert row.lower == pytest.approx((20 - 15.0411) / 3600 * DEG, rel=1e-4)
    assert row.verdict == "not sure"
    row = bias_rows(sensor, "gyro_x", {"gyro_x": 26 / 3600 * DEG})["offset"]
    assert row.verdict == "worse than max"


def test_a_range_of_offsets_is_a_size() -> None:
    sensor = sheet(offset={"value": [-250, 250], "unit": "deg/h", "kind": "range"})
    for mean, verdict in ((-200, "as printed"), (0, "as printed"), (-300, "worse than max")):
        row = bias_rows(sensor, "gyro_x", {"gyro_x": mean / 3600 * DEG})["offset"]
        assert row.verdict == verdict
        assert (row.printed, row.delta) == (250.0, pytest.approx(abs(mean) / 250 - 1))


def test_totals_over_temperature_and_runs_are_not_compared_with_one_log() -> None:
    sensor = sheet(
        temperature_total={"value": 30, "unit": "deg/s"},
        bias_repeatability={"value": 4, "unit": "deg/h"},
    )
    found = bias_rows(sensor, "gyro_x", {"gyro_x": 0.1 * DEG})
    assert found["offset"].verdict == "not looked up"
    for name in ("temperature_total", "bias_repeatability"):
        assert found[name].verdict == "not comparable (condition)"
        assert found[name].measured is None and found[name].printed is not None


COEFFICIENT = sheet(temperature_coefficient={"value": 0.05, "unit": "deg/s/K"})


def thermal(
    s: tuple[float | None, float | None, float | None], compensated: bool, q: float | None = None
) -> list[TemperatureRow]:
    """Rows of the table ``temperature``, of a sensitivity with its limits in °/s/K."""
    figures = [None if one is None else one * DEG for one in s]
    names = ("value", "lower", "upper")
    row = dict(zip(names, figures, strict=True)) | {"reason": "BIC favours it by 2.0 only"}
    rows: list[dict[str, Any]] = [
        {"parameter": "T_0", "value": 27.0, "compensated": compensated},
        {"parameter": "sensitivity", "compensated": compensated} | row,
        {"parameter": "quadratic", "value": q, "compensated": compensated},
    ]
    return typed(TemperatureRow, rows)


def coefficient(rows: list[TemperatureRow]) -> Delta:
    found = compute_sensitivity(rows, 21.0, 34.0)
    (row,) = (
        r
        for r in bias_deltas(COEFFICIENT, "gyro_x", {"gyro_x": 0.0}, 0.1, found)
        if r.quantity == "temperature_coefficient"
    )
    return row


def test_a_fitted_sensitivity_is_compared_with_the_coefficient_by_its_size() -> None:
    row = coefficient(thermal((-0.06, -0.07, -0.056), True))
    assert (row.printed, row.unit, row.comparable) == (0.05, "deg/s/K", pytest.approx(0.05 * DEG))
    found = [x / DEG for x in (row.measured, row.lower, row.upper) if x is not None]
    assert found == pytest.approx([0.06, 0.056, 0.07])
    limits = [row.delta, row.delta_lower, row.delta_upper]
    assert limits == pytest.approx([0.2, 0.12, 0.4])
    assert row.verdict == "worse than typ"
    assert "slope at 27 °C, from readings of 21 to 34 °C" in "; ".join(row.reasons)
    bent = coefficient(thermal((0.05, 0.049, 0.051), True, q=1e-6))
    assert bent.verdict == "as printed" and "slope changes with temperature" in "; ".join(
        bent.reasons
    )


@pytest.mark.parametrize(
    ("s", "compensated", "verdict"),
    [
        ((0.001, -0.003, 0.004), False, "better than typ"),  # at most 0.004 of 0.05
        ((0.03, -0.01, 0.07), False, "not measured"),
        ((None, 0.01, 0.02), True, "not measured"),  # temperature and time alike: no limits
    ],
)
def test_a_sensitivity_that_is_not_told_has_limits_at_most(
    s: tuple[float | None, float, float], compensated: bool, verdict: str
) -> None:
    row = coefficient(thermal(s, compensated))
    assert row.verdict == verdict
    assert row.measured is None and row.delta is None


def test_without_readings_of_the_temperature_there_is_no_sensitivity() -> None:
    row = coefficient([])
    assert row.verdict == "not measured" and "no temperature readings" in "; ".join(row.reasons)


ACCEL = Datasheet.model_validate({"accel": {"offset": {"value": 20, "unit": "mg"}}})


def test_gravity_tells_the_offset_of_a_vertical_axis_alone() -> None:
    means = {"accel_x": 0.05 * G, "accel_y": -0.02 * G, "accel_z": -1.03 * G}
    norm = G * math.sqrt(0.05**2 + 0.02**2 + 1.03**2)
    row = bias_rows(ACCEL, "accel_z", means)["offset"]
    assert row.measured == pytest.approx(norm - G)
    assert row.lower == pytest.approx(norm - G - 0.027)
    assert row.verdict == "worse than typ"  # 31.4 mg, of which 2.8 may be local gravity
    for channel in ("accel_x", "accel_y"):
        row = bias_rows(ACCEL, channel, means)["offset"]
        assert row.verdict == "not comparable (condition)"
        assert "cannot be separated from tilt" in "; ".join(row.reasons)
        assert row.measured is None and row.printed == 20.0


@pytest.mark.parametrize(
    ("means", "reason"),
    [
        ({"accel_z": G}, "three axes are needed"),
        ({"accel_x": 0.1, "accel_y": 0.1, "accel_z": 0.1}, "which is not gravity"),
        ({"accel_x": 6.0, "accel_y": 5.0, "accel_z": 5.9}, "not vertical"),
    ],
)
def test_where_gravity_does_not_tell_the_offset(means: dict[str, float], reason: str) -> None:
    found = compute_fixed_bias("accel_z", means)
    assert found.value is None and reason in (found.reason or "")


def test_the_distance_of_a_curve_from_the_lines_of_a_datasheet() -> None:
    density = {"value": 0.01, "unit": "deg/s/sqrt(Hz)", "sidedness": "two-sided"}
    sensor = sheet(noise_density=density, bias_instability={"value": 36, "unit": "deg/h"})
    tau = np.array([1.0, 4.0])
    line = np.array([math.sqrt(1e-4 + 1e-4), math.sqrt(0.25e-4 + 1e-4)]) * DEG
    (found,) = curve_rms(list(read_comparables(sensor, "gyro_x")), tau, 10.0 * line)
    assert found.rms_log10 == pytest.approx(1.0)
    # 9 times the line: 9 * √((2e-4 + 1.25e-4) / 2) = 0.114728 °/s
    assert found.rms == pytest.approx(0.114728 * DEG, rel=1e-5)
    (same,) = curve_rms(list(read_comparables(sensor, "gyro_x")), tau, line)
    assert same.rms == pytest.approx(0.0, abs=1e-15)


def test_lines_that_a_datasheet_does_not_have() -> None:
    tau, adev = np.array([1.0, 100.0]), np.array([1.0, 1.0]) * DEG
    floor = sheet(bias_instability={"value": 3600, "unit": "deg/h"})
    (found,) = curve_rms(list(read_comparables(floor, "gyro_x")), tau, adev)
    assert found.N is None and found.rms == pytest.approx(0.0, abs=1e-15)
    both_sides = sheet(noise_density={"value": math.sqrt(2), "unit": "deg/s/sqrt(Hz)"})
    one, two = curve_rms(list(read_comparables(both_sides, "gyro_x")), tau[:1], adev[:1])
    assert (one.sidedness, two.sidedness) == ("one-sided", "two-sided")
    assert one.rms == pytest.approx(0.0, abs=1e-15)
    assert two.rms_log10 == pytest.approx(math.log10(2) / 2)
    assert curve_rms(list(read_comparables(sheet(), "gyro_x")), tau, adev) == []


def test_typical_figures_make_the_lines() -> None:
    walk = [
        {"value": 90, "unit": "deg/sqrt(h)", "kind": "max"},
        {"value": 60, "unit": "deg/sqrt(h)", "kind": "typ"},
    ]
    sensor = Datasheet.model_validate({"gyro": {"random_walk": walk}})
    (found,) = curve_rms(list(read_comparables(sensor, "gyro_x")), np.array([1.0]), np.array([DEG]))
    assert found.N == pytest.approx(DEG)  # 60 deg/sqrt(h)
    largest = Datasheet.model_validate({"gyro": {"random_walk": walk[:1]}})
    (found,) = curve_rms(
        list(read_comparables(largest, "gyro_x")), np.array([1.0]), np.array([DEG])
    )
    assert found.N == pytest.approx(1.5 * DEG)


def test_every_shipped_datasheet_gives_rows() -> None:
    means = {f"gyro_{a}": 1e-3 for a in "xyz"} | {"accel_x": 0.1, "accel_y": 0.1, "accel_z": G}
    found = estimate(N=1e-4, B=1e-4, T_B=10.0, K=1e-6)
    for sensor in catalogue().values():
        for channel in means:
            listed = [*all_rows(sensor.datasheet, found, channel)]
            listed += bias_deltas(sensor.datasheet, channel, means, 0.1)
            assert {row.verdict for row in listed} <= set(DATASHEET_VERDICTS)
            assert {row.quantity for row in listed} >= {
                "N",
                "bias_instability",
                "K",
                "T_B",
                "offset",
            }
            for row in listed:
                assert all(v == v for v in asdict(row).values())  # no NaN


@pytest.mark.parametrize("unit", ["g/sqrt(Hz)", "mg/sqrt(Hz)"])
def test_a_noise_that_lost_the_sign_of_micro_says_how_to_write_it(unit: str) -> None:
    sheet = {"accel": {"noise_density": {"value": 130, "unit": unit}}}
    with pytest.raises(ValueError, match=r"expected a value such as 130 ug/sqrt\(Hz\)"):
        Datasheet.model_validate(sheet)
