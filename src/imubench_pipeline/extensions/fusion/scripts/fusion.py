"""Compute how many cheap sensors match one good sensor."""

from pathlib import Path

from imubench_pipeline.extensions.fusion.fusion import write_fusion

if __name__ == "__main__":
    write_fusion(
        snakemake.input,
        [Path(path) for path in snakemake.input.draws],
        snakemake.params.settings,
        snakemake.params.catalogue,
        [Path(path) for path in snakemake.output],
    )
