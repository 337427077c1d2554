"""What a likelihood fit says of each parameter: value, 95 % interval, and whether it is known."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from imubench_pipeline.estimators.estimate import FAMILY, Estimate, Parameter
from imubench_pipeline.estimators.frame import FitSelection
from imubench_pipeline.estimators.identifiability import durations_needed, parameter_names
from imubench_pipeline.estimators.model_choice import Candidate
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.whittle import Maximum, Terms, Whittle
from imubench_pipeline.typing import Array

_AT_BOUND = 0.985
_ABOUT_AS_GOOD = 2.0

_ABSENT = "the data do not ask for it"
_ABSENT_BELOW = f"{_ABSENT}; with 95 % it is below the upper limit"


def with_upper_limits(
    estimate: Estimate,
    alike: Sequence[Candidate],
    wider: Sequence[Candidate],
    draws: dict[Terms, Posterior],
) -> Estimate:
    """Return an estimate that says of the K and B that its model does not have what is known.

    Where a model that has one is about as good as the chosen one it is ``not_identified``, with its
    interval; else ``absent``, with an upper limit. ``alike`` are the models that the log does not
    rule out, the chosen one first; ``wider`` those with a random walk, or with one bias
    instability, beside its terms.
    """
    parameters = dict(estimate.parameters)
    for name in ("K", "B"):
        if parameters[name].status != "absent":
            continue
        having = [candidate for candidate in (*wider, *alike) if _has(name, candidate.terms)]
        if not having:
            continue
        limits = [
            float(np.quantile(_draws_of(name, candidate.terms, draws), 0.975))
            for candidate in having
        ]
        good = [
            candidate
            for candidate in alike[1:]
            if as_good(candidate, alike[0]) and _in_model(name, candidate.maximum)
        ]
        if not good:
            parameters[name] = Parameter(None, "absent", _ABSENT_BELOW, 0.0, max(limits))
            continue
        names = " and ".join(candidate.terms.name for candidate in good)
        verb = "is" if len(good) == 1 else "are"
        reason = f"{names}, which {'has' if len(good) == 1 else 'have'} it, {verb} about as good"
        reason += f" as {alike[0].terms.name}; only its interval is given"
        parameters[name] = Parameter(None, "not_identified", reason, 0.0, max(limits))
        timed = [candidate.terms for candidate in good if _has("T_B", candidate.terms)]
        times = [_draws_of("T_B", terms, draws) for terms in timed]
        if name == "B" and times:
            ends = [np.quantile(drawn_times, (0.025, 0.975)) for drawn_times in times]
            low, high = float(min(end[0] for end in ends)), float(max(end[1] for end in ends))
            parameters["T_B"] = Parameter(None, "not_identified", reason, low, high)
    return replace(estimate, parameters=parameters)


def as_good(other: Candidate, chosen: Candidate) -> bool:
    """Tell whether a model is about as good as the chosen one: AIC favours it, or BIC hardly less.

    A difference of 2 is not worth more than a bare mention (R. Kass and A. Raftery, J. Am. Stat.
    Assoc. 90, 1995).
    """
    return other.aic <= chosen.aic or other.bic <= chosen.bic + _ABOUT_AS_GOOD


def _in_model(name: str, maximum: Maximum) -> bool:
    """Tell whether a fit has a parameter above 0."""
    names = parameter_names(maximum.terms)
    return name in names and bool(maximum.powers[names.index(name)] > 0.0)


def papers_only(parameters: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """Return the four parameters of the papers' model."""
    return {name: parameters[name] for name in ("N", "B", "T_B", "K")}


def describe(
    method: str,
    whittle: Whittle,
    chosen: Candidate,
    alike: Sequence[Candidate],
    draws: dict[Terms, Posterior],
    frame: FitSelection,
) -> Estimate:
    """Describe a fit: values with intervals, what is not identified, and what is absent.

    Of all the family's parameters. The intervals go over the models ``alike``, ``chosen`` among
    them, by their shares. K is the median over them: they share the power of the lowest frequencies
    in different ways, and it is a fifth nearer to the truth than that of one of them where it is
    known badly.
    """
    maximum = chosen.maximum
    names = parameter_names(maximum.terms)
    values = [*np.sqrt(maximum.powers), *maximum.times] + [maximum.ramp] * maximum.terms.ramp
    if "N" in names:
        values[names.index("N")] *= math.sqrt(frame.folding)
    needed = durations_needed(
        maximum, whittle.spectrum.rate, float(whittle.spectrum.duration), frame.band.highest
    )
    described: dict[str, Parameter] = {}
    for i, (name, value) in enumerate(zip(names, values, strict=True)):
        lower, upper = _interval(name, chosen, alike, draws)
        described[name] = _parameter(name, float(value), lower, upper, needed[i], whittle)
    if "K" in described and described["K"].checked().status == "ok":
        weighted_draws = _over_models("K", chosen, alike, draws)
        if len(weighted_draws) > 1:
            median = mixture_quantile(weighted_draws, 0.5)
            described["K"] = replace(described["K"], value=median)
    for number in ("", " 2"):
        if f"B{number}" in described and described[f"B{number}"].status == "absent":
            described[f"T_B{number}"] = replace(
                described[f"B{number}"], lower=None, upper=None, duration_needed=None
            )
    absent = Parameter(None, "absent", _ABSENT)
    parameters = {name: described.get(name, absent) for name in FAMILY}
    if "B" in described and "T_B" not in described:
        parameters["T_B"] = Parameter(
            None, "absent", "bias instability is flicker noise here, which has no correlation time"
        )
    further = []
    if "B 2" in described:
        further.append({"B": described["B 2"], "T_B": described["T_B 2"]})
    return Estimate(method, parameters, further)


