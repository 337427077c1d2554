"""Rank the sensors for each requirement."""

import json
from pathlib import Path

import pyarrow.compute as pc

from imubench_pipeline.requirements import Requirement
from imubench_pipeline.selection import ranking_rows
from imubench_pipeline.tables import build, read, write_arrow


def main(
    errors: Path, backtest: Path, recordings: Path, settings: str, outputs: list[Path]
) -> None:
    """Write the table ``ranking``, as Parquet and CSV."""
    given = json.loads(settings)
    requirements = {
        name: Requirement.model_validate(one) for name, one in given["requirements"].items()
    }
    asked = read("error_budget", [errors]).filter(pc.field("requirement").is_valid())
    about = read("recordings", [recordings]).to_pylist()
    shown = read("backtest", [backtest]).to_pylist()
    rows = ranking_rows(asked.to_pylist(), requirements, given["sensors"], about, shown)
    table = build("ranking", rows)
    for output in outputs:
        write_arrow(table, output)


if __name__ == "__main__":
    main(
        Path(snakemake.input.errors),
        Path(snakemake.input.backtest),
        Path(snakemake.input.recordings),
        snakemake.params.settings,
        [Path(path) for path in snakemake.output],
    )
