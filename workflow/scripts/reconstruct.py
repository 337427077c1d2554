"""Simulate logs from every estimated model, and score how well they repeat the curve."""

from pathlib import Path

from imubench_pipeline.settings.config import ReconstructionSettings
from imubench_pipeline.steps.reconstruct import write_reconstruction

if __name__ == "__main__":
    write_reconstruction(
        [Path(name) for name in snakemake.input],
        [Path(name) for name in snakemake.output],
        ReconstructionSettings.model_validate_json(snakemake.params.settings),
    )
