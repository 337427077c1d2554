"""Compare the estimates of a recording, and its fixed bias, with its sensor's datasheet."""

from pathlib import Path

from imubench_pipeline.steps.datasheet import datasheet_tables
from imubench_pipeline.tables import write_each

if __name__ == "__main__":
    names = snakemake.wildcards
    folder = Path(snakemake.input.parameters).parent
    tables = datasheet_tables(folder, names.sensor, names.recording, snakemake.params.settings)
    write_each(tables, map(Path, snakemake.output))
