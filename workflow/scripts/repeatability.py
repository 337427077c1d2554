"""Compare how the fixed bias of each device changes between turn-ons with its datasheet."""

from pathlib import Path

from imubench_pipeline.steps.repeatability import write_repeatability

if __name__ == "__main__":
    write_repeatability(
        Path(snakemake.input.biases),
        Path(snakemake.input.recordings),
        snakemake.params.settings,
        snakemake.params.catalogue,
        [Path(path) for path in snakemake.output],
    )
