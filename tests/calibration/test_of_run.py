"""What a run finds of bias and scale factor in what it keeps of a recording."""

import math
from pathlib import Path

import numpy as np
import pytest

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.tables import CALIBRATED
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.tables.files import build
from tests.calibration.recordings import (
    BIAS,
    DEGREES,
    SCALE,
    STEPS,
    UP,
    at_rest,
    by_parameter,
    on_table,
    run,
    true_rates,
)
from tests.earth_rate.recordings import PRINTED, SENSOR, put, put_at_rest
from tests.earth_rate.runs import RATE

EAST = {"latitude": "45 deg", "heading": "60 deg", "heading_sigma": "2 deg"}


@pytest.fixture
def rest(tmp_path: Path) -> list[Path]:
    return [put_at_rest(tmp_path / "night")]


def put_table(folder: Path, samples: np.ndarray, **about: object) -> Path:
    return put(folder, {"gyro_x": samples}, kind="rate_table", **about)


def test_scale_factor_and_bias_lie_in_their_limits(tmp_path: Path, rest: list[Path]) -> None:
    folder = put_table(tmp_path / "table", on_table())
    found = run(folder, rest, rate_table={"steps": STEPS, "axis": UP})
    for table in CALIBRATED:
        assert build(table, found[table]).num_rows == len(found[table])
    rows = by_parameter(found["calibration"])
    for name, true in (("scale_factor", SCALE), ("bias", BIAS)):
        row = rows[name]
        assert row["status"] == "ok" and row["lower"] < true < row["upper"]
        half = 1.959964 * row["sigma"]
        assert row["upper"] - row["value"] == pytest.approx(half, rel=1e-6)
    assert rows["scale_factor"]["sigma"] < 5e-5
    assert rows["bias"]["earth_rate"] == pytest.approx(EARTH_RATE * math.sin(math.pi / 4))
    for name in ("quadratic", "asymmetry", "linearity"):
        assert rows[name]["chance"] > 0.001
    assert rows["bias"]["model_from"].startswith("static recording night")


def test_points_are_readings_and_what_the_line_leaves(tmp_path: Path, rest: list[Path]) -> None:
    samples = on_table()
    folder = put_table(tmp_path / "table", samples)
    found = run(folder, rest, rate_table={"steps": STEPS, "settling": "5 s", "axis": UP})
    points = found["calibration_points"]
    assert [round(math.degrees(one["table_rate"]), 9) for one in points] == list(DEGREES)
    for one in points:
        part = samples[round(one["start"] * RATE) : round(one["stop"] * RATE)]
        assert one["mean"] == pytest.approx(part.mean(), rel=1e-9)
        assert one["residual"] == pytest.approx(one["mean"] - one["line"], abs=1e-12)
        assert abs(one["residual"]) < 4.5 * one["sigma"]
    assert [one["start"] for one in points][:2] == [5.0, 75.0]


def test_a_bend_is_found_where_there_is_one(tmp_path: Path, rest: list[Path]) -> None:
    true = true_rates()
    bent = on_table() + 2e-3 * true**2
    found = run(put_table(tmp_path / "bent", bent), rest, rate_table={"steps": STEPS, "axis": UP})
    rows = by_parameter(found["calibration"])
    assert rows["quadratic"]["lower"] < 2e-3 < rows["quadratic"]["upper"]
    assert rows["quadratic"]["chance"] < 1e-6 and rows["linearity"]["chance"] < 1e-6
    worst = max(abs(one["residual"]) / one["sigma"] for one in found["calibration_points"])
    assert worst > 5.0


@pytest.mark.release
def test_residuals_scatter_by_their_sigma(tmp_path: Path, rest: list[Path]) -> None:
    ratios = []
    for seed in range(12):
        folder = put_table(tmp_path / f"run{seed}", on_table(seed))
        points = run(folder, rest, rate_table={"steps": STEPS, "axis": UP})["calibration_points"]
        ratios += [one["residual"] / one["sigma"] for one in points]
    assert 0.75 < np.sqrt(np.mean(np.square(ratios))) < 1.25


def test_the_rate_may_be_a_column_and_the_log_begin_late(tmp_path: Path, rest: list[Path]) -> None:
    columns = {"gyro_x": on_table(), "table_rate": true_rates()}
    by_column = run(put(tmp_path / "column", columns, kind="rate_table"), rest, rate_table={})
    stated = run(put_table(tmp_path / "steps", on_table()), rest, rate_table={"steps": STEPS})
    one, other = (by_parameter(found["calibration"]) for found in (by_column, stated))
    scale = one["scale_factor"]
    assert abs(scale["value"] - other["scale_factor"]["value"]) < 0.5 * scale["sigma"]
    assert len(by_column["calibration_points"]) == len(DEGREES)
    begun = 3000 / RATE
    late = put_table(tmp_path / "late", on_table()[3000:], begins=begun)
    kept = [step for step in STEPS if float(step["start"].split()[0]) > begun]
    found = run(late, rest, rate_table={"steps": kept})
    assert found["calibration_points"][0]["start"] == pytest.approx(142.0, abs=0.05)


