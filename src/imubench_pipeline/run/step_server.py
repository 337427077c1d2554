"""The process that forks for each step of the workflow; started by `run.processes`."""

import fcntl
import gc
import importlib
import os
import resource
import runpy
import select
import signal
import socket
import sys
import traceback
import zlib
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryFile
from types import FrameType
from typing import IO, Any

from numba import njit
from numba.core.caching import FunctionCache

from imubench_pipeline.readers.bounded import limit_memory
from imubench_pipeline.recordings.availability import OF_RESULTS
from imubench_pipeline.report.run_summary import fold_text
from imubench_pipeline.run.processes import Job, StepError
from imubench_pipeline.run.sealing import seal_outputs
from imubench_pipeline.tables.failures import describe_error
from imubench_pipeline.tables.findings import UnavailableError


def compile_once(locks: IO[bytes]) -> None:
    """Make this process and its forks wait for kernels that another process compiles.

    Otherwise, a third of all compilations in a first run would be duplicates.
    `locks`: a file open for writing, never closed, the same for all processes. Each kernel locks
    one byte, at the hash of its name; the system unlocks it when the process ends.
    """
    load, save = FunctionCache.load_overload, FunctionCache.save_overload

    def load_or_lock(kernel: FunctionCache, signature: Any, context: Any) -> Any:
        found = load(kernel, signature, context)
        if found is None:
            # Callers wait for the kernels that they call, never the reverse: no deadlock.
            fcntl.lockf(locks, fcntl.LOCK_EX, 1, _compute_lock_offset(kernel))
            found = load(kernel, signature, context)  # the other process may have cached it
            if found is not None:
                fcntl.lockf(locks, fcntl.LOCK_UN, 1, _compute_lock_offset(kernel))
        return found

    def save_and_unlock(kernel: FunctionCache, signature: Any, compiled: Any) -> None:
        try:
            save(kernel, signature, compiled)
        finally:
            fcntl.lockf(locks, fcntl.LOCK_UN, 1, _compute_lock_offset(kernel))

    FunctionCache.load_overload, FunctionCache.save_overload = load_or_lock, save_and_unlock


def _compute_lock_offset(kernel: FunctionCache) -> int:
    function = kernel._py_func
    return zlib.crc32(f"{function.__module__}.{function.__qualname__}".encode())


_MAX_ERROR_LENGTH = 300  # max. length of an error in one line, characters.


