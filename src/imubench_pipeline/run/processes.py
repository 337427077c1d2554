"""Run the scripts of the workflow in forks of one process that already has their imports.

For a short log, a step computes for a tenth of a second, but its imports take a second. One process
therefore lives as long as the run. It imports the modules of a kind of step once, and forks for
each step: see `imubench_pipeline.run.step_server`.
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
"""Messages about a step: its begin, and its outcome. An outcome is followed by the length of a JSON
text and the text: the cost of the step, its error, or the signal that ended it."""

LENGTH = 4
"""Bytes of the length of the JSON text."""

COSTS = "IMUBENCH_COSTS"
"""Environment variable with the file for the cost of each step, one line of JSON each: CPU time in
s, peak memory in MB."""

_MAX_KILL_TIME = 60.0
"""Max. time for the system to end a step, s."""

_STOP_SIGNALS = {signal.SIGHUP, signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGIO", None)}
"""Signals that end a step because the run ends."""


class StepError(Exception):
    """Raised if a script of the workflow did not finish.

    Attributes
    ----------
    cause : {"error", "killed", "time"} or None
        None: not caused by the recording. The run was stopped, the disk is full, or the script
        cannot be imported.
    reason : str
        In one line.
    trace : str
        Output of the script.
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
    """A script with its inputs and outputs.

    Attributes
    ----------
    input, output, params, wildcards : object
        Attributes of ``snakemake`` in the script; they are pickled.
    log : Path
        Output of the script is appended to it.
    memory : int or None
        Max. memory besides the memory of the forking process, bytes; None: no limit.
    results : Path or None
        Folder for the seals of its outputs (`imubench_pipeline.run.sealing`); None: no seals.
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

    The forking process ends with the process of this object, even if that is killed. On Linux the
    forks end, too, and each has the name of its script. A fork does not depend on the forking
    process.
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
            Max. time without imports; a longer script is ended.

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
            how, details = _request_answer(ours, len(request).to_bytes(8, "big") + request, seconds)
        if how != DONE:
            raise _make_error(job.name, how, details, seconds)
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
            # One dead process may have been killed; a second one is a fault.
            for _ in range(2):
                process, requests = self._server = self._server or _start_server()
                try:
                    socket.send_fds(requests, [b"s"], [connection.fileno()])
                    return
                except OSError:
                    self._server = None
                    requests.close()
                    process.wait()
        raise StepError("the process that starts the steps ends at once; what it says stands above")


def _request_answer(
    connection: socket.socket, request: bytes, seconds: float | None
) -> tuple[bytes, dict[str, Any]]:
    """Return the outcome of a step and its details; empty if they are not known."""
    try:
        connection.sendall(request)
        if _receive_bytes(connection, 1) != BEGUN:
            return b"", {}
        try:
            connection.settimeout(seconds)
            return _receive_outcome(connection)
        except TimeoutError:
            # Closing the connection ends the step.
            connection.shutdown(socket.SHUT_WR)
            connection.settimeout(_MAX_KILL_TIME)
            with contextlib.suppress(TimeoutError):
                _receive_outcome(connection)
            return b"", {"time": True}
    except OSError:
        return b"", {}  # the process that should start it has ended


def _receive_outcome(connection: socket.socket) -> tuple[bytes, dict[str, Any]]:
    how = _receive_bytes(connection, 1)
    length = _receive_bytes(connection, LENGTH)
    return how, json.loads(_receive_bytes(connection, int.from_bytes(length, "big")) or b"{}")


def _receive_bytes(connection: socket.socket, size: int) -> bytes:
    """Return ``size`` bytes; fewer if the other end is closed."""
    received = b""
    while len(received) < size and (more := connection.recv(size - len(received))):
        received += more
    return received


def _make_error(
    name: str, how: bytes, details: Mapping[str, Any], seconds: float | None
) -> StepError:
    if "time" in details:
        reason = f"ran for longer than {seconds:.4g} s"
        return StepError(f"{name}.py {reason}", "time", reason)
    if how == FAILED:
        alone = details["imported"] and details["errno"] not in OF_RESULTS
        cause: Cause | None = "error" if alone else None
        return StepError(f"{name}.py failed", cause, details["error"], details["trace"])
    if how == KILLED and details["signal"] not in _STOP_SIGNALS:
        with_it = signal.Signals(details["signal"]).name
        reason = with_it + ", perhaps for want of memory" * (with_it == "SIGKILL")
        return StepError(f"{name}.py was killed", "killed", reason)
    return StepError(f"{name}.py was killed")


def _start_server() -> tuple[subprocess.Popen[bytes], socket.socket]:
    ours, theirs = socket.socketpair()
    with theirs:
        process = subprocess.Popen(
            [sys.executable, "-m", "imubench_pipeline.run.step_server", str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            env=ONE_THREAD | os.environ,
        )
    return process, ours
