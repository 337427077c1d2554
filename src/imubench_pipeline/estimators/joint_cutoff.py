"""Joint fit of the cut-off of a low-pass filter and the parameters of a noise model.

The slope of a process or of flicker noise affects the fitted cut-off: each noise model has its own
cut-off, and its own N before the filter.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from imubench_pipeline.estimators.cutoff import (
    DELTA_LOG_LIKELIHOOD_EXCLUDED,
    MAX_LIMIT_RATIO,
    Cutoff,
)
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.filter_fits import (
    FAMILY,
    HALF_CHI_SQUARED,
    MIN_PROCESS_SAMPLES,
    Allowed,
    BinGains,
    FilterTrial,
    OfModel,
    Reading,
    compute_density_in_log,
    explains_bend,
    get_highest_cutoff,
    read_as_digital,
)
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
from imubench_pipeline.words.reasons import spectra as texts

_MAX_LOG_SHIFT = math.log(2.0)  # Maximum change of log f_c by a joint fit
_SEARCH_HALF_WIDTHS = 6.0  # Range of the first search for a cut-off, in half widths of its interval
_RELATIVE_TOLERANCE = 0.04  # Tolerance of a cut-off over the half width of its interval
_MAX_DELTA_BIC = 6.0  # Above the best model, up to which a joint fit may change the order
_MIN_AKAIKE_WEIGHT = 0.03  # From which a model is fitted jointly; less than for intervals
_MIN_N_RATIO = 1e-6  # Minimum N over the density of the log, instead of 0

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
