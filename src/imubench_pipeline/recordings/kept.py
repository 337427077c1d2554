"""The samples of a recording for the steps that analyse them: as the ingest left them, or none."""

from __future__ import annotations

from pathlib import Path

from imubench_pipeline.recordings.quality_file import MEND, Quality
from imubench_pipeline.recordings.recording import (
    ChannelLog,
    channel_logs,
    log_paths,
    was_at_rest,
)
from imubench_pipeline.tables.findings import RecordingError


def kept_logs(folder: Path) -> dict[str, ChannelLog]:
    """Return the channels of a recording that can be analysed, by name; none of a rejected one.

    Parameters
    ----------
    folder : Path
        Of the recording, with its ``quality.json``.

    Raises
    ------
    RecordingError
        If files of samples are not there, are not those that the ingest left, or are damaged.
    """
    quality = Quality.read(folder / "quality.json")
    if fault := quality.fault(folder):
        raise RecordingError(fault)
    if quality.kept is not None:
        for path in log_paths(folder):
            if path.name not in quality.kept:
                raise RecordingError(f"{path}: is none that the ingest wrote: {MEND}")
    return channel_logs(folder)


def kept_static_logs(folder: Path) -> dict[str, ChannelLog]:
    """Return those that were at rest all the time, as `kept_logs`: none of a turned sensor."""
    logs = kept_logs(folder)
    return logs if was_at_rest(folder) else {}
