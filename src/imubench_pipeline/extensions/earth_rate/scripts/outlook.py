"""Predict the accuracy of attitude, north and the Earth's rate by a sensor at rest."""

from pathlib import Path

from imubench_pipeline.extensions.earth_rate.outlook import make_outlook_tables
from imubench_pipeline.tables.files import write

if __name__ == "__main__":
    found = make_outlook_tables(
        [Path(path).parent for path in snakemake.input.quality],
        snakemake.wildcards.sensor,
        snakemake.params.settings,
    )
    for table, path in snakemake.output.items():
        write(table, found[table], Path(path))
