"""Compute the Allan variance of every channel of a recording."""

from pathlib import Path

from imubench_pipeline.settings.config import AllanSettings
from imubench_pipeline.steps.allan import yield_allan_rows
from imubench_pipeline.tables.files import write

if __name__ == "__main__":
    names = snakemake.wildcards
    settings = AllanSettings.model_validate_json(snakemake.params.settings)
    kept = Path(snakemake.input.quality).parent
    rows = yield_allan_rows(kept, names.sensor, names.recording, settings)
    write("allan", rows, Path(snakemake.output.curve))
