"""Write a simulated recording, in the layout of its sensor's logs."""

import json
from pathlib import Path

from imubench_pipeline.settings.sensor import LogFormat
from imubench_pipeline.settings.simulated_recordings import SimulatedRecording
from imubench_pipeline.steps.simulate import write_simulated
from imubench_pipeline.tables import making


def main(settings: str, folder: Path) -> None:
    """Write the recording into ``folder``, which appears when it is complete."""
    given = json.loads(settings)
    recording = SimulatedRecording.model_validate(given["recording"])
    with making(folder) as made:
        write_simulated(recording, LogFormat.model_validate(given["log"]), made)


if __name__ == "__main__":
    main(snakemake.params.settings, Path(snakemake.output[0]))
