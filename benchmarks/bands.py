"""The band that an estimate takes by itself, and the Cramér-Rao bounds over it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.intervals import compute_cramer_rao_bounds
from imubench_pipeline.estimators.likelihood import Likelihood
from imubench_pipeline.noise import NoiseModel

Array = NDArray[np.float64]

_ALL = 0.999
_FINE = 50


def highest(found: Likelihood, rate: float) -> float:
    """Return the highest frequency that an estimate used, Hz."""
    return found.band.highest if found.band else 0.5 * rate


def what_is_cut(bands: Sequence[float], rate: float) -> str:
    """Say in how many logs the band ends before Nyquist, and where.

    Parameters
    ----------
    bands : sequence of float
        Highest frequency of each log, Hz.
    rate : float
        Hz.
    """
    ends = np.array([band for band in bands if band < _ALL * 0.5 * rate])
    text = f"default band: up to Nyquist, {0.5 * rate:g} Hz, in {len(bands) - len(ends)} of "
    text += f"{len(bands)} logs"
    if len(ends):
        text += f"; cut in {len(ends)}, at {ends.min():.3g} to {ends.max():.3g} Hz "
        text += f"(median {np.median(ends):.3g})"
    return text


def bounds_over(
    model: NoiseModel, rate: float, duration: float, bands: Sequence[float]
) -> dict[str, Array]:
    """Return the Cramér-Rao bounds of each log over the band that was used of it.

    Parameters
    ----------
    model : NoiseModel
    rate, duration : float
        Hz and s.
    bands : sequence of float
        Highest frequency of each log, Hz; taken to 1.4 %.

    Returns
    -------
    dict of str to ndarray, shape (logs,)
        Relative standard deviations, by parameter.
    """
    places = [round(_FINE * math.log2(2.0 * band / rate)) for band in bands]
    known = {
        place: compute_cramer_rao_bounds(model, rate, duration, 0.5 * rate * 2.0 ** (place / _FINE))
        for place in set(places)
    }
    names = dict.fromkeys(name for bounds in known.values() for name in bounds)
    return {
        name: np.array([known[place].get(name, math.inf) for place in places]) for name in names
    }
