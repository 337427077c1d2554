"""Estimate the noise parameters of every channel by every method."""

from pathlib import Path

from imubench_pipeline.steps.estimate import estimate_recording
from imubench_pipeline.tables.files import write_each

if __name__ == "__main__":
    names = snakemake.wildcards
    folder = Path(snakemake.input.quality).parent
    rows = estimate_recording(folder, names.sensor, names.recording, snakemake.params.settings)
    outputs = [Path(path) for path in snakemake.output]
    write_each({path.stem: getattr(rows, path.stem) for path in outputs}, outputs)
