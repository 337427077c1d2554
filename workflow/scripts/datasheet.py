"""Compare the estimates of a recording, and its fixed bias, with its sensor's datasheet."""

from pathlib import Path

from imubench_pipeline.steps.datasheet import compare_with_datasheet
from imubench_pipeline.tables.files import write_each

if __name__ == "__main__":
    names = snakemake.wildcards
    folder = Path(snakemake.input.parameters).parent
    tables = compare_with_datasheet(
        folder, names.sensor, names.recording, snakemake.params.settings
    )
    write_each(tables, map(Path, snakemake.output))
