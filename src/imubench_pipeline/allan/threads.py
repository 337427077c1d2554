"""Distribute work on numbered pieces to threads; the result is independent of their number."""

import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

_SHARES_PER_THREAD = 4  # so that no thread waits long for the last share


def count_threads(threads: int | None) -> int:
    """Return the number of threads, by default of all cores available; ValueError below 1."""
    if threads is None:
        if hasattr(os, "sched_getaffinity"):
            return len(os.sched_getaffinity(0))
        return os.cpu_count() or 1
    if threads < 1:
        raise ValueError(f"threads is {threads}, expected 1 or more, or None for all cores")
    return threads


def run_in_threads(
    work: Callable[[int, int], tuple[NDArray[Any], ...]], pieces: int, threads: int
) -> tuple[NDArray[Any], ...]:
    """Return the joined rows of ``work(first, end)`` on all pieces; ``work`` releases the GIL."""
    threads = max(1, min(threads, pieces))
    if threads == 1:
        return work(0, pieces)
    shares = min(pieces, threads * _SHARES_PER_THREAD)
    cuts = [pieces * share // shares for share in range(shares + 1)]
    with ThreadPoolExecutor(threads) as pool:
        parts = list(pool.map(work, cuts[:-1], cuts[1:]))
    return tuple(np.concatenate(rows) for rows in zip(*parts, strict=True))


def read_ahead(blocks: Iterable[NDArray[Any]]) -> Iterator[NDArray[Any]]:
    """Yield blocks while another thread computes the next one, which takes additional memory."""
    coming = iter(blocks)
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(next, coming, None)
        while (block := waiting.result()) is not None:
            waiting = pool.submit(next, coming, None)
            yield block
