"""Work on numbered pieces shared between threads, with a result that does not depend on them."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

_SHARES = 4
"""Shares of the work a thread takes, one after the other: no thread waits long for the last."""


def available(threads: int | None) -> int:
    """Return a number of threads; None: one for each core that this process may use.

    Raises
    ------
    ValueError
        If it is below 1.
    """
    if threads is None:
        return (
            len(os.sched_getaffinity(0))
            if hasattr(os, "sched_getaffinity")
            else os.cpu_count() or 1
        )
    if threads < 1:
        raise ValueError(f"threads is {threads}, expected 1 or more, or None for all cores")
    return threads


def in_threads(
    work: Callable[[int, int], tuple[NDArray[Any], ...]], pieces: int, threads: int
) -> tuple[NDArray[Any], ...]:
    """Do work on pieces 0 to ``pieces``, a few at a time, and join the rows of all in order.

    The work takes the first and one-past-last piece, and returns arrays with one row a piece. It
    must let other threads run.
    """
    threads = max(1, min(threads, pieces))
    if threads == 1:
        return work(0, pieces)
    shares = min(pieces, threads * _SHARES)
    cuts = [pieces * share // shares for share in range(shares + 1)]
    with ThreadPoolExecutor(threads) as pool:
        parts = list(pool.map(work, cuts[:-1], cuts[1:]))
    return tuple(np.concatenate(rows) for rows in zip(*parts, strict=True))


def read_ahead(blocks: Iterable[NDArray[Any]]) -> Iterator[NDArray[Any]]:
    """Yield blocks while the next one is made in another thread: one block more is in memory."""
    coming = iter(blocks)
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(next, coming, None)
        while (block := waiting.result()) is not None:
            waiting = pool.submit(next, coming, None)
            yield block
