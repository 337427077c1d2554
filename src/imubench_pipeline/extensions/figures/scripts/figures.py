"""Draw the figures of all sensors for print."""

from pathlib import Path

from imubench_pipeline.extensions.figures.figures import write_figures

if __name__ == "__main__":
    write_figures(
        [Path(path) for path in snakemake.input],
        snakemake.params.units,
        Path(snakemake.output.folder),
    )
