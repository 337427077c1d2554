"""Long times that a temperature spends in one cell of its register, and what they leave open.

A path that wanders as it does elsewhere would have left the cell: while it stays there, it moves
less, and may as well be near an edge all the time. What such a path may be off by does not average
out, while the wandering one's error does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.typing import Array

_LONG = 3.0
"""Times that a path takes to cross a cell, from which its stay there is long."""


@dataclass(frozen=True)
class Dwell:
    """A long time in one cell.

    Attributes
    ----------
    blocks : slice
        Of a segment.
    taper : ndarray, shape (b,)
        From 0 at the moments when the path crosses an edge of the cell, which say where it is, to
        1 a crossing time away from them.
    """

    blocks: slice
    taper: Array


def dwells(inside: NDArray[np.bool_], level: Array, half: float, q: float) -> Iterator[Dwell]:
    """Find the long times in one cell.

    Parameters
    ----------
    inside : ndarray of bool, shape (k,)
        All readings of a block are of one cell.
    level : ndarray, shape (k,)
        The mean reading of a block, K.
    half : float
        Half the width of a cell, K.
    q : float
        Density of the second derivative of the path (an integrated random walk), K² per block³.
    """
    if not inside.any():
        return
    # q t^3 / 3 is the variance of an integrated random walk.
    crossing = (3.0 * (2.0 * half) ** 2 / q) ** (1.0 / 3.0)
    other = (inside[1:] != inside[:-1]) | (np.abs(np.diff(level)) > half)
    edges = np.concatenate(([0], np.flatnonzero(other) + 1, [len(inside)]))
    for begin, end in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        if not inside[begin] or end - begin < _LONG * crossing:
            continue
        place = np.arange(end - begin) + 0.5
        before = place if begin > 0 else math.inf
        after = end - begin - place if end < len(inside) else math.inf
        away = np.minimum(np.minimum(before, after), crossing) / crossing
        yield Dwell(slice(begin, end), np.asarray(away) * np.ones(end - begin))
