"""Compile each numba kernel in one process only; other processes wait for its cache entry.

Without this, processes of a first run compile the same kernels at the same time: a third of all
compilations of the demonstration.
"""

from __future__ import annotations

import fcntl
import time
import zlib
from typing import IO, Any

from numba.core.caching import FunctionCache

_MAX_WAIT = 120.0
"""Max. time to wait for another process, s. After it the kernel is compiled here, too; the result
is the same."""

_RETRY_INTERVAL = 0.02
"""Time between two attempts to lock, s."""


def compile_once(locks: IO[bytes]) -> None:
    """Make this process and its forks wait for kernels that another process compiles.

    Parameters
    ----------
    locks : file
        Open for writing, and never closed; the same file for all processes. Each kernel locks the
        byte of the hash of its name; the system unlocks it when the process ends.
    """
    load, save = FunctionCache.load_overload, FunctionCache.save_overload

    def load_or_lock(kernel: FunctionCache, signature: Any, context: Any) -> Any:
        found = load(kernel, signature, context)
        if found is None and _lock_kernel(locks, kernel):
            found = load(kernel, signature, context)  # the other process may have cached it
            if found is not None:
                _unlock_kernel(locks, kernel)
        return found

    def save_and_let_go(kernel: FunctionCache, signature: Any, compiled: Any) -> None:
        try:
            save(kernel, signature, compiled)
        finally:
            _unlock_kernel(locks, kernel)

    FunctionCache.load_overload, FunctionCache.save_overload = load_or_lock, save_and_let_go


def _lock_kernel(locks: IO[bytes], kernel: FunctionCache) -> bool:
    """Wait for the kernel; return whether it is locked.

    Callers wait for the kernels that they call, never the reverse: deadlocks are impossible.
    """
    until = time.monotonic() + _MAX_WAIT
    while time.monotonic() < until:
        try:
            fcntl.lockf(locks, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, _compute_lock_offset(kernel))
        except OSError:
            time.sleep(_RETRY_INTERVAL)
        else:
            return True
    return False


def _unlock_kernel(locks: IO[bytes], kernel: FunctionCache) -> None:
    fcntl.lockf(locks, fcntl.LOCK_UN, 1, _compute_lock_offset(kernel))


def _compute_lock_offset(kernel: FunctionCache) -> int:
    function = kernel._py_func
    return zlib.crc32(f"{function.__module__}.{function.__qualname__}".encode())
