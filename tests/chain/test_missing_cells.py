"""Tables with missing cells, whatever their pattern, through every step of an analysis."""

from __future__ import annotations

import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings

import imubench_pipeline as imu
from imubench_pipeline.tables.findings import RecordingError
from tests.chain.logs import METHODS, Table, analysed, checked, project, tables


def hold(table: Table, *methods: str) -> None:
    """Assert that every channel is analysed or left out with a reason, and all ways agree."""
    with tempfile.TemporaryDirectory() as folder:
        plan = project(table, Path(folder), methods or METHODS)
        found = analysed(plan)
        assert not found["failures"], found["failures"]
        (recording,) = found["recordings"]
        status, reason, names = checked(plan)
        assert (status, reason) == (recording["status"], recording.get("reason"))
        assert status == "ok" or not table.good, (reason, table.good)
        library = None
        try:
            log = imu.read_log(Path(folder, "logs/made/log.csv"), table.sensor())
        except RecordingError as error:
            library = str(error)
        assert library == reason
        if status != "ok":
            return
        estimated = {row["channel"] for row in found["parameters"] if row["recommended"]}
        fatal = {f["channel"] for f in found["findings"] if f["severity"] == "fatal"}
        channels = set(table.columns) - {"temperature"}
        assert estimated | fatal == channels
        assert not estimated & fatal
        assert set(table.good) <= estimated
        assert {f["finding"] for f in found["findings"] if f["severity"] == "fatal"} <= names
        if estimated:
            estimates = imu.estimate(log)
            assert set(estimates) == estimated
            assert set(imu.allan_variance(log)) == estimated


@settings(suppress_health_check=list(HealthCheck), max_examples=2)
@given(tables(most=150))
def test_no_step_fails_for_missing_cells(table: Table) -> None:
    hold(table, "likelihood")


@pytest.mark.release
@settings(suppress_health_check=list(HealthCheck), max_examples=300)
@given(tables(most=3000))
def test_no_step_fails_for_more_missing_cells(table: Table) -> None:
    hold(table)
