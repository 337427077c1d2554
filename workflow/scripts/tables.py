"""Join the tables of all sensors, as Parquet and CSV."""

from pathlib import Path

from imubench_pipeline.tables import write_arrow
from imubench_pipeline.tables.failures import Failure, read_with_failures, with_failures

if __name__ == "__main__":
    joined, failures = {}, dict[Failure, None]()
    for name, paths in snakemake.input.items():
        joined[name], failed = read_with_failures(name, [Path(path) for path in paths])
        failures |= dict.fromkeys(failed)
    joined = with_failures(joined, list(failures))
    for output in map(Path, snakemake.output):
        write_arrow(joined[output.stem], output)
