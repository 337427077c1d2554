"""Join the results of a sensor's recordings: one file for each table."""

from pathlib import Path

from imubench_pipeline.steps.sensor_tables import join_tables
from imubench_pipeline.tables.files import write_arrow

if __name__ == "__main__":
    parts = {name: [Path(path) for path in paths] for name, paths in snakemake.input.items()}
    params = snakemake.params
    tables = join_tables(parts, params.truths, params.sensor, params.usual, params.decide)
    for output in map(Path, snakemake.output):
        write_arrow(tables[output.stem], output)
