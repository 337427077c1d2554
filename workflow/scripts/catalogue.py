"""List the figures that vendors publish for the sensors of the catalogue."""

from pathlib import Path

from imubench_pipeline.steps.catalogue import write_coverage

if __name__ == "__main__":
    write_coverage(snakemake.params.catalogue, [Path(path) for path in snakemake.output])
