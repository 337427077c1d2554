"""Replace a noise model by the nearest model that a program supports.

Most filters support white noise and a random walk, and one simulator a Gauss-Markov process. The
slow terms of a model (processes, flicker noise, random walk, ramp) are replaced so that **the Allan
variance at the horizon stays the same**. 2 h^2 sigma^2(h) is the variance of the angle (or
velocity) that is integrated over the horizon h with a bias that was averaged over the preceding h.
This is about the error of a filter that predicts for h without a measurement. For a random walk
alone, K'^2 = 3 sigma^2(h) / h with sigma^2 of the slow terms; for a Gauss-Markov process and
h << T_B this is K'^2 = S_B, its driving density.

White noise is not changed. Quantization noise does not grow, and sinusoids are not noise: both are
left out, and the file notes this. At other tau the two models differ. The file states the relative
error at half and at twice the horizon, and the largest one below the horizon: for flicker noise,
which no random walk approximates well, -26 and +40 %. `overbound` makes a model that is
conservative at every tau.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from imubench_pipeline.allan import AllanCurve
from imubench_pipeline.noise import GaussMarkov, NoiseModel, Role, Term, compute_bias_instability
from imubench_pipeline.typing import Array
from imubench_pipeline.words.numbers import number_text

_MIN_TIME_OVER_HORIZON = 1 / 30
"""Shortest tau of the fit of a process, and shortest T_B of its search, over the horizon."""

_MAX_TIME_OVER_HORIZON = 100.0  # longest T_B of the search, over the horizon
_TRIED_CORRELATION_TIMES = 120
_ROLES_NOT_REPLACED = (Role.WHITE, Role.NOT_GROWING, Role.NO_NOISE)


@dataclass(frozen=True)
class Mapped:
    """A replacement model that a program supports."""

    model: NoiseModel  # for the program: N, at most one B with T_B, and K
    words: Sequence[str]  # description of the replacement and its error


def as_walk(model: NoiseModel, horizon: float, rate: float) -> Mapped:
    """Replace a noise model by white noise and a random walk.

    The error is stated for tau from one sample, 1 / ``rate`` (Hz), to twice ``horizon`` (s).
    """
    slow = _select_slow_terms(model)
    if all(term.role is Role.RANDOM_WALK for term in slow):
        return Mapped(NoiseModel(N=model.N, K=model.K), _describe_omitted_terms(model))
    K = math.sqrt(3.0 * _sum_allan_variance(slow, horizon) / horizon)
    words = f"a random walk K = {K:.3e}"
    return _describe_replacement(model, NoiseModel(N=model.N, K=K), words, slow, horizon, rate)


def as_process(
    model: NoiseModel, horizon: float, rate: float, *, walk: bool = False, time: float | None = None
) -> Mapped:
    """Replace a noise model by white noise and one Gauss-Markov process.

    T_B minimises the mean square error of the logarithm of the Allan variance, from a thirtieth of
    the horizon to the horizon; or it is `time`, s. For `horizon`, s, and `rate`, Hz, see `as_walk`.
    With `walk` the program also supports a random walk, and the random walk of the model is not
    changed.
    """
    replaced = _select_slow_terms(model, walk=walk)
    processes = [term.gauss_markov for term in replaced if term.gauss_markov is not None]
    K = model.K if walk else 0.0
    exact = len(replaced) == len(processes) <= 1
    if exact and all(time in (None, process.T_B) for process in processes):
        B, T_B = (processes[0].B, processes[0].T_B) if processes else (0.0, None)
        return Mapped(NoiseModel(N=model.N, B=B, T_B=T_B, K=K), _describe_omitted_terms(model))
    time = time or find_common_time([model], horizon, walk=walk)
    process = _make_process(_sum_allan_variance(replaced, horizon), horizon, time)
    replacement = NoiseModel(N=model.N, B=process.B, T_B=process.T_B, K=K)
    what = f"a Gauss-Markov process B = {process.B:.3e}, T_B = {number_text(process.T_B)} s"
    return _describe_replacement(model, replacement, what, replaced, horizon, rate)


def find_common_time(models: Sequence[NoiseModel], horizon: float, *, walk: bool = False) -> float:
    """Return the T_B, s, of least error if each model is replaced by white noise and one process.

    `as_process` defines the error. T_B is the horizon, s, if no model has a slow term.
    """
    slow = [(model.N, terms) for model in models if (terms := _select_slow_terms(model, walk=walk))]
    own = {term.gauss_markov and term.gauss_markov.T_B for _, terms in slow for term in terms}
    if all(len(terms) == 1 for _, terms in slow) and len(own) == 1 and (time := own.pop()):
        return time
    tau = np.geomspace(_MIN_TIME_OVER_HORIZON * horizon, horizon, 60)
    times = np.geomspace(
        _MIN_TIME_OVER_HORIZON * horizon, _MAX_TIME_OVER_HORIZON * horizon, _TRIED_CORRELATION_TIMES
    )
    # The Allan variance of each process over the one at the horizon, the last tau.
    shapes = [_make_process(1.0, horizon, T_B).allan_variance(tau) for T_B in times]
    errors = np.zeros(len(times))
    for N, terms in slow:
        white = N**2 / tau
        replaced = np.sum([term.allan_variance(tau) for term in terms], axis=0)
        replacing = white + replaced[-1] * np.array(shapes)
        errors += np.mean((np.log(replacing) - np.log(white + replaced)) ** 2, axis=1)
    return float(times[int(np.argmin(errors))]) if slow else horizon


def _make_process(variance: float, horizon: float, T_B: float) -> GaussMarkov:
    """Return the process of a T_B with an Allan variance at the horizon."""
    unit = GaussMarkov(compute_bias_instability(1.0, T_B), T_B)
    density = variance / _sum_allan_variance([unit], horizon)
    return GaussMarkov(compute_bias_instability(density, T_B), T_B)


def map_to_family(
    model: NoiseModel, family: str, horizon: float, rate: float, time: float | None = None
) -> Mapped:
    """Replace a model by one of a family; N+GM+K: unchanged. Arguments are as in `as_process`."""
    if family == "N+K":
        return as_walk(model, horizon, rate)
    return as_process(model, horizon, rate, time=time) if family == "N+GM" else Mapped(model, [])


def bound_walk(curve: AllanCurve, N: float, horizon: float) -> float:
    """Return an upper 95 % limit of K, SI, from a curve that shows no slow term.

    At tau = horizon, s, or at the end of a shorter curve, K^2 tau / 3 is the excess of the Allan
    variance over N^2 / tau, at least 0, plus the half-width of its interval.
    """
    place = int(np.searchsorted(curve.tau, min(horizon, float(curve.tau[-1])) * (1.0 - 1e-9)))
    tau, variance = float(curve.tau[place]), float(curve.variance[place])
    half_width = float(curve.limits(0.95)[1][place]) ** 2 - variance
    return math.sqrt(3.0 * (max(variance - N**2 / tau, 0.0) + half_width) / tau)


def describe_terms(terms: Sequence[Term]) -> str:
    """Describe terms with their values in SI."""
    return ", ".join(term.in_words for term in terms) or "no noise"


def _select_slow_terms(model: NoiseModel, *, walk: bool = False) -> list[Term]:
    """Return the terms that are replaced; with `walk` the random walk is not."""
    left = (*_ROLES_NOT_REPLACED, Role.RANDOM_WALK) if walk else _ROLES_NOT_REPLACED
    return [term for term in model.terms if term.role not in left]


def _describe_omitted_terms(model: NoiseModel) -> list[str]:
    words = [
        f"{term.label} noise {term.in_words} is not included, as its error does not grow"
        for term in model.terms
        if term.role is Role.NOT_GROWING
    ]
    lines = [term for term in model.terms if term.role is Role.NO_NOISE]
    if lines:
        words.append(f"{describe_terms(lines)}: not included, as a spectral line is not noise")
    return words


def _sum_allan_variance(terms: Sequence[Term], tau: float) -> float:
    return float(sum(term.allan_variance(np.array([tau]))[0] for term in terms))


def _describe_replacement(
    model: NoiseModel,
    replacement: NoiseModel,
    what: str,
    replaced: Sequence[Term],
    horizon: float,
    rate: float,
) -> Mapped:
    noise = replace(model, Q=0.0, sinusoids=())

    def error(tau: Array) -> Array:
        return np.sqrt(replacement.allan_variance(tau) / noise.allan_variance(tau)) - 1.0

    half, twice = (float(x) for x in error(np.array([0.5, 2.0]) * horizon))
    tau = np.geomspace(1.0 / rate, horizon, 200)
    below = error(tau)
    worst = int(np.argmax(np.abs(below)))
    largest, at_largest = float(below[worst]), number_text(float(tau[worst]), 3)
    words = (
        f"{describe_terms(replaced)}: replaced by {what}, with the same Allan variance at the "
        f"horizon of {number_text(horizon)} s. The Allan deviation differs by {100 * half:+.1f} % "
        f"at {number_text(horizon / 2)} s and {100 * twice:+.1f} % at {number_text(2 * horizon)} "
        f"s. Below the horizon the largest difference is {100 * largest:+.1f} %, at {at_largest} s"
    )
    return Mapped(replacement, [words, *_describe_omitted_terms(model)])
