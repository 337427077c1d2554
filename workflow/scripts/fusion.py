"""Say how many of one sensor are as good as one of another."""

import json
from collections.abc import Mapping
from pathlib import Path

from imubench_pipeline.config import FusionSettings
from imubench_pipeline.fusion.of_run import NEEDED, fusion_rows
from imubench_pipeline.tables import build, read, write_arrow


def main(inputs: Mapping[str, str], settings: str, outputs: list[Path]) -> None:
    """Write the table ``fusion``, as Parquet and CSV."""
    how = FusionSettings.model_validate(json.loads(settings))
    tables = {name: read(name, [Path(inputs[name])]) for name in NEEDED}
    table = build("fusion", fusion_rows(tables, how))
    for output in outputs:
        write_arrow(table, output)


if __name__ == "__main__":
    main(
        snakemake.input,
        snakemake.params.settings,
        [Path(path) for path in snakemake.output],
    )
