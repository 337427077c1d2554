"""Compute the items of a list in several processes, in order."""

import gc
import sys
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, TypeVar

_MIN_ITEMS_PER_PROCESS = 20  # with fewer, starting a process takes longer than it saves

Made = TypeVar("Made")

_work: Callable[[int], Any]  # of this process


def compute_in_order(make: Callable[[int], Made], number: int, processes: int) -> Iterator[Made]:
    """Yield ``make(0)`` to ``make(number - 1)``, from up to ``processes`` processes.

    ``make`` must not change shared objects: it may run in a copy of this process. There is one
    process on other systems than Linux, where copies are unsafe beside threads of libraries.
    """
    processes = min(processes, number // _MIN_ITEMS_PER_PROCESS)
    if processes < 2 or sys.platform != "linux":
        yield from map(make, range(number))
        return
    with warnings.catch_warnings():
        # Threads of OpenBLAS and Arrow exist, which both provide for copies.
        warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
        # Unlike a `Pool`, it ends its processes by a message: a signal could leave a lock taken.
        executor = ProcessPoolExecutor(processes, get_context("fork"), _receive, (make,))
        results = executor.map(_run, range(number))
    try:
        yield from results
    finally:
        executor.shutdown(cancel_futures=True)


def _receive(work: Callable[[int], Any]) -> None:
    global _work
    _work = work
    # Looking for garbage often, and in what is shared, would copy the memory of that.
    gc.freeze()
    gc.set_threshold(100_000, 20, 100)


def _run(place: int) -> Any:
    return _work(place)
