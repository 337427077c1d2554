"""List for every file in the drop zone whether it is analysed, rejected, failed or skipped."""

from pathlib import Path

from imubench_pipeline.steps.files import NEEDED, write_files

if __name__ == "__main__":
    write_files(
        {name: Path(snakemake.input[name]) for name in NEEDED},
        snakemake.params.files,
        [Path(path) for path in snakemake.output],
    )