@pytest.mark.parametrize(
    ("declared", "status", "said"),
    [
        (
            {"steps": [*STEPS, {"start": "500 s", "end": "600 s", "rate": "1 deg/s"}]},
            "too_short",
            "rate_table.steps: step 7 lasts from 500 to 600 s; expected steps within the log",
        ),
        ({"steps": STEPS[:1]}, "not_observable", "the table has one rate only"),
        ({}, "too_short", "log.table_rate: the column has another clock than the gyro"),
    ],
)
def test_what_cannot_be_told_has_a_reason(
    declared: dict, status: str, said: str, tmp_path: Path, rest: list[Path]
) -> None:
    found = run(put_table(tmp_path / "table", on_table()), rest, rate_table=declared)
    rows = by_parameter(found["calibration"])
    assert set(rows) == {"bias", "scale_factor"} and found["calibration_points"] == []
    for row in rows.values():
        assert row["status"] == status and said in row["reason"] and row.get("value") is None


def test_a_column_that_is_nowhere_steady_says_what_to_change(
    tmp_path: Path, rest: list[Path]
) -> None:
    columns = {"gyro_x": on_table(), "table_rate": np.linspace(-1.0, 1.0, len(on_table()))}
    found = run(put(tmp_path / "ramp", columns, kind="rate_table"), rest, rate_table={})
    reason = found["calibration"][0]["reason"]
    assert "nowhere steady" in reason and "change rate_table: tolerance (0.05 deg/s)" in reason


def test_without_any_noise_nothing_is_estimated(tmp_path: Path) -> None:
    folder = put_table(tmp_path / "table", on_table())
    rows = run(folder, [], rate_table={"steps": STEPS})["calibration"]
    assert {row["status"] for row in rows} == {"no_model"}
    printed = run(folder, [], SENSOR | {"datasheet": PRINTED}, rate_table={"steps": STEPS})
    assert "typical figures (" in printed["calibration"][0]["model_from"]


def test_two_rates_have_no_straightness(tmp_path: Path, rest: list[Path]) -> None:
    folder = put_table(tmp_path / "table", on_table())
    rows = by_parameter(run(folder, rest, rate_table={"steps": STEPS[1:3]})["calibration"])
    for name in ("quadratic", "asymmetry", "linearity"):
        assert rows[name]["status"] == "not_observable" and rows[name].get("value") is None
    assert rows["scale_factor"]["lower"] < SCALE < rows["scale_factor"]["upper"]
    open_bias = [row for row in run(folder, rest, rate_table={"steps": STEPS})["calibration"]
                 if row["parameter"] == "bias" and row["status"] == "not_observable"]  # fmt: skip
    assert "is a part of the bias" in open_bias[0]["reason"]


def test_the_bias_at_rest_has_no_earth_in_it(tmp_path: Path, rest: list[Path]) -> None:
    sensed = EARTH_RATE * math.cos(math.radians(45.0)) * math.cos(math.radians(60.0))
    folder = put(tmp_path / "still", {"gyro_x": at_rest(sensed)}, kind="static")
    rows = by_parameter(run(folder, rest, pointing=EAST)["calibration"])
    assert set(rows) == {"bias", "present_bias", "earth_rate", "scale_factor"}
    bias = rows["bias"]
    assert bias["lower"] < BIAS < bias["upper"] and bias["sigma"] > bias["sigma_noise"]
    assert bias["earth_rate"] == pytest.approx(sensed, rel=1e-3)
    north = by_parameter(run(folder, rest, pointing=EAST | {"heading": "0 deg"})["calibration"])
    moved = bias["value"] - north["bias"]["value"]
    assert moved == pytest.approx(north["bias"]["earth_rate"] - bias["earth_rate"], rel=1e-6)
    assert "only the sum of Earth's rate" in rows["earth_rate"]["reason"]


def test_without_a_heading_limits_hold_for_all(tmp_path: Path, rest: list[Path]) -> None:
    half = EARTH_RATE * math.cos(math.radians(45.0))
    place = {"latitude": "45 deg"}
    for name, sensed in (("north", half), ("south", -half)):
        folder = put(tmp_path / name, {"gyro_x": at_rest(sensed)}, kind="static")
        rows = by_parameter(run(folder, rest, pointing=place)["calibration"])
        bias = rows["bias"]
        assert bias["lower"] < BIAS < bias["upper"]
        assert bias["upper"] - bias["lower"] > 2 * half
        assert rows["heading"]["half_width"] == pytest.approx(half)
        assert rows["heading"]["status"] == "not_observable"


def test_white_noise_alone_gives_the_mean_over_the_root_of_time(tmp_path: Path) -> None:
    white = put_at_rest(tmp_path / "white", NoiseModel(N=2e-4))
    folder = put(tmp_path / "still", {"gyro_x": at_rest(0.0)}, kind="static")
    rows = by_parameter(run(folder, [white], pointing=EAST)["calibration"])
    assert rows["bias"]["sigma_noise"] == pytest.approx(2e-4 / math.sqrt(600.0), rel=1e-6)


def test_a_gyro_that_cannot_be_used_says_so(tmp_path: Path, rest: list[Path]) -> None:
    folder = put(tmp_path / "still", {"gyro_y": at_rest(0.0)}, kind="static")
    rows = run(folder, rest, pointing=EAST | {"channel": "gyro_x"})["calibration"]
    assert {row["status"] for row in rows} == {"not_shown"}
    assert "gyro_x cannot be used" in rows[0]["reason"]
