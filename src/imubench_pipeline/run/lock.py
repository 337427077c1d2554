"""Lock a folder of results: one run at a time, also after a killed run."""

import fcntl
import json
import os
import platform
import shlex
import sys
import time
from collections.abc import Mapping
from contextlib import AbstractContextManager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import psutil

from imubench_pipeline.run.recovery import was_restarted
from imubench_pipeline.tables.files import read_json

INHERITED = "IMUBENCH_LOCK"  # environment variable: descriptor of a lock that the caller holds
_RETRY_INTERVAL = 0.5  # s between two attempts
_MAX_COMMAND = 200  # characters


class TakenError(RuntimeError):
    """Raised if another run uses the results; the message names it and its start."""


def locate_lock(results: Path) -> Path:
    """Return the path of the lock file of a folder of results."""
    return results / "nightly/lock"


class Lock(AbstractContextManager["Lock"]):
    """A lock on a folder of results, which the system releases if the process is killed.

    Each process that has ``descriptor`` open holds the lock; Snakemake inherits it. The file has a
    note about the holder; if the lock is free, the note is from a run that was killed.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.descriptor = -1
        self.since = 0.0  # when it was taken, s since 1970
        self.left_over: Mapping[str, Any] = {}
        """The note of a run that did not reach its end; otherwise empty. After a recovery the
        caller sets it to empty; until then, the note stays for the next run."""

    def acquire(self, wait: float = 0.0) -> None:
        """Acquire the lock; raise `TakenError` if another run still holds it after `wait` s."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        until = time.monotonic() + wait
        while True:
            try:
                fcntl.flock(self.descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if time.monotonic() >= until:
                    note = read_note(self.path)
                    self._close()
                    raise TakenError(
                        f"another run works on {self.path.parent.parent}: {_describe_holder(note)};"
                        " wait for its end, or use another folder of results"
                    ) from None
            time.sleep(min(_RETRY_INTERVAL, max(until - time.monotonic(), 0.0)))
        self.since = time.time()
        self.left_over = read_note(self.path)
        self.note()

    def acquire_unless_inherited(self) -> None:
        """Acquire the lock, unless this process inherited it; raise `TakenError` if it is taken.

        The note of a killed run stays only if the machine was restarted after it: `imubench
        nightly` then checks the files of that run.
        """
        if self.descriptor >= 0:
            return
        with suppress(ValueError, OSError):
            held = os.fstat(int(os.environ.get(INHERITED, "")))
            if os.path.samestat(held, self.path.stat()):
                return
        self.acquire()
        if not was_restarted(self.left_over):
            self.left_over = {}

    def note(self, **more: object) -> None:
        """Write a note about the holder, and ``more`` data for a later run, to the lock file."""
        program = Path(sys.argv[0])
        name = program.parent.name if program.name == "__main__.py" else program.name
        about = {
            "process": os.getpid(),
            "command": shlex.join([name, *sys.argv[1:]])[:_MAX_COMMAND],
            "host": platform.node(),
            "since": datetime.fromtimestamp(self.since, UTC).isoformat(timespec="seconds"),
        }
        self._write(json.dumps(about | more) + "\n")

    def release(self) -> None:
        """Release the lock; remove the note, unless the note of an earlier run is still needed."""
        if self.descriptor >= 0:
            self._write(json.dumps(self.left_over) + "\n" if self.left_over else "")
            # Unlock for all processes: a step that outlives Snakemake must not hold the lock.
            fcntl.flock(self.descriptor, fcntl.LOCK_UN)
            self._close()

    def __exit__(self, *_: object) -> None:
        self.release()

    def _write(self, text: str) -> None:
        with suppress(OSError):  # a full disk: the lock holds without its note
            os.ftruncate(self.descriptor, 0)
            os.pwrite(self.descriptor, text.encode(), 0)

    def _close(self) -> None:
        os.close(self.descriptor)
        self.descriptor = -1


def read_note(path: Path) -> Mapping[str, Any]:
    """Return the note in the file of a lock; empty if it cannot be read."""
    try:
        note = read_json(path)
    except (OSError, ValueError):
        return {}
    return note if isinstance(note, dict) else {}


def _describe_holder(note: Mapping[str, Any]) -> str:
    if not isinstance(process := note.get("process"), int):
        return "its owner is not known"
    since = f"since {note.get('since')}"
    command = note.get("command")
    named = f"process {process}" + (f" ({command})" if isinstance(command, str) else "")
    if note.get("host") != platform.node():
        return f"{named} on {note.get('host')}, {since}"
    if psutil.pid_exists(process):
        return f"{named}, {since}"
    return f"{named} is gone, but Snakemake ({note.get('snakemake')}) goes on, {since}"
