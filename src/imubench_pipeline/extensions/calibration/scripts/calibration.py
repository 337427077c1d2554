"""Estimate bias and scale factor from known rates; no rows for a rejected recording."""

from pathlib import Path

from imubench_pipeline.extensions.calibration.calibration import make_calibration_tables
from imubench_pipeline.tables.files import write

if __name__ == "__main__":
    names = snakemake.wildcards
    found = make_calibration_tables(
        Path(snakemake.input.quality).parent,
        [Path(path).parent for path in snakemake.input.static_quality],
        names.sensor,
        names.recording,
        snakemake.params.settings,
    )
    for table, path in snakemake.output.items():
        write(table, found[table], Path(path))
