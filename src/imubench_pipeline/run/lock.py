"""One run at a time in a folder of results, whoever starts it, whatever became of the last one."""

from __future__ import annotations

import fcntl
import json
import os
import platform
import shlex
import sys
import time
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import psutil

from imubench_pipeline.run.nightly.recovery import restarted
from imubench_pipeline.tables import read_json

INHERITED = "IMUBENCH_LOCK"
"""The environment variable with the descriptor of a lock that a caller holds for this process."""

_PAUSE = 0.5  # s between two attempts
_MAX_COMMAND = 200  # characters


class TakenError(RuntimeError):
    """Another run works on the results; the text says which, and since when."""


def lock_of(results: Path) -> Path:
    """Return the file of the lock on a folder of results."""
    return results / "nightly/lock"


class Lock:
    """A lock on a folder of results, that the system takes back from a process that was killed.

    It is held by whatever has ``descriptor`` open: given to Snakemake too, it stays as long as one
    of the two lives. While it is held, the file has a note of who holds it; one that is still there
    when the lock is free comes from a run that did not reach its end.

    Attributes
    ----------
    descriptor : int
    since : float
        When it was taken, s since 1970.
    left_over : mapping
        The note of a run that did not reach its end; empty where it did. Who has put right what
        that run left makes it empty: until then, it is left to the next run again.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.descriptor = -1
        self.since = 0.0
        self.left_over: Mapping[str, Any] = {}

    def acquire(self, wait: float = 0.0) -> None:
        """Take the lock; `wait`: for a run that goes on, s.

        Raises
        ------
        TakenError
            If another run still holds it then.
        """
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        until = time.monotonic() + wait
        while not self._taken():
            if time.monotonic() >= until:
                note = read_note(self.path)
                self._close()
                raise TakenError(
                    f"another run works on {self.path.parent.parent}: {_holder(note)}; wait for "
                    "its end, or use another folder of results"
                )
            time.sleep(min(_PAUSE, max(until - time.monotonic(), 0.0)))
        self.since = time.time()
        self.left_over = read_note(self.path)
        self.note()

    def acquire_unless_inherited(self) -> None:
        """Take the lock, unless the caller of this process holds it for it.

        A note of a run that did not reach its end stays only if the machine was restarted since:
        `imubench nightly` then checks the files that were being written.

        Raises
        ------
        TakenError
            If another run holds it.
        """
        if self.descriptor >= 0 or self._is_inherited():
            return
        self.acquire()
        if not restarted(self.left_over):
            self.left_over = {}

    def _is_inherited(self) -> bool:
        try:
            held = os.fstat(int(os.environ.get(INHERITED, "")))
            return os.path.samestat(held, self.path.stat())
        except (ValueError, OSError):
            return False

    def note(self, **more: object) -> None:
        """Write who holds the lock, and what else a later run should know."""
        about = {
            "process": os.getpid(),
            "command": _command(),
            "host": platform.node(),
            "since": datetime.fromtimestamp(self.since, UTC).isoformat(timespec="seconds"),
        }
        self._write(json.dumps(about | more) + "\n")

    def release(self) -> None:
        """Give the lock back; the note goes, unless that of an earlier run is still needed."""
        if self.descriptor >= 0:
            self._write(json.dumps(self.left_over) + "\n" if self.left_over else "")
            # For all that have it open: a step that outlives Snakemake must not keep it.
            fcntl.flock(self.descriptor, fcntl.LOCK_UN)
            self._close()

    def __enter__(self) -> Lock:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def _taken(self) -> bool:
        try:
            fcntl.flock(self.descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True

    def _write(self, text: str) -> None:
        try:
            os.ftruncate(self.descriptor, 0)
            os.pwrite(self.descriptor, text.encode(), 0)
        except OSError:
            return  # a full disk: the lock holds without its note

    def _close(self) -> None:
        os.close(self.descriptor)
        self.descriptor = -1


def read_note(path: Path) -> Mapping[str, Any]:
    """Return what stands in the file of a lock; nothing where that cannot be read."""
    try:
        note = read_json(path)
    except (OSError, ValueError):
        return {}
    return note if isinstance(note, dict) else {}


def _command() -> str:
    """Return the command of this process, as a user would type it."""
    program = Path(sys.argv[0])
    name = program.parent.name if program.name == "__main__.py" else program.name
    return shlex.join([name, *sys.argv[1:]])[:_MAX_COMMAND]


def _holder(note: Mapping[str, Any]) -> str:
    """Return who holds a lock, in words."""
    if not isinstance(process := note.get("process"), int):
        return "who holds it is not known"
    since = f"since {note.get('since')}"
    command = note.get("command")
    named = f"process {process}" + (f" ({command})" if isinstance(command, str) else "")
    if note.get("host") != platform.node():
        return f"{named} on {note.get('host')}, {since}"
    if psutil.pid_exists(process):
        return f"{named}, {since}"
    return f"{named} is gone, but Snakemake ({note.get('snakemake')}) goes on, {since}"
