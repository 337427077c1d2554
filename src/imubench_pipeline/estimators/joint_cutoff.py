"""The cut-off of a low-pass fitted together with the noise behind it.

What stands behind a filter bends its spectrum too: how a process or flicker noise falls decides
what is left for the filter. Each model of the noise has a cut-off of its own, and an N before the
filter that goes with it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar

from imubench_pipeline.estimators.cutoff import ALLOWED, NOT_AS_BEHIND, RULED_OUT, WIDEST, Cutoff
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.filter_fits import (
    HALF_CHI_SQUARED,
    PROCESSES,
    Allowed,
    BinGains,
    FilterTrial,
    OfModel,
    Reading,
    also_after_sampling,
    density_in_the_log,
    explains_bend,
    highest_cutoff,
)
from imubench_pipeline.estimators.model_choice import Candidate
from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.estimators.whittle import COARSE, Behind, Maximum, Terms, Whittle, whittle_of

_REFINED_WITHIN = math.log(2.0)
"""Distance in log f_c that a joint fit with the noise may move the cut-off."""

_REACH = 6.0
"""Half widths of the interval of a cut-off within which it is looked for first."""

_FINE = 0.04
"""Part of that half width to which a cut-off is found."""

_WORTH_JOINING = 6.0
"""BIC over the best up to which a model may be the best with a cut-off of its own."""

_LEAST_SHARE = 0.03
"""Share by AIC from which one enters intervals, and to spare."""

_LEAST_N = 1e-6
"""N that stands for none, over the density of the log."""

_SHARE = 0.05
"""Share by AIC, with its own cut-off, from which a model has a part in the interval of that."""


def worth_joining(candidates: Sequence[Candidate], always: Terms) -> list[Candidate]:
    """Return the models for which the cut-off of a filter is fitted, the best first, as they come.

    ``always`` is one of them in any case.
    """
    best = candidates[0]
    return [
        candidate
        for candidate in candidates
        if candidate.bic < best.bic + _WORTH_JOINING
        or candidate.akaike_weight >= _LEAST_SHARE
        or candidate.terms == always
    ]


def refine_cutoff(
    low_pass: Cutoff, spectrum: Spectrum, clear: NDArray[np.bool_], candidates: Sequence[Candidate]
) -> Cutoff:
    """Return a low-pass whose cut-off is fitted together with all parameters of a model.

    Of the models, that which is the best by BIC with a cut-off of its own; what the others, and
    other filters that the log allows, make of N is in ``models``. ``clear``, shape (b,), are the
    bins that no line touches, and in which the ends of the transform do not rule. The candidates
    come with the cut-off as it is, the best first; of a ramp nothing is taken.
    """
    if low_pass.kind is None or low_pass.behind is None or not candidates:
        return low_pass
    joint = _Joint(spectrum, clear, low_pass)
    tried: dict[Terms, list[_Fit]] = {}
    bic: dict[Terms, float] = {}
    aic: dict[Terms, float] = {}
    for candidate in candidates:
        terms = replace(candidate.terms, ramp=False)
        if terms not in tried:
            tried[terms] = joint.fits(terms)
            gained = joint.common(terms) - tried[terms][0].cost
            bic[terms], aic[terms] = candidate.bic - 2.0 * gained, candidate.aic - 2.0 * gained
    chosen = min(bic, key=lambda terms: bic[terms])
    fit = tried[chosen][0]
    models = {terms: joint.of_model(fits, fit) for terms, fits in tried.items()}
    likely = {terms: math.exp(0.5 * (aic[chosen] - aic[terms])) for terms in aic}
    least = _SHARE * sum(likely.values())
    ends = [
        each.allowed.at(x).low_pass.half_power(spectrum.rate)
        for terms, fits in tried.items()
        if likely[terms] >= least or terms == chosen
        for each in fits
        for x in joint.limits(each)
    ]
    best, state = fit.allowed.at(fit.x), joint.at(fit.allowed, fit.x, chosen)
    return replace(
        low_pass,
        frequency=_as_parameter(best.low_pass.half_power(spectrum.rate), ends, joint.explains(fit)),
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


def _as_parameter(shown: float, ends: Sequence[float], explains: bool) -> Parameter:
    """Return a cut-off with its limits, or why it is not told."""
    lower, upper = min(ends), max(ends)
    if upper > WIDEST * lower:
        reason = ALLOWED.format(lower, upper)
    elif not explains:
        reason = NOT_AS_BEHIND
    else:
        return Parameter(shown, lower=lower, upper=upper)
    return Parameter(None, "not_identified", reason, lower, upper, fitted=shown)


@dataclass(frozen=True)
class _State:
    """-log L, N and what of white noise stands behind the filter (SI, squared)."""

    cost: float
    N: float
    floor: float


@dataclass(frozen=True)
class _Fit:
    """The best logarithm of a cut-off for a filter and a model."""

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
        shortest = PROCESSES / spectrum.rate
        self._plain = whittle_of(self._spectrum, 0.5 * spectrum.rate, COARSE, shortest=shortest)
        self._states: dict[tuple[FilterTrial, float, Terms], _State] = {}

    def behind(self, gains: BinGains, trial: FilterTrial, floor: float = 0.0) -> Behind:
        """Return what a filter leaves, with what stands behind it in parts of N^2."""
        white, flicker, slow = gains(trial)
        return Behind(white + self._low_pass.rounded + floor, flicker, slow)

    def fits(self, terms: Terms) -> list[_Fit]:
        """Return the fits of a model behind the filters that the log allows, the best first."""
        fits = [self._best(allowed, terms) for allowed in self._low_pass.allowed]
        fits.sort(key=lambda fit: fit.cost + fit.allowed.filter.floor)
        return [fit for fit in fits if fit.cost < fits[0].cost + RULED_OUT]

    def common(self, terms: Terms) -> float:
        """Return -log L of a model at the cut-off that is common to all so far."""
        chosen = self._low_pass.allowed[0]
        return self.at(chosen, math.log(chosen.filter.cutoff), terms).cost

    def of_model(self, fits: Sequence[_Fit], chosen: _Fit) -> OfModel:
        """Return what the filters make of N in a model, over it at a chosen cut-off."""
        terms = fits[0].terms
        common = self.at(chosen.allowed, chosen.x, terms)
        shown = self._in_the_log(chosen.allowed, chosen.x, common)
        readings = []
        for fit in fits:
            low, high = self.limits(fit)
            places = low, fit.x, high
            states = [self.at(fit.allowed, x, terms) for x in places]
            below, at, above = (math.log(state.N / common.N) for state in states)
            first, second, third = (
                math.log(self._in_the_log(fit.allowed, x, state) / shown)
                for x, state in zip(places, states, strict=True)
            )
            weight = math.exp(fits[0].cost - fit.cost)
            readings.append(Reading(weight, below, at, above, (first, second, third)))
            best = fit.allowed.at(fit.x)
            if best.is_first_order_analogue:
                readings.append(also_after_sampling(readings[-1], best, self._spectrum.rate))
        return OfModel(readings, common.cost - fits[0].cost)

    def _in_the_log(self, allowed: Allowed, x: float, state: _State) -> float:
        """Return the density of white noise in the log, at a logarithm of the cut-off."""
        beside = self._low_pass.rounded * state.N**2 + state.floor
        low_pass = allowed.at(x).low_pass
        return density_in_the_log(low_pass, state.N, beside, self._spectrum.rate)

    def explains(self, fit: _Fit) -> bool:
        """Return whether a fit gives the spectrum where it bends."""
        whittle, maximum = self._maximum(fit.allowed, fit.x, fit.terms)
        return explains_bend(self._spectrum, whittle.density(maximum), fit.allowed.at(fit.x))

    def at(self, allowed: Allowed, x: float, terms: Terms) -> _State:
        """Return the best fit of a model at a logarithm of the cut-off."""
        key = allowed.filter, x, terms
        if key not in self._states:
            maximum = self._maximum(allowed, x, terms)[1]
            floor = maximum.parameter("Q") ** 2 if allowed.filter.floor else 0.0
            N = max(maximum.parameter("N"), _LEAST_N * math.sqrt(self._plain.scale))
            self._states[key] = _State(maximum.cost, N, floor)
        return self._states[key]

    def _maximum(self, allowed: Allowed, x: float, terms: Terms) -> tuple[Whittle, Maximum]:
        whittle = self._plain.standing(self.behind(self._gains, allowed.at(x)))
        if allowed.filter.floor:
            # White noise behind the filter stands where quantization noise would.
            whittle = whittle.with_column("Q", np.ones(len(self._spectrum.density)))
            terms = replace(terms, linear="Q" + terms.linear)
        return whittle, whittle.maximum(terms)

    def limits(self, fit: _Fit) -> tuple[float, float]:
        """Return the ends of the 95 % interval of the logarithm of the cut-off."""
        most = fit.cost + HALF_CHI_SQUARED

        def beyond(x: float) -> float:
            return self.at(fit.allowed, x, fit.terms).cost - most

        highest = self._highest(fit.allowed)

        def end(sign: float) -> float:
            inside, step = fit.x, fit.allowed.half_width
            while abs(inside - fit.x) < _REFINED_WITHIN:
                outside = inside + sign * step
                if outside >= highest:
                    return highest
                if beyond(outside) > 0.0:
                    return float(brentq(beyond, inside, outside, xtol=_FINE * step))
                inside, step = outside, 2.0 * step
            return inside

        return end(-1.0), end(1.0)

    def _highest(self, allowed: Allowed) -> float:
        trial = allowed.filter
        return math.log(highest_cutoff(trial.kind, trial.order, self._spectrum.rate))

    def _best(self, allowed: Allowed, terms: Terms) -> _Fit:
        around = math.log(allowed.filter.cutoff)
        for reach in (_REACH * allowed.half_width, _REFINED_WITHIN):
            best = minimize_scalar(
                lambda x: self.at(allowed, x, terms).cost,
                bounds=(around - reach, min(around + reach, self._highest(allowed))),
                method="bounded",
                options={"xatol": _FINE * allowed.half_width},
            )
            if abs(best.x - around) < 0.9 * reach:
                break
        return _Fit(allowed, terms, float(best.x), float(best.fun))
