"""Bounds of memory and time that hold whatever a library does with what a file says of itself."""

from __future__ import annotations

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

_READ = 1 << 20

_OVERLOADED = 5.0
"""Times as long may take what waits for a core or a disk that others use."""

_FORKING = Lock()
"""Held while a pipe is open in two processes that ought to have one end each: what another thread
forks meanwhile would keep it open."""


class BoundError(Exception):
    """What was called took more memory or time than it may.

    Attributes
    ----------
    is_external : bool
        The reason lies outside of the function: it waited, as for a disk, or was killed.
    """

    def __init__(self, text: str, *, is_external: bool = False) -> None:
        super().__init__(text)
        self.is_external = is_external


def limit_memory(more: int) -> None:
    """Let this process have so many bytes more than it has now, on Linux.

    What it asks for beyond is refused to it, which the libraries report as an error. Addresses
    that are only reserved do not count, as they do with RLIMIT_AS: Arrow and numba reserve many.
    """
    if sys.platform != "linux":
        return
    status = Path("/proc/self/status").read_text(encoding="ascii", errors="replace")
    now = 1024 * int(status.partition("VmData:")[2].split()[0])
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    most = now + more if hard == resource.RLIM_INFINITY else min(now + more, hard)
    resource.setrlimit(resource.RLIMIT_DATA, (most, hard))


def bounded(
    seconds: float, memory: int, function: Callable[P, T], *arguments: P.args, **named: P.kwargs
) -> T:
    """Call a function in a process of its own, which is ended where it takes too long.

    Parameters
    ----------
    seconds : float
        How long it may take; of a busy machine, how much time of a core, and five times as long.
    memory : int
        Bytes that it may take beside what this process has.
    function : callable
        What it returns or raises is pickled.
    *arguments, **named
        Its arguments.

    Raises
    ------
    BoundError
        If it takes more, or is ended by the system.
    """
    return Bounded(memory, function, *arguments, **named).result(seconds)


class Bounded(Generic[T]):
    """A function that is called in a process of its own, which begins at once.

    Parameters
    ----------
    memory, function, *arguments, **named
        As of `bounded`.
    """

    def __init__(
        self, memory: int, function: Callable[P, T], *arguments: P.args, **named: P.kwargs
    ) -> None:
        self._memory = memory
        self._status: int | None = None
        with _FORKING:
            self._pipe, theirs = os.pipe()
            self._process = os.fork()
            if self._process:
                os.close(theirs)
        if self._process == 0:
            os.close(self._pipe)
            _answer(theirs, memory, lambda: function(*arguments, **named))

    @property
    def answered(self) -> bool:
        """Whether `result` would not wait."""
        return self._status is not None or bool(select.select([self._pipe], [], [], 0.0)[0])

    def end(self) -> None:
        """End the process, unless that was done."""
        if self._status is None:
            os.close(self._pipe)
            with suppress(ProcessLookupError):
                os.kill(self._process, signal.SIGKILL)
            _, self._status = os.waitpid(self._process, 0)

    def result(self, seconds: float) -> T:
        """Return what it returns, or raise what it raises; ask once.

        Raises
        ------
        BoundError
            If that takes more than ``seconds`` from now on, or as `bounded` counts them where the
            machine is busy, or more memory than it may, or the process is ended by the system.
        """
        process = psutil.Process(self._process)
        try:
            answer = _received(self._pipe, seconds, process)
            was_waiting = answer is None and _time_of_core(process) < seconds / 2.0
        finally:
            self.end()  # it has answered, or it will not
        if answer is None:
            raise BoundError(f"took more than {seconds:g} s", is_external=was_waiting)
        try:
            returned, value = pickle.loads(answer)
        except (EOFError, pickle.UnpicklingError):
            ended = os.waitstatus_to_exitcode(self._status or 0)
            reason = f"ended the process that read it ({ended})"
            raise BoundError(reason, is_external=ended == -signal.SIGKILL) from None
        if returned:
            result: T = value
            return result
        if isinstance(value, MemoryError):
            raise BoundError(f"took more than {self._memory >> 20} MiB of memory")
        raise value


def _answer(pipe: int, memory: int, called: Callable[[], Any]) -> None:
    """Send what a function returns or raises, and end this process."""
    try:
        limit_memory(memory)
        try:
            answer = True, called()
        except Exception as error:
            answer = False, error
        with os.fdopen(pipe, "wb") as stream:
            pickle.dump(answer, stream)
    finally:
        os._exit(0)


def _received(pipe: int, seconds: float, sender: psutil.Process) -> bytes | None:
    """Return what comes through a pipe until its end; None where that takes longer."""
    begin = time.monotonic()
    end, last = begin + seconds, begin + _OVERLOADED * seconds
    received: list[bytes] = []
    while True:
        if select.select([pipe], [], [], max(0.0, end - time.monotonic()))[0]:
            block = os.read(pipe, _READ)
            if not block:
                return b"".join(received)
            received.append(block)
        elif end < last and is_kept_waiting(sender, seconds):
            end = min(end + seconds / 4.0, last)
        else:
            return None


def is_kept_waiting(process: psutil.Process, seconds: float) -> bool:
    """Tell whether a process had less time of a core than it may, and would go on if it had one."""
    try:
        waiting = process.status() in (psutil.STATUS_RUNNING, psutil.STATUS_DISK_SLEEP)
    except psutil.NoSuchProcess:
        return False
    return waiting and _time_of_core(process) < seconds


def _time_of_core(process: psutil.Process) -> float:
    """Return the time of a core that a process has used, s; infinite where it has ended."""
    try:
        used = process.cpu_times()
    except psutil.NoSuchProcess:
        return math.inf
    return float(used.user + used.system)
