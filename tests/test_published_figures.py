import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from imubench_pipeline.datasheets.deltas import bias_deltas, compute_sensitivity, deltas
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.estimators.rows import make_parameter_rows
from imubench_pipeline.extensions.fusion.published_figures import yield_published_figures
from imubench_pipeline.model.estimates import TemperatureRow
from imubench_pipeline.settings.printed import Datasheet
from imubench_pipeline.steps.sensor_tables import list_true_parameters
from imubench_pipeline.tables.files import build
from imubench_pipeline.tables.keys import Key
from tests.rows import typed

DEGREE = math.pi / 180
KEY = Key("imu", "sim_board", "gyro_x")
NAMES = asdict(KEY)

ABSENT = Parameter(None, "absent", "the data do not support it")

Row = Mapping[str, Any]


def printed_as(parameter: str, means: str, **more: str) -> dict[str, str]:
    return {
        "where": "Table 5",
        "figure": parameter,
        "printed": f"{means}, or so",
        "parameter": parameter,
        "means": means,
    } | more


FIGURES = [
    printed_as("N", "0.6 deg/sqrt(h)", why="read at 1 h"),
    printed_as("B", "36 deg/h"),
    printed_as("bias", "-5 deg/s"),
    printed_as("sensitivity", "0.02 deg/s/K"),
    printed_as("N", "0.005 deg/s/sqrt(Hz)", of="datasheet"),
]
CHANNEL: dict[str, Any] = {
    "N": "0.54 deg/sqrt(h)",
    "B": "32 deg/h",
    "T_B": "100 s",
    "bias": "-4 deg/s",
    "drift": {"sensitivity": "0.018 deg/s/K"},
    "published": FIGURES,
}
SHEET = {
    "noise_density": {
        "value": 0.005, "unit": "deg/s/sqrt(Hz)", "kind": "typ", "sidedness": "unknown"
    },
    "bias_instability": {"value": 10, "unit": "deg/h", "kind": "typ"},
    "offset": {"value": 1, "unit": "deg/s", "kind": "max"},
    "temperature_coefficient": {"value": 15, "unit": "mdps/K", "kind": "typ"},
}  # fmt: skip


def truths(channels: Mapping[str, Any] | None = None, **changes: Any) -> str:
    entry = {
        "sensor": "imu",
        "recording": "sim_board",
        "duration": "1 h",
        "rate": "100 Hz",
        "seed": 1,
        "source": "here",
        "channels": channels or {"gyro_x": CHANNEL},
    }
    return json.dumps([entry | changes])


def estimate(method: str, *processes: tuple[float, float | None], n: float = 0.009) -> Estimate:
    """N in °/s/√Hz, and B (°/h) and T_B (s) of each process; without T_B: flicker noise."""
    groups = [
        {"B": with_limits(B / 3600 * DEGREE), "T_B": with_limits(T_B) if T_B else ABSENT}
        for B, T_B in processes
    ]
    first = {"N": with_limits(n * DEGREE), "K": ABSENT}
    return Estimate(method, first | groups[0], groups[1:])


def with_limits(value: float) -> Parameter:
    return Parameter(value, lower=0.9 * value, upper=1.2 * value)


