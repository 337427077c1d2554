"""The files in the drop zone: each belongs to a recording, or is skipped for a stated reason."""

import errno
import os
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from imubench_pipeline.readers import is_endless, log_files
from imubench_pipeline.settings.validation import cut
from imubench_pipeline.tables.texts import escape_invisible
from imubench_pipeline.words.reasons import files as texts

PARTIAL = frozenset({".part", ".tmp", ".filepart", ".crdownload"})  # ends of names in transfer
COMPRESSED = frozenset({".gz", ".zst", ".xz", ".bz2", ".zip"})  # ends of compressed files
NO_SENSOR = "(no sensor)"  # sensor of logs that lie beside the folders of the sensors
_NOTES = ".yaml"
_MISNAMED_NOTES = {".yml", _NOTES}  # in lower case
_NOT_LOGS = {".md"} | _MISNAMED_NOTES | PARTIAL
_FOLLOWED = 2  # levels of folders where links are followed: sensors, and recordings
_UNUSABLE_IN_NAMES = re.compile(r"[^\w .+()-]")
_LONGEST_NAME, _MOST_BYTES = 120, 160  # letters, bytes: the name of a page is longer
_PERIODIC = re.compile(r"(.+?)\1{19,}$")  # Snakemake ends a run over names that repeat


@dataclass(frozen=True)
class Recording:
    """One recording that was found, or is to be simulated."""

    sensor: str
    name: str
    path: Path  # the log file, or the folder of a recording that has several
    notes: Path | None  # the file of notes beside it
    simulated: bool
    error: str | None = None  # why the file cannot be used, if its name or place says so
    unavailable: str | None = None  # why it cannot be looked at now; nothing is known about it
    held_back: bool = False  # the log is not read in this run: the results that are there stay

    @property
    def files(self) -> list[Path]:
        """The present files of its log and notes; the folder if it cannot be listed."""
        alone = self.simulated or _holds_itself(self.path)
        try:
            logs = [self.path] if alone else log_files(self.path)
        except OSError:  # the ingest meets the same error, and reports it
            logs = [self.path]
        return logs + ([self.notes] if self.notes else [])

    @property
    def inputs(self) -> list[Path]:
        """Input files for Snakemake; their dates decide whether it reads the recording again.

        A simulated recording has its files. Any other has none: changes of its logs and notes show
        in the settings of the ingest. A recording that is held back has a file that does not exist,
        so that Snakemake leaves its results as they are.
        """
        if self.held_back:
            return [self.path / "held back"]
        return self.files if self.simulated else []


@dataclass(frozen=True)
class FoundFile:
    """A file in the drop zone: it belongs to a recording, or is skipped."""

    file: str  # path in the drop zone
    sensor: str | None = None
    recording: str | None = None
    reason: str | None = None  # why it is skipped


def find_logs(logs: Path) -> list[Recording]:
    """Return the recordings in a drop zone, sorted; ``error`` is set if outside a sensor folder."""
    recordings: list[Recording] = []
    for path in _shown(logs):
        if path.is_dir():
            recordings += _logs_of(path)
        elif _is_dangling(path):
            recordings.append(_behind_link(path, get_sensor_name(path), get_sensor_name(path)))
        elif _is_log(path):
            fault = _fault(path, _stem(path)) or (
                f"{path.name} lies beside the folders of the sensors; expected it in "
                f"{logs / '<sensor>'}, the folder with the name of its sensor file: move it there"
            )
            name = get_recording_name(path.name)
            recordings.append(Recording(NO_SENSOR, name, path, None, simulated=False, error=fault))
    return recordings


def account_for(
    logs: Path, recordings: Iterable[Recording], held_back: Iterable[Recording] = ()
) -> list[FoundFile]:
    """Return every file in a drop zone once, with its recording, or the reason why it is skipped.

    ``held_back``: recordings that are still written; their files are skipped.
    """
    owners = {file: recording for recording in recordings for file in recording.files}
    waiting = {file for recording in held_back for file in recording.files}
    found = []
    for file in sorted(_every_file(logs)) if logs.is_dir() else ():
        place = escape_invisible(
            os.fsencode(file.relative_to(logs)).decode(errors="backslashreplace")
        )
        if owner := owners.get(file):
            found.append(FoundFile(place, owner.sensor, owner.name))
        elif file in waiting:
            found.append(FoundFile(place, reason=texts.STILL_WRITTEN))
        else:
            found.append(FoundFile(place, reason=_why_skipped(file, logs)))
    return found


def _every_file(folder: Path) -> Iterator[Path]:
    """Yield all files below a folder, and folders that cannot be listed."""
    waiting = [(folder, 0)]
    while waiting:
        inside, level = waiting.pop()
        try:
            with os.scandir(inside) as entries:
                for entry in entries:
                    path = Path(entry.path)
                    followed = level < _FOLLOWED and not _holds_itself(path)
                    if entry.is_dir(follow_symlinks=followed):
                        waiting.append((path, level + 1))
                    else:
                        yield path
        except OSError:  # such as a path that is too long
            yield inside


