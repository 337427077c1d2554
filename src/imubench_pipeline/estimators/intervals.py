"""Describe a likelihood fit: values, 95 % intervals, and which parameters are identified.

The Cramér-Rao bounds are from the information of the Whittle likelihood, I_ij = 1/2 sum_k nu_k
d_i log S_k d_j log S_k, nu_k ordinates in bin k of density S_k (P. Whittle, Ark. Mat. 2, 1953).
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from imubench_pipeline.estimators.estimate import FAMILY, Estimate, Parameter
from imubench_pipeline.estimators.model_choice import Candidate
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.spectrum import SINGLE, WIDTH, Spectrum
from imubench_pipeline.estimators.whittle import Maximum, Terms, Whittle
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import estimates as texts

TARGET_RELATIVE_ERROR = 0.1
"""Relative standard deviation at which `find_durations_needed` calls a parameter known."""

_DURATION_RATIOS = np.geomspace(1e-4, 1e4, 17)  # Durations tried over the duration of the log


def compute_relative_bounds(whittle: Whittle, maximum: Maximum) -> Array:
    """Return relative Cramér-Rao bounds of the parameters, T_B and R, (m,); infinite if 0."""
    sensitivity = whittle.sensitivity(maximum)
    if maximum.terms.ramp:
        sensitivity[-1] *= maximum.ramp
    bounds = np.full(len(sensitivity), np.inf)
    size = np.linalg.norm(sensitivity, axis=1)
    sensitive = size > 1e-9
    if sensitive.any():
        # QR of the sensitivities: forming the information would square their condition number.
        root = np.linalg.qr((sensitivity[sensitive] / size[sensitive, None]).T, mode="r")
        if np.abs(np.diag(root)).min() > 0.0:
            inverse = np.linalg.inv(root)
            bounds[sensitive] = np.linalg.norm(inverse, axis=1) / size[sensitive]
    return bounds


def make_ideal_spectrum(rate: float, duration: float, highest: float) -> Spectrum:
    """Return the bins of a gapless log of a duration, s, up to ``highest``, Hz, without data."""
    samples = math.floor(rate * duration + 1e-6)
    count = min(math.floor(2.0 * highest * duration + 1e-6), samples - 1)
    edges = list(range(1, min(SINGLE, count) + 1))
    while edges[-1] < count:
        edges.append(min(max(edges[-1] + 1, int(edges[-1] * WIDTH)), count))
    first = np.array([*edges[:-1], count] if count <= SINGLE else edges[:-1], dtype=np.float64)
    last = np.append(first[1:], count + 1.0) - 1.0
    frequency = (first + last) / 4.0 / duration
    odd = np.where((first == last) & (first % 2 == 1), 1.0, 0.0)
    return Spectrum(
        frequency=frequency,
        lower=(first - 0.5) / 2.0 / duration,
        upper=(last + 0.5) / 2.0 / duration,
        ordinates=last - first + 1.0,
        density=np.ones(len(first)),
        block=np.ones(len(first), dtype=np.int64),
        length=np.full(len(first), duration),
        # The coefficients of a unit ramp, for k << L.
        ramp=odd * 8.0 * duration**3 / (np.pi * np.maximum(first, 1.0)) ** 4,
        cross=np.zeros(len(first)),
        rate=rate,
        duration=duration,
        mean=0.0,
    )


def compute_cramer_rao_bounds(
    model: NoiseModel, rate: float, duration: float, highest: float
) -> dict[str, float]:
    """Return relative Cramér-Rao bounds by parameter name, for a log of a duration, s."""
    values = {"Q": model.Q, "N": model.N, "F": 0.0 if model.T_B else model.B, "K": model.K}
    letters = "".join(letter for letter, value in values.items() if value > 0)
    processes = [(model.B, model.T_B)] if model.B > 0 and model.T_B else []
    processes += [(process.B, process.T_B) for process in model.further_processes]
    processes.sort(key=lambda process: process[1])
    powers = [values[letter] ** 2 for letter in letters] + [B**2 for B, _ in processes]
    times = np.array([time for _, time in processes], dtype=np.float64)
    terms = Terms(letters, len(processes), model.R != 0)
    maximum = Maximum(terms, np.array(powers), times, model.R, 0.0)
    errors = _compute_relative_errors(make_ideal_spectrum(rate, duration, highest), maximum)
    return dict(zip(list_parameter_names(terms), errors, strict=True))


def list_parameter_names(terms: Terms) -> list[str]:
    """Return the names of the parameters in the order of the bounds; ``B 2`` is a second B."""
    names = ["B" if letter == "F" else letter for letter in terms.linear]
    offset = "F" in terms.linear
    numbers = [f" {i}" if i > 1 else "" for i in range(1 + offset, 1 + offset + terms.gauss_markov)]
    names += [f"B{number}" for number in numbers] + [f"T_B{number}" for number in numbers]
    return names + ["R"] * terms.ramp


def find_durations_needed(
    maximum: Maximum, rate: float, duration: float, highest: float
) -> list[float | None]:
    """Return the log duration, s, that determines each parameter to a tenth; None if none does."""
    lengths = duration * _DURATION_RATIOS
    lengths = lengths[lengths * 2.0 * min(highest, 0.5 * rate) > 4.0 * maximum.terms.parameters]
    errors = [
        _compute_relative_errors(make_ideal_spectrum(rate, length, highest), maximum)
        for length in lengths.tolist()
    ]
    logarithms, needed = np.log(lengths), list[float | None]()
    for column in np.array(errors).T:
        # The length from which the excess stays at or below 0, interpolated.
        excess = np.log(column / TARGET_RELATIVE_ERROR)
        low = int(np.flatnonzero(excess > 0.0).max(initial=-1))
        if low == len(excess) - 1:
            needed.append(None)
            continue
        reached = logarithms[low + 1]
        if low >= 0 and np.isfinite(excess[low]):
            part = excess[low] / (excess[low] - excess[low + 1])
            reached = logarithms[low] + part * (reached - logarithms[low])
        needed.append(float(np.exp(reached)))
    return needed


def _compute_relative_errors(spectrum: Spectrum, maximum: Maximum) -> Array:
    times = maximum.times if len(maximum.times) else np.array([1.0])
    whittle = _UntabulatedWhittle(spectrum, float(times[0]) / 2.0, float(times[-1]) * 2.0)
    return compute_relative_bounds(whittle, maximum)


class _UntabulatedWhittle(Whittle):
    """A likelihood that computes Gauss-Markov shapes on demand, without the table of shapes."""

    def gauss_markov(self, time: float) -> Array:
        return self.shape_of.gauss_markov(time)


_AT_BOUND = 0.985
_ABOUT_AS_GOOD = 2.0


def add_upper_limits(
    estimate: Estimate,
    alike: Sequence[Candidate],
    wider: Sequence[Candidate],
    draws: dict[Terms, Posterior],
) -> Estimate:
    """Return an estimate with upper limits of K and B if its model does not have these terms.

    K or B is ``not_identified`` if a model with the term is about as good as the chosen one, else
    ``absent``. ``alike`` are the models that the log does not rule out, the chosen one first;
    ``wider`` are models with its terms, and in addition a random walk or one bias instability.
    """
    parameters = dict(estimate.parameters)
    for name in ("K", "B"):
        if parameters[name].status != "absent":
            continue
        having = [c.terms for c in (*wider, *alike) if name in list_parameter_names(c.terms)]
        if not having:
            continue
        upper = max(float(np.quantile(_draws_of(name, terms, draws), 0.975)) for terms in having)
        parameters[name] = Parameter(None, "absent", texts.ABSENT_BELOW, 0.0, upper)
        as_good = [c.terms for c in alike[1:] if is_as_good(c, alike[0])]
        good = [terms.name for terms in as_good if name in list_parameter_names(terms)]
        if good:
            reason = texts.models_alike(good, alike[0].terms.name)
            parameters[name] = Parameter(None, "not_identified", reason, 0.0, upper)
    return replace(estimate, parameters=parameters)


def is_as_good(other: Candidate, chosen: Candidate) -> bool:
    """Return whether a model has no higher AIC than the chosen one, or a BIC higher by up to 2.

    Such a difference is hardly evidence (R. Kass and A. Raftery, J. Am. Stat. Assoc. 90, 1995).
    """
    return other.aic <= chosen.aic or other.bic <= chosen.bic + _ABOUT_AS_GOOD


def describe(
    method: str,
    whittle: Whittle,
    chosen: Candidate,
    alike: Sequence[Candidate],
    draws: dict[Terms, Posterior],
    highest: float,
) -> Estimate:
    """Return the estimate of a fit: for each parameter a value with its interval, or a status.

    The intervals of all parameters cover the models ``alike``, which include ``chosen``, weighted
    by AIC. K is the median over these models: they divide the power of the lowest frequencies
    differently, and where K is poorly known, the median is a fifth nearer to the truth than a
    single model.
    """
    maximum = chosen.maximum
    names = list_parameter_names(maximum.terms)
    values = [*np.sqrt(maximum.powers), *maximum.times] + [maximum.ramp] * maximum.terms.ramp
    spectrum = whittle.spectrum
    needed = find_durations_needed(maximum, spectrum.rate, float(spectrum.duration), highest)
    described: dict[str, Parameter] = {}
    for i, (name, value) in enumerate(zip(names, values, strict=True)):
        # The interval of the chosen model lies inside: AIC, against a model that fits as well,
        # prefers a process as slow as a walk to the walk.
        own, over = _draws_of(name, chosen.terms, draws), _over_models(name, chosen, alike, draws)
        lower, upper = compute_mixture_limits(over, own)
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
    parameters = dict.fromkeys(FAMILY, Parameter(None, "absent", texts.ABSENT))
    parameters |= {name: described[name] for name in FAMILY if name in described}
    if "B" in described and "T_B" not in described:
        parameters["T_B"] = Parameter(None, "absent", texts.FLICKER_WITHOUT_TIME)
    further = [{"B": described["B 2"], "T_B": described["T_B 2"]}] if "B 2" in described else []
    return Estimate(method, parameters, further)


def _over_models(
    name: str, chosen: Candidate, alike: Sequence[Candidate], draws: dict[Terms, Posterior]
) -> list[tuple[Array, float]]:
    """Return the draws of a parameter in each model in which it means the same, with weights."""
    parts, own = [], chosen.terms.biases
    for candidate in alike:
        biases = candidate.terms.biases
        # One bias instability is one level, flicker or not; of several each has its own.
        single = name == "B" and sum(own) == sum(biases) == 1
        same = name[0] not in "BT" or own == biases or single
        if same and name in list_parameter_names(candidate.terms):
            weight = math.exp(0.5 * (chosen.aic - candidate.aic))
            parts.append((_draws_of(name, candidate.terms, draws), weight))
    return parts


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


def compute_mixture_limits(parts: Sequence[tuple[Array, float]], own: Array) -> tuple[float, float]:
    """Return 95 % limits of draws of several models that include the 95 % limits of ``own``."""
    both = [compute_mixture_quantiles(draws, 0.025, 0.975) for draws in (parts, [(own, 1.0)])]
    return min(lower for lower, _ in both), max(upper for _, upper in both)


def _draws_of(name: str, terms: Terms, draws: dict[Terms, Posterior]) -> Array:
    posterior = draws[terms]
    columns = np.column_stack([posterior.parameters, posterior.times, posterior.ramps])
    return np.asarray(columns[:, list_parameter_names(terms).index(name)])
