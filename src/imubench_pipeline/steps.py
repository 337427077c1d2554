"""Runs the scripts of the workflow, each in a process of its own that has its imports already.

What a step of a short log computes takes a tenth of a second, what it imports a second. So one
process, which lives as long as the run, imports what a kind of step needs before the first of
them, and forks for each: `imubench_pipeline.step_server`.
"""

from __future__ import annotations

import atexit
import json
import os
import pickle
import socket
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

DONE, FAILED = b"d", b"f"
"""What is said of a step that ends by itself, and then what it has cost, as JSON."""

COSTS = "IMUBENCH_COSTS"
"""The environment variable with the file to which what each step has cost is appended, a line of
JSON each: CPU time in s, peak of memory in MB."""

_ONE_THREAD = {
    f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "VECLIB_MAXIMUM")
}
"""A job has one core; and what has threads should not fork."""


class StepError(Exception):
    """A script of the workflow did not come to its end."""


class Steps:
    """Runs scripts in forks of one process, which begins with the first of them.

    It ends with the process that has this object, even where that is killed; so do the forks, on
    Linux, where each also has the name of its script. A fork does not need the process that made
    it any more.

    Parameters
    ----------
    folder : Path
        Where the scripts are, as <name>.py.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._lock = threading.Lock()
        self._server: tuple[subprocess.Popen[bytes], socket.socket] | None = None
        atexit.register(self.close)

    def run(self, name: str, input: Any, output: Any, params: Any, wildcards: Any) -> None:
        """Run a script to its end; several threads may run one each.

        Parameters
        ----------
        name : str
            Of the script.
        input, output, params, wildcards : object
            What the script sees as ``snakemake.input`` and so on. They are pickled.

        Raises
        ------
        StepError
            If the script fails, which it has said on the standard error, or is killed.
        """
        given = {"input": input, "output": output, "params": params, "wildcards": wildcards}
        request = pickle.dumps((str(self._folder / f"{name}.py"), given))
        ours, theirs = socket.socketpair()
        with ours:
            with theirs:
                self._hand_over(theirs)
            said = _answer(ours, len(request).to_bytes(8, "big") + request)
        if said[:1] != DONE:
            raise StepError(f"{name}.py failed" if said[:1] == FAILED else f"{name}.py was killed")
        if COSTS in os.environ:
            about = {"step": name, "of": "/".join(map(str, wildcards))} | json.loads(said[1:])
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


def _answer(connection: socket.socket, request: bytes) -> bytes:
    """Return what is said of a step that ends by itself; nothing of one that is killed."""
    try:
        connection.sendall(request)
        with connection.makefile("rb") as stream:
            return stream.read()
    except OSError:
        return b""  # so is the process that was to start it


def _started() -> tuple[subprocess.Popen[bytes], socket.socket]:
    ours, theirs = socket.socketpair()
    with theirs:
        process = subprocess.Popen(
            [sys.executable, "-m", "imubench_pipeline.step_server", str(theirs.fileno())],
            pass_fds=[theirs.fileno()],
            env=_ONE_THREAD | os.environ,
        )
    return process, ours
