"""Recover by night from a run that was killed, or interrupted by a power failure.

Steps may still run, and files may not have been on the disk when the machine stopped.
"""

import contextlib
import os
import platform
import signal
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import psutil

from imubench_pipeline.run.recovery import remove_path, walk_outputs, was_restarted

_MAX_WRITE_DELAY = 60.0  # s; systems buffer writes in memory for about half a minute
_MAX_TERMINATION_TIME = 10.0  # s; for a process to end


def end_left_over(note: Mapping[str, Any], project: Path) -> int:
    """End steps of a killed run, by its lock note, that still run in `project`; return how many."""
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
    """Kill the remaining processes of a process group that this run started, by its ID."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)


def remove_doubtful(results: Path) -> int:
    """Remove the files of the last minute before a power failure; return their number.

    Such a file may exist without its content. A folder that one step makes is removed as a whole.
    """
    stamps: dict[Path, float] = {}
    for path in walk_outputs(results):
        with contextlib.suppress(OSError):
            if path.is_file() and path.relative_to(results).parts[0] != "nightly":
                stamps[path] = path.stat().st_mtime
    last = max(stamps.values(), default=0.0)
    doubtful = [path for path, stamp in stamps.items() if stamp > last - _MAX_WRITE_DELAY]
    for path in doubtful:
        parts = path.relative_to(results).parts
        depth = {"report": 1, "exports": 1, "simulated": 3}.get(parts[0], len(parts))
        with contextlib.suppress(OSError):
            remove_path(results.joinpath(*parts[:depth]))
    return len(doubtful)
