"""The process that forks for each step of the workflow; started by `run.processes`."""

from __future__ import annotations

import fcntl
import gc
import importlib
import json
import os
import pickle
import resource
import runpy
import select
import signal
import socket
import sys
import traceback
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryFile
from types import FrameType
from typing import Any

from numba import njit

from imubench_pipeline.readers.bounded import limit_memory
from imubench_pipeline.report.run_summary import one_line
from imubench_pipeline.run.kernels import compile_once
from imubench_pipeline.run.processes import BEGUN, DONE, FAILED, KILLED, LENGTH, Job
from imubench_pipeline.run.sealing import sealed
from imubench_pipeline.tables.failures import describe_error
from imubench_pipeline.tables.findings import UnavailableError

_MAX_ERROR_LENGTH = 300
"""Max. length of an error in one line, characters."""


def serve(requests: socket.socket) -> None:
    """Fork for each connection that comes through a socket, until the other end is closed.

    A connection transfers the job of a step, and returns its outcome.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the forks end, and that the run ends is seen
    signal.signal(signal.SIGCHLD, _reap)
    ready: dict[Path, bool] = {}
    while True:
        _, descriptors, _, _ = socket.recv_fds(requests, 1, 1)
        if not descriptors:
            return
        with socket.socket(fileno=descriptors[0]) as connection:
            with connection.makefile("rb") as stream:
                size = int.from_bytes(stream.read(8), "big")
                job: Job = pickle.loads(stream.read(size))
            if job.script not in ready:
                ready[job.script] = _import_modules_of(job.script)
            # Until a fork is known, that it has ended must not be heard of.
            signal.pthread_sigmask(signal.SIG_BLOCK, _CHILD_SIGNALS)
            fork = os.fork()
            if fork == 0:
                requests.close()
                _run(connection, job, imported=ready[job.script])
            _running[fork] = connection.dup()
            signal.pthread_sigmask(signal.SIG_UNBLOCK, _CHILD_SIGNALS)


_CHILD_SIGNALS = {signal.SIGCHLD}

_running: dict[int, socket.socket] = {}
"""The connection of each fork, by its process."""


def _reap(signal_number: int, frame: FrameType | None) -> None:
    """Say of the forks that were killed, by what: they cannot."""
    with suppress(ChildProcessError):
        while True:
            process, status = os.waitpid(-1, os.WNOHANG)
            if not process:
                return
            connection = _running.pop(process, None)
            if connection is None:
                continue
            with connection, suppress(OSError):
                if os.WIFSIGNALED(status):
                    connection.sendall(_message(KILLED, {"signal": os.WTERMSIG(status)}))


def _message(how: bytes, details: Mapping[str, Any]) -> bytes:
    text = json.dumps(details).encode()
    return how + len(text).to_bytes(LENGTH, "big") + text


def _import_modules_of(script: Path) -> bool:
    """Import what a script does; return whether that was possible."""
    try:
        runpy.run_path(str(script), run_name="imports")
        # What two libraries put off until they are first used: half of what imports cost.
        importlib.import_module("pyarrow.dataset")
        _nothing()
    except (Exception, SystemExit):
        return False  # the fork meets the same error, and says it
    gc.collect()
    gc.freeze()  # what the forks share stays shared
    return True


@njit(cache=True)
def _nothing() -> None:
    """Make numba load what every function needs that it has compiled before."""


def _run(connection: socket.socket, job: Job, *, imported: bool) -> None:
    """Run a script in this fork, say how it ended, and end."""
    how = FAILED
    details: dict[str, Any] = {"imported": imported, "error": "", "trace": "", "errno": None}
    try:
        for other in _running.values():
            other.close()
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _CHILD_SIGNALS)
        if sys.platform == "linux":
            _end_with_who_asked(connection)
            Path("/proc/self/comm").write_text(job.name)  # for ps and top
        connection.sendall(BEGUN)
        _print_to(job.log)
        if job.memory is not None:
            limit_memory(job.memory)
        with sealed(job):
            runpy.run_path(str(job.script), init_globals={"snakemake": job}, run_name="__main__")
            sys.stdout.flush()
            sys.stderr.flush()
        how = DONE
    except BaseException as error:
        if not isinstance(error, UnavailableError):  # of the surroundings: its text says it all
            details["trace"] = _trace(error, str(job.script))
        details["error"] = one_line(describe_error(error), _MAX_ERROR_LENGTH)
        if isinstance(error, MemoryError):
            details["error"] += f"; limits.memory allows {(job.memory or 0) // 10**6} MB"
        details["errno"] = error.errno if isinstance(error, OSError) else None
    finally:
        with suppress(OSError):  # a disk that is full takes no words either
            sys.stderr.write(details["trace"])
            sys.stdout.flush()
            sys.stderr.flush()
        used = resource.getrusage(resource.RUSAGE_SELF)
        cost = {"cpu": used.ru_utime + used.ru_stime, "memory": used.ru_maxrss * 1024 / 1e6}  # KiB
        connection.sendall(_message(how, cost if how == DONE else details))
        os._exit(how != DONE)


def _print_to(log: Path) -> None:
    """Have this process print to the end of a file."""
    log.parent.mkdir(parents=True, exist_ok=True)
    file = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
    for stream in (1, 2):
        os.dup2(file, stream)
    os.close(file)


def _end_with_who_asked(connection: socket.socket) -> None:
    """Have the system end this process as soon as the other end of a connection is closed.

    That the server ends would tell later: it may be importing what another step needs, while the
    next run begins.
    """
    signal.signal(signal.SIGIO, signal.SIG_DFL)
    fcntl.fcntl(connection, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(connection, fcntl.F_SETFL, fcntl.fcntl(connection, fcntl.F_GETFL) | os.O_ASYNC)
    if select.select([connection], [], [], 0.0)[0]:  # closed before; nothing more is ever sent
        os._exit(1)


def _trace(error: BaseException, script: str) -> str:
    """Return where the script failed, without how it was started."""
    trace = error.__traceback__
    while trace is not None and trace.tb_frame.f_code.co_filename != script:
        trace = trace.tb_next
    return "".join(traceback.format_exception(error.with_traceback(trace or error.__traceback__)))


if __name__ == "__main__":
    with socket.socket(fileno=int(sys.argv[1])) as given_requests, TemporaryFile() as given_locks:
        compile_once(given_locks)
        serve(given_requests)
