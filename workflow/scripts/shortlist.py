"""Judge all sensors of the catalogue for each requirement, only by their datasheets."""

from pathlib import Path

from imubench_pipeline.steps.shortlist import NEEDED, write_shortlist

if __name__ == "__main__":
    write_shortlist(
        {name: Path(snakemake.input[name]) for name in NEEDED},
        snakemake.params.settings,
        snakemake.params.catalogue,
        [Path(path) for path in snakemake.output],
    )
