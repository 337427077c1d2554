from typing import Any

import pytest

from imubench_pipeline.estimators.estimate import Estimate
from tests.test_selection import known
from tests.verdicts.budgets import HEADING, about, doubt, gyro, judge, requirement, three_axes

MANY = {name: gyro(3.0, 0.05) for name in "abc"}


def reasons(**given: Any) -> list[str]:
    asked = given.pop("asked", HEADING)
    logs = given.pop("logs", MANY)
    (row,), _ = judge({"s": logs}, {"robot": asked}, **given)
    assert (row["evidence"] == "weak") == bool(row["evidence_reasons"])
    found: list[str] = row["evidence_reasons"]
    return found


def test_long_logs_of_several_specimens_are_strong_evidence() -> None:
    assert reasons() == []


def test_one_specimen_is_weak_evidence_however_many_recordings_it_has() -> None:
    assert reasons(logs={"a": gyro(3.0)}) == ["one_specimen"]
    assert reasons(recordings=[about("s", name, device="unit") for name in MANY]) == [
        "one_specimen"
    ]


@pytest.mark.parametrize(("duration", "found"), [(9 * 3600 - 1, ["short_log"]), (9 * 3600 + 1, [])])
def test_a_log_is_short_below_nine_times_what_is_asked(duration: float, found: list[str]) -> None:
    """The window of an hour before is asked, and longer than the 100 s after it."""
    lengths = (1000.0, duration, 2000.0)  # the longest counts
    logs = [about("s", name, duration=one) for name, one in zip("abc", lengths, strict=True)]
    assert reasons(recordings=logs) == found


def test_a_worst_axis_is_one_of_three() -> None:
    one = [row for name in MANY for row in three_axes("s", name) if row["channel"] == "gyro_x"]
    assert reasons(parameters=one) == ["few_axes"]
    median = requirement(("heading", "100 s", "0.1 deg"), axis="median")
    assert reasons(parameters=one, asked=median) == []


def test_limits_far_apart_are_weak_evidence_though_the_verdict_is_sure() -> None:
    # Two specimens: t is 12.7.
    assert reasons(logs={"a": gyro(80.0), "b": gyro(100.0)}) == ["wide_interval"]


def test_only_doubts_about_the_dominant_source_weaken_evidence() -> None:
    """The error comes of N of gyro_x; in half the recordings or more."""

    def of(*names: str, **values: Any) -> list[dict[str, Any]]:
        return [doubt("s", name, "not_explained", **values) for name in names]

    assert reasons(doubts=of("a", "b")) == ["not_explained"]
    assert reasons(doubts=of("a")) == []
    assert reasons(doubts=of("a", "b", channel="gyro_y")) == []
    assert reasons(doubts=of("a", "b", parameters=("K", "R"))) == []
    assert reasons(doubts=of("a", "b", parameters=("N", "Q"))) == ["not_explained"]
    assert reasons(doubts=of("a", "b", channel=None)) == ["not_explained"]
    slow = {name: {"gyro_x": Estimate("likelihood", {"K": known(1e-7)})} for name in "abc"}
    assert reasons(doubts=of("a", "b", parameters=("K", "R")), logs=slow) == ["not_explained"]


def test_unjudged_sensor_has_no_evidence() -> None:
    (row,), _ = judge({"s": {"a": {"accel_x": known_white()}}}, {"robot": HEADING})
    assert (row["evidence"], row["evidence_reasons"]) == (None, [])


def known_white() -> Estimate:
    return Estimate("likelihood", {"N": known(1e-3)})