def tables(
    best: Estimate,
    temperature: Sequence[Row] = (),
    sheet: Mapping[str, Any] = SHEET,
    bias: float = -4.1 * DEGREE,
) -> dict[str, pa.Table]:
    """What a run leaves of one channel."""
    curve = estimate("curve", (30.0, 80.0), n=0.0095)
    tau = np.geomspace(0.1, 1e3, 9)
    datasheet = Datasheet.model_validate({"gyro": sheet})
    compared = [
        NAMES | {"method": one.method} | asdict(delta)
        for one in (curve, best)
        for delta in deltas(datasheet, "gyro_x", one, tau, 0.1)
    ]
    warm = compute_sensitivity(typed(TemperatureRow, temperature), None, None)
    compared += [
        NAMES | {"method": "mean"} | asdict(delta)
        for delta in bias_deltas(datasheet, "gyro_x", {"gyro_x": bias}, 0.1, warm)
    ]
    # A curve that falls to 3e-6 rad/s at a ninth of the hour, and further where it is not read.
    falling = [
        NAMES | {"tau": tau, "adev": adev, "cluster_size": 1, "edf_source": "none"}
        for tau, adev in ((10.0, 3e-5), (100.0, 1e-5), (360.0, 3e-6), (1000.0, 1e-6))
    ]
    told = NAMES | {"status": "ok", "duration": 3600.0, "device": "a", "kind": "static"}
    del told["channel"]
    rows: dict[str, list[Row]] = {
        "allan": falling,
        "recordings": [told | {"simulated": True}],
        "parameters": [
            *make_parameter_rows(KEY, curve, recommended=False),
            *make_parameter_rows(KEY, best, recommended=True),
            *make_parameter_rows(KEY, estimate("compensated", (1.0, 1.0)), recommended=False),
        ],
        "fixed_bias": [NAMES | {"value": bias, "unit": "rad/s"}],
        "temperature": [*temperature],
        "datasheet": compared,
    }
    return {name: build(name, own) for name, own in rows.items()}


def thermal(name: str, value: float | None, unit: str) -> Row:
    limits = {"lower": value and value * 0.9, "upper": value and value * 1.1}
    status = "not_identified" if value is None else "ok"
    return NAMES | {"parameter": name, "value": value, "unit": unit, "status": status,
                    "reason": None,
                    "compensated": True} | limits  # fmt: skip


WARM = [thermal("T_0", 25.0, "degC"), thermal("sensitivity", 0.019 * DEGREE, "rad/s/K"),
        thermal("quadratic", None, "rad/s/K^2"),
        thermal("bias", -4.05 * DEGREE, "rad/s")]  # fmt: skip


def rows(given: Mapping[str, pa.Table], said: str | None = None) -> list[dict[str, Any]]:
    """The rows of the table, as it is written."""
    said = said or truths()
    made = yield_published_figures(said, list(list_true_parameters(said)), given)
    found: list[dict[str, Any]] = build("published_figures", made).to_pylist()
    return found


def by_parameter(found: Sequence[Row], of: str = "log") -> dict[str, Row]:
    return {row["parameter"]: row for row in found if row["of"] == of}


def test_truth_curve_estimate_and_datasheet_stand_in_one_convention() -> None:
    found = rows(tables(estimate("likelihood", (31.0, 90.0)), WARM))
    assert len(found) == len(FIGURES)
    n = by_parameter(found)["N"]
    assert n["unit"] == "rad/s/sqrt(Hz)"
    assert (n["place"], n["figure"], n["printed"]) == ("Table 5", "N", "0.6 deg/sqrt(h), or so")
    values = {name: n[name] / DEGREE for name in ("means", "truth", "curve", "value")}
    assert values == pytest.approx(
        {"means": 0.01, "truth": 0.009, "curve": 0.0095, "value": 0.009}, rel=1e-12
    )
    assert (n["lower"], n["upper"]) == pytest.approx((0.9 * n["value"], 1.2 * n["value"]))
    # A side that is not stated: one-sided it is a root of 2 less.
    sides = (n["datasheet"] / DEGREE, n["datasheet_upper"] / DEGREE)
    assert sides == pytest.approx((0.005 / math.sqrt(2), 0.005))
    assert n["reason"] == "read at 1 h"


def test_the_floor_of_a_datasheet_is_taken_to_b() -> None:
    b = by_parameter(rows(tables(estimate("likelihood", (31.0, 90.0)))))["B"]
    hour = DEGREE / 3600
    values = {name: b[name] / hour for name in ("means", "truth", "curve", "value", "datasheet")}
    floor = math.sqrt(2 * math.log(2) / math.pi)
    assert values == pytest.approx(
        {"means": 36.0, "truth": 32.0, "curve": 30.0, "value": 31.0, "datasheet": 10.0 / floor}
    )
    assert b["unit"] == "rad/s" and b["datasheet_upper"] is None and b["reason"] is None


