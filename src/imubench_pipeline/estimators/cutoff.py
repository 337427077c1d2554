"""Estimation of the cut-off of a sensor's low-pass filter from the spectrum of its noise at rest.

An analogue cut-off may exceed Nyquist: aliasing then hides most of the bend, but a long log can
determine it. White noise behind an analogue filter of first order is a Gauss-Markov process. A
process of a few samples without white noise is attributed to a filter; a longer one is ambiguous,
and no filter is reported. Each noise model has its own cut-off (`refine_cutoff`), since a process
or flicker noise affects it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from imubench_pipeline.estimators.estimate import SIGMAS, Parameter
from imubench_pipeline.estimators.filter_fits import (
    FAMILY,
    HALF_CHI_SQUARED,
    MIN_BINS,
    MIN_PROCESS_SAMPLES,
    Allowed,
    BinGains,
    FilterFits,
    FilterTrial,
    OfModel,
    Reading,
    compute_density_in_log,
    draw_factors,
    explains_bend,
    get_highest_cutoff,
    read_as_digital,
)
from imubench_pipeline.estimators.low_pass import Kind
from imubench_pipeline.estimators.model_choice import Candidate
from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.estimators.whittle import (
    COARSE,
    Behind,
    Maximum,
    Terms,
    Whittle,
    make_whittle,
)
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import spectra as texts

_MIN_WHITE_GAIN = 2.0  # Minimum gain of log likelihood by white noise in addition to a process
_MAX_LEAKAGE_FRACTION = 0.01  # Maximum spectral leakage over density in a fitted bin
_MIN_GAIN_RATIO = 0.4  # Minimum over maximum gain within a fitted bin
_MAX_DENSITY_RATIO = 10.0  # Measured over expected density; leakage exceeds it in 1 of 20,000
_MAX_PASSES = 3  # Fits; each excludes the bins with leakage under the previous filter
_COARSE_TOLERANCE = 1e-3  # Relative tolerance of the cut-off in the first fit
_MIN_FREQUENCY_RATIO = 1 / 300  # Minimum fitted frequency over cut-off: below, drift may dominate
DELTA_LOG_LIKELIHOOD_EXCLUDED = 3.0  # Below the best, another filter is excluded: weight 5 %

_MIN_DELTA_BIC = 6.0
"""Minimum gain of BIC by a filter: "strong" evidence (Kass and Raftery, J. Am. Stat. Assoc. 90)."""

_CERTAIN_DELTA_BIC = 20.0  # Below it, the interval includes N without a filter
_NO_FILTER_WEIGHT = 0.1
_MIN_N_RATIO = 1e-6  # Minimum N over N at the best cut-off, or over the density of the log
MAX_LIMIT_RATIO = 1.2  # Ratio of the limits of a cut-off above which it is not identified
_MIN_HALF_WIDTH = 1e-5  # Minimum half width of the interval of a log cut-off

_MAX_STATED_RATIO = 1.6  # Ratio of found to configured cut-off of the same filter


@dataclass(frozen=True)
class Cutoff:
    """The low-pass filter in a spectrum."""

    frequency: Parameter  # f_c (-3 dB), Hz
    order: int | None  # n; None without a filter
    N: Parameter  # density of white noise before the filter, SI
    floor: float  # density of white noise added after the filter, with rounding, SI
    gained: float  # BIC of the noise without a filter, less that with it
    or_quantization: bool = False  # quantization noise would explain the spectrum as well
    kind: Kind | None = None  # ``analogue``, ``bilinear`` or ``boxcar``; None without a filter
    or_process: str | None = None  # reason why process and filter are not distinguishable, or None
    N_behind: float | None = None  # N before the filter, if it is one, in this case; SI
    behind: Behind | None = None  # power gains of the filter in each bin of the whole spectrum
    ruled: NDArray[np.bool_] | None = None  # (b,): bins that spectral leakage dominates
    readings: Sequence[Reading] = ()  # for all filters that the log does not exclude
    allowed: Sequence[Allowed] = ()  # those filters, the chosen one first
    rounded: float = 0.0  # density of rounding over N^2
    models: Mapping[Terms, OfModel] = field(default_factory=dict)
    """Results of joint fits of the cut-off with noise models."""

    @property
    def words(self) -> str:
        """Description of the filter; empty without one."""
        cutoff = self.frequency.value or self.frequency.fitted
        if self.kind is None or self.order is None or cutoff is None:
            return ""
        return texts.filter_text(self.kind, self.order, cutoff)

    @property
    def beside(self) -> float:
        """Ratio of the white noise added after the filter, without rounding, to N, in power."""
        N = self.N.in_model
        if self.behind is None or not N:
            return 0.0
        return max((self.floor / N) ** 2 - self.rounded, 0.0)

    def factors(
        self, number: int, rng: np.random.Generator, terms: Terms, *, in_the_log: bool = False
    ) -> Array:
        """Return draws of N over its value, before the filter or in the log, shape (number,)."""
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
    """Estimate the low-pass filter of a sensor from a spectrum, or find that there is none.

    Noise alone, with processes of ten sampling intervals and more, and noise behind each filter
    of the family are fitted up to Nyquist. BIC selects kind and order, and a floor of white noise
    after the filter in addition to rounding. The interval covers all filters that the log does not
    exclude: above Nyquist the aliases of two filters may look alike. The cut-off is
    ``not_identified`` if its limits differ by more than a fifth, or if no such filter fits the
    bend; ``absent`` without a filter.

    ``spectrum`` reaches Nyquist; ``clear``, shape (b,), are the bins without spectral lines;
    ``resolution`` is the step of the register (LSB), SI: rounding adds white noise of variance
    LSB^2 / 12; ``stated`` is the cut-off in the data sheet, Hz, which decides between filter and
    process where the spectrum is ambiguous.
    """
    usable = np.ones(len(spectrum.frequency), dtype=np.bool_) if clear is None else clear
    if usable.sum() < MIN_BINS:
        reason = texts.few_bins(int(usable.sum()), MIN_BINS)
        unknown = Parameter(None, "not_shown", reason)
        return Cutoff(unknown, None, unknown, 0.0, 0.0)
    fits = FilterFits(spectrum.select(usable))
    if not fits.may_bend():
        return _describe_no_filter(fits.unfiltered()[0], 0.0, None)
    rounding = resolution**2 / (12.0 * spectrum.rate)
    tried = fits.try_filters(_COARSE_TOLERANCE)
    ruled = np.zeros(len(usable), dtype=np.bool_)
    # Repeat the fits while the best filter changes the set of usable bins.
    for passed in range(_MAX_PASSES if tried else 0):
        earlier, ruled = ruled, _find_leaky_bins(spectrum, fits, tried[0], rounding)
        if passed and bool((ruled == earlier).all()):
            break
        near = usable & ~ruled & (spectrum.frequency > _MIN_FREQUENCY_RATIO * tried[0].cutoff)
        if near.sum() >= MIN_BINS:
            fits = FilterFits(spectrum.select(near))
        if rounding > 0.0:
            fits.rounded = rounding / fits.density(tried[0])[0] ** 2
        fits.choose_slow(tried[0])
        tried = fits.try_filters()
        if not tried:
            break
    N_alone, without, cost_alone, rising = fits.unfiltered()
    behind = fits.behind(tried[0]) if tried else math.inf
    gained = 2.0 * (without - behind)
    beside_rounding = 2.0 * (rising - behind)
    doubt = _explain_ambiguity(fits, tried, cost_alone, gained, stated)
    if doubt is not None or gained < _MIN_DELTA_BIC or beside_rounding < -_MIN_DELTA_BIC:
        return _describe_no_filter(N_alone, gained, doubt)
    found = _describe_filter(spectrum, fits, tried, N_alone, gained, beside_rounding)
    return replace(found, floor=math.hypot(found.floor, math.sqrt(rounding)), ruled=ruled)


def _describe_filter(
    spectrum: Spectrum,
    fits: FilterFits,
    tried: Sequence[FilterTrial],
    N_alone: float,
    gained: float,
    beside_rounding: float,
) -> Cutoff:
    """Return the best filter without rounding, with its gains over no filter and over rounding."""
    best = tried[0]
    # Trials with a floor count only if the best has one: with a floor no high cut-off is known.
    alike = [
        trial
        for trial in tried
        if trial.floor <= best.floor
        and trial.cost + trial.floor < best.cost + best.floor + DELTA_LOG_LIKELIHOOD_EXCLUDED
    ]
    limits = [fits.limits(trial) for trial in alike]
    lower, upper = min(low for low, _ in limits), max(high for _, high in limits)
    N, after = fits.density(best)
    highest = upper >= 0.999 * get_highest_cutoff(best.kind, best.order, fits.rate)
    shown, lower, upper = (
        replace(best, cutoff=cutoff).low_pass.half_power(spectrum.rate)
        for cutoff in (best.cutoff, lower, upper)
    )
    readings = _compute_readings(fits, alike, limits)
    if gained < _CERTAIN_DELTA_BIC and N_alone > 0.0:
        # With so many filters, one may be selected by chance.
        alone = math.log(N_alone / N)
        beside = fits.rounded * N**2 + after**2
        in_log = math.log(N_alone / compute_density_in_log(best.low_pass, N, beside, fits.rate))
        readings.append(Reading(_NO_FILTER_WEIGHT, alone, alone, alone, (in_log,) * 3))
    error = SIGMAS / math.sqrt(2.0 * float(fits.whittle.spectrum.ordinates.sum()))
    ends = [end for reading in readings for end in (reading.below, reading.above)]
    density = Parameter(
        N, lower=N * math.exp(min(0.0, *ends) - error), upper=N * math.exp(max(0.0, *ends) + error)
    )
    or_quantization = beside_rounding < _MIN_DELTA_BIC
    frequency = Parameter(shown, lower=lower, upper=upper)
    reason = None
    if or_quantization:
        reason = texts.filter_or_quantization(lower, upper)
    elif upper > MAX_LIMIT_RATIO * lower or highest:
        reason = texts.cutoff_range(lower, upper)
    elif not fits.explains(best):
        reason = texts.unknown_filter(len(FAMILY))
    if reason is not None:
        frequency, density = (
            replace(each, value=None, status="not_identified", reason=reason, fitted=each.value)
            for each in (frequency, density)
        )
    white, *slow = BinGains(spectrum)(best)
    return Cutoff(
        frequency,
        best.order,
        density,
        after,
        gained,
        or_quantization,
        best.kind,
        behind=Behind(white + fits.rounded + (after / N) ** 2, *slow),
        readings=readings,
        allowed=[
            Allowed(trial, max(0.5 * math.log(high / low), _MIN_HALF_WIDTH))
            for trial, (low, high) in zip(alike, limits, strict=True)
        ],
        rounded=fits.rounded,
    )


def _describe_no_filter(N_alone: float, gained: float, doubt: tuple[str, float] | None) -> Cutoff:
    """Return a result without a filter, or, with a ``doubt``, with an ambiguous one and its N."""
    absent = Parameter(None, "absent", texts.NO_FILTER)
    if doubt is None:
        return Cutoff(absent, None, Parameter(N_alone), 0.0, gained)
    reason, before = doubt
    low, high = sorted((N_alone, before))
    unknown = Parameter(None, "not_identified", reason, low, high, fitted=N_alone)
    frequency = replace(absent, status="not_identified", reason=reason)
    return Cutoff(frequency, None, unknown, 0.0, gained, or_process=reason, N_behind=before)


def _compute_readings(
    fits: FilterFits, alike: Sequence[FilterTrial], limits: Sequence[tuple[float, float]]
) -> list[Reading]:
    """Return N before each allowed filter over N of the best one, with the filter's weight."""
    best = alike[0]

    def densities(trial: FilterTrial) -> tuple[float, float]:
        N, after = fits.density(trial)
        beside = fits.rounded * N**2 + after**2
        return N, compute_density_in_log(trial.low_pass, N, beside, fits.rate)

    N, shown = densities(best)
    readings = []
    for trial, (low, high) in zip(alike, limits, strict=True):
        at = [densities(replace(trial, cutoff=cutoff)) for cutoff in (low, trial.cutoff, high)]
        below, middle, above = (math.log(max(density / N, _MIN_N_RATIO)) for density, _ in at)
        first, second, third = (math.log(max(density / shown, _MIN_N_RATIO)) for _, density in at)
        weight = math.exp(best.cost - trial.cost)
        readings.append(Reading(weight, below, middle, above, (first, second, third)))
    digital = [
        read_as_digital(reading, trial, fits.rate)
        for reading, trial in zip(readings, alike, strict=True)
        if trial.is_first_order_analogue
    ]
    return readings + digital