def serve(requests: socket.socket) -> None:
    """Fork for each job from a socket; send None at its start, then its cost or a `StepError`."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # only forks end by it; this ends with the socket
    signal.signal(signal.SIGCHLD, _reap)
    ready: dict[Path, bool] = {}
    while True:
        _, descriptors, _, _ = socket.recv_fds(requests, 1, 1)
        if not descriptors:
            return
        with Connection(descriptors[0]) as connection:
            job: Job = connection.recv()
            if job.script not in ready:
                ready[job.script] = _import_modules_of(job.script)
            # No SIGCHLD until the fork is in `_running`.
            signal.pthread_sigmask(signal.SIG_BLOCK, _CHILD_SIGNALS)
            fork = os.fork()
            if fork == 0:
                requests.close()
                _run(connection, job, imported=ready[job.script])
            _running[fork] = Connection(os.dup(connection.fileno())), job.name
            signal.pthread_sigmask(signal.SIG_UNBLOCK, _CHILD_SIGNALS)


_CHILD_SIGNALS = {signal.SIGCHLD}

_STOP_SIGNALS = {signal.SIGHUP, signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGIO", None)}

_running: dict[int, tuple["Connection[Any, Any]", str]] = {}  # connection and step of each fork


def _reap(signal_number: int, frame: FrameType | None) -> None:
    """Report the signals of killed forks, which cannot report themselves."""
    with suppress(ChildProcessError):
        while True:
            process, status = os.waitpid(-1, os.WNOHANG)
            if not process:
                return
            if process not in _running:  # of a library
                continue
            connection, name = _running.pop(process)
            with connection, suppress(OSError):
                if not os.WIFSIGNALED(status):
                    continue
                error, number = StepError(f"{name}.py was killed"), os.WTERMSIG(status)
                if number not in _STOP_SIGNALS:
                    reason = signal.Signals(number).name
                    error.cause = "killed"
                    error.reason = reason + ", perhaps because memory was exhausted" * (
                        reason == "SIGKILL"
                    )
                connection.send(error)


def _import_modules_of(script: Path) -> bool:
    try:
        runpy.run_path(str(script), run_name="imports")
        # Deferred imports of two libraries: half of the cost of imports.
        importlib.import_module("pyarrow.dataset")
        _nothing()
    except (Exception, SystemExit):
        return False  # the fork raises the same error, and reports it
    gc.collect()
    gc.freeze()  # so that the forks go on sharing this memory
    return True


@njit(cache=True)
def _nothing() -> None:
    """Make numba load the common parts of all compiled functions."""


def _run(connection: "Connection[Any, Any]", job: Job, *, imported: bool) -> None:
    outcome: dict[str, float] | StepError = StepError(f"{job.name}.py failed")
    try:
        for other, _ in _running.values():
            other.close()
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _CHILD_SIGNALS)
        if sys.platform == "linux":
            # The system ends this process when the peer of the connection closes or sends; the end
            # of the server would come later: it may be importing for another step.
            signal.signal(signal.SIGIO, signal.SIG_DFL)
            fcntl.fcntl(connection, fcntl.F_SETOWN, os.getpid())
            fcntl.fcntl(
                connection, fcntl.F_SETFL, fcntl.fcntl(connection, fcntl.F_GETFL) | os.O_ASYNC
            )
            if select.select([connection], [], [], 0.0)[0]:  # closed before
                os._exit(1)
            Path("/proc/self/comm").write_text(job.name)  # for ps and top
        connection.send(None)
        job.log.parent.mkdir(parents=True, exist_ok=True)
        log = os.open(job.log, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        for stream in (1, 2):
            os.dup2(log, stream)
        os.close(log)
        if job.memory is not None:
            limit_memory(job.memory)
        with seal_outputs(job):
            runpy.run_path(str(job.script), init_globals={"snakemake": job}, run_name="__main__")
            sys.stdout.flush()
            sys.stderr.flush()
        used = resource.getrusage(resource.RUSAGE_SELF)
        cpu, memory = used.ru_utime + used.ru_stime, used.ru_maxrss * 1024 / 1e6  # KiB
        outcome = {"cpu": cpu, "memory": memory}
    except BaseException as error:
        assert isinstance(outcome, StepError)
        if not isinstance(error, UnavailableError):  # no fault of the code: its text is enough
            outcome.trace = _trace(error, str(job.script))
        outcome.reason = fold_text(describe_error(error), _MAX_ERROR_LENGTH)
        if isinstance(error, MemoryError):
            outcome.reason += f"; limits.memory allows {(job.memory or 0) // 10**6} MB"
        of_results = isinstance(error, OSError) and error.errno in OF_RESULTS
        outcome.cause = "error" if imported and not of_results else None
    finally:
        with suppress(OSError):  # a full disk cannot store the text either
            sys.stderr.write(outcome.trace if isinstance(outcome, StepError) else "")
            sys.stdout.flush()
            sys.stderr.flush()
        connection.send(outcome)
        os._exit(isinstance(outcome, StepError))


def _trace(error: BaseException, script: str) -> str:
    """Return the traceback within the script, without the frames that started it."""
    trace = error.__traceback__
    while trace is not None and trace.tb_frame.f_code.co_filename != script:
        trace = trace.tb_next
    return "".join(traceback.format_exception(error.with_traceback(trace or error.__traceback__)))


if __name__ == "__main__":
    with socket.socket(fileno=int(sys.argv[1])) as given_requests, TemporaryFile() as given_locks:
        compile_once(given_locks)
        serve(given_requests)