def test_the_bias_is_that_without_temperature_beside_the_mean_of_the_log() -> None:
    bias = by_parameter(rows(tables(estimate("likelihood", (31.0, 90.0)), WARM)))["bias"]
    values = {name: bias[name] / DEGREE for name in ("means", "truth", "curve", "value")}
    assert values == pytest.approx({"means": -5.0, "truth": -4.0, "curve": -4.1, "value": -4.05})
    assert bias["datasheet"] == pytest.approx(DEGREE)
    assert bias["unit"] == "rad/s"


def test_the_sensitivity_stands_beside_the_coefficient_of_the_datasheet() -> None:
    found = by_parameter(rows(tables(estimate("likelihood", (31.0, 90.0)), WARM)))["sensitivity"]
    values = {name: found[name] / DEGREE for name in ("means", "truth", "value", "datasheet")}
    assert values == pytest.approx(
        {"means": 0.02, "truth": 0.018, "value": 0.019, "datasheet": 0.015}
    )
    assert found["unit"] == "rad/s/K" and found["curve"] is None


def test_without_temperature_there_is_no_sensitivity_and_no_bias_but_the_mean() -> None:
    found = by_parameter(rows(tables(estimate("likelihood", (31.0, 90.0)))))
    assert found["sensitivity"]["value"] is found["bias"]["value"] is None
    assert found["bias"]["curve"] == pytest.approx(-4.1 * DEGREE)
    unknown = [WARM[0], thermal("sensitivity", None, "rad/s/K"), WARM[2]]
    found = by_parameter(rows(tables(estimate("likelihood", (31.0, 90.0)), unknown)))
    assert found["sensitivity"]["value"] is None


def test_a_figure_of_the_datasheet_is_called_so() -> None:
    found = by_parameter(rows(tables(estimate("likelihood", (31.0, 90.0)))), of="datasheet")["N"]
    assert found["means"] == pytest.approx(0.005 * DEGREE)
    assert found["datasheet_upper"] == pytest.approx(found["means"])


def test_a_printed_maximum_stands_beside_the_maximum_of_the_sheet() -> None:
    offset = [
        {"value": 1, "unit": "deg/s", "kind": "typ"},
        {"value": 3, "unit": "deg/s", "kind": "max"},
    ]
    given = tables(estimate("likelihood", (31.0, 90.0)), sheet=SHEET | {"offset": offset})
    found = {}
    for kind in (None, "typ", "max"):
        stated = {} if kind is None else {"kind": kind}
        figure = printed_as("bias", "3 deg/s", of="datasheet", **stated)
        (row,) = rows(given, truths({"gyro_x": CHANNEL | {"published": [figure]}}))
        upper = row["datasheet_upper"]
        found[kind] = (row["datasheet"] / DEGREE, upper and upper / DEGREE)
    assert found == {
        None: (pytest.approx(1.0), pytest.approx(3.0)),
        "typ": (pytest.approx(1.0), None),
        "max": (pytest.approx(3.0), None),
    }


def test_a_curve_without_a_minimum_has_its_lowest_point_for_the_b_before_the_fit() -> None:
    given = tables(estimate("likelihood", (31.0, 90.0)))
    parameters = given["parameters"].to_pylist()
    without = [row for row in parameters if (row["method"], row["parameter"]) != ("curve", "B")]
    assert len(without) < len(parameters)
    found = by_parameter(rows(given | {"parameters": build("parameters", without)}))["B"]
    assert found["curve"] == pytest.approx(3e-6 / math.sqrt(2 * math.log(2) / math.pi))


def test_nothing_printed_is_no_datasheet() -> None:
    found = rows(tables(estimate("likelihood", (31.0, 90.0)), WARM, sheet={}))
    assert len(found) == len(FIGURES)
    assert (
        {row["datasheet"] for row in found} == {row["datasheet_upper"] for row in found} == {None}
    )


