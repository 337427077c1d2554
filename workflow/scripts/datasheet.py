"""Compare the estimates of a recording with its sensor's datasheet."""

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from imubench_pipeline.datasheet import deltas
from imubench_pipeline.results import Quality, Row, curves, estimates
from imubench_pipeline.sensor import Datasheet
from imubench_pipeline.tables import write


def rows(folder: Path, sensor: str, recording: str, settings: str) -> Iterator[Row]:
    """Yield the rows of the table ``datasheet``; none of a rejected recording."""
    measured = curves(folder / "allan.parquet", Quality.read(folder / "quality.json"))
    given = json.loads(settings)
    datasheet = Datasheet.model_validate(given["datasheet"])
    for channel, by_method in estimates(folder / "parameters.parquet").items():
        tau = measured[channel].up_to(given["longest"])
        names = {"sensor": sensor, "recording": recording, "channel": channel}
        for estimate in by_method:
            for delta in deltas(datasheet, channel, estimate, tau, given["tolerance"]):
                yield names | {"method": estimate.method} | asdict(delta)


if __name__ == "__main__":
    names = snakemake.wildcards
    found = rows(
        Path(snakemake.input.parameters).parent,
        names.sensor,
        names.recording,
        snakemake.params.settings,
    )
    write("datasheet", found, Path(snakemake.output[0]))