def _find_leaky_bins(
    spectrum: Spectrum, fits: FilterFits, best: FilterTrial, rounding: float
) -> NDArray[np.bool_]:
    """Return the bins that leakage dominates, or in which the gain of the filter varies."""
    N = fits.density(best)[0]
    gains, low_pass = BinGains(spectrum), best.low_pass
    within = gains.white(low_pass) + rounding / N**2
    white, leak = within.mean(axis=0), gains.leakage(low_pass)
    rules = (leak > _MAX_LEAKAGE_FRACTION * white) | (
        within.min(axis=0) < _MIN_GAIN_RATIO * within.max(axis=0)
    )
    return np.asarray(rules & (spectrum.density < _MAX_DENSITY_RATIO * N**2 * (white + leak)))


def _explain_ambiguity(
    fits: FilterFits,
    tried: Sequence[FilterTrial],
    cost_alone: float,
    gained: float,
    stated: float | None,
) -> tuple[str, float] | None:
    """Return a reason if a process may be a first-order filter, and N before it; else None."""
    first = next(
        (trial for trial in tried if trial.is_first_order_analogue and not trial.floor), None
    )
    if first is None or first.correlation(fits.rate) < MIN_PROCESS_SAMPLES:
        return None
    if stated is not None and 1.0 / _MAX_STATED_RATIO < first.cutoff / stated < _MAX_STATED_RATIO:
        return None
    leads = gained >= _MIN_DELTA_BIC and tried[0] == first
    if not leads and first.cost > cost_alone + _MIN_WHITE_GAIN:
        return None
    if not leads and gained >= _MIN_DELTA_BIC:
        return None  # another filter fits better than both
    time = 1.0 / (2.0 * math.pi * first.cutoff)
    return texts.process_or_filter(time, first.cutoff), fits.density(first)[0]


