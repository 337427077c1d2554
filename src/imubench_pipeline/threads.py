"""Work on numbered pieces shared between threads, with a result that does not depend on them."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray


def in_threads(
    work: Callable[[int, int], tuple[NDArray[Any], ...]], pieces: int, threads: int
) -> tuple[NDArray[Any], ...]:
    """Do work on pieces 0 to ``pieces`` in contiguous shares, one a thread, and join the results.

    Parameters
    ----------
    work : callable
        Takes the first and one-past-last piece; returns arrays with one row a piece. It must let
        other threads run.
    pieces : int
    threads : int

    Returns
    -------
    tuple of ndarray
        The rows of all pieces in order.
    """
    shares = max(1, min(threads, pieces))
    if shares == 1:
        return work(0, pieces)
    cuts = [pieces * share // shares for share in range(shares + 1)]
    with ThreadPoolExecutor(shares) as pool:
        parts = list(pool.map(work, cuts[:-1], cuts[1:]))
    return tuple(np.concatenate(rows) for rows in zip(*parts, strict=True))
