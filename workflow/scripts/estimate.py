"""Estimate the noise parameters of every channel by every method."""

import json
from collections.abc import Iterator
from pathlib import Path

from imubench_pipeline.config import EstimateSettings
from imubench_pipeline.estimators import estimate
from imubench_pipeline.results import Key, Quality, Row, curves, parameter_rows
from imubench_pipeline.tables import write


def parameters(
    allan: Path, quality: Quality, sensor: str, recording: str, settings: EstimateSettings
) -> Iterator[Row]:
    """Yield the rows of the table ``parameters``; none of a rejected recording."""
    best = "weighted" if "weighted" in settings.methods else settings.methods[0]
    for channel, curve in curves(allan, quality).items():
        for method in settings.methods:
            found = estimate(curve, method, longest=settings.longest)
            key = Key(sensor, recording, channel)
            yield from parameter_rows(key, found, recommended=method == best)


if __name__ == "__main__":
    names = snakemake.wildcards
    settings = EstimateSettings.model_validate(json.loads(snakemake.params.settings))
    quality = Quality.read(Path(snakemake.input.quality))
    rows = parameters(Path(snakemake.input.allan), quality, names.sensor, names.recording, settings)
    write("parameters", rows, Path(snakemake.output[0]))
