"""The screen of one log: events of several findings, tables of 80 columns, at most 40 lines."""

from __future__ import annotations

import json
from dataclasses import asdict
from io import StringIO
from typing import Any

import pytest
from rich.console import Console

from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.model.recordings import FindingRow, RecordingRow
from imubench_pipeline.report.log_screen import SHOWN, group_events, render_log_screen
from imubench_pipeline.tables.files import build
from imubench_pipeline.words.events import events_text
from imubench_pipeline.words.findings.changes import BiasStep

CHANNELS = [f"{quantity}_{axis}" for quantity in ("gyro", "accel") for axis in "xyz"]
SLOW = ("B", "K")


def finding(code: str, channel: str | None, start: float | None = None, **more: Any) -> FindingRow:
    about = {"severity": "warning", "affects": SLOW, "detail": f"{code} of {channel}. " * 12}
    return FindingRow(
        **{"sensor": "s", "recording": "r", **about, **more},
        channel=channel,
        finding=code,
        start=start,
        end=None if start is None else start + 1.0,
    )


def parameter(channel: str, symbol: str, **about: Any) -> ParameterRow:
    key = {"sensor": "s", "recording": "r", "method": "robust", "model": "N+F", "component": 1}
    return ParameterRow(
        **key, channel=channel, parameter=symbol, recommended=True, unit="rad/s", **about
    )


def test_steps_of_all_axes_at_one_time_are_one_disturbance() -> None:
    steps = [
        finding("bias_step", channel, start, value=size)
        for channel, start, size in (
            ("accel_x", 2153.0, 0.017),
            ("accel_y", 2154.0, 0.02),
            ("accel_x", 2178.0, -0.03),
            ("accel_x", 7000.0, 0.02),
        )
    ]
    events = group_events(steps)
    assert [len(event.findings) for event in events] == [3, 1]
    text = events_text(events[0].findings)
    assert text.startswith("Disturbed at 2153 to 2179 s: 3 bias steps of 1700 to 3100 µg")
    assert "(accel x and y)" in text


def test_findings_of_one_kind_are_one_event_and_fatal_ones_are_first() -> None:
    rows = [finding("strong_line", channel) for channel in CHANNELS]
    stuck = finding("stuck", "gyro_x", severity="fatal", affects=())
    events = group_events([*rows, stuck])
    assert [len(event.findings) for event in events] == [1, 6]
    assert events_text(events[1].findings).startswith(
        "Gyro x, y and z and accel x, y and z, for example: "
    )


@pytest.mark.parametrize("width", [80, 120])
def test_the_screen_of_six_axes_has_40_lines_of_80_columns(width: int) -> None:
    parameters = [
        parameter(channel, symbol, value=1.234e-4, lower=1.1e-4, upper=1.5e-4, status="ok")
        for channel in CHANNELS
        for symbol in SHOWN
    ]
    parameters[2] = parameter(CHANNELS[0], "K", upper=2e-4, status="not_identified")
    parameters[1] = parameter(
        CHANNELS[0], "B_curve", value=1e-4, lower=1e-5, upper=1e-3, status="doubtful"
    )
    kinds = ("strong_line", "knocks", "not_stationary", "warm_up", "too_many_lines")
    findings = [finding(kind, channel) for kind in kinds for channel in CHANNELS]
    recording = RecordingRow(
        sensor="s", device="d", recording="r", kind="static", simulated=True, status="ok",
        rate=100.0, duration=3600.0, fitness="fit with doubts",
    )  # fmt: skip
    rows = {"recordings": [recording], "parameters": parameters, "findings": findings}
    tables = {name: build(name, own) for name, own in rows.items()} | {"allan": build("allan", [])}
    console = Console(width=width, record=True, file=StringIO())
    for part in render_log_screen(tables, "practical", width):
        console.print(part)
    lines = console.export_text().splitlines()
    assert len(lines) <= 40
    assert max(map(len, lines)) <= width
    state = " ".join(line.strip() for line in lines[:2])
    assert state.startswith(
        "r: at rest; usable, with doubts (1, 2, 3); 60 min at 100 Hz, 6 channels"
    )
    (cells,) = (line.split() for line in lines if line.startswith("gyro_x"))
    assert "?" in cells and "<" in cells
    assert sum(line.startswith(("1. ", "2. ", "3. ", "4. ")) for line in lines) == 3
    assert lines[-2].startswith("12 other findings")


def test_a_log_in_motion_says_so_first_and_shows_no_parameters() -> None:
    moved = [finding("motion", "gyro_x", 10.0), finding("motion", "accel_y", 10.5)]
    recording = RecordingRow(
        sensor="s", device="d", recording="r", kind="static", simulated=True, status="ok",
        rate=100.0, duration=20.0, fitness="unfit",
    )  # fmt: skip
    rows = {
        "recordings": [recording],
        "parameters": [parameter("gyro_x", "N", value=1e-4, status="ok")],
        "findings": moved,
    }
    tables = {name: build(name, own) for name, own in rows.items()} | {"allan": build("allan", [])}
    lines = "\n".join(str(part) for part in render_log_screen(tables, "practical", 80)).splitlines()
    assert lines[1].startswith("Not at rest: the sensor was moved (gyro x and accel y) at 10 to")
    assert "At rest: 0 to 10 s and 11.5 to 20 s." in " ".join(lines)
    assert not any(line.startswith("gyro_x") for line in lines)


def test_a_sensor_that_was_turning_is_not_called_at_rest() -> None:
    recording = RecordingRow(
        sensor="s", device="d", recording="r", kind="static", simulated=True, status="ok",
        rate=100.0, duration=20.0, fitness="unfit",
    )  # fmt: skip
    rows = {
        "recordings": [recording],
        "parameters": [parameter("gyro_x", "N", value=1e-4, status="ok")],
        "findings": [finding("turning", "gyro_x")],
    }
    tables = {name: build(name, own) for name, own in rows.items()} | {"allan": build("allan", [])}
    (first, *_) = map(str, render_log_screen(tables, "practical", 80))
    assert first.startswith("r: not used; 20 s at 100 Hz")


def test_an_event_states_what_changes_without_its_removal() -> None:
    def step(channel: str, factors: dict[str, float], severity: str) -> FindingRow:
        data = BiasStep(1e-3, 9e-4, 1.1e-3, 50.0, 1.0, factors)
        about = {"detail": data.text(channel), "data": json.dumps(asdict(data)), "value": 1e-3}
        return finding("bias_step", channel, 50.0, severity=severity, **about)

    strong, none = step("accel_x", {"K": 3.0, "N": 1.0004}, "warning"), step("accel_y", {}, "note")
    (event,) = group_events([strong, none])
    assert event.findings == (strong,)
    text = events_text(event.findings, "practical", event.factors())
    assert "otherwise K would be 3 times as large" in text and "N would" not in text
    assert "102 µg" in text
    assert "0.001 m/s²" in events_text(event.findings, "si", event.factors())
