"""Highest frequency at which the sensor's low-pass filter does not affect the spectrum."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.estimators.whittle import COARSE, Maximum, Terms, Whittle, make_whittle
from imubench_pipeline.model.states import BandSource

_DEFAULT_BAND = 1 / 20  # Frequency over sampling rate below which filters are assumed to be flat
_MIN_BAND = 1 / 1000
_MIN_BANDWIDTH_RATIO = 10.0  # There a first-order filter lowers the density by 1 %
_MIN_DEPARTURE_SIGMAS = 4.0
_GROUP_BINS = 4
_MAX_STEPS = 8
_MAX_FILTER_SAMPLES = 100  # Correlation; shorter processes need visible white noise in addition
_MAX_PROCESS_OVER_WHITE = 0.3
_MIN_BINS = 24
_CONVERGED_RATIO = 0.95
_FLEXIBLE_TERMS = Terms("NFK", 1)


@dataclass(frozen=True)
class Band:
    """The highest frequency that enters the likelihood."""

    highest: float  # Hz
    source: BandSource


def find_band(
    spectrum: Spectrum,
    clear: NDArray[np.bool_],
    *,
    asked: float | None = None,
    bandwidth: float | None = None,
) -> Band:
    """Return the highest frequency to use.

    A model fitted below a twentieth of the sampling rate is extrapolated to Nyquist. The deviation
    of a filter from it decreases as f² towards low frequencies. The band ends where this deviation
    is below half the standard error of S_N. A deviation that quantization noise explains is
    ignored.

    Parameters
    ----------
    clear : ndarray of bool, shape (b,)
        Bins without spectral lines.
    asked : float, optional
        Set by the user, Hz; it is used unchanged up to Nyquist.
    bandwidth : float, optional
        Configured cut-off of the sensor's filter, Hz; the limit is a tenth of it.
    """
    nyquist = 0.5 * spectrum.rate
    if asked is not None:
        highest = min(asked, nyquist)
        return Band(highest, "set")
    cap = nyquist
    if bandwidth is not None and bandwidth / _MIN_BANDWIDTH_RATIO < nyquist:
        cap = bandwidth / _MIN_BANDWIDTH_RATIO
    limit = _find_unbent_limit(spectrum, clear, cap)
    if limit is not None and limit < cap:
        return Band(limit, "bend")
    if cap < nyquist:
        return Band(cap, "bandwidth")
    if limit is None:
        return Band(_DEFAULT_BAND * spectrum.rate, "no_model")
    return Band(nyquist, "whole")


def _find_unbent_limit(spectrum: Spectrum, clear: NDArray[np.bool_], cap: float) -> float | None:
    """Return the frequency up to which no bend is visible; None if there is no such frequency."""
    limit = min(_DEFAULT_BAND * spectrum.rate, cap)
    for step in range(_MAX_STEPS):
        below = clear & (spectrum.upper <= limit)
        if below.sum() < _MIN_BINS or limit < _MIN_BAND * spectrum.rate:
            # The log is too short, or the deviation does not decrease.
            return cap if step == 0 else None
        whittle = _make_whittle(spectrum.select(below))
        maximum = whittle.maximum(_FLEXIBLE_TERMS)
        if _is_filter_like(whittle, maximum):
            maximum = whittle.maximum(replace(_FLEXIBLE_TERMS, gauss_markov=0))
        beyond = clear & ~below & (spectrum.upper <= cap * (1 + 1e-9))
        departure = None
        if beyond.any():
            departure = _find_first_departure(spectrum.select(beyond), whittle, maximum)
        if departure is None or (step == 0 and _is_quantized(spectrum, clear, cap)):
            return cap if step == 0 else limit
        frequency, size = departure
        # size (f / frequency)^2 / 3 = 1 / 2 sqrt(1 / (D f)), the error of S_N.
        faded = (1.5 * frequency**2 / (size * math.sqrt(spectrum.duration))) ** 0.4
        if faded > _CONVERGED_RATIO * limit:
            return min(faded, frequency) if step == 0 else limit
        limit = faded
    return limit


def _is_filter_like(whittle: Whittle, maximum: Maximum) -> bool:
    """Return whether a fast process, without visible white noise above it, may be a filter."""
    if not len(maximum.times) or maximum.times[0] > _MAX_FILTER_SAMPLES / whittle.spectrum.rate:
        return False
    process = maximum.process_powers[-1] * whittle.gauss_markov(float(maximum.times[0]))[-1]
    white = maximum.powers[maximum.terms.linear.index("N")] * whittle.column("N")[-1]
    return bool(process > _MAX_PROCESS_OVER_WHITE * white)


def _find_first_departure(
    rest: Spectrum, whittle: Whittle, maximum: Maximum
) -> tuple[float, float] | None:
    """Return frequency and relative size of the first significant deviation from a fit, or None."""
    sensitivity = whittle.sensitivity(maximum)
    _, strength, directions = np.linalg.svd(sensitivity.T, full_matrices=False)
    carried = Whittle(rest, whittle.shortest, whittle.longest, len(whittle.times))
    ratio = rest.density / carried.density(maximum) - 1.0
    slopes = carried.sensitivity(maximum) / np.sqrt(rest.ordinates / 2.0)
    determined = strength > 1e-9 * strength[0]
    errors = (directions[determined] / strength[determined, None]) @ slopes
    for i in range(0, len(ratio), _GROUP_BINS):
        nu = rest.ordinates[i : i + _GROUP_BINS]
        share = nu / nu.sum()
        mean = float(ratio[i : i + _GROUP_BINS] @ share)
        fit_variance = float(np.sum((errors[:, i : i + _GROUP_BINS] @ share) ** 2))
        if abs(mean) > _MIN_DEPARTURE_SIGMAS * math.sqrt(2.0 / nu.sum() + fit_variance):
            return float(rest.frequency[i : i + _GROUP_BINS] @ share), abs(mean)
    return None


def _is_quantized(spectrum: Spectrum, clear: NDArray[np.bool_], cap: float) -> bool:
    """Return whether quantization noise explains the spectrum up to Nyquist."""
    chosen = spectrum.select(clear & (spectrum.upper <= cap * (1 + 1e-9)))
    whittle = _make_whittle(chosen)
    maximum = whittle.maximum(Terms("QNFK"))
    if maximum.parameter("Q") == 0.0:
        return False
    high = chosen.select(chosen.frequency > _DEFAULT_BAND * spectrum.rate)
    return _find_first_departure(high, whittle, maximum) is None


def _make_whittle(spectrum: Spectrum) -> Whittle:
    return make_whittle(spectrum, float(spectrum.upper.max()), COARSE)
