"""Say what the estimated noise of a recording means for dead reckoning."""

import json
from collections.abc import Iterator
from pathlib import Path

from imubench_pipeline.config import ErrorBudgetSettings
from imubench_pipeline.error_budget.printed_errors import in_use
from imubench_pipeline.expected_errors import error_rows, of_requirement, standard
from imubench_pipeline.printed import Datasheet
from imubench_pipeline.requirements import Requirement
from imubench_pipeline.results import Row, recommended_estimates
from imubench_pipeline.tables import read, write
from imubench_pipeline.units import quantity_to_si


def rows(
    parameters: Path, draws: Path, temperature: Path, sensor: str, recording: str, settings: str
) -> Iterator[Row]:
    """Yield the rows of the table ``error_budget``; none of a rejected recording."""
    given = json.loads(settings)
    how = ErrorBudgetSettings.model_validate(given["error_budget"])
    times = [quantity_to_si(time, "time") for time in how.times]
    window, latitude = (
        quantity_to_si(how.static_window, "time"),
        quantity_to_si(how.latitude, "angle"),
    )
    questions = list(standard(times, window, latitude, how.axes))
    for name, requirement in given["requirements"].items():
        questions += of_requirement(name, Requirement.model_validate(requirement))
    estimates = recommended_estimates(parameters, draws)
    if not estimates:
        return
    names = {"sensor": sensor, "recording": recording}
    datasheet = Datasheet.model_validate(given["datasheet"])
    figures = in_use(datasheet, estimates, read("temperature", [temperature]).to_pylist())
    yield from error_rows(
        names, estimates, questions, draws=how.draws, seed=how.seed, figures=figures
    )


if __name__ == "__main__":
    names = snakemake.wildcards
    found = rows(
        Path(snakemake.input.parameters),
        Path(snakemake.input.draws),
        Path(snakemake.input.temperature),
        names.sensor,
        names.recording,
        snakemake.params.settings,
    )
    write("error_budget", found, Path(snakemake.output[0]))
