"""Say how many of one sensor are as good as one of another."""

import json
from pathlib import Path

from imubench_pipeline.config import FusionSettings
from imubench_pipeline.fusion.of_run import fusion_rows
from imubench_pipeline.tables import build, read, write_arrow


def main(recordings: Path, parameters: Path, settings: str, outputs: list[Path]) -> None:
    """Write the table ``fusion``, as Parquet and CSV."""
    how = FusionSettings.model_validate(json.loads(settings))
    rows = fusion_rows(read("recordings", [recordings]), read("parameters", [parameters]), how)
    table = build("fusion", rows)
    for output in outputs:
        write_arrow(table, output)


if __name__ == "__main__":
    main(
        Path(snakemake.input.recordings),
        Path(snakemake.input.parameters),
        snakemake.params.settings,
        [Path(path) for path in snakemake.output],
    )