_MAX_LOG_SHIFT = math.log(2.0)  # Maximum change of log f_c by a joint fit
_SEARCH_HALF_WIDTHS = 6.0  # Range of the first search for a cut-off, in half widths of its interval
_RELATIVE_TOLERANCE = 0.04  # Tolerance of a cut-off over the half width of its interval
_MAX_DELTA_BIC = 6.0  # Above the best model, up to which a joint fit may change the order
_MIN_AKAIKE_WEIGHT = 0.03  # From which a model is fitted jointly; less than for intervals

_MIN_INTERVAL_WEIGHT = 0.05
"""Akaike weight from which a joint fit enters the interval of the cut-off."""


def select_joint_models(candidates: Sequence[Candidate], always: Terms) -> list[Candidate]:
    """Return the models to fit jointly with a cut-off, always with the model ``always``."""
    best = candidates[0]
    return [
        candidate
        for candidate in candidates
        if candidate.bic < best.bic + _MAX_DELTA_BIC
        or candidate.akaike_weight >= _MIN_AKAIKE_WEIGHT
        or candidate.terms == always
    ]


def refine_cutoff(
    low_pass: Cutoff, spectrum: Spectrum, clear: NDArray[np.bool_], candidates: Sequence[Candidate]
) -> Cutoff:
    """Return a low-pass whose cut-off is fitted together with all parameters of a model.

    The model is the best by BIC after joint fits; N under the others, and other allowed filters, is
    in ``models``. ``clear``, shape (b,), are the bins to fit. The candidates are fits with the
    present cut-off, best first; ramps are ignored.
    """
    if low_pass.kind is None or low_pass.behind is None or not candidates:
        return low_pass
    joint = _Joint(spectrum, clear, low_pass)
    tried: dict[Terms, list[_Fit]] = {}
    present = low_pass.allowed[0]
    bic: dict[Terms, float] = {}
    aic: dict[Terms, float] = {}
    for candidate in candidates:
        terms = replace(candidate.terms, ramp=False)
        if terms not in tried:
            tried[terms] = joint.fits(terms)
            common = joint.at(present, math.log(present.filter.cutoff), terms)
            gained = common.cost - tried[terms][0].cost
            bic[terms], aic[terms] = candidate.bic - 2.0 * gained, candidate.aic - 2.0 * gained
    chosen = min(bic, key=lambda terms: bic[terms])
    fit = tried[chosen][0]
    best, state = fit.allowed.at(fit.x), joint.at(fit.allowed, fit.x, chosen)
    models = {terms: joint.of_model(fits, fit) for terms, fits in tried.items()}
    likely = {terms: math.exp(0.5 * (aic[chosen] - aic[terms])) for terms in aic}
    least = _MIN_INTERVAL_WEIGHT * sum(likely.values())
    ends = [
        each.allowed.at(x).low_pass.half_power(spectrum.rate)
        for terms, fits in tried.items()
        if likely[terms] >= least or terms == chosen
        for each in fits
        for x in joint.limits(each)
    ]
    shown, lower, upper = best.low_pass.half_power(spectrum.rate), min(ends), max(ends)
    reason = None
    if upper > MAX_LIMIT_RATIO * lower:
        reason = texts.cutoff_range(lower, upper)
    elif not joint.explains(fit):
        reason = texts.unknown_filter(len(FAMILY))
    frequency = Parameter(shown, lower=lower, upper=upper)
    if reason is not None:
        frequency = Parameter(None, "not_identified", reason, lower, upper, fitted=shown)
    return replace(
        low_pass,
        frequency=frequency,
        kind=best.kind,
        order=best.order,
        floor=math.sqrt(state.floor + low_pass.rounded * state.N**2),
        behind=joint.behind(BinGains(spectrum), best, state.floor / state.N**2),
        readings=models[chosen].readings,
        allowed=[
            Allowed(each.allowed.at(each.x), each.allowed.half_width) for each in tried[chosen]
        ],
        models=models,
    )


