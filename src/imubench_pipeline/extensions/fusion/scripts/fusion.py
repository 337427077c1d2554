"""Say how many of one sensor are as good as one of another."""

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
