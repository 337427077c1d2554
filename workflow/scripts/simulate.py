"""Write a simulated recording, in the layout of its sensor's logs."""

import json
import shutil
import tempfile
from pathlib import Path

from imubench_pipeline.config import SimulatedRecording
from imubench_pipeline.sensor import LogFormat
from imubench_pipeline.simulated_logs import write_simulated


def main(settings: str, folder: Path) -> None:
    """Write the recording into ``folder``, which appears when it is complete."""
    given = json.loads(settings)
    folder.parent.mkdir(parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", suffix=".part", dir=folder.parent))
    try:
        recording = SimulatedRecording.model_validate(given["recording"])
        write_simulated(recording, LogFormat.model_validate(given["log"]), scratch / "log")
        (scratch / "log").rename(folder)
    finally:
        shutil.rmtree(scratch)


if __name__ == "__main__":
    main(snakemake.params.settings, Path(snakemake.output[0]))
