"""Read log files of all formats (`formats`) as batches of SI samples, in bounded memory."""

import errno
import os
import unicodedata
from itertools import islice
from pathlib import Path

from imubench_pipeline.readers import compressed
from imubench_pipeline.readers.batch import Batch, LogFile, name_settings_file
from imubench_pipeline.readers.bounds import MAX_ARCHIVE_PROBES
from imubench_pipeline.readers.content import find_format, is_endless, recognise_folder
from imubench_pipeline.settings import sensor
from imubench_pipeline.settings.validation import cut
from imubench_pipeline.tables.findings import RecordingError

__all__ = ["Batch", "LogFile", "RecordingError", "find_only_log", "is_endless", "log_files", "read"]


def log_files(path: Path) -> list[Path]:
    """Return a log file itself, or the visible files of a folder and its subfolders, sorted.

    Includes broken links to files; follows no links to folders. OSError for a device or pipe.
    """
    if is_endless(path):
        raise OSError(errno.EINVAL, "it is neither a file nor a folder")
    if not path.is_dir():
        return [path]
    files, waiting = [], [path]
    while waiting:
        with os.scandir(waiting.pop()) as entries:
            for entry in entries:
                file = Path(entry.path)
                if not compressed.is_visible(Path(entry.name)):
                    continue
                if entry.is_dir(follow_symlinks=False):
                    waiting.append(file)
                elif file.is_file() or (file.is_symlink() and not file.exists()):
                    files.append(file)
    return sorted(files)


def read(path: Path, log: sensor.LogFormat) -> list[LogFile]:
    """Open a recording: a log file, or a folder or zip archive with the files of a recording.

    Returns a LogFile for each file, or each topic of a file, sorted by name, with its columns.
    Raises RecordingError if a file that ``log`` names is missing, or if there are several files
    and ``log`` does not name the file of each channel.
    """
    if is_endless(path):
        raise RecordingError(f"{path.name}: is neither a file nor a folder; expected a log file")
    # In a fixed order, independent of the sensor file, so that findings and columns are too.
    channels = sorted(log.channels, key=sensor.CHANNELS.index)
    sources = {str(name): log.channels[name] for name in channels}
    others = {
        sensor.TEMPERATURE: log.temperature,
        sensor.POSITION: log.position,
        sensor.TABLE_RATE: log.table_rate,
    }
    sources |= {name: source for name, source in others.items() if source is not None}
    present = _list_present(path, log)
    together: dict[tuple[Path, str], dict[str, sensor.ColumnSource]] = {}
    for name, source in sources.items():
        file = _find_file(path, present, source, name)
        clock = ""  # the part of the file with a clock of its own: a topic, or a kind of message
        if source.variable is not None and not compressed.is_member(file):
            clock = source.variable if find_format(file, log.reader).clock_of == "variable" else ""
        together.setdefault((file, clock), {})[name] = source
    files = []
    for (file, _), columns in sorted(together.items(), key=lambda item: item[0]):
        inside = None if compressed.is_member(file) else _list_present(file, log)
        if inside is not None:
            file = find_only_log(file, inside)  # an archive with one log, among other files
        files.append(find_format(file, log.reader).load().log_file(file, log, columns))
    return files


def _list_present(path: Path, log: sensor.LogFormat) -> list[Path] | None:
    """Return the files of a folder or an archive; None if the path is one log."""
    if recognise_folder(path) is not None:
        return None
    if path.is_dir():
        return log_files(path)
    if compressed.is_archive(path) and find_format(path, log.reader).streamed:
        return compressed.list_members(path)
    return None


def _find_file(
    path: Path, present: list[Path] | None, source: sensor.ColumnSource, name: str
) -> Path:
    if source.file is None:
        return path if present is None else find_only_log(path, present)
    if present is None:
        raise RecordingError(
            f"{path.name}: is a single file, but 'file:' in the sensor file expects a folder with "
            f"{source.file!r} for {name}; put the files into a folder, or drop 'file:'"
        )
    # The file may be one level deeper: a folder packed with its name, or unpacked into another.
    # Some systems store accents separately (NFD)
    names = {
        file: unicodedata.normalize("NFC", file.relative_to(path).as_posix()) for file in present
    }
    wanted = unicodedata.normalize("NFC", Path(source.file).as_posix())
    found = [file for file in present if names[file] == wanted] or [
        file for file in present if names[file].endswith(f"/{wanted}")
    ]
    if len(found) != 1:
        what = f"{len(found)} files" if found else "no file"
        raise RecordingError(
            f"{path.name}: {what} {source.file!r} for {name}; the folder has "
            f"{_join_names(path, found or present)}; correct 'file' of {name} in "
            f"{name_settings_file(name)}"
        )
    return found[0]


def find_only_log(path: Path, present: list[Path]) -> Path:
    """Return the only log of a folder or archive; raise `RecordingError` if there is not just one.

    ``present``: its files. Without others, those in subfolders count; in an archive, only texts.
    """
    if not present and not path.is_dir():
        raise RecordingError(
            f"{path.name}: the archive has no log: it is empty, cut short, or has only folders, "
            "hidden files, or paths that lead out of it (../); pack the log again"
        )
    logs = [file for file in present if file.parent == path] or present
    if 1 < len(logs) <= MAX_ARCHIVE_PROBES and not path.is_dir():
        logs = list(islice(filter(compressed.holds_text, logs), 2))  # two are enough for the error
    if len(logs) != 1:
        kind = "folder" if path.is_dir() else "archive"
        raise RecordingError(
            f"{path.name}: expected one file, the {kind} has {_join_names(path, present)}; name "
            "the file of each channel with 'file:' in the sensor file"
        )
    return logs[0]


def _join_names(path: Path, files: list[Path]) -> str:
    shown = ", ".join(cut(file.relative_to(path).as_posix(), str) for file in files[:30])
    names = shown or "no file"
    return f"{names} and {len(files) - 30} more" if len(files) > 30 else names
