"""Records of steps that failed, and tables that are empty for it."""

from pathlib import Path

import pytest

from imubench_pipeline.run.faults import TOLD, Faults
from imubench_pipeline.tables.failures import (
    Failure,
    mark_failures,
    read_failure,
    read_with_failures,
    write_empty,
)
from imubench_pipeline.tables.files import build, read, write
from imubench_pipeline.tables.schemas import PARTS_OF, TABLES

FAILURE = Failure("s", "a", "estimate", "error", "the step estimate failed: ValueError: no")
OF = ("estimate", "s", "a")


def test_a_step_that_failed_has_another_attempt_at_each_run_until_it_succeeds(
    tmp_path: Path,
) -> None:
    log = tmp_path / "logs/estimate.log"
    assert Faults(tmp_path).attempt(OF) == 0
    for attempt in (0, 1, 2):
        run = Faults(tmp_path)
        assert run.attempt(OF) == attempt
        assert list(run.now()) == []
        run.failed(FAILURE, attempt, log)
        assert list(run.now()) == [(FAILURE, log)]
        assert log.read_text().endswith(f"s/a, estimate: {FAILURE.reason}\n")
        assert run.attempt(OF) == attempt  # the same until the end of the run
    assert Faults(tmp_path).attempt(OF, again=False) == 2
    run = Faults(tmp_path)
    run.succeeded(OF, run.attempt(OF))
    assert list(run.now()) == []
    assert Faults(tmp_path).attempt(OF) == Faults(tmp_path).attempt(OF, again=False) == 3


def test_what_never_failed_leaves_no_record(tmp_path: Path) -> None:
    Faults(tmp_path).succeeded(OF, 0)
    assert list(tmp_path.iterdir()) == []


def test_a_record_that_was_cut_off_stops_nothing(tmp_path: Path) -> None:
    Faults(tmp_path).failed(FAILURE, 0, tmp_path / "log")
    (record,) = tmp_path.rglob("*.json")
    record.write_text("{")
    assert Faults(tmp_path).attempt(OF) == 0


def test_a_run_says_what_is_left_out_unless_its_caller_looks_itself(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = Faults(tmp_path)
    assert run.left_out() == ""
    run.failed(FAILURE, 0, tmp_path / "log")
    assert f"s/a: {FAILURE.reason}" in run.left_out()
    monkeypatch.setenv(TOLD, "1")
    assert run.left_out() == ""


@pytest.mark.parametrize("table", [*TABLES, *PARTS_OF])
def test_any_table_can_be_empty_and_say_why(table: str, tmp_path: Path) -> None:
    path = tmp_path / f"{table}.parquet"
    write_empty([path], FAILURE)
    assert read_failure(path) == FAILURE
    assert read(table, [path]).num_rows == 0
    assert read_with_failures(table, [path])[1] == [FAILURE]


def test_a_table_of_a_step_that_did_its_work_tells_nothing(tmp_path: Path) -> None:
    write("fixed_bias", [], tmp_path / "fixed_bias.parquet")
    assert read_failure(tmp_path / "fixed_bias.parquet") is None


def tables(kind: str = "static") -> dict:
    names = [{"sensor": "s", "recording": name} for name in "ab"]
    about = {"device": "d", "kind": kind, "simulated": False, "status": "ok"}
    bias = {"channel": "gyro_x", "value": 1.0, "unit": "rad/s"}
    return {
        "recordings": build("recordings", [one | about for one in names]),
        "findings": build("findings", []),
        "fixed_bias": build("fixed_bias", [one | bias for one in names]),
    }


def test_a_recording_of_which_a_step_failed_is_left_out_with_the_reason() -> None:
    found = mark_failures(tables(), [FAILURE])
    status = {row["recording"]: row["status"] for row in found["recordings"].to_pylist()}
    assert status == {"a": "failed", "b": "ok"}
    assert found["fixed_bias"]["recording"].to_pylist() == ["b"]
    (finding,) = found["findings"].to_pylist()
    assert (finding["finding"], finding["severity"]) == ("failed", "fatal")
    assert finding["detail"].startswith(FAILURE.reason)
    again = mark_failures(found, [FAILURE])
    assert all(again[name].equals(found[name]) for name in found)


@pytest.mark.parametrize(("kind", "status"), [("static", "ok"), ("rate_table", "failed")])
def test_a_static_log_stands_without_its_calibration(kind: str, status: str) -> None:
    failure = Failure("s", "a", "calibration", "time", "the step calibration ran for longer")
    found = mark_failures(tables(kind), [failure])
    assert found["recordings"]["status"].to_pylist()[0] == status
    assert found["findings"]["finding"].to_pylist() == ["failed"]


def test_a_sensor_of_which_a_step_failed_leaves_out_no_recording() -> None:
    failure = Failure("s", None, "outlook", "error", "the step outlook failed")
    found = mark_failures(tables(), [failure])
    assert found["recordings"]["status"].to_pylist() == ["ok", "ok"]
    assert found["failures"].to_pylist()[0]["recording"] is None
