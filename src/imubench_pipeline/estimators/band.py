"""Up to which frequency a spectrum shows the noise, and not the sensor's own filter."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.estimators.whittle import COARSE, Maximum, Terms, Whittle, whittle_of

_DEFAULT = 1 / 20
"""Part of the rate below which filters are expected to be flat."""

_LOWEST = 1 / 1000
_FILTER = 10.0
"""A first-order filter lowers the density by 1 % at a tenth of its cut-off."""

_BENT_SIGMAS = 4.0
_GROUP = 4
_MOST_STEPS = 8
_AS_A_FILTER = 100
"""Sampling intervals: a correlation may be shorter only where white noise shows beside it."""

_SHOWS_BESIDE = 0.3

_FEWEST_BINS = 24
_SETTLED = 0.95
_FLEXIBLE = Terms("NFK", 1)


@dataclass(frozen=True)
class Band:
    """The highest frequency that enters the likelihood."""

    highest: float  # Hz
    source: str  # how it was found, in words


def find_band(
    spectrum: Spectrum,
    clear: NDArray[np.bool_],
    *,
    asked: float | None = None,
    bandwidth: float | None = None,
) -> Band:
    """Find the highest frequency to use.

    A model of the frequencies below a twentieth of the rate is carried on to Nyquist. Where the
    spectrum leaves it, the departure of a filter fades as f² downwards: the band ends where what
    is left of it is below half the standard error of S_N. Where quantization noise explains the
    departure, there is none.

    Parameters
    ----------
    clear : ndarray of bool, shape (b,)
        Bins that no line touches.
    asked : float, optional
        Set by the user, Hz: it is taken as it is.
    bandwidth : float, optional
        Cut-off of the sensor's own filter, Hz, where it is stated: a tenth of it is the limit.
    """
    nyquist = 0.5 * spectrum.rate
    if asked is not None:
        highest = min(asked, nyquist)
        return Band(highest, f"set: {highest:.4g} Hz")
    cap = nyquist
    if bandwidth is not None and bandwidth / _FILTER < nyquist:
        cap = bandwidth / _FILTER
    limit = _unbent(spectrum, clear, cap)
    if limit is not None and limit < cap:
        return Band(
            limit, f"found: beyond {limit:.4g} Hz the spectrum bends, as by the sensor's filter"
        )
    if cap < nyquist:
        return Band(cap, f"a tenth of the stated bandwidth: {cap:.4g} Hz")
    if limit is None:
        limit = _DEFAULT * spectrum.rate
        return Band(
            limit,
            f"default: a twentieth of the rate, {limit:.4g} Hz; the spectrum follows no model "
            "beyond any frequency",
        )
    return Band(nyquist, "found: the spectrum follows its model up to Nyquist")


def _unbent(spectrum: Spectrum, clear: NDArray[np.bool_], cap: float) -> float | None:
    """Return the frequency up to which no bend shows; None where one shows everywhere."""
    limit = min(_DEFAULT * spectrum.rate, cap)
    for step in range(_MOST_STEPS):
        below = clear & (spectrum.upper <= limit)
        if below.sum() < _FEWEST_BINS or limit < _LOWEST * spectrum.rate:
            # Too short a log to tell, or a departure that does not fade.
            return cap if step == 0 else None
        departure = _departure(spectrum, clear, below, cap, _FLEXIBLE)
        if departure is None or (step == 0 and _quantized(spectrum, clear, cap)):
            return cap if step == 0 else limit
        frequency, size = departure
        # size (f / frequency)^2 / 3 = 1 / 2 sqrt(1 / (D f)), the error of S_N.
        faded = (1.5 * frequency**2 / (size * math.sqrt(spectrum.duration))) ** 0.4
        if faded > _SETTLED * limit:
            return min(faded, frequency) if step == 0 else limit
        limit = faded
    return limit


def _departure(
    spectrum: Spectrum, clear: NDArray[np.bool_], below: NDArray[np.bool_], cap: float, terms: Terms
) -> tuple[float, float] | None:
    """Return frequency and relative size of the first departure beyond some bins, if any."""
    chosen = spectrum.select(below)
    whittle = _whittle(chosen)
    maximum = whittle.maximum(terms)
    if _looks_like_a_filter(whittle, maximum):
        maximum = whittle.maximum(replace(terms, gauss_markov=0))
    beyond = clear & ~below & (spectrum.upper <= cap * (1 + 1e-9))
    if not beyond.any():
        return None
    return _first_departure(spectrum.select(beyond), whittle, maximum)


def _looks_like_a_filter(whittle: Whittle, maximum: Maximum) -> bool:
    """Tell whether a short correlation leaves no white noise to be seen beyond its corner.

    White noise behind a first-order filter is a Gauss-Markov process.
    """
    if not len(maximum.times) or maximum.times[0] > _AS_A_FILTER / whittle.spectrum.rate:
        return False
    process = maximum.process_powers[-1] * whittle.gauss_markov(float(maximum.times[0]))[-1]
    white = maximum.powers[maximum.terms.linear.index("N")] * whittle.column("N")[-1]
    return bool(process > _SHOWS_BESIDE * white)


def _first_departure(
    rest: Spectrum, whittle: Whittle, maximum: Maximum
) -> tuple[float, float] | None:
    """Return frequency and relative size of the first departure from a fit, if any.

    A departure is measured by the errors of the bins, and of the fit carried on to them.
    """
    sensitivity = whittle.sensitivity(maximum)
    _, strength, directions = np.linalg.svd(sensitivity.T, full_matrices=False)
    carried = Whittle(rest, whittle.shortest, whittle.longest, len(whittle.times))
    ratio = rest.density / carried.density(maximum) - 1.0
    slopes = carried.sensitivity(maximum) / np.sqrt(rest.ordinates / 2.0)
    determined = strength > 1e-9 * strength[0]
    errors = (directions[determined] / strength[determined, None]) @ slopes
    for i in range(0, len(ratio), _GROUP):
        nu = rest.ordinates[i : i + _GROUP]
        share = nu / nu.sum()
        mean = float(ratio[i : i + _GROUP] @ share)
        fit_variance = float(np.sum((errors[:, i : i + _GROUP] @ share) ** 2))
        if abs(mean) > _BENT_SIGMAS * math.sqrt(2.0 / nu.sum() + fit_variance):
            return float(rest.frequency[i : i + _GROUP] @ share), abs(mean)
    return None


def _quantized(spectrum: Spectrum, clear: NDArray[np.bool_], cap: float) -> bool:
    """Tell whether quantization noise explains the spectrum up to Nyquist."""
    inside = clear & (spectrum.upper <= cap * (1 + 1e-9))
    chosen = spectrum.select(inside)
    whittle = _whittle(chosen)
    maximum = whittle.maximum(Terms("QNFK"))
    if maximum.parameter("Q") == 0.0:
        return False
    high = chosen.select(chosen.frequency > _DEFAULT * spectrum.rate)
    return _first_departure(high, whittle, maximum) is None


def _whittle(spectrum: Spectrum) -> Whittle:
    return whittle_of(spectrum, float(spectrum.upper.max()), COARSE)
