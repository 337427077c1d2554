"""Read a recording into Parquet; one that cannot be used is recorded as rejected."""

import json
from dataclasses import asdict
from pathlib import Path

from imubench_pipeline.config import QualitySettings
from imubench_pipeline.ingest import ingest, rejected, remove_kept
from imubench_pipeline.readers import RecordingError
from imubench_pipeline.sensor import LogFormat, RecordingNotes
from imubench_pipeline.tables import write_json


def main(source: Path, settings: str, sensor: str, recording: str, quality: Path) -> None:
    """Write ``log*.parquet`` beside ``quality``, then ``quality`` itself."""
    given = json.loads(settings)
    notes = RecordingNotes.model_validate(given.get("notes", {}))
    names = {"sensor": sensor, "device": notes.device or recording, "recording": recording}
    names |= {"kind": "static", "simulated": given["simulated"]}
    try:
        if "error" in given:
            raise RecordingError(given["error"])
        log = LogFormat.model_validate(given["log"])
        limits = QualitySettings.model_validate(given["quality"])
        kept = ingest(source, log, notes, limits, quality.parent, names)
    except RecordingError as error:
        remove_kept(quality.parent)
        kept = rejected(error, notes)
    write_json(asdict(kept.quality(names)), quality)


if __name__ == "__main__":
    main(
        Path(snakemake.params.source),
        snakemake.params.settings,
        snakemake.wildcards.sensor,
        snakemake.wildcards.recording,
        Path(snakemake.output[0]),
    )
