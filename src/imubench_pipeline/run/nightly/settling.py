"""Which logs are complete, and which are still being written.

A log is taken when nothing of it has changed for a while. Three signs say that it is not complete:
a stamp of its last change that is too young, a size or a stamp that moves between two looks (stamps
alone may be wrong: clocks of network disks and of copied files), and a process on this machine that
has it open for writing (a logger may write its buffer every few minutes only).
"""

from __future__ import annotations

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
    Recording,
    found_logs,
    name_of,
    sensor_of,
)
from imubench_pipeline.report.run_summary import one_line

Signature = tuple[tuple[str, int, int], ...]
"""Path, size in bytes and last change in ns of each file of a recording."""

_LONGEST_PAUSE = 10.0  # s; what writes less often is known by its stamps, or as an open file
_GIVEN_UP = 86400.0  # s without a byte; a partial file that is older is not being transferred now
_OF_RSYNC = re.compile(r"\.(.+)\.[A-Za-z0-9]{6}")
_GONE = -1


@dataclass(frozen=True)
class Found:
    """What the drop zone has of one recording.

    Attributes
    ----------
    files : Signature
        Its files, and the notes beside them; those still being transferred apart.
    partial : tuple or None
        Path below the sensor's folder, size and last change of a file of it that is still being
        transferred.
    incomplete : bool
        The partial file is a part of it, not a later version that will replace it.
    """

    files: Signature = ()
    partial: tuple[str, int, int] | None = None
    incomplete: bool = False


@dataclass(frozen=True)
class Skip:
    """A log, or a part of one, that is not read in this run.

    Attributes
    ----------
    recording : str
        Sensor and name, such as ``mti_7/night``.
    held_back : bool
        False: nothing to hold back. A complete log beside the partial one is read; where there
        is none, the partial one was given up long ago.
    """

    recording: str
    reason: str
    held_back: bool = True


def look(logs: Path) -> dict[str, Found]:
    """Return what is in a drop zone, by sensor and name of the recording; it may be missing."""
    recordings: dict[str, Found] = {}
    if not logs.is_dir():
        return recordings
    for log in found_logs(logs):
        key = f"{log.sensor}/{log.name}"
        before = recordings.get(key, Found())
        partial = next(_partial_inside(log.path), before.partial)
        recordings[key] = Found(before.files + _signature(log), partial, partial is not None)
    for path in sorted(logs.glob("*/*")):
        whole = complete_name(path.name)
        if whole is not None and path.is_file():
            key = f"{sensor_of(path.parent)}/{name_of(whole)}"
            before = recordings.get(key, Found())
            if not before.incomplete:
                recordings[key] = Found(before.files, _stamped(path, path.parent))
    return recordings


def complete_name(name: str) -> str | None:
    """Return the name that a file will have once it is complete; None if it is complete.

    It may be ``run.csv.part``, ``.run.csv.Xy12Zq`` (rsync) or ``.run.csv``.
    """
    if name.startswith("._"):
        return None  # what macOS keeps beside a file
    whole = name.lstrip(".")
    if whole != name and (of_rsync := _OF_RSYNC.fullmatch(name)):
        return of_rsync[1]
    if Path(whole).suffix.lower() in PARTIAL:
        return Path(whole).stem
    # Systems keep hidden files in folders too; those have no ending.
    return whole if whole != name and Path(whole).suffix else None


def settled(
    logs: Path, settle: float, earlier: Mapping[str, Signature]
) -> tuple[dict[str, Found], list[Skip]]:
    """Look at a drop zone, twice where logs are new, for what is still being written.

    Parameters
    ----------
    logs : Path
    settle : float
        How long nothing of a complete log has changed, s.
    earlier : mapping of str to Signature
        The logs as they were at an earlier run: one that is as it was then needs no second look.

    Returns
    -------
    dict of str to Found, and list of Skip
        The last look, and what is still being written.
    """
    first = look(logs)
    second = first
    if settle and any(earlier.get(key) != recording.files for key, recording in first.items()):
        pause = min(settle, _LONGEST_PAUSE)
        time.sleep(pause)
        second = look(logs)
    return second, list(unsettled(first, second, settle, time.time(), writers(second)))


