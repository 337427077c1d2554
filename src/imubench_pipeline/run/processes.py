"""Run the scripts of the workflow in forks of one process that already has their imports.

For a short log, a step computes for a tenth of a second, but its imports take a second. One process
lives as long as the run, and forks for each step: see `imubench_pipeline.run.step_server`.
"""

import atexit
import json
import os
import socket
import subprocess
import sys
import threading
from dataclasses import dataclass
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any

from imubench_pipeline.run.start import ONE_THREAD
from imubench_pipeline.tables.failures import Cause

COSTS = "IMUBENCH_COSTS"  # environment variable: file for CPU time, s, and MB of each step
_MAX_KILL_TIME = 60.0  # max. time for the system to end a step, s.


class StepError(Exception):
    """Raised if a script of the workflow did not finish.

    ``cause`` is None if the recording is not the cause: the run was stopped, the disk is full, or
    the script cannot be imported. ``reason`` is one line, ``trace`` the traceback in the script.
    """

    def __init__(self, text: str, cause: Cause | None = None, reason: str = "") -> None:
        super().__init__(text)
        self.cause, self.reason, self.trace = cause, reason or text, ""


@dataclass(frozen=True)
class Job:
    """A script to run, with the attributes of the object ``snakemake`` for it; all are pickled."""

    script: Path
    input: Any
    output: Any
    params: Any
    wildcards: Any
    log: Path  # output of the script is appended to it
    memory: int | None = None  # max. bytes besides the forking process; None: no limit
    results: Path | None = None  # folder for the seals of its outputs; None: no seals
    threads: int = 1

    @property
    def name(self) -> str:
        """Name of the step."""
        return self.script.stem


class Processes:
    """Runs scripts in forks of one process, which starts with the first script.

    The forking process ends with the process of this object, even if that is killed. On Linux the
    forks end, too, and each has the name of its script. A fork goes on if the forking process ends.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._server: tuple[subprocess.Popen[bytes], socket.socket] | None = None
        atexit.register(self.close)

    def run(self, job: Job, seconds: float | None = None) -> None:
        """Run a script; `StepError` if it fails, or lasts over `seconds` (not counting imports)."""
        ours, theirs = Pipe()
        with ours:
            with theirs:
                self._hand_over(theirs)
            outcome = _request(ours, job, seconds)
        if isinstance(outcome, StepError):
            raise outcome
        if COSTS in os.environ:
            about = {"step": job.name, "of": "/".join(map(str, job.wildcards))} | outcome
            with self._lock, Path(os.environ[COSTS]).open("a", encoding="utf-8") as file:
                file.write(json.dumps(about) + "\n")

    def close(self) -> None:
        """End the forking process and the running scripts."""
        with self._lock:
            if self._server is not None:
                process, requests = self._server
                self._server = None
                requests.close()
                process.wait()

    def _hand_over(self, connection: "Connection[Any, Any]") -> None:
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
        raise StepError(
            "the process that starts the steps ended immediately; see its message above"
        )


def _request(
    connection: "Connection[Any, Any]", job: Job, seconds: float | None
) -> dict[str, float] | StepError:
    try:
        connection.send(job)
        if connection.recv() is None:  # it begins
            if connection.poll(seconds):
                return connection.recv()
            connection.send(None)  # any message ends the step
            connection.poll(_MAX_KILL_TIME)
            reason = f"ran for longer than {seconds:.4g} s"
            return StepError(f"{job.name}.py {reason}", "time", reason)
    except (OSError, EOFError):
        pass  # the process that should start it has ended
    return StepError(f"{job.name}.py was killed")


def _start_server() -> tuple[subprocess.Popen[bytes], socket.socket]:
    ours, theirs = socket.socketpair()
    with theirs:
        process = subprocess.Popen(
            [sys.executable, "-m", "imubench_pipeline.run.step_server", str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            env=ONE_THREAD | os.environ,
        )
    return process, ours
