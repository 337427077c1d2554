"""Kernels that processes need at the same time: one compiles, the others wait for what it keeps.

Without, each process of a first run compiles for itself what another has half done: a third of all
that is compiled for the demonstration.
"""

from __future__ import annotations

import fcntl
import time
import zlib
from typing import IO, Any

from numba.core.caching import FunctionCache

_LONGEST = 120.0
"""s; who has waited for longer compiles, too: nothing depends on it."""

_AGAIN = 0.02
"""s."""


def compile_once(locks: IO[bytes]) -> None:
    """Have this process, and its forks, compile no kernel that another compiles.

    Parameters
    ----------
    locks : file
        Open for writing, and never closed; the same for all that wait for each other. A byte of it
        is locked for each kernel, by its name, and let go with the process at the latest.
    """
    load, save = FunctionCache.load_overload, FunctionCache.save_overload

    def load_or_lock(kernel: FunctionCache, signature: Any, context: Any) -> Any:
        found = load(kernel, signature, context)
        if found is None and _locked(locks, kernel):
            found = load(kernel, signature, context)  # the one who had it may have kept it
            if found is not None:
                _let_go(locks, kernel)
        return found

    def save_and_let_go(kernel: FunctionCache, signature: Any, compiled: Any) -> None:
        try:
            save(kernel, signature, compiled)
        finally:
            _let_go(locks, kernel)

    FunctionCache.load_overload, FunctionCache.save_overload = load_or_lock, save_and_let_go


def _locked(locks: IO[bytes], kernel: FunctionCache) -> bool:
    """Wait for the kernel; return whether it is locked.

    A kernel is waited for by those that call it, and never by those that it calls: nobody waits in
    a circle.
    """
    until = time.monotonic() + _LONGEST
    while time.monotonic() < until:
        try:
            fcntl.lockf(locks, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _place(kernel))
        except OSError:
            time.sleep(_AGAIN)
        else:
            return True
    return False


def _let_go(locks: IO[bytes], kernel: FunctionCache) -> None:
    fcntl.lockf(locks, fcntl.LOCK_UN, 1, _place(kernel))


def _place(kernel: FunctionCache) -> int:
    function = kernel._py_func
    return zlib.crc32(f"{function.__module__}.{function.__qualname__}".encode())
