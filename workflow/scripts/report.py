"""Render the cross-IMU report."""

import json
from pathlib import Path

from imubench_pipeline.report.page import render
from imubench_pipeline.tables import read, replacing


def main(tables: list[Path], settings: str, page: Path) -> None:
    """Write the report, a single file that needs nothing else."""
    read_tables = {path.stem: read(path.stem, [path]) for path in tables}
    text = render(read_tables, json.loads(settings))
    with replacing(page) as temporary:
        temporary.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(
        [Path(path) for path in snakemake.input],
        snakemake.params.settings,
        Path(snakemake.output[0]),
    )
