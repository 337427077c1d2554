"""Enforce limits of memory and time on library calls with untrusted files."""

import math
import os
import pickle
import resource
import select
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from threading import Lock
from typing import Any, Generic, ParamSpec, TypeVar

import psutil

P = ParamSpec("P")
T = TypeVar("T")
_PIPE_BLOCK = 1 << 20
_OVERLOAD_FACTOR = 5.0  # on the time limit, while a process waits for a core or a disk
_FORK_LOCK = Lock()
"""Held between opening a pipe and closing its unused ends: a process forked by another thread in
the meantime would keep the pipe open."""


class BoundError(Exception):
    """A function exceeded a limit; ``is_external`` if it waited, as for a disk, or was killed."""

    def __init__(self, text: str, *, is_external: bool = False) -> None:
        super().__init__(text)
        self.is_external = is_external


def limit_memory(more: int) -> None:
    """Limit the additional memory of this process to ``more`` bytes, on Linux.

    Unlike RLIMIT_AS, it does not count reserved addresses: Arrow and numba reserve many.
    """
    if sys.platform != "linux":
        return
    status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
    now = 1024 * int(status.partition("VmData:")[2].split()[0])
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = now + more if hard == resource.RLIM_INFINITY else min(now + more, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (most, hard))


def run_bounded(
    seconds: float, memory: int, function: Callable[P, T], *arguments: P.args, **named: P.kwargs
) -> T:
    """Return the result of a function in a process of its own, with limits of time and memory.

    ``seconds``: time limit; up to five times as long if the process waits for a core or disk.
    ``memory``: limit of additional memory, bytes. Raises `BoundError` if a limit is exceeded, or
    the system ends the process. The result is pickled.
    """
    return Bounded(memory, function, *arguments, **named).result(seconds)


class Bounded(Generic[T]):
    """A function call in a process of its own, which starts immediately (see `run_bounded`)."""

    def __init__(
        self, memory: int, function: Callable[P, T], *arguments: P.args, **named: P.kwargs
    ) -> None:
        self._memory = memory
        self._status: int | None = None
        with _FORK_LOCK:
            self._pipe, theirs = os.pipe()
            self._process = os.fork()
            if self._process:
                os.close(theirs)
        if self._process == 0:
            try:
                os.close(self._pipe)
                limit_memory(memory)
                try:
                    answer: tuple[bool, Any] = True, function(*arguments, **named)
                except Exception as error:
                    answer = False, error
                with os.fdopen(theirs, "wb") as stream:
                    pickle.dump(answer, stream)
            finally:
                os._exit(0)

    @property
    def answered(self) -> bool:
        """Whether the result is available without waiting."""
        return self._status is not None or bool(select.select([self._pipe], [], [], 0.0)[0])

    def end(self) -> None:
        """End the process, if it has not ended."""
        if self._status is None:
            os.close(self._pipe)
            with suppress(ProcessLookupError):
                os.kill(self._process, signal.SIGKILL)
            _, self._status = os.waitpid(self._process, 0)

    def result(self, seconds: float) -> T:
        """Return the result of the function, or raise its exception; to be called once.

        Raises `BoundError` if a limit is exceeded, or the system ends the process. The time limit
        ``seconds`` counts from now.
        """
        process = psutil.Process(self._process)
        try:
            begin = time.monotonic()
            end, last = begin + seconds, begin + _OVERLOAD_FACTOR * seconds
            received: list[bytes] = []
            while True:
                if select.select([self._pipe], [], [], max(0.0, end - time.monotonic()))[0]:
                    received.append(os.read(self._pipe, _PIPE_BLOCK))
                    if not received[-1]:
                        break
                elif end < last and is_kept_waiting(process, seconds):
                    end = min(end + seconds / 4.0, last)
                else:
                    was_waiting = _get_core_time(process) < seconds / 2.0
                    raise BoundError(f"took more than {seconds:g} s", is_external=was_waiting)
        finally:
            self.end()  # it has answered, or it will not
        try:
            returned, value = pickle.loads(b"".join(received))
        except (EOFError, pickle.UnpicklingError):
            ended = os.waitstatus_to_exitcode(self._status or 0)
            reason = f"ended the process with exit code {ended}"
            raise BoundError(reason, is_external=ended == -signal.SIGKILL) from None
        if returned:
            return value
        if isinstance(value, MemoryError):
            raise BoundError(f"took more than {self._memory >> 20} MiB of memory")
        raise value


def is_kept_waiting(process: psutil.Process, seconds: float) -> bool:
    """Return whether a process waits for a core or disk; False after ``seconds`` of core time."""
    try:
        waiting = process.status() in (psutil.STATUS_RUNNING, psutil.STATUS_DISK_SLEEP)
    except psutil.NoSuchProcess:
        return False
    return waiting and _get_core_time(process) < seconds


def _get_core_time(process: psutil.Process) -> float:
    """Return the core time that a process has used, s; infinite if it has ended."""
    try:
        used = process.cpu_times()
    except psutil.NoSuchProcess:
        return math.inf
    return float(used.user + used.system)
