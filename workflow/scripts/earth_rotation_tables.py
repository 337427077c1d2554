"""Join the tables of the gyros that were turned, as Parquet and CSV."""

from pathlib import Path

from imubench_pipeline.tables import read, write_arrow

if __name__ == "__main__":
    joined = {
        name: read(name, [Path(path) for path in paths]) for name, paths in snakemake.input.items()
    }
    for output in map(Path, snakemake.output):
        write_arrow(joined[output.stem], output)
