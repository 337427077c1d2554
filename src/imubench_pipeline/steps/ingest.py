"""Convert a recording to Parquet; an unusable one is recorded as rejected."""

import json
import shutil
from dataclasses import asdict
from pathlib import Path

from imubench_pipeline.recordings.ingest import ingest_as_planned
from imubench_pipeline.recordings.overview import overview
from imubench_pipeline.recordings.recording import (
    METADATA_FILE,
    SAMPLES_FOLDER,
    list_log_files,
    read_metadata,
)
from imubench_pipeline.tables.files import write_content, write_each


def write_recording(
    source: Path,
    settings: str,
    sensor: str,
    recording: str,
    folder: Path,
    samples: Path | None = None,
) -> None:
    """Write the samples of a log, their overview and ``quality.json`` into a folder.

    ``samples``: a separate folder for the samples; None: ``folder``. An object store needs it: its
    rules declare each output, and the report reads the metadata from a file, not from the samples.
    """
    # Results may be a copy of a bucket.
    shutil.rmtree(folder / SAMPLES_FOLDER, ignore_errors=True)
    (folder / METADATA_FILE).unlink(missing_ok=True)
    quality = ingest_as_planned(source, settings, sensor, recording, folder, guarded=True)
    seen = overview(folder, sensor, recording)
    write_each(vars(seen), [folder / "envelope.parquet", folder / "histogram.parquet"])
    if samples is not None:
        files = list_log_files(folder)
        text = json.dumps(asdict(read_metadata(files[0]))) if files else "null"
        samples.mkdir(exist_ok=True)
        for path in files:
            path.replace(samples / path.name)
        write_content(text, folder / METADATA_FILE)
        write_content(text, samples / METADATA_FILE)  # a store has no empty folders
    quality.write(folder / "quality.json")
