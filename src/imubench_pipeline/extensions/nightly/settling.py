"""Find logs that are complete, and logs that are still being written.

A log is read if it has not changed for a while. Three signs show an incomplete log: a modification
time that is too recent, a size or modification time that changes between two scans (times alone may
be wrong: clocks of network disks and of copied files), and a process on this machine that has it
open for writing (a logger may write its buffer only every few minutes).
"""

import contextlib
import os
import re
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import psutil

from imubench_pipeline.recordings.drop_zone import (
    PARTIAL,
    find_logs,
    get_recording_name,
    get_sensor_name,
)
from imubench_pipeline.report.run_summary import fold_text

Signature = tuple[tuple[str, int, int], ...]
"""Path, size in bytes and last change in ns of each file of a recording."""

_MAX_PAUSE = 10.0  # s; slower writers are found by their time stamps, or as open files
_MAX_TRANSFER_PAUSE = 86400.0  # s without a change; an older partial file is not being transferred
_RSYNC_NAME = re.compile(r"\.(.+)\.[A-Za-z0-9]{6}")
_MISSING = -1


@dataclass(frozen=True)
class Found:
    """Files of one recording in the drop zone."""

    files: Signature = ()  # and notes, without files that are still being transferred
    partial: tuple[str, int, int] | None = None  # signature of a file that is being transferred
    incomplete: bool = False  # the partial file is a part of the recording, not a later version


@dataclass(frozen=True)
class Skip:
    """A log, or part of a log, that is not read in this run."""

    recording: str  # sensor and name, such as mti_7/night
    reason: str
    held_back: bool = True  # False: there is a complete log, too, or the transfer was given up


def scan_drop_zone(logs: Path) -> dict[str, Found]:
    """Scan a drop zone, which may be missing; return its files by sensor and recording."""
    recordings: dict[str, Found] = {}
    if not logs.is_dir():
        return recordings
    for log in find_logs(logs):
        key = f"{log.sensor}/{log.name}"
        before = recordings.get(key, Found())
        partial = next(_find_partial_files(log.path), before.partial)
        files = tuple(_stat_file(path) for path in log.files or [log.path])
        recordings[key] = Found(before.files + files, partial, partial is not None)
    for path in sorted(logs.glob("*/*")):
        whole = find_complete_name(path.name)
        if whole is not None and path.is_file():
            key = f"{get_sensor_name(path.parent)}/{get_recording_name(whole)}"
            before = recordings.get(key, Found())
            if not before.incomplete:
                recordings[key] = Found(before.files, _stat_file(path, path.parent))
    return recordings


def find_complete_name(name: str) -> str | None:
    """Return the final name of a partial file (.part, hidden, rsync); None for a complete file."""
    if name.startswith("._"):
        return None  # files of attributes that macOS adds
    whole = name.lstrip(".")
    if whole != name and (of_rsync := _RSYNC_NAME.fullmatch(name)):
        return of_rsync[1]
    if Path(whole).suffix.lower() in PARTIAL:
        return Path(whole).stem
    # Systems keep hidden files in folders too; those have no ending.
    return whole if whole != name and Path(whole).suffix else None


def find_settled_logs(
    logs: Path, settle: float, earlier: Mapping[str, Signature]
) -> tuple[dict[str, Found], list[Skip]]:
    """Return the last scan of a drop zone, and the logs that changed within ``settle``, s."""
    first = second = scan_drop_zone(logs)
    if settle and any(earlier.get(key) != recording.files for key, recording in first.items()):
        time.sleep(min(settle, _MAX_PAUSE))
        second = scan_drop_zone(logs)
    writing = find_writers(second)
    return second, list(find_unsettled_logs(first, second, settle, time.time(), writing))


def find_unsettled_logs(
    first: Mapping[str, Found],
    second: Mapping[str, Found],
    settle: float,
    now: float,
    writing: Mapping[Path, str],
) -> Iterator[Skip]:
    """Yield the logs being written, from two scans, the second at ``now``, and open files."""
    for key in sorted(first.keys() | second.keys()):
        was, latest = first.get(key, Found()), second.get(key, Found())
        by = next((writing[real] for real in _resolve_paths(latest) if real in writing), None)
        age = now - max((stamp for _, _, stamp in latest.files), default=_MISSING) * 1e-9
        if latest.partial and latest.incomplete:
            yield Skip(key, _describe_transfer(latest.partial, now))
        elif was.files != latest.files:
            yield Skip(key, "it changed during the check")
        elif by is not None:
            yield Skip(key, f"{by} has it open for writing")
        # A time far in the future comes from a clock that was not set, and is ignored.
        elif abs(age) < settle:
            yield Skip(key, f"last written to {max(age, 0.0):.0f} s ago")
        elif latest.partial:
            replaces = not latest.files and now - latest.partial[2] * 1e-9 < _MAX_TRANSFER_PAUSE
            yield Skip(key, _describe_transfer(latest.partial, now), held_back=replaces)


def _describe_transfer(partial: tuple[str, int, int], now: float) -> str:
    path, _, stamp = partial
    days = (now - stamp * 1e-9) / _MAX_TRANSFER_PAUSE
    if days < 1.0:
        return fold_text(f"{path} is still being transferred")
    return fold_text(f"{path} is not complete, and nothing was written to it for {days:.0f} days")


def find_writers(recordings: Mapping[str, Found]) -> dict[Path, str]:
    """Return the files of recordings that accessible processes have open for writing."""
    looked_for = {real for recording in recordings.values() for real in _resolve_paths(recording)}
    writing: dict[Path, str] = {}
    for process in psutil.process_iter() if looked_for else ():
        with contextlib.suppress(psutil.Error, OSError):
            for file in process.open_files():
                if getattr(file, "mode", "r") != "r" and Path(file.path) in looked_for:
                    writing[Path(file.path)] = fold_text(
                        f"process {process.pid} ({process.name()})"
                    )
    return writing


def find_changed_logs(before: Mapping[str, Found], after: Mapping[str, Found]) -> set[str]:
    """Return the recordings whose logs changed or appeared between two scans."""
    return {key for key, log in after.items() if before.get(key, Found()).files != log.files}


def _resolve_paths(recording: Found) -> Iterable[Path]:
    return (Path(os.path.realpath(path)) for path, _, _ in recording.files)


def _stat_file(path: Path, below: Path | None = None) -> tuple[str, int, int]:
    shown = str(path.relative_to(below) if below else path)
    try:
        about = path.stat()
    except OSError:
        return shown, _MISSING, _MISSING
    return shown, about.st_size, about.st_mtime_ns


def _find_partial_files(path: Path) -> Iterator[tuple[str, int, int]]:
    """Yield the partial files of a recording in a folder, or the folder if it is partial."""
    if path.is_dir():
        if path.suffix.lower() in PARTIAL:
            yield _stat_file(path, path.parent)
        for file in sorted(path.rglob("*")):
            # Other hidden files are no part of a recording.
            named = file.suffix.lower() in PARTIAL or _RSYNC_NAME.fullmatch(file.name)
            if named and find_complete_name(file.name) and file.is_file():
                yield _stat_file(file, path.parent)