def _why_skipped(file: Path, logs: Path) -> str:
    name, suffix = file.name, file.suffix.lower()
    if copy := next((part for part in file.relative_to(logs).parts if part.endswith("~")), ""):
        return texts.editor_backup(copy)
    if suffix in PARTIAL or Path(name.lstrip(".")).suffix.lower() in PARTIAL:
        return texts.still_transferred(suffix)
    if dotted := next((part for part in file.relative_to(logs).parts if part.startswith(".")), ""):
        return texts.hidden(dotted)
    if "__MACOSX" in file.parts:
        return texts.ARCHIVE_ATTRIBUTES
    if suffix == ".md":
        return texts.DOCUMENTATION
    if suffix in _MISNAMED_NOTES:
        if file.parent == logs:
            return texts.SETTINGS_BESIDE_SENSORS
        if suffix == file.suffix == _NOTES:
            return texts.notes_without_log(file.stem)
        return texts.misnamed_notes(f"{file.stem}{_NOTES}")
    try:
        if file.is_symlink() and file.is_dir():
            return texts.LINKED_FOLDER
        if file.is_dir():
            return texts.CLOSED_FOLDER
        if is_endless(file):
            return texts.NEITHER_FILE_NOR_FOLDER
    except OSError as error:
        return texts.unreadable(error.strerror)
    return texts.NO_RECORDING


def _logs_of(folder: Path) -> Iterator[Recording]:
    sensor = get_sensor_name(folder)
    try:
        shown = _shown(folder)
    except OSError as error:
        reason = f"the folder {folder.name!a} cannot be listed ({error.strerror})"
        yield Recording(sensor, sensor, folder, None, simulated=False, unavailable=reason)
        return
    logs = [path for path in shown if path.is_dir() or _is_log(path)]
    notes_of = {path.name: path for path in shown if path.suffix == _NOTES and not path.is_dir()}
    misnamed: dict[str, Path] = {}
    for path in sorted({*shown} - {*logs} - {*notes_of.values()}):
        if path.suffix.lower() in _MISNAMED_NOTES:
            misnamed.setdefault(path.stem, path)
    names = {path.name if path.is_dir() else _stem(path) for path in logs if not _is_dangling(path)}
    for path in logs:
        name = path.name if path.is_dir() else _stem(path)
        if _is_dangling(path):  # it may lead to a folder, whose name has no ending
            yield _behind_link(path, sensor, path.name if name in names else name)
            continue
        notes, other = notes_of.get(f"{name}{_NOTES}"), misnamed.get(name)
        fault = _fault(path, name)
        if fault is None and other:
            fault = f"{other.name}: notes end in {_NOTES}; rename it to {name}{_NOTES}"
        yield Recording(sensor, _usable(name), path, notes, simulated=False, error=fault)


def _holds_itself(path: Path) -> bool:
    """Return whether a path is a link to one of its parent folders."""
    if not path.is_symlink():
        return False
    try:
        return path.parent.resolve().is_relative_to(path.resolve())
    except (OSError, RuntimeError):  # links in a circle
        return False


def _is_dangling(path: Path) -> bool:
    """Return whether a path is a link whose target is missing, for example with a mount."""
    if not path.is_symlink():
        return False
    try:
        path.stat()
    except OSError as error:
        return error.errno in (errno.ENOENT, errno.ENOTDIR, errno.EACCES)
    return False


def _behind_link(path: Path, sensor: str, name: str) -> Recording:
    reason = f"{path.name}: cannot be read (No such file or directory): its target is missing now"
    return Recording(sensor, _usable(name), path, None, simulated=False, unavailable=reason)


def _shown(folder: Path) -> list[Path]:
    """Return the content of a folder, in order, without hidden files and backups of editors."""
    names = (path for path in folder.iterdir() if not path.name.startswith("."))
    return sorted(path for path in names if not path.name.endswith("~"))


def _is_log(path: Path) -> bool:
    return path.suffix.lower() not in _NOT_LOGS


def get_recording_name(file: str) -> str:
    """Return the name of the recording whose log has this file name."""
    return _usable(_stem(Path(file)))


def get_sensor_name(folder: Path) -> str:
    """Return the name of the sensor whose logs are in a folder of the drop zone."""
    return _usable(folder.name)


def _usable(name: str) -> str:
    short = _UNUSABLE_IN_NAMES.sub("_", name)[:_LONGEST_NAME].encode()[:_MOST_BYTES]
    return _PERIODIC.sub(r"\1", short.decode("utf-8", "ignore"))


def _fault(path: Path, name: str) -> str | None:
    shown = ascii(path.name)
    folder = path.parent.name
    for what, name_shown, stem in (("file", shown, name), ("folder", ascii(folder), folder)):
        if _usable(stem) != stem:
            return (
                f"the {what} name {cut(name_shown, str)} cannot be used; expected letters, digits, "
                f"spaces and . _ - + ( ), {_LONGEST_NAME} characters ({_MOST_BYTES} bytes) at "
                f"most, and no end that repeats 20 times: rename the {what}"
            )
    try:
        if _holds_itself(path):
            return f"{shown} links to one of its parent folders; expected a log: remove the link"
        if is_endless(path):
            return f"{shown} is neither a file nor a folder; expected a log"
        files = log_files(path)
    except OSError:  # the ingest meets the same error, and reports it
        return None
    if not files:
        return f"the folder {shown} has no files; expected a log in it"
    for file in files:
        try:
            file.name.encode()
        except UnicodeEncodeError:
            return f"{shown} has a file {file.name!a}, whose name is not UTF-8: rename it"
    return None


def _stem(path: Path) -> str:
    name = path.name
    for suffix in path.suffixes[::-1]:
        if suffix.lower() in COMPRESSED:
            name = name[: -len(suffix)]
    return name.rsplit(".", maxsplit=1)[0] if "." in name else name
