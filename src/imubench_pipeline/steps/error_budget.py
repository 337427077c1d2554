"""Say what the estimated noise of a recording means for dead reckoning, and what its log shows."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

from imubench_pipeline.estimators.rows import recommended_estimates
from imubench_pipeline.navigation.backtest.of_recording import backtest_rows
from imubench_pipeline.navigation.error_budget.printed_errors import in_use
from imubench_pipeline.navigation.expected_errors import error_rows, of_requirement, standard
from imubench_pipeline.recordings.kept import kept_static_logs
from imubench_pipeline.settings.config import ErrorBudgetSettings
from imubench_pipeline.settings.printed import Datasheet
from imubench_pipeline.settings.requirements import requirements_of
from imubench_pipeline.tables import read
from imubench_pipeline.typing import Row
from imubench_pipeline.units import quantity_to_si


def error_tables(
    inputs: dict[str, Path], names: dict[str, str], settings: str
) -> dict[str, Iterator[Row]]:
    """Return the rows of the tables ``error_budget`` and ``backtest``; none of a rejected log."""
    sections = json.loads(settings)
    how = ErrorBudgetSettings.model_validate(sections["error_budget"])
    times = [quantity_to_si(time, "time") for time in how.times]
    window = quantity_to_si(how.static_window, "time")
    latitude = quantity_to_si(how.latitude, "angle")
    requirements = requirements_of(sections["requirements"])
    questions = list(standard(times, window, latitude, how.axes))
    for name, requirement in requirements.items():
        questions += of_requirement(name, requirement)
    estimates = recommended_estimates(inputs["parameters"], inputs["draws"])
    if not estimates:
        return {"error_budget": iter(()), "backtest": iter(())}
    drawn = {"draws": how.draws, "seed": how.seed}
    logs = kept_static_logs(inputs["quality"].parent)
    apart = read("deterministic", [inputs["deterministic"]]).to_pylist()
    temperature = read("temperature", [inputs["temperature"]]).to_pylist()
    figures = in_use(Datasheet.model_validate(sections["datasheet"]), estimates, temperature)
    return {
        "error_budget": error_rows(names, estimates, questions, figures=figures, **drawn),
        "backtest": backtest_rows(names, logs, estimates, requirements, apart, **drawn),
    }
