"""Join the tables of all sensors, as Parquet and CSV."""

from pathlib import Path

from imubench_pipeline.steps.tables import join_all_tables
from imubench_pipeline.tables.files import write_arrow

if __name__ == "__main__":
    parts = {name: [Path(path) for path in paths] for name, paths in snakemake.input.items()}
    joined = join_all_tables(parts)
    for output in map(Path, snakemake.output):
        write_arrow(joined[output.stem], output)
