"""Compute the items of a list in several processes, in order."""

import multiprocessing
import sys
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

_MIN_ITEMS_PER_PROCESS = 20  # with fewer, starting a process takes longer than it saves

Made = TypeVar("Made")

_work: Callable[[int], Any]  # of this process


def compute_in_order(
    make: Callable[[int], Made], number: int, first: Sequence[int], processes: int
) -> Iterator[Made]:
    """Yield ``make(0)`` to ``make(number - 1)``; those of ``first`` are begun first.

    ``make`` must not change anything that others use: it may run in a copy of this process. Only
    Linux copies a process safely beside the threads of numerical libraries.
    """
    processes = min(processes, number // _MIN_ITEMS_PER_PROCESS)
    if processes < 2 or sys.platform != "linux":
        yield from map(make, range(number))
        return
    with warnings.catch_warnings():
        # Threads of OpenBLAS and Arrow exist, which both provide for copies.
        warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
        pool = multiprocessing.get_context("fork").Pool(processes, _receive, (make,))
    with pool:
        begun = {place: pool.apply_async(_run, (place,)) for place in first}
        others = pool.imap(_run, [place for place in range(number) if place not in begun])
        for place in range(number):
            yield begun[place].get() if place in begun else next(others)


def _receive(work: Callable[[int], Any]) -> None:
    global _work
    _work = work


def _run(place: int) -> Any:
    return _work(place)
