"""Compute the dead-reckoning errors of a recording by its noise, and compare them with its log."""

from pathlib import Path

from imubench_pipeline.steps.error_budget import compute_error_tables
from imubench_pipeline.tables.files import write_each

if __name__ == "__main__":
    names = snakemake.wildcards
    folder = Path(snakemake.input.quality).parent
    tables = compute_error_tables(folder, names.sensor, names.recording, snakemake.params.settings)
    write_each(tables, map(Path, snakemake.output))