def _parameter(
    name: str,
    value: float,
    lower: float,
    upper: float,
    needed: float | None,
    whittle: Whittle,
) -> Parameter:
    if value == 0.0:
        return Parameter(None, "absent", _ABSENT_BELOW, 0.0, upper)
    # At the end of a search, or where draws are few, the best value lies at the edge.
    lower, upper = min(lower, value), max(upper, value)
    if name.startswith("T_B"):
        for bound, end in ((whittle.longest, "longest"), (whittle.shortest, "shortest")):
            near = value > bound * _AT_BOUND if end == "longest" else value < bound / _AT_BOUND
            if near:
                reason = f"the {end} correlation time that the log can show is {bound:.4g} s"
                return Parameter(value, "at_bound", reason, lower, upper, needed)
    return Parameter(value, "ok", None, lower, upper, needed)


def _interval(
    name: str, chosen: Candidate, alike: Sequence[Candidate], draws: dict[Terms, Posterior]
) -> tuple[float, float]:
    """Return the 95 % interval of a parameter, over the models that have it, by their AIC.

    That of the chosen model lies inside: of models that the log hardly tells apart, AIC likes a
    process that is as slow as a walk better than the walk.
    """
    own = [(_draws_of(name, chosen.terms, draws), 1.0)]
    return mixture_limits(_over_models(name, chosen, alike, draws), own)


def _over_models(
    name: str, chosen: Candidate, alike: Sequence[Candidate], draws: dict[Terms, Posterior]
) -> list[tuple[Array, float]]:
    """Return the draws of a parameter in each model that has it, with the weight of the model."""
    terms = chosen.terms
    return [
        (_draws_of(name, candidate.terms, draws), math.exp(0.5 * (chosen.aic - candidate.aic)))
        for candidate in alike
        if candidate.terms == terms or _comparable(name, terms, candidate.terms)
    ]


def mixture_quantile(parts: Sequence[tuple[Array, float]], level: float) -> float:
    """Return a quantile of draws that come from several models, each with its weight."""
    if len(parts) == 1:
        return float(np.quantile(parts[0][0], level))  # without the sorting
    values = np.concatenate([part for part, _ in parts])
    mass = np.concatenate([np.full(len(part), weight / len(part)) for part, weight in parts])
    order = np.argsort(values, kind="stable")
    share = np.cumsum(mass[order])
    place = np.searchsorted(share / share[-1], level)
    return float(values[order][min(int(place), len(values) - 1)])


def mixture_limits(
    parts: Sequence[tuple[Array, float]], own: Sequence[tuple[Array, float]]
) -> tuple[float, float]:
    """Return the 95 % limits of draws of several models; those of one of them lie inside."""
    return (
        min(mixture_quantile(parts, 0.025), mixture_quantile(own, 0.025)),
        max(mixture_quantile(parts, 0.975), mixture_quantile(own, 0.975)),
    )


def _draws_of(name: str, terms: Terms, draws: dict[Terms, Posterior]) -> Array:
    """Return the draws of a parameter of a model."""
    posterior = draws[terms]
    columns = np.column_stack([posterior.parameters, posterior.times, posterior.ramps])
    return np.asarray(columns[:, parameter_names(terms).index(name)])


def _has(name: str, terms: Terms) -> bool:
    return name in parameter_names(terms)


def _comparable(name: str, terms: Terms, other: Terms) -> bool:
    """Tell whether a parameter means the same in two models."""
    if not _has(name, other):
        return False
    if not name.startswith(("B", "T_B")):
        return True
    # One bias instability is one level, flicker or not; of several each has its own.
    single = sum(terms.biases) == sum(other.biases) == 1
    return terms.biases == other.biases or (name == "B" and single)
