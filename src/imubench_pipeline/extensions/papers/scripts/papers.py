"""Compare printed values of the papers with the results."""

from pathlib import Path

from imubench_pipeline.extensions.papers.papers import write_published

if __name__ == "__main__":
    write_published(map(Path, snakemake.input), map(Path, snakemake.output))
