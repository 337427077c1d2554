"""One module a log format: file -> batches of SI samples, in bounded memory."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from imubench_pipeline.readers.batch import TEMPERATURE, Batch, LogFile, RecordingError
from imubench_pipeline.readers.content import is_ros_2_bag, reader_of
from imubench_pipeline.sensor import ColumnSource, LogFormat, Reader

_CLASSES: dict[Reader, tuple[str, str]] = {
    "csv": ("imubench_pipeline.readers.csv", "CsvFile"),
    "matlab": ("imubench_pipeline.readers.matlab", "MatlabFile"),
}
"""Module and class of each reader: only those that a run needs are imported."""

__all__ = ["TEMPERATURE", "Batch", "LogFile", "RecordingError", "log_files", "read"]


def log_files(path: Path) -> list[Path]:
    """Return the files of a recording: the file itself, or the visible files of its folder."""
    if path.is_dir():
        return sorted(
            file for file in path.iterdir() if file.is_file() and not file.name.startswith(".")
        )
    return [path]


def read(path: Path, log: LogFormat) -> list[LogFile]:
    """Open a recording.

    Parameters
    ----------
    path : Path
        A log file, or the folder of a recording that has several.
    log : LogFormat
        How the files are written.

    Returns
    -------
    list of LogFile
        One a file, sorted by name, each with the columns that it holds.

    Raises
    ------
    RecordingError
        If a file that the format names is not there, or the recording is a folder and the
        format does not say which file a channel is in.
    """
    sources = {str(name): source for name, source in log.channels.items()}
    if log.temperature is not None:
        sources[TEMPERATURE] = log.temperature
    by_file: dict[Path, dict[str, ColumnSource]] = {}
    for name, source in sources.items():
        by_file.setdefault(_file_of(path, source, name), {})[name] = source
    return [_open(file, log, by_file[file]) for file in sorted(by_file)]


def _file_of(path: Path, source: ColumnSource, name: str) -> Path:
    if is_ros_2_bag(path):
        return path
    present = log_files(path)
    if source.file is not None:
        if not path.is_dir():
            raise RecordingError(
                f"{path.name}: is one file, but the sensor file takes {name} from "
                f"{source.file!r} of a folder; put the files into a folder, or drop 'file:'"
            )
        if path / source.file not in present:
            names = ", ".join(file.name for file in present) or "no file"
            raise RecordingError(
                f"{path.name}: no file {source.file!r} for {name}; the folder has {names}"
            )
        return path / source.file
    if len(present) != 1:
        names = ", ".join(file.name for file in present) or "no file"
        raise RecordingError(
            f"{path.name}: expected one file, the folder has {names}; name the file of each "
            "channel with 'file:' in the sensor file"
        )
    return present[0]


def _open(file: Path, log: LogFormat, sources: dict[str, ColumnSource]) -> LogFile:
    reader = log.reader or reader_of(file)
    module, name = _CLASSES[reader]
    kind: type[LogFile] = getattr(import_module(module), name)
    return kind(file, log, sources)
