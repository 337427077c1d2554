"""The cut-off of a sensor's own low-pass, from the spectrum of its noise at rest.

White noise of density N behind a filter (`imubench_pipeline.estimators.low_pass`) has the density
N^2 G(f); an analogue filter may have its cut-off above Nyquist, where the folds leave little of the
bend, but a long log shows it. N is the density before the filter.

White noise behind an analogue filter of first order is a Gauss-Markov process. What tells the one
from the other is the white noise that stands beside a process up to Nyquist, and not behind a
filter; where it does not show, a correlation of a few samples is a filter's, and a longer one may
be either: then nothing is said.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.estimators.estimate import SIGMAS, Parameter
from imubench_pipeline.estimators.filter_fits import (
    FAMILY,
    FEWEST_BINS,
    PROCESSES,
    Allowed,
    BinGains,
    FilterFits,
    FilterTrial,
    OfModel,
    Reading,
    also_after_sampling,
    density_in_the_log,
    draw_factors,
    highest_cutoff,
)
from imubench_pipeline.estimators.low_pass import Filter, Kind
from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.estimators.whittle import Behind, Terms
from imubench_pipeline.typing import Array

_SHOWS = 2.0
"""Log likelihood that white noise beside a process must gain to be there."""

_ENDS_RULE = 0.01
"""Part of the density that the ends of the transform may add; beyond, a bin says nothing."""

_STEEP = 0.4
"""Least over greatest gain in a bin below which its mean is ruled by one end of it."""

_SOMETHING_ELSE = 10.0
"""Measured over expected density from which it is not those ends: what the two ends of a log leave
is exponentially distributed, and beyond this in one of 20,000."""

_PASSES = 3
"""Fits, each without the bins in which the ends rule behind the filter found before."""

_COARSE = 1e-3
"""Part of a cut-off to which the first of them finds it."""

_NEAR = 1 / 300
"""Part of the cut-off from which frequencies count: drift, as with temperature, is not as any noise
is, and far below the bend it says nothing of it."""

RULED_OUT = 3.0
"""Log likelihood by which another filter must be the worse not to count: its share is 5 %."""

_BEYOND_BIC = 6.0
"""Gain of BIC below which there is no filter: strong evidence, on the scale that is used of it."""

_BEYOND_DOUBT = 20.0
"""That below which N without a filter is in the interval as well, with the weight `_WITHOUT`."""

_WITHOUT = 0.1

_LEAST_N = 1e-6
"""N at an end of the interval of a cut-off that stands for none, over that at the best one."""

WIDEST = 1.2
"""Ratio of the limits of a cut-off beyond which it is not called known."""

_LEAST_WIDTH = 1e-5
"""Half of an interval of a logarithm."""

ALLOWED = "the log allows cut-offs from {:.4g} to {:.4g} Hz"
NOT_AS_BEHIND = (
    f"the spectrum bends, but not as behind any of {len(FAMILY)} filters that were tried"
)

_AS_STATED = 1.6
"""Ratio to the stated cut-off up to which a filter is the stated one."""


@dataclass(frozen=True)
class Cutoff:
    """The low-pass that a spectrum shows."""

    frequency: Parameter  # f_c (-3 dB), Hz
    order: int | None  # n; None where no filter shows
    N: Parameter  # density of white noise before the filter, SI
    floor: float  # density of white noise after it, that of rounding and what else shows, SI
    gained: float  # BIC of the noise without a filter, less that with it
    or_quantization: bool = False  # quantization noise would explain the spectrum as well
    kind: Kind | None = None  # ``analogue``, ``bilinear`` or ``boxcar``; None where no filter shows
    or_process: str | None = None
    """Why what bends the spectrum may be a process or a filter, and is not told."""
    N_behind: float | None = None  # N before the filter, if it is one, where that is not told; SI
    behind: Behind | None = None
    """What the filter leaves of noise in each bin of the whole spectrum."""
    ruled: NDArray[np.bool_] | None = None
    """(b,): bins in which the ends of the transform rule, and not the noise."""
    readings: Sequence[Reading] = ()  # of all filters that the log does not rule out
    allowed: Sequence[Allowed] = ()  # those filters, the chosen one first
    rounded: float = 0.0  # density of rounding, parts of N^2
    models: Mapping[Terms, OfModel] = field(default_factory=dict)
    """Where the cut-off was fitted together with models of the noise."""

    @property
    def words(self) -> str:
        """The filter, in words; empty where none shows."""
        cutoff = self.frequency.value or self.frequency.fitted
        if self.kind is None or self.order is None or cutoff is None:
            return ""
        return f"{Filter(self.kind, self.order, cutoff).name} at {cutoff:.4g} Hz"

    @property
    def beside(self) -> float:
        """Power of the white noise that does not pass the filter, less rounding, over that of N."""
        N = self.N.in_model
        if self.behind is None or not N:
            return 0.0
        return max((self.floor / N) ** 2 - self.rounded, 0.0)

    def factors(
        self, number: int, rng: np.random.Generator, terms: Terms, *, in_the_log: bool = False
    ) -> Array:
        """Return draws of N over its value for the chosen filter in a model, shape (number,).

        Of N before the filter, or of the density in the log.
        """
        of_model = self.models.get(replace(terms, ramp=False))
        readings = self.readings if of_model is None else of_model.readings
        if not readings:
            return np.ones(number)
        return draw_factors(readings, number, rng, in_the_log=in_the_log)


def find_cutoff(
    spectrum: Spectrum,
    clear: NDArray[np.bool_] | None = None,
    *,
    resolution: float = 0.0,
    stated: float | None = None,
) -> Cutoff:
    """Find the low-pass of a sensor from its spectrum, or that there is none.

    Noise alone, with processes of ten sampling intervals and more, and noise behind each filter
    of the family are fitted up to Nyquist; kind and order, and a floor behind the filter beyond
    that of rounding, are chosen by BIC. The interval is that of all filters that the log does not
    rule out: above Nyquist the folds of one may look like those of another.

    Parameters
    ----------
    spectrum : Spectrum
        Of a log, up to Nyquist.
    clear : ndarray of bool, shape (b,), optional
        Bins that no line touches.
    resolution : float
        Step of the register (LSB), SI, where the samples are rounded: white noise of variance
        LSB^2 / 12 behind the filter.
    stated : float, optional
        Cut-off of the sensor's filter as its maker states it, Hz: tells a filter from a process
        where the spectrum does not.

    Returns
    -------
    Cutoff
        With status ``not_identified`` where the interval of the cut-off is wider than a fifth, or
        the bend is another than that of such a filter; ``absent`` where no filter shows.
    """
    used = np.ones(len(spectrum.frequency), dtype=np.bool_) if clear is None else clear
    if used.sum() < FEWEST_BINS:
        unknown = Parameter(None, "not_shown", f"the spectrum has {used.sum()} bins only")
        return Cutoff(unknown, None, unknown, 0.0, 0.0)
    fits = FilterFits(spectrum.select(used))
    if not fits.may_bend():
        return _without_filter(fits.unfiltered()[0], 0.0, None)
    rounding = resolution**2 / (12.0 * spectrum.rate)
    settled = _settled(spectrum, used, fits, rounding)
    fits, tried = settled.fits, settled.tried
    N_alone, without, cost_alone, rising = fits.unfiltered()
    behind = fits.behind(tried[0]) if tried else math.inf
    gained = 2.0 * (without - behind)
    beside_rounding = 2.0 * (rising - behind)
    doubt = _process_or_filter(fits, tried, cost_alone, gained, stated)
    if doubt is not None or gained < _BEYOND_BIC or beside_rounding < -_BEYOND_BIC:
        return _without_filter(N_alone, gained, doubt)
    return _with_filter(spectrum, settled, rounding, (N_alone, gained, beside_rounding))


@dataclass(frozen=True)
class _Settled:
    """Fits of filters to the bins that tell of them: ``used``, not those ``ruled`` by the ends."""

    fits: FilterFits
    tried: Sequence[FilterTrial]
    used: NDArray[np.bool_]
    ruled: NDArray[np.bool_]


def _settled(
    spectrum: Spectrum,
    usable: NDArray[np.bool_],
    fits: FilterFits,
    rounding: float,
) -> _Settled:
    """Fit the filters, and again where the best of them changes which bins tell of it."""
    tried = fits.try_filters(_COARSE)
    used, ruled = usable, np.zeros(len(usable), dtype=np.bool_)
    for passed in range(_PASSES if tried else 0):
        earlier, ruled = ruled, _ruled_by_ends(spectrum, fits, tried[0], rounding)
        if passed and bool((ruled == earlier).all()):
            break
        near = usable & ~ruled & (spectrum.frequency > _NEAR * tried[0].cutoff)
        if near.sum() >= FEWEST_BINS:
            used = near
            fits = FilterFits(spectrum.select(used))
        if rounding > 0.0:
            fits.rounded = rounding / fits.density(tried[0])[0] ** 2
        fits.choose_slow(tried[0])
        tried = fits.try_filters()
        if not tried:
            break
    return _Settled(fits, tried, used, ruled)


def _with_filter(
    spectrum: Spectrum,
    settled: _Settled,
    rounding: float,
    against: tuple[float, float, float],
) -> Cutoff:
    """Describe the best of the filters and the others that the log allows.

    ``against``: N of the noise alone, and what BIC gains over it, and over that with rounding.
    """
    fits, tried, used = settled.fits, settled.tried, settled.used
    N_alone, gained, beside_rounding = against
    best = tried[0]
    # A floor is taken to be there where it shows only: with it a high cut-off is never told.
    alike = [
        trial
        for trial in tried
        if trial.floor <= best.floor
        and trial.cost + trial.floor < best.cost + best.floor + RULED_OUT
    ]
    limits = [fits.limits(trial) for trial in alike]
    lower, upper = min(low for low, _ in limits), max(high for _, high in limits)
    N, after = fits.density(best)
    highest = upper >= 0.999 * highest_cutoff(best.kind, best.order, fits.rate)
    shown, lower, upper = (
        replace(best, cutoff=cutoff).low_pass.half_power(spectrum.rate)
        for cutoff in (best.cutoff, lower, upper)
    )
    readings = _readings(fits, alike, limits)
    if gained < _BEYOND_DOUBT and N_alone > 0.0:
        # Of so many filters one may be there by chance.
        alone = math.log(N_alone / N)
        beside = fits.rounded * N**2 + after**2
        shown_alone = math.log(N_alone / density_in_the_log(best.low_pass, N, beside, fits.rate))
        readings.append(Reading(_WITHOUT, alone, alone, alone, (shown_alone,) * 3))
    error = SIGMAS / math.sqrt(2.0 * float(spectrum.ordinates[used].sum()))
    ends = [end for reading in readings for end in (reading.below, reading.above)]
    density = Parameter(
        N, lower=N * math.exp(min(0.0, *ends) - error), upper=N * math.exp(max(0.0, *ends) + error)
    )
    or_quantization = beside_rounding < _BEYOND_BIC
    reason = None
    if or_quantization:
        reason = (
            "the spectrum rises towards Nyquist, by quantization noise as well as by a low-pass "
            f"with a cut-off from {lower:.4g} to {upper:.4g} Hz"
        )
    elif upper > WIDEST * lower or highest:
        reason = ALLOWED.format(lower, upper)
    elif not fits.explains(best):
        reason = NOT_AS_BEHIND
    if reason is not None:
        frequency = Parameter(None, "not_identified", reason, lower, upper, fitted=shown)
        density = replace(
            density, value=None, status="not_identified", reason=reason, fitted=density.value
        )
    else:
        frequency = Parameter(shown, lower=lower, upper=upper)
    white, *slow = BinGains(spectrum)(best)
    return Cutoff(
        frequency,
        best.order,
        density,
        math.hypot(after, math.sqrt(rounding)),
        gained,
        or_quantization,
        best.kind,
        behind=Behind(white + fits.rounded + (after / N) ** 2, *slow),
        ruled=settled.ruled,
        readings=readings,
        allowed=[
            Allowed(trial, max(0.5 * math.log(high / low), _LEAST_WIDTH))
            for trial, (low, high) in zip(alike, limits, strict=True)
        ],
        rounded=fits.rounded,
    )


def _without_filter(N_alone: float, gained: float, doubt: tuple[str, float] | None) -> Cutoff:
    """Return that no filter shows; or, with a doubt, that one may be there, with another N."""
    absent = Parameter(None, "absent", "the spectrum shows no low-pass")
    if doubt is None:
        return Cutoff(absent, None, Parameter(N_alone), 0.0, gained)
    reason, before = doubt
    low, high = sorted((N_alone, before))
    unknown = Parameter(None, "not_identified", reason, low, high, fitted=N_alone)
    frequency = replace(absent, status="not_identified", reason=reason)
    return Cutoff(frequency, None, unknown, 0.0, gained, or_process=reason, N_behind=before)


def _readings(
    fits: FilterFits, alike: Sequence[FilterTrial], limits: Sequence[tuple[float, float]]
) -> list[Reading]:
    """Return N before each filter that the log allows, over that of the best, and how likely."""
    best = alike[0]

    def densities(trial: FilterTrial) -> tuple[float, float]:
        N, after = fits.density(trial)
        beside = fits.rounded * N**2 + after**2
        return N, density_in_the_log(trial.low_pass, N, beside, fits.rate)

    N, shown = densities(best)
    readings = []
    for trial, (low, high) in zip(alike, limits, strict=True):
        at = [densities(replace(trial, cutoff=cutoff)) for cutoff in (low, trial.cutoff, high)]
        below, middle, above = (math.log(max(density / N, _LEAST_N)) for density, _ in at)
        first, second, third = (math.log(max(density / shown, _LEAST_N)) for _, density in at)
        weight = math.exp(best.cost - trial.cost)
        readings.append(Reading(weight, below, middle, above, (first, second, third)))
    readings += [
        also_after_sampling(reading, trial, fits.rate)
        for reading, trial in zip(readings, alike, strict=True)
        if trial.is_first_order_analogue
    ]
    return readings


def _ruled_by_ends(
    spectrum: Spectrum, fits: FilterFits, best: FilterTrial, rounding: float
) -> NDArray[np.bool_]:
    """Return the bins in which the ends of the transform rule, or the filter falls within the bin.

    Those in which something else stands are none of them.
    """
    N = fits.density(best)[0]
    gains, low_pass = BinGains(spectrum), best.low_pass
    within = gains.white(low_pass) + rounding / N**2
    white, leak = within.mean(axis=0), gains.leakage(low_pass)
    rules = (leak > _ENDS_RULE * white) | (within.min(axis=0) < _STEEP * within.max(axis=0))
    return np.asarray(rules & (spectrum.density < _SOMETHING_ELSE * N**2 * (white + leak)))


def _process_or_filter(
    fits: FilterFits,
    tried: Sequence[FilterTrial],
    cost_alone: float,
    gained: float,
    stated: float | None,
) -> tuple[str, float] | None:
    """Return why the log does not tell a process from a filter, and N before that; None if it does.

    Only a filter of first order looks like a process, and only where no white noise shows beside
    it up to Nyquist.
    """
    first = next(
        (trial for trial in tried if trial.is_first_order_analogue and not trial.floor), None
    )
    if first is None or first.correlation(fits.rate) < PROCESSES:
        return None
    if stated is not None and 1.0 / _AS_STATED < first.cutoff / stated < _AS_STATED:
        return None
    leads = gained >= _BEYOND_BIC and tried[0] == first
    if not leads and first.cost > cost_alone + _SHOWS:
        return None
    if not leads and gained >= _BEYOND_BIC:
        return None  # another filter explains it better than both
    time = 1.0 / (2.0 * math.pi * first.cutoff)
    reason = (
        f"a Gauss-Markov process of T_B = {time:.3g} s and a low-pass of first order at "
        f"{first.cutoff:.3g} Hz look alike: no white noise shows beside it; bandwidth in the "
        "sensor file would tell"
    )
    return reason, fits.density(first)[0]
