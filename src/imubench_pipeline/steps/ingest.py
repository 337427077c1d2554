"""Read a recording into Parquet; one that cannot be used is recorded as rejected."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from imubench_pipeline.recordings.ingest import ingest_as_planned
from imubench_pipeline.recordings.overview import overview
from imubench_pipeline.tables import write


def write_recording(
    source: Path, settings: str, sensor: str, recording: str, outputs: Mapping[str, Path]
) -> None:
    """Write what is kept of a log, beside ``quality.json``, and what it looks like."""
    folder = outputs["quality"].parent
    quality = ingest_as_planned(source, settings, sensor, recording, folder, guarded=True)
    seen = overview(folder, sensor, recording)
    write("envelope", seen.envelope, outputs["envelope"])
    write("histogram", seen.histogram, outputs["histogram"])
    quality.write(outputs["quality"])
