"""Compute the dead-reckoning errors of a recording by its noise, and compare them with its log."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from imubench_pipeline.estimators.estimate import Estimate
from imubench_pipeline.estimators.rows import read_recommended_estimates
from imubench_pipeline.model.estimates import DeterministicRow, DrawnDeviationRow, TemperatureRow
from imubench_pipeline.model.table import TableRow
from imubench_pipeline.navigation import expected_errors
from imubench_pipeline.navigation.backtest.comparison import list_backtest_rows
from imubench_pipeline.navigation.error_budget.in_use import (
    collect_figures_in_use,
    read_stated_figures,
)
from imubench_pipeline.navigation.expected_errors import list_growth_rows
from imubench_pipeline.navigation.ratios import ComparedChannel, list_deviation_rows
from imubench_pipeline.recordings.kept import Quality, load_static_logs
from imubench_pipeline.settings.config import ErrorBudgetSettings, FusionSettings
from imubench_pipeline.settings.requirements import validate_requirements
from imubench_pipeline.tables.files import read
from imubench_pipeline.units import parse_quantity


def compute_error_tables(
    folder: Path, sensor: str, recording: str, settings: str
) -> dict[str, Iterator[TableRow]]:
    """Return the rows of each table of the step, by its name; none for a rejected recording."""
    names = {"sensor": sensor, "recording": recording}
    sections = json.loads(settings)
    how = ErrorBudgetSettings.model_validate(sections["error_budget"])
    times = [parse_quantity(time, "time") for time in how.times]
    window = parse_quantity(how.static_window, "time")
    latitude = parse_quantity(how.latitude, "angle")
    requirements = validate_requirements(sections["requirements"])
    questions = list(expected_errors.list_standard_questions(times, window, latitude, how.axes))
    for name, requirement in requirements.items():
        questions += expected_errors.list_requirement_questions(name, requirement)
    estimates = read_recommended_estimates(folder / "parameters.parquet", folder / "draws.parquet")
    if not estimates:
        return {name: iter(()) for name in _OUTPUT_TABLES}
    drawn = {"draws": how.draws, "seed": how.seed}
    logs = load_static_logs(folder)
    apart = DeterministicRow.rows_of(read("deterministic", [folder / "deterministic.parquet"]))
    temperature = TemperatureRow.rows_of(read("temperature", [folder / "temperature.parquet"]))
    figures = collect_figures_in_use(
        read_stated_figures(sections["figures"]), estimates, temperature
    )
    tables = (
        expected_errors.list_error_rows(names, estimates, questions, figures=figures, **drawn),
        list_backtest_rows(names, logs, estimates, requirements, apart, **drawn),
        list_growth_rows(names, estimates, times=times, window=window, figures=figures, **drawn),
        _deviations(names, Quality.read(folder / "quality.json"), estimates, sections),
    )
    return dict(zip(_OUTPUT_TABLES, tables, strict=True))


_OUTPUT_TABLES = ("error_budget", "backtest", "error_growth", "drawn_deviations")


def _deviations(
    names: Mapping[str, str],
    quality: Quality,
    estimates: Mapping[str, Estimate],
    sections: Mapping[str, Any],
) -> Iterator[DrawnDeviationRow]:
    how = FusionSettings.model_validate(sections["fusion"])
    for name, estimate in estimates.items():
        channel = ComparedChannel(
            sensor=names["sensor"],
            recording=names["recording"],
            channel=name,
            simulated=quality.recording.simulated,
            duration=quality.recording.duration or 0.0,
            estimate=estimate,
        )
        rate = quality.channels[name].rate
        yield from list_deviation_rows(
            channel, rate, longest=how.longest, draws=how.draws, seed=how.seed
        )
