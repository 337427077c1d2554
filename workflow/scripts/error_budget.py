"""Say what the estimated noise of a recording means for dead reckoning, and what its log shows."""

from pathlib import Path

from imubench_pipeline.steps.error_budget import error_tables
from imubench_pipeline.tables import write

if __name__ == "__main__":
    found = error_tables(
        {name: Path(path) for name, path in snakemake.input.items()},
        {name: snakemake.wildcards[name] for name in ("sensor", "recording")},
        snakemake.params.settings,
    )
    for table, path in snakemake.output.items():
        write(table, found[table], Path(path))