@pytest.mark.parametrize(
    ("processes", "floor"),
    [
        ([(60.0, 5.0), (20.0, 200.0)], 20.0),
        ([(20.0, 200.0), (60.0, 5.0)], 20.0),
        ([(15.0, None), (60.0, 5.0), (20.0, 200.0)], 15.0),
        ([(60.0, 5.0), (15.0, None)], 15.0),
    ],
)
def test_of_several_processes_the_slowest_is_the_floor(
    processes: list[tuple[float, float | None]], floor: float
) -> None:
    found = by_parameter(rows(tables(estimate("likelihood", *processes))))["B"]
    assert found["value"] == pytest.approx(floor * DEGREE / 3600)
    assert found["upper"] == pytest.approx(1.2 * found["value"])


@pytest.mark.parametrize(
    ("axis", "floor"),
    [
        ({"B": "30 deg/h", "T_B": "200 s", "further": [{"B": "60 deg/h", "T_B": "5 s"}]}, 30.0),
        ({"B": "60 deg/h", "T_B": "5 s", "further": [{"B": "30 deg/h", "T_B": "200 s"}]}, 30.0),
        ({"B": "10 deg/h", "further": [{"B": "30 deg/h", "T_B": "200 s"}]}, 10.0),
    ],
)
def test_so_it_is_of_the_truth(axis: dict[str, Any], floor: float) -> None:
    said = truths({"gyro_x": axis | {"published": FIGURES[1:2]}})
    (found,) = rows(tables(estimate("likelihood", (31.0, 90.0))), said)
    assert found["truth"] == pytest.approx(floor * DEGREE / 3600)


def test_what_has_no_value_has_none_beside_what_is_printed() -> None:
    names = ("B", "T_B", "K")
    best = Estimate("likelihood", {"N": with_limits(1e-4)} | dict.fromkeys(names, ABSENT))
    found = by_parameter(rows(tables(best)))["B"]
    assert found["value"] is found["lower"] is found["upper"] is None
    assert found["curve"] is not None and found["truth"] is not None


def test_the_truth_of_n_is_that_of_the_log() -> None:
    filtered = CHANNEL | {"low_pass": {"cutoff": "64 Hz"}}
    found = by_parameter(
        rows(tables(estimate("likelihood", (31.0, 90.0))), truths({"gyro_x": filtered}))
    )
    x = math.pi * 0.64
    wanted = 0.009 * DEGREE * math.sqrt(x / math.tanh(x))
    assert found["N"]["truth"] == pytest.approx(wanted, rel=1e-4)


def test_a_recording_of_which_nothing_is_published_has_no_rows() -> None:
    plain = {name: value for name, value in CHANNEL.items() if name != "published"}
    given = tables(estimate("likelihood", (31.0, 90.0)))
    assert rows(given, truths({"gyro_x": plain})) == []
    assert rows(given, "[]") == []


def test_a_rejected_recording_has_what_is_printed_and_its_truth() -> None:
    empty = {
        name: build(name, [])
        for name in (
            "recordings",
            "allan",
            "parameters",
            "fixed_bias",
            "temperature",
            "datasheet",
        )
    }
    found = rows(empty)
    assert len(found) == len(FIGURES)
    for row in found:
        assert row["means"] is not None and row["truth"] is not None
        assert row["value"] is row["curve"] is row["datasheet"] is None


def test_another_channel_and_another_recording_are_told_apart() -> None:
    both = {"gyro_x": CHANNEL, "gyro_y": CHANNEL | {"N": "0.3 deg/sqrt(h)"}}
    entries = json.loads(truths(both)) + json.loads(truths(recording="sim_other"))
    found = rows(tables(estimate("likelihood", (31.0, 90.0))), json.dumps(entries))
    n = {(r["recording"], r["channel"]): r for r in found if r["parameter"] == r["figure"] == "N"
         and r["of"] == "log"}  # fmt: skip
    assert n["sim_board", "gyro_y"]["truth"] == pytest.approx(0.005 * DEGREE)
    assert n["sim_board", "gyro_x"]["value"] is not None
    assert n["sim_board", "gyro_y"]["value"] is n["sim_other", "gyro_x"]["value"] is None
