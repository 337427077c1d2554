"""Simulate samples of the estimated models of a log, to compare with samples of the log."""

from pathlib import Path

from imubench_pipeline.extensions.fusion.samples_of_models import simulate_samples_of_models
from imubench_pipeline.settings.config import ReconstructionSettings
from imubench_pipeline.tables.files import write

if __name__ == "__main__":
    names = snakemake.wildcards
    settings = ReconstructionSettings.model_validate_json(snakemake.params.settings)
    folder = Path(snakemake.input.quality).parent
    found = simulate_samples_of_models(folder, names.sensor, names.recording, settings.seed)
    write("samples_of_models", found, Path(snakemake.output.samples_of_models))
