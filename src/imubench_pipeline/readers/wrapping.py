"""Stamps of a counter that starts again from 0, made to go on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass
class WrapState:
    """What is known of a counter after the stamps read so far."""

    last: Any = None
    """The last stamp that was there, as written."""
    turns: int = 0
    """How often the counter has started again."""


def unwrapped(stamps: NDArray[Any], wraps: float, state: WrapState) -> NDArray[Any]:
    """Make the stamps of a counter that starts again from 0 go on.

    A step back by more than half of ``wraps`` is a new start. A step forward by more than half
    is a record from before the start that comes late, or a damaged stamp, which so harms itself
    alone.

    Parameters
    ----------
    stamps : ndarray of int or float
        The next stamps, as written; NaN where one is missing.
    wraps : float
        Where the counter starts again from 0, in the unit of the stamps.
    state : WrapState
        Carried on from block to block; changed in place.

    Returns
    -------
    ndarray
        int64 for whole numbers, with no digit lost; else float64, NaN where it was NaN.
    """
    whole = stamps.dtype.kind in "iu" and float(wraps).is_integer()
    going_on = stamps.astype(np.int64 if whole else np.float64)
    present = np.ones(len(stamps), bool) if whole else ~np.isnan(going_on)
    written = going_on[present]
    if not len(written):
        return going_on
    before = written[0] if state.last is None else state.last
    steps = np.diff(written, prepend=before)
    half = wraps / 2
    turns = state.turns + np.cumsum((steps < -half).astype(np.int64) - (steps > half))
    going_on[present] = written + turns * (int(wraps) if whole else wraps)
    state.last, state.turns = written[-1], int(turns[-1])
    return going_on
