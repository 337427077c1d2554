"""Rank the sensors for each requirement, and recommend next steps."""

from pathlib import Path

from imubench_pipeline.steps.ranking import write_ranking

if __name__ == "__main__":
    write_ranking(
        {name: Path(path) for name, path in snakemake.input.items()},
        snakemake.params.settings,
        [Path(path) for path in snakemake.output],
    )
