"""Write what filters and simulators load, for every sensor."""

import json
from pathlib import Path

from imubench_pipeline.export.request import load, recordings_of
from imubench_pipeline.settings.config import ExportSettings
from imubench_pipeline.steps.exports import exports
from imubench_pipeline.tables import making, write_content


def main(tables: Path, settings: str, folder: Path) -> None:
    """Write a folder a sensor, with a file a program; all appear together."""
    how = ExportSettings.model_validate(json.loads(settings))
    with making(folder) as made:
        for place, content in exports(load(tables), how, recordings_of(tables)):
            write_content(content, made / place)


if __name__ == "__main__":
    main(
        Path(snakemake.input[0]).parent,
        snakemake.params.settings,
        Path(snakemake.output[0]),
    )
