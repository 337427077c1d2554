"""Convert a recording to Parquet; an unusable one is recorded as rejected."""

from pathlib import Path

from imubench_pipeline.recordings.ingest import ingest_as_planned
from imubench_pipeline.recordings.overview import overview
from imubench_pipeline.tables.files import write_each


def write_recording(source: Path, settings: str, sensor: str, recording: str, folder: Path) -> None:
    """Write the samples of a log, their overview and ``quality.json`` into a folder."""
    quality = ingest_as_planned(source, settings, sensor, recording, folder, guarded=True)
    seen = overview(folder, sensor, recording)
    write_each(vars(seen), [folder / "envelope.parquet", folder / "histogram.parquet"])
    quality.write(folder / "quality.json")
