"""Limits at the end of outages: how they are stated, and how sensors are held against them."""

import math
from statistics import NormalDist
from typing import Any

import pytest
from pydantic import ValidationError

from imubench_pipeline.extensions.aided.limits import yield_outage_rows
from imubench_pipeline.extensions.aided.trajectories import TRAJECTORY_NAMES
from imubench_pipeline.model.recordings import RecordingRow
from imubench_pipeline.navigation.selection import rank_sensors
from imubench_pipeline.navigation.verdicts.basis import Basis
from imubench_pipeline.navigation.verdicts.judgement import judge_sensors
from imubench_pipeline.settings.requirements import Limit, Requirement, Trajectory
from imubench_pipeline.tables.files import build
from tests.report.tables import recording_rows
from tests.report.test_navigated import navigation_row

LIMIT = {"error": "position", "outage": "30 s", "trajectory": "field", "at_most": "2 m"}
OUTAGE = Requirement.model_validate({"title": "Robot", "limits": [LIMIT]})


def verdict(size: float, half: float = 1.05, **changes: Any) -> dict[str, Any]:
    """The row of the table ``ranking`` of a sensor whose rms in the plane is a size in m."""
    run = navigation_row(
        "imu",
        position=size,
        position_lower=size / half,
        position_upper=size * half,
        **changes,
    )
    about = RecordingRow.rows_of(build("recordings", recording_rows("imu")["recordings"]))
    runs = build("navigation", [run])
    rows = yield_outage_rows(runs, about, {"robot": OUTAGE})
    basis = Basis.of(about)
    judged = list(judge_sensors(rows, {"robot": OUTAGE}, {"imu": {"price_class": None}}, basis))
    (row,) = build("ranking", rank_sensors(judged, basis)).to_pylist()
    return row


def test_an_outage_is_stated_with_its_trajectory() -> None:
    limit = Limit.model_validate(LIMIT)
    assert limit.seconds == 30.0 and limit.size == 2.0
    assert limit.text == "position within 2 m at the end of 30 s without GNSS (field)"
    assert OUTAGE.by_dead_reckoning == () and OUTAGE.in_outages == (limit,)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"after": "30 s"}, "either 'after' or 'outage'"),
        ({"trajectory": None}, "'outage' and 'trajectory' together"),
        ({"error": "attitude", "at_most": "1 deg"}, "one of position, velocity, heading"),
        ({"trajectory": "boat"}, "field"),
    ],
)
def test_what_is_wrong_with_a_limit_is_said(changes: dict[str, Any], words: str) -> None:
    with pytest.raises(ValidationError, match=words):
        Limit.model_validate(LIMIT | changes)


def test_dead_reckoning_still_needs_a_start() -> None:
    by_itself = {"error": "position", "after": "30 s", "at_most": "2 m"}
    with pytest.raises(ValidationError, match="static_window"):
        Requirement.model_validate({"title": "Robot", "limits": [LIMIT, by_itself]})


def test_a_sensor_is_held_against_the_error_of_one_axis() -> None:
    allowed = 2.0 / NormalDist().inv_cdf(0.975)
    row = verdict(1.0)
    assert row["sigma"] == pytest.approx(1.0 / math.sqrt(2.0))
    assert row["margin"] == pytest.approx(allowed * math.sqrt(2.0))
    assert (row["verdict"], row["trajectory"], row["time"]) == ("meets", "field", 30.0)
    assert "simulated drives" in "; ".join(row["reasons"])
    assert verdict(2.0)["verdict"] == "fails"
    near = allowed * math.sqrt(2.0)
    assert verdict(0.97 * near)["verdict"] == "likely_meets"
    assert verdict(1.03 * near)["verdict"] == "likely_fails"


@pytest.mark.parametrize(
    "changes",
    [{"recommended": False}, {"signals": "log"}, {"trajectory": "car"}, {"outage": 60.0}],
    ids=lambda changes: next(iter(changes)),
)
def test_a_run_of_something_else_does_not_answer(changes: dict[str, Any]) -> None:
    row = verdict(1.0, **changes)
    assert row["verdict"] == "not_enough_data"
    assert "navigate" in "; ".join(row["reasons"])


def test_trajectory_names_match_the_settings() -> None:
    assert set(Trajectory.__args__) == set(TRAJECTORY_NAMES)
