"""Describe a likelihood fit: values, 95 % intervals, and which parameters are identified."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from imubench_pipeline.estimators.estimate import FAMILY, Estimate, Parameter
from imubench_pipeline.estimators.frame import FitSelection
from imubench_pipeline.estimators.identifiability import find_durations_needed, list_parameter_names
from imubench_pipeline.estimators.model_choice import Candidate
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.whittle import Terms, Whittle
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import estimates as texts

_AT_BOUND = 0.985
_ABOUT_AS_GOOD = 2.0


def add_upper_limits(
    estimate: Estimate,
    alike: Sequence[Candidate],
    wider: Sequence[Candidate],
    draws: dict[Terms, Posterior],
) -> Estimate:
    """Return an estimate with limits of the K and B that its model does not have.

    ``not_identified``, with its interval, where a model that has the term is about as good as the
    chosen one; else ``absent``, with an upper limit. ``alike`` are the models that the log does not
    rule out, the chosen one first; ``wider`` those with a random walk, or with one bias
    instability, in addition to its terms.
    """
    parameters = dict(estimate.parameters)
    for name in ("K", "B"):
        if parameters[name].status != "absent":
            continue
        having = [c.terms for c in (*wider, *alike) if name in list_parameter_names(c.terms)]
        if not having:
            continue
        upper = max(float(np.quantile(_draws_of(name, terms, draws), 0.975)) for terms in having)
        good = []
        for other in alike[1:]:
            powers = dict(
                zip(list_parameter_names(other.terms), other.maximum.powers, strict=False)
            )
            if is_as_good(other, alike[0]) and powers.get(name, 0.0) > 0.0:
                good.append(other)
        if not good:
            parameters[name] = Parameter(None, "absent", texts.ABSENT_BELOW, 0.0, upper)
            continue
        reason = texts.models_alike([c.terms.name for c in good], alike[0].terms.name)
        parameters[name] = Parameter(None, "not_identified", reason, 0.0, upper)
        timed = [c.terms for c in good if "T_B" in list_parameter_names(c.terms)]
        if name == "B" and timed:
            drawn = [_draws_of("T_B", terms, draws) for terms in timed]
            low = min(float(np.quantile(times, 0.025)) for times in drawn)
            high = max(float(np.quantile(times, 0.975)) for times in drawn)
            parameters["T_B"] = Parameter(None, "not_identified", reason, low, high)
    return replace(estimate, parameters=parameters)


def is_as_good(other: Candidate, chosen: Candidate) -> bool:
    """Return whether a model is about as good as the chosen one: by AIC, or hardly worse by BIC.

    A difference of 2 is not worth more than a bare mention (R. Kass and A. Raftery, J. Am. Stat.
    Assoc. 90, 1995).
    """
    return other.aic <= chosen.aic or other.bic <= chosen.bic + _ABOUT_AS_GOOD


def describe(
    method: str,
    whittle: Whittle,
    chosen: Candidate,
    alike: Sequence[Candidate],
    draws: dict[Terms, Posterior],
    frame: FitSelection,
) -> Estimate:
    """Describe a fit: values with intervals, what is not identified, and what is absent.

    The intervals of all parameters cover the models ``alike``, ``chosen`` among them, weighted by
    AIC. K is the median over them: they share the power of the lowest frequencies in different
    ways, and the median is a fifth nearer to the truth than a single model where K is poorly known.
    """
    maximum = chosen.maximum
    names = list_parameter_names(maximum.terms)
    values = [*np.sqrt(maximum.powers), *maximum.times] + [maximum.ramp] * maximum.terms.ramp
    if "N" in names:
        values[names.index("N")] *= math.sqrt(frame.folding)
    needed = find_durations_needed(
        maximum, whittle.spectrum.rate, float(whittle.spectrum.duration), frame.band.highest
    )
    described: dict[str, Parameter] = {}
    for i, (name, value) in enumerate(zip(names, values, strict=True)):
        # The interval of the chosen model lies inside: AIC, against a model that fits as well,
        # prefers a process as slow as a walk to the walk.
        own = [(_draws_of(name, chosen.terms, draws), 1.0)]
        lower, upper = compute_mixture_limits(_over_models(name, chosen, alike, draws), own)
        if value == 0.0:
            described[name] = Parameter(None, "absent", texts.ABSENT_BELOW, 0.0, upper)
            continue
        # At the end of a search, or where draws are few, the best value lies at the edge.
        limits = min(lower, float(value)), max(upper, float(value))
        described[name] = Parameter(float(value), "ok", None, *limits, needed[i])
        longest, shortest = whittle.longest, whittle.shortest
        at_longest, at_shortest = value > longest * _AT_BOUND, value < shortest / _AT_BOUND
        if name.startswith("T_B") and (at_longest or at_shortest):
            bound = longest if at_longest else shortest
            reason = texts.correlation_bound(bound, longest=bool(at_longest))
            described[name] = replace(described[name], status="at_bound", reason=reason)
    if "K" in described and described["K"].checked().status == "ok":
        weighted_draws = _over_models("K", chosen, alike, draws)
        if len(weighted_draws) > 1:
            (median,) = compute_mixture_quantiles(weighted_draws, 0.5)
            described["K"] = replace(described["K"], value=median)
    for number in ("", " 2"):
        if f"B{number}" in described and described[f"B{number}"].status == "absent":
            bias = described[f"B{number}"]
            described[f"T_B{number}"] = replace(bias, lower=None, upper=None, duration_needed=None)
    absent = Parameter(None, "absent", texts.ABSENT)
    parameters = {name: described.get(name, absent) for name in FAMILY}
    if "B" in described and "T_B" not in described:
        parameters["T_B"] = Parameter(None, "absent", texts.FLICKER_WITHOUT_TIME)
    second = "B 2" in described
    further = [{"B": described["B 2"], "T_B": described["T_B 2"]}] if second else []
    return Estimate(method, parameters, further)


def _over_models(
    name: str, chosen: Candidate, alike: Sequence[Candidate], draws: dict[Terms, Posterior]
) -> list[tuple[Array, float]]:
    """Return the draws of a parameter in each model in which it means the same, with weights."""

    def is_comparable(terms: Terms, other: Terms) -> bool:
        if name not in list_parameter_names(other):
            return False
        # One bias instability is one level, flicker or not; of several each has its own.
        single = name == "B" and sum(terms.biases) == sum(other.biases) == 1
        return name[0] not in "BT" or terms.biases == other.biases or single

    return [
        (_draws_of(name, candidate.terms, draws), math.exp(0.5 * (chosen.aic - candidate.aic)))
        for candidate in alike
        if is_comparable(chosen.terms, candidate.terms)
    ]


def compute_mixture_quantiles(
    parts: Sequence[tuple[Array, float]], *levels: float
) -> tuple[float, ...]:
    """Return quantiles of draws that come from several models, each with its weight."""
    if len(parts) == 1:
        return tuple(np.quantile(parts[0][0], levels).tolist())  # without the sorting
    values = np.concatenate([part for part, _ in parts])
    mass = np.concatenate([np.full(len(part), weight / len(part)) for part, weight in parts])
    order = np.argsort(values, kind="stable")
    share = np.cumsum(mass[order])
    places = np.minimum(np.searchsorted(share / share[-1], levels), len(values) - 1)
    return tuple(values[order[places]].tolist())


def compute_mixture_limits(
    parts: Sequence[tuple[Array, float]], own: Sequence[tuple[Array, float]]
) -> tuple[float, float]:
    """Return the 95 % limits of draws of several models; those of one of them lie inside."""
    lower, upper = compute_mixture_quantiles(parts, 0.025, 0.975)
    own_lower, own_upper = compute_mixture_quantiles(own, 0.025, 0.975)
    return min(lower, own_lower), max(upper, own_upper)


def _draws_of(name: str, terms: Terms, draws: dict[Terms, Posterior]) -> Array:
    """Return the draws of a parameter of a model."""
    posterior = draws[terms]
    columns = np.column_stack([posterior.parameters, posterior.times, posterior.ramps])
    return np.asarray(columns[:, list_parameter_names(terms).index(name)])
