"""What stands beside a log of a gyro that was turned, and what is wrong with it."""

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from imubench_pipeline.extensions.earth_rate.settings import TwoPosition
from imubench_pipeline.recordings.ingest import ingest_as_planned
from imubench_pipeline.recordings.recording import open_channel_logs, open_static_logs
from imubench_pipeline.run.plan import Plan
from imubench_pipeline.settings.validation import ConfigError, parse
from tests.earth_rate.recordings import SENSOR

GOOD: dict[str, Any] = {"latitude": "45 deg", "dwell": "30 s"}


def test_what_is_declared_in_si() -> None:
    one = TwoPosition.model_validate(
        GOOD | {"first": "south", "turn_on_bias": "1 deg/s", "drift": "3600 deg/h/h"}
    )
    assert one.seconds("dwell") == 30.0 and one.seconds("turning") == 2.0
    assert one.first_sense == -1
    assert one.latitude_si == pytest.approx(0.785398, rel=1e-5)
    assert one.turn_on_bias_si == pytest.approx(0.0174533, rel=1e-5)
    assert one.drift_si == pytest.approx(0.0174533 / 3600, rel=1e-5)
    plain = TwoPosition.model_validate(GOOD)
    assert plain.first_sense is None and plain.turn_on_bias_si is None and plain.drift_si == 0.0


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"latitude": None}, "latitude is missing; expected the latitude of the place, such as"),
        ({"dwell": None}, "dwell is missing; expected the time from one turn to the next"),
        ({"latitude": "90 deg"}, "latitude: found '90 deg'; expected a latitude between the poles"),
        ({"latitude": "89.5 deg"}, "at a pole a horizontal axis does not sense"),
        ({"latitude": 45}, "latitude: found"),
        ({"dwell": "0 s"}, "dwell: found '0 s'; expected a time above zero"),
        ({"dwell": "30 deg"}, "dwell: found '30 deg'"),
        ({"turning": "-1 s"}, "turning: found '-1 s'; expected 0 or more"),
        ({"turning": "15 s"}, "expected less than half of the dwell of 30 s"),
        ({"first": "east"}, "first: found 'east'"),
        ({"channel": "accel_x"}, "channel: found 'accel_x'"),
        ({"turn_on_bias": "-1 deg/s"}, "expected 0 or more"),
        ({"drift": "1 deg/s"}, "drift: found '1 deg/s'"),
        ({"dwel": "30 s"}, "dwel: unknown key; did you mean 'dwell'?"),
    ],
)
def test_what_cannot_be_used_names_file_and_key(changes: dict[str, Any], said: str) -> None:
    given = {key: value for key, value in (GOOD | changes).items() if value is not None}
    with pytest.raises(ConfigError) as error:
        parse(TwoPosition, given, "logs/s/a.yaml: two_position")
    assert str(error.value).startswith("logs/s/a.yaml: two_position") and said in str(error.value)


def test_the_channel_that_was_turned() -> None:
    one = TwoPosition.model_validate(GOOD)
    assert one.moved_gyro(["gyro_y", "accel_x"]) == "gyro_y"
    with pytest.raises(ValueError, match=r"^channel: missing; .* the log has gyro_x, gyro_y$"):
        one.moved_gyro(["gyro_x", "gyro_y"])
    with pytest.raises(ValueError, match="the log has no gyro"):
        one.moved_gyro(["accel_x"])
    with pytest.raises(
        ValueError, match="channel: found 'gyro_z'; expected a gyro of the log: gyro_x"
    ):
        TwoPosition.model_validate(GOOD | {"channel": "gyro_z"}).moved_gyro(["gyro_x"])


def planned(tmp_path: Path, notes: dict[str, Any], text: str, log: dict[str, Any]) -> Plan:
    (tmp_path / "sensors").mkdir(exist_ok=True)
    (tmp_path / "logs/s").mkdir(parents=True, exist_ok=True)
    (tmp_path / "sensors/s.yaml").write_text(yaml.safe_dump(SENSOR | {"log": log}))
    (tmp_path / "logs/s/a.yaml").write_text(yaml.safe_dump(notes))
    (tmp_path / "logs/s/a.csv").write_text(text)
    folders = {name: str(tmp_path / name) for name in ("logs", "sensors", "results")}
    return Plan(folders | {"simulated": "false"})


def ingested(plan: Plan, tmp_path: Path) -> dict[str, Any]:
    path = plan.recordings["s", "a"].path
    return ingest_as_planned(
        path, plan.ingest_settings("s", "a"), "s", "a", tmp_path / "kept"
    ).recording


TEXT = "w,p\n" + "".join(f"{0.01 * (k % 7)},{1 - 2 * (k // 300 % 2)}\n" for k in range(1200))
LOG = {"rate": "32 Hz", "channels": {"gyro_x": {"column": "w", "unit": "deg/s"}}}


@pytest.mark.parametrize(
    ("notes", "said"),
    [
        ({"two_position": {"dwell": "30 s"}}, "a.yaml: two_position: latitude is missing"),
        ({"two_position": GOOD | {"channel": "gyro_y"}}, "a.yaml: two_position.channel: found"),
        (
            {"two_position": GOOD, "log": {"position": {"column": "angle"}}},
            "no column 'angle' for position; found w, p",
        ),
    ],
)
def test_a_log_with_such_notes_is_rejected_and_says_why(
    tmp_path: Path, notes: dict[str, Any], said: str
) -> None:
    plan = planned(tmp_path, notes, TEXT, LOG)
    assert plan.of_experiment("two_position") == [("s", "a")] and plan.static_of("s") == []
    row = ingested(plan, tmp_path)
    assert (row["status"], row["kind"]) == ("rejected", "two_position")
    assert said in row["reason"]
    json.loads(plan.experiment_settings("s", "a", "earth_rate"))


def test_several_gyros_need_the_one_that_was_turned(tmp_path: Path) -> None:
    channels = {f"gyro_{axis}": {"column": "w", "unit": "deg/s"} for axis in "xy"}
    plan = planned(tmp_path, {"two_position": GOOD}, TEXT, LOG | {"channels": channels})
    reason = ingested(plan, tmp_path)["reason"]
    assert "a.yaml: two_position.channel: missing" in reason and "gyro_x, gyro_y" in reason


def test_a_turned_log_is_read_with_its_position_and_keeps_its_turns(tmp_path: Path) -> None:
    lines = TEXT.splitlines()
    lines[400:403] = ["50,1"] * 3  # at rest this would be a knock
    notes = {"two_position": GOOD, "log": {"position": {"column": "p"}}}
    plan = planned(tmp_path, notes, "\n".join(lines) + "\n", LOG)
    row = ingested(plan, tmp_path)
    assert (row["status"], row["kind"]) == ("ok", "two_position"), row["reason"]
    log = open_channel_logs(tmp_path / "kept")["gyro_x"]
    assert log.position and open_static_logs(tmp_path / "kept") == {}
    (samples,), (stood,) = list(log.blocks()), list(log.positions())
    assert samples.max() == pytest.approx(50 * 0.0174533, rel=1e-5)
    assert stood[:300].tolist() == [1.0] * 300 and stood[300] == -1.0


def test_a_log_without_such_notes_is_static(tmp_path: Path) -> None:
    plan = planned(tmp_path, {"device": "7"}, TEXT, LOG)
    assert plan.of_experiment("two_position") == [] and plan.static_of("s") == ["a"]
    assert ingested(plan, tmp_path)["kind"] == "static"
