"""Estimate the noise parameters of every channel by every method."""

import json
from pathlib import Path

from imubench_pipeline.recordings.quality_file import Quality
from imubench_pipeline.recordings.recording import static_logs
from imubench_pipeline.settings.config import EstimateSettings
from imubench_pipeline.steps.estimate import Estimation, estimate_channel
from imubench_pipeline.steps.kept_curves import curves
from imubench_pipeline.tables import write
from imubench_pipeline.tables.keys import Key


def estimation(
    quality: Path, curve: Path, sensor: str, recording: str, settings: str
) -> Estimation:
    """Return the rows that the channels leave; none of a rejected recording."""
    given = json.loads(settings)
    found = Estimation()
    measured = curves(curve, Quality.read(quality))
    for channel, log in static_logs(quality.parent).items():
        key = Key(sensor, recording, channel)
        how = EstimateSettings.model_validate(given["estimate"])
        estimate_channel(key, log, measured[channel], how, given["bandwidth"], found)
    return found


if __name__ == "__main__":
    names = snakemake.wildcards
    rows = estimation(
        Path(snakemake.input.quality),
        Path(snakemake.input.curve),
        names.sensor,
        names.recording,
        snakemake.params.settings,
    )
    for table, path in snakemake.output.items():
        write(table, getattr(rows, table), Path(path))
