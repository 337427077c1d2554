"""Judge all sensors of the catalogue for each requirement by their datasheets alone."""

import json
from pathlib import Path

from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.settings.sensor import sensors_of
from imubench_pipeline.steps.shortlist import NEEDED, rows_of_run
from imubench_pipeline.tables import build, write_arrow


def main(tables: dict[str, Path], settings: str, catalogue: str, outputs: list[Path]) -> None:
    """Write the table ``shortlist``, as Parquet and CSV."""
    asked = json.loads(settings)["requirements"]
    requirements = {name: Requirement.model_validate(one) for name, one in asked.items()}
    table = build("shortlist", rows_of_run(requirements, sensors_of(catalogue), tables))
    for output in outputs:
        write_arrow(table, output)


if __name__ == "__main__":
    main(
        {name: Path(snakemake.input[name]) for name in NEEDED},
        snakemake.params.settings,
        snakemake.params.catalogue,
        [Path(path) for path in snakemake.output],
    )
