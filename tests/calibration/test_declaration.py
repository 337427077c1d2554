"""What stands beside a log of known rates, and what is wrong with it."""

import json
import math
from pathlib import Path
from typing import Any

import pytest
import yaml

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.settings import AtRest, OnRateTable
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.settings.validation import ConfigError, parse
from tests.calibration.recordings import STEPS, UP
from tests.earth_rate.recordings import SENSOR


def test_what_is_declared_in_si() -> None:
    one = OnRateTable.model_validate({"steps": STEPS, "axis": UP, "setting_sigma": "1 deg/s"})
    assert one.steps[1].seconds == (70.0, 130.0)
    assert one.si("setting_sigma", "angular_rate") == pytest.approx(math.radians(1.0))
    assert one.axis is not None and one.axis.pointing.heading is None
    assert one.axis.pointing.rate == pytest.approx(EARTH_RATE * math.sin(math.radians(45.0)))
    rest = AtRest.model_validate(
        {"latitude": "60 deg", "heading": "180 deg", "heading_sigma": "2 deg"}
    )
    assert rest.pointing.rate == pytest.approx(-EARTH_RATE / 2, rel=1e-3)
    assert rest.moved_gyro(["gyro_y", "accel_x"]) == "gyro_y"


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"axis": {"elevation": "90 deg"}}, "axis: latitude is missing; expected the latitude"),
        ({"axis": {"latitude": "45 deg"}}, "axis.heading is missing; expected where the axis of"),
        ({"settling": "60 s"}, "step 1 lasts from 0 s to 60 s; expected more than the settling"),
        ({"settling": "-1 s"}, "settling: found '-1 s'; expected 0 or more"),
        ({"steps": STEPS[::-1]}, "step 2 starts at 280 s, before step 1 ends at 410 s"),
        ({"steps": [STEPS[0] | {"end": "0 s"}]}, "end is 0 s; expected a time after start, 0 s"),
        ({"steps": [STEPS[0] | {"rate": "5 m/s"}]}, "steps.0.rate: found '5 m/s'"),
        ({"steps": [], "shortest": "1 s"}, "shortest is 1 s; expected more than the settling"),
        ({"channel": "accel_x"}, "channel: found 'accel_x'"),
        ({"stepps": []}, "stepps: unknown key; did you mean 'steps'?"),
    ],
)
def test_what_cannot_be_used_names_file_and_key(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ConfigError) as error:
        parse(OnRateTable, {"steps": STEPS} | changes, "logs/s/a.yaml")
    assert str(error.value).startswith("logs/s/a.yaml: ") and said in str(error.value)


THREE = {name: {"column": k, "unit": "deg/s"} for k, name in
         enumerate(("gyro_x", "gyro_y", "gyro_z"), 1)}  # fmt: skip
COLUMN = {"column": 4, "unit": "deg/s"}


@pytest.mark.parametrize(
    ("notes", "said"),
    [
        ({"rate_table": {}}, "rate_table.steps: missing; expected the steady rates, such as"),
        (
            {"rate_table": {"steps": STEPS}, "log": {"table_rate": COLUMN}},
            "rate_table.steps: found both steps (6) and the column log.table_rate; expected one",
        ),
        (
            {"rate_table": {"steps": STEPS}, "log": {"channels": THREE}},
            "rate_table.channel: missing; expected the gyro whose axis is along the axis of the "
            "table",
        ),
        (
            {"rate_table": {}, "log": {"table_rate": COLUMN | {"unit": "m/s"}}},
            "table_rate.unit: ",
        ),
        (
            {"pointing": {"latitude": "45 deg", "channel": "gyro_z"}},
            "pointing.channel: found 'gyro_z'; expected a gyro of the log: gyro_x",
        ),
        (
            {"pointing": {"heading": "3 deg"}},
            "pointing: latitude is missing; expected the latitude",
        ),
        (
            {"pointing": UP, "rate_table": {"steps": STEPS}},
            "found rate_table and pointing; expected one of them",
        ),
    ],
)
def test_a_recording_with_wrong_notes_is_rejected_alone(
    notes: dict[str, Any], said: str, tmp_path: Path
) -> None:
    plan = plan_of(tmp_path, {"bad": notes, "good": {}})
    error = json.loads(plan.ingest_settings("s", "bad"))["error"]
    assert said in error and error.startswith("logs/s/bad.yaml: ")
    assert "error" not in json.loads(plan.ingest_settings("s", "good"))


def plan_of(tmp_path: Path, recordings: dict[str, dict[str, Any]]) -> Plan:
    """The plan of a run with logs and what stands beside them."""
    folders = {name: tmp_path / name for name in ("logs", "sensors", "results")}
    (folders["logs"] / "s").mkdir(parents=True)
    folders["sensors"].mkdir()
    (folders["sensors"] / "s.yaml").write_text(yaml.safe_dump(SENSOR))
    for name, notes in recordings.items():
        (folders["logs"] / f"s/{name}.csv").write_text("0.1\n" * 200)
        if notes:
            (folders["logs"] / f"s/{name}.yaml").write_text(yaml.safe_dump(notes))
    return Plan({key: str(path) for key, path in folders.items()} | {"simulated": "false"})


def test_a_rate_table_is_no_static_recording_and_a_direction_leaves_one(tmp_path: Path) -> None:
    table = {"rate_table": {"steps": STEPS}}
    plan = plan_of(tmp_path, {"table": table, "still": {"pointing": UP}, "night": {}})
    assert [plan.kind("s", name) for name in ("table", "still", "night")] == [
        "rate_table",
        "static",
        "static",
    ]
    assert plan.static_of("s") == ["night", "still"]
    assert plan.of_experiment("rate_table", "positions", "pointing") == [
        ("s", "still"),
        ("s", "table"),
    ]


def test_the_ingest_does_not_depend_on_steps_and_directions(tmp_path: Path) -> None:
    before = plan_of(tmp_path / "a", {"table": {"rate_table": {"steps": STEPS}}})
    after = plan_of(tmp_path / "b", {"table": {"rate_table": {"steps": STEPS[:2]}}})
    one, other = (json.loads(plan.ingest_settings("s", "table")) for plan in (before, after))
    del one["files"], other["files"]
    assert one == other
    assert before.experiment_settings("s", "table") != after.experiment_settings("s", "table")


def test_the_column_of_the_table_is_not_asked_of_static_logs(tmp_path: Path) -> None:
    log = {"log": {"table_rate": COLUMN}}
    plan = plan_of(tmp_path, {"night": log, "table": log | {"rate_table": {}}})
    written = {name: json.loads(plan.ingest_settings("s", name))["log"]["table_rate"]
               for name in ("night", "table")}  # fmt: skip
    assert written["night"] is None and written["table"]["unit"] == "deg/s"
