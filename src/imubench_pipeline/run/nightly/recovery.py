"""What a run leaves that was killed, or cut off with the power, and how the next one goes on.

Steps that were interrupted are left to Snakemake (``--rerun-incomplete``). The rest is here: its
lock, steps that run on without it, temporary files, and files that were on their way to the disk
when the machine stopped.
"""

from __future__ import annotations

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

_FOLDERS = (
    *("recordings", "sensors", "tables", "simulated", "report", "exports", "seals", "faults"),
    "nightly",
)
"""What a run writes to, below the results: nothing else is touched."""

_TEMPORARY = re.compile(r"\..+\.[a-z0-9_]{8}\.part")
"""Names that `tables.replacing`, `tables.making` and the ingest give to what is not complete."""

STILL_WRITTEN = 60.0
"""s; what has changed so shortly before a run may be a command's of someone."""

_ON_ITS_WAY = 60.0  # s; a system keeps what is written in memory for half a minute or so
_PATIENCE = 10.0  # s; for a process to end


def snakemake_locks(project: Path, results: Path) -> list[Path]:
    """Return the locks of Snakemake on files of these results; `project` has the Snakefile."""
    # The paths in a lock are as Snakemake was told them: links are not followed.
    inside = os.path.normpath(results) + os.sep

    def concerns(path: Path) -> bool:
        with path.open(encoding="utf-8", errors="replace") as lines:
            return any(
                os.path.normpath(project / line.strip()).startswith(inside) for line in lines
            )

    locks = []
    for path in sorted(project.glob(".snakemake/locks/*.lock")):
        with contextlib.suppress(OSError):  # a run that has just ended takes its own away
            if concerns(path):
                locks.append(path)
    return locks


def owner(locks: Iterable[Path], project: Path, results: Path) -> int | None:
    """Return the process of a Snakemake that these locks may belong to; None: they are stale."""
    stamps = []
    for lock in locks:
        with contextlib.suppress(OSError):
            stamps.append(lock.stat().st_mtime)
    if not stamps:
        return None
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error):
            # A process that began after the lock was made did not make it.
            if _is_snakemake(process, project, results) and process.create_time() < max(stamps):
                return process.pid
    return None


def _is_snakemake(process: psutil.Process, project: Path, results: Path) -> bool:
    words = process.cmdline()
    if not any(Path(word).name == "snakemake" for word in words):
        return False
    stated = [word.partition("=")[2] for word in words if word.startswith("results=")]
    if stated and os.path.normpath(project / stated[-1]) != os.path.normpath(results):
        return False
    try:
        return Path(process.cwd()) == project.resolve()
    except psutil.AccessDenied:
        return True  # somebody else's: rather wait one night


def end_left_over(note: Mapping[str, Any], project: Path) -> int:
    """End the steps that a run left running which was killed; return how many there were.

    `note` is what that run left in the lock; the steps run in `project`.
    """
    group = note.get("snakemake")
    if note.get("host") != platform.node() or not isinstance(group, int) or restarted(note):
        return 0
    ended = []
    for process in psutil.process_iter():
        with contextlib.suppress(psutil.Error, OSError):
            # The number may have gone to another group of processes since.
            if os.getpgid(process.pid) == group and Path(process.cwd()) == project.resolve():
                process.terminate()
                ended.append(process)
    for process in psutil.wait_procs(ended, timeout=_PATIENCE)[1]:
        with contextlib.suppress(psutil.Error):
            process.kill()
    return len(ended)


def end_group(group: int) -> None:
    """End what is left of a group of processes that this run has started, by the first of them."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)


def restarted(note: Mapping[str, Any], boot: float | None = None) -> bool:
    """Tell whether the machine has been started anew since a run that left this note began.

    `boot`: when the machine was started, s since 1970; default: asked of the system.
    """
    try:
        since = datetime.fromisoformat(str(note.get("since"))).timestamp()
    except ValueError:
        return False
    if note.get("host", platform.node()) != platform.node():
        return False
    return since < (psutil.boot_time() if boot is None else boot)


def remove_temporary(results: Path, locked: float) -> tuple[int, int]:
    """Remove the temporary files of killed runs; return how many they were, and their bytes.

    `locked`: when the lock was, s since 1970: what changed shortly before, or later, stays.
    """
    number = size = 0
    for path in list(_below(results)):
        if not _TEMPORARY.fullmatch(path.name) or path.is_symlink():
            continue
        inside = list(path.rglob("*")) if path.is_dir() else []
        with contextlib.suppress(OSError):
            statuses = [status.lstat() for status in (path, *inside)]
            if max(status.st_mtime for status in statuses) < locked - STILL_WRITTEN:
                _remove(path)
                number, size = number + 1, size + sum(status.st_size for status in statuses)
    return number, size


def temporary(results: Path) -> list[Path]:
    """Return the files and folders below the results that are not complete."""
    unfinished = [path for path in _below(results) if _TEMPORARY.fullmatch(path.name)]
    return [path for path in unfinished if not any(other in path.parents for other in unfinished)]


def remove_unfinished(outputs: Iterable[Path]) -> None:
    """Remove what a step that was ended had not completed of its outputs."""
    for path in outputs:
        for left in path.parent.glob(f".{glob.escape(path.name)}.*.part"):
            if _TEMPORARY.fullmatch(left.name):
                with contextlib.suppress(FileNotFoundError):
                    _remove(left)


def remove_doubtful(results: Path) -> int:
    """Remove what was written in the last minute before the power went; return how many files.

    A file that has its name already may have no content then. Snakemake makes anew what is not
    there. Of a folder that one step makes, all goes.
    """
    stamps: dict[Path, float] = {}
    for path in _below(results):
        with contextlib.suppress(OSError):
            if path.is_file() and path.relative_to(results).parts[0] != "nightly":
                stamps[path] = path.stat().st_mtime
    last = max(stamps.values(), default=0.0)
    doubtful = [path for path, stamp in stamps.items() if stamp > last - _ON_ITS_WAY]
    for made in dict.fromkeys(_made_as_one(results, path) for path in doubtful):
        with contextlib.suppress(OSError):
            _remove(made)
    return len(doubtful)


def _made_as_one(results: Path, path: Path) -> Path:
    """Return the folder that one step makes and a file is in; else the file itself."""
    parts = path.relative_to(results).parts
    if parts[0] in ("report", "exports"):
        return results / parts[0]
    return results.joinpath(*parts[:3]) if parts[0] == "simulated" else path


def _remove(path: Path) -> None:
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()


def _below(results: Path) -> Iterator[Path]:
    """Yield files and folders that a run wrote; links to elsewhere are not followed."""
    for folder in _FOLDERS:
        yield from results.glob(f".{folder}.*.part")  # the folder itself, while it is made
        for place, folders, files in os.walk(results / folder):
            yield from (Path(place, name) for name in (*folders, *files))
