"""Say how many of one sensor are as good as one of another."""

import json
from collections.abc import Mapping
from pathlib import Path

from imubench_pipeline.settings.config import FusionSettings
from imubench_pipeline.steps.fusion import NEEDED, fusion_rows
from imubench_pipeline.tables import build, read, write_arrow


def main(inputs: Mapping[str, str], joint: list[Path], settings: str, outputs: list[Path]) -> None:
    """Write the table ``fusion``, as Parquet and CSV; ``joint``: tables ``draws`` of recordings."""
    how = FusionSettings.model_validate(json.loads(settings))
    tables = {name: read(name, [Path(inputs[name])]) for name in NEEDED}
    of_recording = {(path.parts[-3], path.parts[-2]): path for path in joint}
    table = build("fusion", fusion_rows(tables, how, of_recording))
    for output in outputs:
        write_arrow(table, output)


if __name__ == "__main__":
    main(
        snakemake.input,
        [Path(path) for path in snakemake.input.draws],
        snakemake.params.settings,
        [Path(path) for path in snakemake.output],
    )
