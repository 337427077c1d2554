"""Simulate logs from every estimated model, and score how well they repeat the curve."""

from pathlib import Path

from imubench_pipeline.settings.config import ReconstructionSettings
from imubench_pipeline.steps.reconstruct import reconstruct_recording
from imubench_pipeline.tables.files import write_each

if __name__ == "__main__":
    settings = ReconstructionSettings.model_validate_json(snakemake.params.settings)
    rows = reconstruct_recording(Path(snakemake.input.quality).parent, settings)
    write_each(vars(rows), map(Path, snakemake.output))