@dataclass(frozen=True)
class _State:
    """-log L, N, and the squared density of white noise added after the filter, SI."""

    cost: float
    N: float
    floor: float


@dataclass(frozen=True)
class _Fit:
    """The best log cut-off for a filter and a model."""

    allowed: Allowed
    terms: Terms
    x: float
    cost: float


class _Joint:
    """Fits of models behind filters, over their cut-offs."""

    def __init__(self, spectrum: Spectrum, clear: NDArray[np.bool_], low_pass: Cutoff) -> None:
        self._low_pass = low_pass
        self._spectrum = spectrum.select(clear)
        self._gains = BinGains(self._spectrum)
        shortest = MIN_PROCESS_SAMPLES / spectrum.rate
        self._plain = make_whittle(self._spectrum, 0.5 * spectrum.rate, COARSE, shortest=shortest)
        self._states: dict[tuple[FilterTrial, float, Terms], _State] = {}

    def behind(self, gains: BinGains, trial: FilterTrial, floor: float = 0.0) -> Behind:
        """Return the gains of a filter, with the floor after it over N^2."""
        white, flicker, slow = gains(trial)
        return Behind(white + self._low_pass.rounded + floor, flicker, slow)

    def fits(self, terms: Terms) -> list[_Fit]:
        """Return the fits of a model with the allowed filters, best first."""
        fits = []
        for allowed in self._low_pass.allowed:
            around = math.log(allowed.filter.cutoff)
            for reach in (_SEARCH_HALF_WIDTHS * allowed.half_width, _MAX_LOG_SHIFT):
                best = minimize_scalar(
                    lambda x, allowed=allowed: self.at(allowed, x, terms).cost,
                    bounds=(around - reach, min(around + reach, self._get_highest(allowed))),
                    method="bounded",
                    options={"xatol": _RELATIVE_TOLERANCE * allowed.half_width},
                )
                if abs(best.x - around) < 0.9 * reach:
                    break
            fits.append(_Fit(allowed, terms, float(best.x), float(best.fun)))
        fits.sort(key=lambda fit: fit.cost + fit.allowed.filter.floor)
        return [fit for fit in fits if fit.cost < fits[0].cost + DELTA_LOG_LIKELIHOOD_EXCLUDED]

    def of_model(self, fits: Sequence[_Fit], chosen: _Fit) -> OfModel:
        """Return N under the filters in a model, relative to N at the selected cut-off."""
        terms = fits[0].terms
        common = self.at(chosen.allowed, chosen.x, terms)
        shown = self._compute_density_in_log(chosen.allowed, chosen.x, common)
        readings = []
        for fit in fits:
            low, high = self.limits(fit)
            places = low, fit.x, high
            states = [self.at(fit.allowed, x, terms) for x in places]
            below, at, above = (math.log(state.N / common.N) for state in states)
            first, second, third = (
                math.log(self._compute_density_in_log(fit.allowed, x, state) / shown)
                for x, state in zip(places, states, strict=True)
            )
            weight = math.exp(fits[0].cost - fit.cost)
            readings.append(Reading(weight, below, at, above, (first, second, third)))
            best = fit.allowed.at(fit.x)
            if best.is_first_order_analogue:
                readings.append(read_as_digital(readings[-1], best, self._spectrum.rate))
        return OfModel(readings, common.cost - fits[0].cost)

    def _compute_density_in_log(self, allowed: Allowed, x: float, state: _State) -> float:
        """Return the density of white noise in the log, at a logarithm of the cut-off."""
        beside = self._low_pass.rounded * state.N**2 + state.floor
        low_pass = allowed.at(x).low_pass
        return compute_density_in_log(low_pass, state.N, beside, self._spectrum.rate)

    def explains(self, fit: _Fit) -> bool:
        """Return whether a fit explains the spectrum where the filter bends it."""
        whittle, maximum = self._fit_maximum(fit.allowed, fit.x, fit.terms)
        return explains_bend(self._spectrum, whittle.density(maximum), fit.allowed.at(fit.x))

    def at(self, allowed: Allowed, x: float, terms: Terms) -> _State:
        """Return the best fit of a model at a logarithm of the cut-off."""
        key = allowed.filter, x, terms
        if key not in self._states:
            maximum = self._fit_maximum(allowed, x, terms)[1]
            floor = maximum.parameter("Q") ** 2 if allowed.filter.floor else 0.0
            N = max(maximum.parameter("N"), _MIN_N_RATIO * math.sqrt(self._plain.scale))
            self._states[key] = _State(maximum.cost, N, floor)
        return self._states[key]

    def _fit_maximum(self, allowed: Allowed, x: float, terms: Terms) -> tuple[Whittle, Maximum]:
        whittle = self._plain.standing(self.behind(self._gains, allowed.at(x)))
        if allowed.filter.floor:
            # The column of quantization noise is used for white noise after the filter.
            whittle = whittle.with_column("Q", np.ones(len(self._spectrum.density)))
            terms = replace(terms, linear="Q" + terms.linear)
        return whittle, whittle.maximum(terms)

    def limits(self, fit: _Fit) -> tuple[float, float]:
        """Return the ends of the 95 % interval of the logarithm of the cut-off."""
        most = fit.cost + HALF_CHI_SQUARED

        def beyond(x: float) -> float:
            return self.at(fit.allowed, x, fit.terms).cost - most

        highest = self._get_highest(fit.allowed)

        def end(sign: float) -> float:
            inside, step = fit.x, fit.allowed.half_width
            while abs(inside - fit.x) < _MAX_LOG_SHIFT:
                outside = inside + sign * step
                if outside >= highest:
                    return highest
                if beyond(outside) > 0.0:
                    return float(brentq(beyond, inside, outside, xtol=_RELATIVE_TOLERANCE * step))
                inside, step = outside, 2.0 * step
            return inside

        return end(-1.0), end(1.0)

    def _get_highest(self, allowed: Allowed) -> float:
        trial = allowed.filter
        return math.log(get_highest_cutoff(trial.kind, trial.order, self._spectrum.rate))
