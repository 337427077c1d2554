"""Recover from a run that was killed, or interrupted by a power failure.

Snakemake reruns interrupted steps (``--rerun-incomplete``). This module handles steps that still
run, temporary files, and files that were not yet on the disk when the machine stopped.
"""

import contextlib
import glob
import os
import platform
import re
import shutil
import signal
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import psutil

from imubench_pipeline.run.project import WRITTEN_FOLDERS

_TEMPORARY_NAME = re.compile(r"\..+\.[a-z0-9_]{8}\.part")  # of incomplete files and folders
STILL_WRITTEN = 60.0  # s; a file that changed so shortly before a run may belong to another command
_MAX_WRITE_DELAY = 60.0  # s; systems buffer writes in memory for about half a minute
_MAX_TERMINATION_TIME = 10.0  # s; for a process to end


def end_left_over(note: Mapping[str, Any], project: Path) -> int:
    """End the steps of a killed run, by its note, that run in `project`; return their number."""
    group = note.get("snakemake")
    if note.get("host") != platform.node() or not isinstance(group, int) or was_restarted(note):
        return 0
    ended = []
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error, OSError):
            # Another process group may have the same number now.
            if os.getpgid(process.pid) == group and Path(process.cwd()) == project.resolve():
                process.terminate()
                ended.append(process)
    for process in psutil.wait_procs(ended, timeout=_MAX_TERMINATION_TIME)[1]:
        with contextlib.suppress(psutil.Error):
            process.kill()
    return len(ended)


def end_group(group: int) -> None:
    """Kill the remaining processes of a group that this run started, by its leader."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)


def was_restarted(note: Mapping[str, Any], boot: float | None = None) -> bool:
    """Return whether the machine was restarted after a run of this note; `boot`: s since 1970."""
    try:
        since = datetime.fromisoformat(str(note.get("since"))).timestamp()
    except ValueError:
        return False
    if note.get("host", platform.node()) != platform.node():
        return False
    return since < (psutil.boot_time() if boot is None else boot)


def remove_temporary(results: Path, locked: float) -> tuple[int, int]:
    """Remove temporary files older than the time of the lock, s; return their number and bytes."""
    number = size = 0
    for path in list(_walk_outputs(results)):
        if not _TEMPORARY_NAME.fullmatch(path.name) or path.is_symlink():
            continue
        inside = list(path.rglob("*")) if path.is_dir() else []
        with contextlib.suppress(OSError):
            statuses = [status.lstat() for status in (path, *inside)]
            if max(status.st_mtime for status in statuses) < locked - STILL_WRITTEN:
                _remove(path)
                number, size = number + 1, size + sum(status.st_size for status in statuses)
    return number, size


def find_unfinished(results: Path) -> list[Path]:
    """Return the files and folders below the results that are not complete."""
    unfinished = [path for path in _walk_outputs(results) if _TEMPORARY_NAME.fullmatch(path.name)]
    return [path for path in unfinished if not any(other in path.parents for other in unfinished)]


def remove_unfinished(outputs: Iterable[Path]) -> None:
    """Remove the incomplete outputs of a step that was ended."""
    for path in outputs:
        for left in path.parent.glob(f".{glob.escape(path.name)}.*.part"):
            if _TEMPORARY_NAME.fullmatch(left.name):
                with contextlib.suppress(FileNotFoundError):
                    _remove(left)


def remove_doubtful(results: Path) -> int:
    """Remove the files of the last minute before a power failure; return their number.

    Such a file may have its name without its content; a folder that one step makes goes as a whole.
    """
    stamps: dict[Path, float] = {}
    for path in _walk_outputs(results):
        with contextlib.suppress(OSError):
            if path.is_file() and path.relative_to(results).parts[0] != "nightly":
                stamps[path] = path.stat().st_mtime
    last = max(stamps.values(), default=0.0)
    doubtful = [path for path, stamp in stamps.items() if stamp > last - _MAX_WRITE_DELAY]
    for path in doubtful:
        parts = path.relative_to(results).parts
        depth = {"report": 1, "exports": 1, "simulated": 3}.get(parts[0], len(parts))
        with contextlib.suppress(OSError):
            _remove(results.joinpath(*parts[:depth]))
    return len(doubtful)


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()


def _walk_outputs(results: Path) -> Iterator[Path]:
    """Yield files and folders that runs write; links are not followed."""
    for folder in WRITTEN_FOLDERS:  # nothing else is changed
        yield from results.glob(f".{folder}.*.part")  # the folder itself, while it is made
        for place, folders, files in os.walk(results / folder):
            yield from (Path(place, name) for name in (*folders, *files))
