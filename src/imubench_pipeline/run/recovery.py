"""Recover from a run that was killed, or interrupted by a power failure.

Snakemake reruns interrupted steps (``--rerun-incomplete``). This module removes temporary
files.
"""

import contextlib
import glob
import os
import platform
import re
import shutil
from collections.abc import Iterable, Iterator, Mapping
from datetime import datetime
from pathlib import Path
from typing import Any

import psutil

from imubench_pipeline.run.project import WRITTEN_FOLDERS

_TEMPORARY_NAME = re.compile(r"\..+\.[a-z0-9_]{8}\.part")  # of incomplete files and folders
STILL_WRITTEN = 60.0  # s; a file that changed so shortly before a run may belong to another command


def was_restarted(note: Mapping[str, Any], boot: float | None = None) -> bool:
    """Return whether this machine started (`boot`, s since 1970) after a lock note was written."""
    try:
        since = datetime.fromisoformat(str(note.get("since"))).timestamp()
    except ValueError:
        return False
    if note.get("host", platform.node()) != platform.node():
        return False
    return since < (psutil.boot_time() if boot is None else boot)


def remove_temporary(results: Path, locked: float) -> tuple[int, int]:
    """Remove temporary files older than ``locked``, s since 1970; return their number and bytes."""
    number = size = 0
    for path in list(walk_outputs(results)):
        if not _TEMPORARY_NAME.fullmatch(path.name) or path.is_symlink():
            continue
        inside = list(path.rglob("*")) if path.is_dir() else []
        with contextlib.suppress(OSError):
            statuses = [status.lstat() for status in (path, *inside)]
            if max(status.st_mtime for status in statuses) < locked - STILL_WRITTEN:
                remove_path(path)
                number, size = number + 1, size + sum(status.st_size for status in statuses)
    return number, size


def find_unfinished(results: Path) -> list[Path]:
    """Return the temporary files and folders in the results, which are incomplete outputs."""
    unfinished = [path for path in walk_outputs(results) if _TEMPORARY_NAME.fullmatch(path.name)]
    return [path for path in unfinished if not any(other in path.parents for other in unfinished)]


def remove_unfinished(outputs: Iterable[Path]) -> None:
    """Remove the incomplete outputs of a step that was ended."""
    for path in outputs:
        for left in path.parent.glob(f".{glob.escape(path.name)}.*.part"):
            if _TEMPORARY_NAME.fullmatch(left.name):
                with contextlib.suppress(FileNotFoundError):
                    remove_path(left)


def remove_path(path: Path) -> None:
    """Remove a file, or a folder with its content."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()


def walk_outputs(results: Path) -> Iterator[Path]:
    """Yield files and folders that runs write; links are not followed."""
    for folder in WRITTEN_FOLDERS:  # nothing else is changed
        yield from results.glob(f".{folder}.*.part")  # the folder itself, while it is made
        for place, folders, files in os.walk(results / folder):
            yield from (Path(place, name) for name in (*folders, *files))
