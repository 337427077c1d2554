"""Compile each numba kernel in one process only; other processes wait for its cache entry.

Without this, processes of a first run compile the same kernels at the same time: a third of all
compilations of the demonstration.
"""

import fcntl
import zlib
from typing import IO, Any

from numba.core.caching import FunctionCache


def compile_once(locks: IO[bytes]) -> None:
    """Make this process and its forks wait for kernels that another process compiles.

    `locks`: a file open for writing, never closed, the same for all processes. Each kernel locks
    the byte of the hash of its name; the system unlocks it when the process ends.
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
