"""Whether slow noise was taken off a log before it was written: less of it than white noise has.

Every noise adds to the density of white noise, N^2; below a sensor's low-pass nothing takes from
it. A log whose lowest frequencies hold less had its bias zeroed again and again at rest, passed a
high-pass, or had a curve or means of its parts subtracted. Its K and B, and the errors of dead
reckoning that come of them, are those of what is left.

The ordinates of white noise are chi-squared variates, so that nu of them, over N^2, sum to
chi-squared with nu degrees of freedom: a sum far below that is none of chance.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtr

from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.tables.findings import Finding
from imubench_pipeline.typing import Array

_HIGHEST = 0.05
"""Part of the rate up to which it is looked for."""

_FLAT = 0.95
"""Part of N^2 that the fitted density has at least, before a low-pass takes from it."""

_FEWEST = 4.0
"""Ordinates that tell."""

_LESS = 0.7
"""Part of N^2 below which it matters."""

_CHANCE = 1e-4
"""Chance, of all sums of a channel together, below which it is none."""

_APART = 1.4
"""Ratio of the ordinates in one sum and in the next that is looked at."""


def slow_noise_missing(
    channel: str, spectrum: Spectrum, fitted: Array, white: float | None
) -> Finding | None:
    """Return a finding where the lowest frequencies hold less than white noise.

    Parameters
    ----------
    channel : str
    spectrum : Spectrum
        Of the log as it is, with nothing taken out.
    fitted : ndarray, shape (b,)
        Density of the chosen model in each bin; NaN where there is none.
    white : float or None
        Lower limit of N, SI; None: it is not known.
    """
    if not white or not np.isfinite(white):
        return None
    order = np.argsort(spectrum.frequency)
    level = white**2
    low = spectrum.frequency[order] <= _HIGHEST * spectrum.rate
    order = order[low & ~np.logical_or.accumulate(fitted[order] < _FLAT * level)]
    degrees = np.cumsum(spectrum.ordinates[order])
    power = np.cumsum(spectrum.ordinates[order] * spectrum.density[order]) / level
    sums = np.floor(np.log(np.maximum(degrees, 1.0)) / np.log(_APART))
    looked = (degrees >= _FEWEST) & (np.diff(sums, prepend=-1.0) > 0.0)
    lacking = looked & (power < _LESS * degrees)
    if not lacking.any():
        return None
    chance = np.where(lacking, chdtr(degrees, power), 1.0) * looked.sum()
    worst = int(np.argmin(chance))
    if chance[worst] > _CHANCE:
        return None
    ratio = float(power[worst] / degrees[worst])
    highest = float(spectrum.upper[order[worst]])
    detail = (
        f"up to {highest:.3g} Hz the spectrum of {channel} has {ratio:.2g} of the density of its "
        "white noise, to which slow noise only adds: it was taken off before the log was written "
        "(bias zeroed at rest, a high-pass, means or a curve subtracted); switch that off, else K, "
        "B and the errors of dead reckoning are too small"
    )
    return Finding("slow_noise_missing", "warning", detail, ratio, channel)
