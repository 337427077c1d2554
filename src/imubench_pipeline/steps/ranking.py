"""Rank the sensors for each requirement, and recommend next steps."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.model.estimates import BacktestRow, ParameterRow
from imubench_pipeline.model.recordings import DoubtRow, RecordingRow
from imubench_pipeline.navigation.selection import rank_sensors
from imubench_pipeline.navigation.verdicts.basis import Basis
from imubench_pipeline.navigation.verdicts.judgement import judge_sensors
from imubench_pipeline.navigation.verdicts.next_steps import list_next_step_rows
from imubench_pipeline.registry import Hook
from imubench_pipeline.settings.requirements import Requirement, validate_requirements
from imubench_pipeline.tables.files import read, write_each

OtherErrors = Callable[
    [pa.Table, Sequence[RecordingRow], Mapping[str, Requirement]], Iterable[ErrorBudgetRow]
]
"""Takes a table, recordings and requirements; returns errors to judge besides dead reckoning."""

_LIMITS: Hook[OtherErrors] = Hook("limits")


def write_ranking(tables: dict[str, Path], settings: str, outputs: list[Path]) -> None:
    """Write the tables ``ranking`` and ``next_steps``, as Parquet and CSV."""
    sections = json.loads(settings)
    requirements = validate_requirements(sections["requirements"])
    joined = {name: read(name, [path]) for name, path in tables.items()}
    asked = joined["error_budget"].filter(pc.field("requirement").is_valid())
    recommended = joined["parameters"].filter(pc.field("recommended"))
    recordings = RecordingRow.rows_of(joined["recordings"])
    basis = Basis.of(
        recordings,
        DoubtRow.rows_of(joined["doubts"]),
        ParameterRow.rows_of(recommended),
        BacktestRow.rows_of(joined["backtest"]),
    )
    sensors = sections["sensors"]
    errors = ErrorBudgetRow.rows_of(asked)
    for name, errors_of in _LIMITS.by_key().items():
        errors += errors_of(joined[name], recordings, requirements)
    of_sensors = [row for row in errors if row.sensor in sensors]
    judged = list(judge_sensors(of_sensors, requirements, sensors, basis))
    rows = {
        "ranking": rank_sensors(judged, basis),
        "next_steps": list_next_step_rows(judged, basis),
    }
    write_each(rows, outputs)
