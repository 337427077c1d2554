"""Estimate the noise parameters of every channel by every method."""

from pathlib import Path

from imubench_pipeline.steps.estimate import estimation
from imubench_pipeline.tables import write

if __name__ == "__main__":
    names = snakemake.wildcards
    rows = estimation(
        Path(snakemake.input.quality),
        Path(snakemake.input.curve),
        names.sensor,
        names.recording,
        snakemake.params.settings,
    )
    for table, path in snakemake.output.items():
        write(table, getattr(rows, table), Path(path))
