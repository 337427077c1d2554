"""Run filters on simulated drives, with every available tuning of a sensor."""

from pathlib import Path

from imubench_pipeline.extensions.aided.navigate import navigate
from imubench_pipeline.tables.files import write

if __name__ == "__main__":
    rows = navigate(
        [Path(path).parent for path in snakemake.input.quality],
        snakemake.wildcards.sensor,
        snakemake.params.settings,
    )
    write("navigation", rows, Path(snakemake.output.navigation))
