"""Turns from a column that says how the sensor stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.typing import Array

_NEAR = 0.1
"""Part of the distance of the two positions within which a sensor is in one of them."""


@dataclass(frozen=True)
class Stays:
    """Where the sensor stood.

    Attributes
    ----------
    start, stop : ndarray, shape (n,)
        s; what lies between two of them is turning.
    high : ndarray of bool, shape (n,)
        Whether it is the position of the larger number; alternates.
    senses : bool
        Whether the column has +1 and -1: then it says the sense itself.
    away : bool
        Whether more than a twentieth of the column is in neither position for longer than a turn
        takes: perhaps there are more than two.
    """

    start: Array
    stop: Array
    high: NDArray[np.bool_]
    senses: bool
    away: bool


def stays(position: Array, rate: float, shortest: float) -> Stays:
    """Find the stays in two positions.

    The positions are the medians of the column's lower and upper half, by range. A sample within
    a tenth of their distance of one is in it; other samples are turning, or overrun. Stays of the
    same position that follow each other are one.

    Parameters
    ----------
    position : ndarray, shape (n,)
        Two positions as numbers in any unit, such as angles, 0 and 1, or -1 and +1; NaN where it
        is not known. An angle must not wrap at one of them.
    rate : float
        Hz.
    shortest : float
        Shorter stays are overruns, s.

    Raises
    ------
    ValueError
        If the column has one position only, or none.
    """
    known = np.flatnonzero(np.isfinite(position))
    if len(known) == 0:
        raise ValueError("the column with the position has no numbers")
    value = position[known]
    middle = 0.5 * (float(value.min()) + float(value.max()))
    if value.min() == value.max():
        raise ValueError(f"the position is {middle:g} throughout: the log never turns")
    low, high = float(np.median(value[value <= middle])), float(np.median(value[value > middle]))
    near = _NEAR * (high - low)
    state = np.where(np.abs(value - high) <= near, 1, np.where(np.abs(value - low) <= near, 0, -1))
    change = np.flatnonzero(np.diff(state)) + 1
    first = np.concatenate(([0], change))
    last = np.concatenate((change, [len(state)])) - 1
    merged: list[list[float]] = []
    away = 0.0
    for a, b in zip(first, last, strict=True):
        start, stop = known[a] / rate, (known[b] + 1) / rate
        if state[a] < 0 or stop - start < shortest:
            away += (stop - start) if stop - start > shortest else 0.0
            continue
        if merged and merged[-1][2] == state[a]:
            merged[-1][1] = stop
        else:
            merged.append([start, stop, state[a]])
    if len(merged) < 2:
        raise ValueError("the column with the position shows no two stays: the log never turns")
    table = np.array(merged)
    return Stays(
        table[:, 0],
        table[:, 1],
        table[:, 2] == 1,
        bool(np.allclose([low, high], [-1.0, 1.0], atol=0.05)),
        away > 0.05 * len(position) / rate,
    )