def unsettled(
    first: Mapping[str, Found],
    second: Mapping[str, Found],
    settle: float,
    now: float,
    writing: Mapping[Path, str],
) -> Iterator[Skip]:
    """Yield the logs that are still being written.

    Parameters
    ----------
    first, second : mapping of str to Found
        Two looks.
    settle : float
        How long nothing of a complete log has changed, s.
    now : float
        When the second look was, s since 1970.
    writing : mapping of Path to str
        Files that are open for writing, and by what.
    """
    for key in sorted(first.keys() | second.keys()):
        was, latest = first.get(key, Found()), second.get(key, Found())
        by = next((writing[real] for real in _real(latest) if real in writing), None)
        age = now - max((stamp for _, _, stamp in latest.files), default=_GONE) * 1e-9
        if latest.partial and latest.incomplete:
            yield Skip(key, _transferred(latest.partial, now))
        elif was.files != latest.files:
            yield Skip(key, "it changed while it was looked at")
        elif by is not None:
            yield Skip(key, f"{by} has it open for writing")
        # A stamp far in the future comes from a clock that was never set, and says nothing.
        elif abs(age) < settle:
            yield Skip(key, f"last written to {max(age, 0.0):.0f} s ago")
        elif latest.partial:
            replaces = not latest.files and now - latest.partial[2] * 1e-9 < _GIVEN_UP
            yield Skip(key, _transferred(latest.partial, now), held_back=replaces)


def _transferred(partial: tuple[str, int, int], now: float) -> str:
    path, _, stamp = partial
    days = (now - stamp * 1e-9) / _GIVEN_UP
    if days < 1.0:
        return one_line(f"{path} is still being transferred")
    return one_line(f"{path} is not complete, and nothing was written to it for {days:.0f} days")


def writers(recordings: Mapping[str, Found]) -> dict[Path, str]:
    """Return the files of recordings that processes have open for writing, and which these are.

    They are the processes that may be looked into: one's own, or all for an administrator.
    """
    looked_for = {real for recording in recordings.values() for real in _real(recording)}
    writing: dict[Path, str] = {}
    for process in psutil.process_iter() if looked_for else ():
        with contextlib.suppress(psutil.Error, OSError):
            for file in process.open_files():
                if getattr(file, "mode", "r") != "r" and Path(file.path) in looked_for:
                    writer = f"process {process.pid} ({process.name()})"
                    writing[Path(file.path)] = one_line(writer)
    return writing


def moved(before: Mapping[str, Found], after: Mapping[str, Found]) -> set[str]:
    """Return the recordings whose logs changed, or appeared, between two looks."""
    return {key for key, log in after.items() if before.get(key, Found()).files != log.files}


def _real(recording: Found) -> Iterable[Path]:
    return (Path(os.path.realpath(path)) for path, _, _ in recording.files)


def _signature(log: Recording) -> Signature:
    return tuple(_stamped(path) for path in log.files or [log.path])


def _stamped(path: Path, below: Path | None = None) -> tuple[str, int, int]:
    shown = str(path.relative_to(below) if below else path)
    try:
        about = path.stat()
    except OSError:
        return shown, _GONE, _GONE
    return shown, about.st_size, about.st_mtime_ns


def _partial_inside(path: Path) -> Iterator[tuple[str, int, int]]:
    """Yield the partial files of a recording that is a folder; the folder itself may be one."""
    if path.is_dir():
        if path.suffix.lower() in PARTIAL:
            yield _stamped(path, path.parent)
        for file in sorted(path.rglob("*")):
            # Other hidden files are no part of a recording.
            named = file.suffix.lower() in PARTIAL or _OF_RSYNC.fullmatch(file.name)
            if named and complete_name(file.name) and file.is_file():
                yield _stamped(file, path.parent)
