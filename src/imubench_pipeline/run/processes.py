"""Runs the scripts of the workflow, each in a process of its own that has its imports already.

What a step of a short log computes takes a tenth of a second, what it imports a second. So one
process, which lives as long as the run, imports what a kind of step needs before the first of
them, and forks for each: `imubench_pipeline.run.step_server`.
"""

from __future__ import annotations

import atexit
import contextlib
import json
import os
import pickle
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from imubench_pipeline.recordings.availability import OF_RESULTS
from imubench_pipeline.run.start import ONE_THREAD
from imubench_pipeline.tables.failures import Cause

BEGUN, DONE, FAILED, KILLED = b"b", b"d", b"f", b"k"
"""What is said of a step: that it begins, and how it ended. To the latter belongs JSON, after its
length: what the step has cost, its error, or the signal that ended it."""

LENGTH = 4
"""Bytes of that length."""

COSTS = "IMUBENCH_COSTS"
"""The environment variable with the file to which what each step has cost is appended, a line of
JSON each: CPU time in s, peak of memory in MB."""

_PATIENCE = 60.0
"""s; for the system to end a step."""

_TO_STOP = {signal.SIGHUP, signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGIO", None)}
"""Signals that end a step because the run ends."""


class StepError(Exception):
    """A script of the workflow did not come to its end.

    Attributes
    ----------
    cause : {"error", "killed", "time"} or None
        None: the recording has nothing to do with it. The run was stopped, the disk is full, the
        script cannot even be imported.
    reason : str
        In one line.
    trace : str
        What it has said.
    """

    def __init__(
        self, text: str, cause: Cause | None = None, reason: str = "", trace: str = ""
    ) -> None:
        super().__init__(text)
        self.cause = cause
        self.reason = reason or text
        self.trace = trace


@dataclass(frozen=True)
class Job:
    """A script, and what it is run for.

    Attributes
    ----------
    input, output, params, wildcards : object
        What the script sees as ``snakemake.input`` and so on. They are pickled.
    log : Path
        What is printed goes to the end of it.
    memory : int or None
        Bytes that it may take beside what the process that forks has; None: no limit.
    results : Path or None
        Where what it leaves is sealed (`imubench_pipeline.run.sealing`); None: nowhere.
    """

    script: Path
    input: Any
    output: Any
    params: Any
    wildcards: Any
    log: Path
    memory: int | None = None
    results: Path | None = None

    @property
    def name(self) -> str:
        """Name of the step."""
        return self.script.stem


class Processes:
    """Runs scripts in forks of one process, which begins with the first of them.

    It ends with the process that has this object, even where that is killed; so do the forks, on
    Linux, where each also has the name of its script. A fork does not need the process that made
    it any more.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._server: tuple[subprocess.Popen[bytes], socket.socket] | None = None
        atexit.register(self.close)

    def run(self, job: Job, seconds: float | None = None) -> None:
        """Run a script to its end; several threads may run one each.

        Parameters
        ----------
        job : Job
        seconds : float, optional
            It is ended where it takes longer, its imports apart.

        Raises
        ------
        StepError
            If the script fails, is killed, or takes longer.
        """
        request = pickle.dumps(job)
        ours, theirs = socket.socketpair()
        with ours:
            with theirs:
                self._hand_over(theirs)
            how, details = _answer(ours, len(request).to_bytes(8, "big") + request, seconds)
        if how != DONE:
            raise _error(job.name, how, details, seconds)
        if COSTS in os.environ:
            about = {"step": job.name, "of": "/".join(map(str, job.wildcards))} | details
            with self._lock, Path(os.environ[COSTS]).open("a", encoding="utf-8") as file:
                file.write(json.dumps(about) + "\n")

    def close(self) -> None:
        """End the process that forks, and with it the scripts that run."""
        with self._lock:
            if self._server is not None:
                process, requests = self._server
                self._server = None
                requests.close()
                process.wait()

    def _hand_over(self, connection: socket.socket) -> None:
        with self._lock:
            # The first that does not live any more was killed; a second one is no accident.
            for _ in range(2):
                process, requests = self._server = self._server or _started()
                try:
                    socket.send_fds(requests, [b"s"], [connection.fileno()])
                    return
                except OSError:
                    self._server = None
                    requests.close()
                    process.wait()
        raise StepError("the process that starts the steps ends at once; what it says stands above")


def _answer(
    connection: socket.socket, request: bytes, seconds: float | None
) -> tuple[bytes, dict[str, Any]]:
    """Return how a step ended, and what is told of it; nothing where nobody can tell."""
    try:
        connection.sendall(request)
        if _received(connection, 1) != BEGUN:
            return b"", {}
        try:
            connection.settimeout(seconds)
            return _told(connection)
        except TimeoutError:
            # The system ends a step whose connection is closed.
            connection.shutdown(socket.SHUT_WR)
            connection.settimeout(_PATIENCE)
            with contextlib.suppress(TimeoutError):
                _told(connection)
            return b"", {"time": True}
    except OSError:
        return b"", {}  # so is the process that was to start it


def _told(connection: socket.socket) -> tuple[bytes, dict[str, Any]]:
    how = _received(connection, 1)
    length = _received(connection, LENGTH)
    return how, json.loads(_received(connection, int.from_bytes(length, "big")) or b"{}")


def _received(connection: socket.socket, size: int) -> bytes:
    """Return so many bytes; fewer where the other end is closed."""
    received = b""
    while len(received) < size and (more := connection.recv(size - len(received))):
        received += more
    return received


def _error(name: str, how: bytes, details: Mapping[str, Any], seconds: float | None) -> StepError:
    if "time" in details:
        reason = f"ran for longer than {seconds:.4g} s"
        return StepError(f"{name}.py {reason}", "time", reason)
    if how == FAILED:
        alone = details["imported"] and details["errno"] not in OF_RESULTS
        cause: Cause | None = "error" if alone else None
        return StepError(f"{name}.py failed", cause, details["error"], details["trace"])
    if how == KILLED and details["signal"] not in _TO_STOP:
        with_it = signal.Signals(details["signal"]).name
        reason = with_it + ", perhaps for want of memory" * (with_it == "SIGKILL")
        return StepError(f"{name}.py was killed", "killed", reason)
    return StepError(f"{name}.py was killed")


def _started() -> tuple[subprocess.Popen[bytes], socket.socket]:
    ours, theirs = socket.socketpair()
    with theirs:
        process = subprocess.Popen(
            [sys.executable, "-m", "imubench_pipeline.run.step_server", str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            env=ONE_THREAD | os.environ,
        )
    return process, ours
