"""Simulate logs from every estimated model, and score how well they repeat the curve."""

import json
from pathlib import Path

from imubench_pipeline.estimators.rows import estimates
from imubench_pipeline.recordings.quality_file import Quality
from imubench_pipeline.settings.config import ReconstructionSettings
from imubench_pipeline.steps.kept_curves import compensated_curves, curves
from imubench_pipeline.steps.reconstruct import reconstruct
from imubench_pipeline.tables import write
from imubench_pipeline.tables.keys import Key


def main(inputs: list[Path], outputs: list[Path], settings: ReconstructionSettings) -> None:
    """Write the tables ``reconstruction`` and ``scores`` of a recording."""
    quality, allan, parameters, compensated = inputs
    about = Quality.read(quality)
    measured = curves(allan, about)
    left = compensated_curves(compensated, measured)
    found = []
    for channel, by_method in estimates(parameters).items():
        key = Key(about.recording["sensor"], about.recording["recording"], channel)
        rate = about.channels[channel]["rate"]
        for estimate in by_method:
            series = quality.parent / "series" / f"{channel}.{estimate.method}.parquet"
            curve = (left if estimate.method == "compensated" else measured)[channel]
            found.append(reconstruct(key, estimate, curve, rate, settings, series))
    write("reconstruction", [row for result in found for row in result.curve_rows], outputs[0])
    write("scores", [result.score_row for result in found], outputs[1])


if __name__ == "__main__":
    main(
        [Path(name) for name in snakemake.input],
        [Path(name) for name in snakemake.output],
        ReconstructionSettings.model_validate(json.loads(snakemake.params.settings)),
    )
