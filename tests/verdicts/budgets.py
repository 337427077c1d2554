"""Error budgets of white noise for the tests of verdicts."""

from collections.abc import Mapping
from typing import Any

from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.model.estimates import ParameterRow
from imubench_pipeline.model.recordings import DoubtRow, RecordingRow
from imubench_pipeline.model.verdicts import DoubtMark
from imubench_pipeline.navigation.error_budget.in_use import Figures
from imubench_pipeline.navigation.expected_errors import (
    NO_FIGURES_OF_CHANNELS,
    list_error_rows,
    list_requirement_questions,
)
from imubench_pipeline.navigation.selection import rank_sensors
from imubench_pipeline.navigation.verdicts.basis import Basis
from imubench_pipeline.navigation.verdicts.judgement import judge_sensors
from imubench_pipeline.navigation.verdicts.next_steps import list_next_step_rows
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.tables.files import build
from tests.rows import typed
from tests.test_selection import white

Rows = list[dict[str, Any]]
Sensors = dict[str, dict[str, dict[str, Estimate]]]  # estimates by sensor and recording


def requirement(*limits: tuple[str, str, str], **keys: Any) -> Requirement:
    listed = [{"error": e, "after": t, "at_most": size} for e, t, size in limits]
    given = {"title": "t", "static_window": "1 h", "limits": listed} | keys
    return Requirement.model_validate(given)


HEADING = requirement(("heading", "100 s", "0.1 deg"))
LARGEST = 0.1 / 57.29577951308232 / 1.959963984540054  # rad, 1 sigma


def gyro(margin: float, share: float = 0.01) -> dict[str, Estimate]:
    """A gyro whose heading error fits so often into the limit of `HEADING`."""
    return {"gyro_x": white(LARGEST / margin / (100 + 100**2 / 3600) ** 0.5, share)}


def about(sensor: str, recording: str, **values: Any) -> dict[str, Any]:
    row = {"sensor": sensor, "recording": recording, "device": recording, "status": "ok",
           "simulated": False, "duration": 36000.0, "decides": True, "doubts": ()}  # fmt: skip
    return row | values


def doubt(sensor: str, recording: str, code: str, **values: Any) -> dict[str, Any]:
    row = {"sensor": sensor, "recording": recording, "channel": "gyro_x", "code": code,
           "parameters": (), "factor": None}  # fmt: skip
    return row | values


def marked(recording: str, *codes: str, channels: tuple[str, ...] = ()) -> tuple[DoubtMark, ...]:
    """Return the doubts of a row of the table ``recordings``."""
    return tuple(DoubtMark(recording, code, channels) for code in codes)


def three_axes(sensor: str, recording: str) -> Rows:
    return [
        {"sensor": sensor, "recording": recording, "channel": f"{quantity}_{axis}",
         "recommended": True, "value": 1.0}
        for quantity in ("gyro", "accel") for axis in "xyz"
    ]  # fmt: skip


def judge(
    sensors: Sensors,
    asked: dict[str, Requirement],
    recordings: Rows | None = None,
    doubts: Rows | None = None,
    parameters: Rows | None = None,
    abilities: dict[str, Any] | None = None,
    figures: Mapping[str, Figures] = NO_FIGURES_OF_CHANNELS,
) -> tuple[Rows, Rows]:
    """Return the tables ``ranking``, of the limits that decide, and ``next_steps``."""
    questions = [q for name, one in asked.items() for q in list_requirement_questions(name, one)]
    errors: list[ErrorBudgetRow] = []
    for sensor, logs in sensors.items():
        for recording, estimates in logs.items():
            names = {"sensor": sensor, "recording": recording}
            rows = list_error_rows(names, estimates, questions, draws=400, seed=1, figures=figures)
            errors += ErrorBudgetRow.rows_of(build("error_budget", rows))
    if recordings is None:
        recordings = [about(sensor, name) for sensor, logs in sensors.items() for name in logs]
    if parameters is None:
        parameters = [
            row
            for sensor, logs in sensors.items()
            for name in logs
            for row in three_axes(sensor, name)
        ]
    basis = Basis.of(
        typed(RecordingRow, recordings),
        typed(DoubtRow, doubts or []),
        typed(ParameterRow, parameters),
    )
    files = {sensor: {"price_class": None, "abilities": abilities or {}} for sensor in sensors}
    judged = list(judge_sensors(errors, asked, files, basis))
    ranking = build("ranking", rank_sensors(judged, basis)).to_pylist()
    steps = build("next_steps", list_next_step_rows(judged, basis)).to_pylist()
    return [row for row in ranking if row["decides"]], steps
