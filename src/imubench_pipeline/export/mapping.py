"""The nearest model that a program can hold, of one that it cannot.

Most filters know white noise and a random walk, a simulator one Gauss-Markov process. What is slow
in a model - processes, flicker noise, a random walk, a ramp - is replaced so that **the Allan
variance at the horizon stays**. 2 h^2 sigma^2(h) is the variance of the angle (or velocity) that is
integrated over the horizon h with a bias that was averaged over the h before: what a filter that
goes without a measurement for h is about. For a random walk alone, K'^2 = 3 sigma^2(h) / h with
sigma^2 of the slow terms; far below T_B a Gauss-Markov process gives K'^2 = S_B, as it must.

White noise stays as it is. Quantization noise does not grow, and sinusoids are no noise: both are
left out, and said. At other tau than the horizon the two differ: by how much at half and at twice
the horizon, and at most below it, stands in the file. For a horizon of 60 s and a random walk the
Allan deviation of the MTi-7's gyro is off by -8 % at 30 s and +22 % at 120 s, that of the C102's
accelerometer by -4 and +13 %, that of flicker noise, of which no random walk is a likeness, by -26
and +40 %. A model that errs to the safe side at every tau is that of
`imubench_pipeline.export.overbound`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from imubench_pipeline.noise import GaussMarkov, NoiseModel, Role, Term, bias_instability
from imubench_pipeline.typing import Array

_SHORTEST = 1 / 30
"""Shortest tau over the horizon at which a process is compared, and shortest T_B tried."""

_LONGEST_TIME = 100.0
_TRIED = 120


@dataclass(frozen=True)
class Mapped:
    """A model that stands for another one.

    Attributes
    ----------
    model : NoiseModel
        What the program gets: N, at most one B with T_B, and K.
    words : sequence of str
        What was replaced by what, and by how much it is off.
    half, twice : float
        Relative error of the Allan deviation at half and at twice the horizon; 0: exact.
    most : float
        The largest one at a tau up to the horizon.
    """

    model: NoiseModel
    words: Sequence[str]
    half: float = 0.0
    twice: float = 0.0
    most: float = 0.0


def as_walk(
    model: NoiseModel, horizon: float, rate: float, least_walk: float | None = None
) -> Mapped:
    """Return white noise and a random walk in place of a model.

    Parameters
    ----------
    model : NoiseModel
    horizon : float
        s.
    rate : float
        Hz; the error is looked for from its period on.
    least_walk : float, optional
        K that is taken where the model has nothing slow.
    """
    slow = _slow(model)
    if not slow and least_walk:
        words = [
            f"the model has no random walk; K = {least_walk:.3e}, its upper 95 % limit, stands in, "
            "since a filter whose bias is never to move stops to estimate it"
        ]
        return Mapped(NoiseModel(N=model.N, K=least_walk), [*words, *_left_out(model)])
    if not slow:
        words = ["the model has no random walk, and no upper limit of one is known: it is 0"]
        return Mapped(NoiseModel(N=model.N), [*words, *_left_out(model)])
    if all(term.role is Role.RANDOM_WALK for term in slow):
        return Mapped(NoiseModel(N=model.N, K=model.K), _left_out(model))
    K = math.sqrt(3.0 * _variance(slow, horizon) / horizon)
    replacement = NoiseModel(N=model.N, K=K)
    return _compared(model, replacement, f"a random walk K = {K:.3e}", slow, horizon, rate)


def as_process(model: NoiseModel, horizon: float, rate: float, *, walk: bool = False) -> Mapped:
    """Return white noise and one Gauss-Markov process in place of a model.

    Its T_B is the one with which the logarithm of the Allan variance from a thirtieth of the
    horizon to the horizon is nearest, in the mean square. `horizon` in s and `rate` in Hz are as of
    `as_walk`; with `walk` the program also holds a random walk, and the model's stays.
    """
    replaced = [term for term in _slow(model) if not (walk and term.role is Role.RANDOM_WALK)]
    processes = _processes(replaced)
    K = model.K if walk else 0.0
    if len(replaced) == len(processes) <= 1:
        B, T_B = (processes[0].B, processes[0].T_B) if processes else (0.0, None)
        return Mapped(NoiseModel(N=model.N, B=B, T_B=T_B, K=K), _left_out(model))
    process = _nearest_process(replaced, model.N, horizon)
    replacement = NoiseModel(N=model.N, B=process.B, T_B=process.T_B, K=K)
    what = f"a Gauss-Markov process B = {process.B:.3e}, T_B = {process.T_B:.4g} s"
    return _compared(model, replacement, what, replaced, horizon, rate)


def named(terms: Sequence[Term]) -> str:
    """Return terms in words, with their values in SI."""
    return ", ".join(term.in_words for term in terms) or "no noise"


_KEPT_OR_LEFT_OUT = (Role.WHITE, Role.NOT_GROWING, Role.NO_NOISE)


def _slow(model: NoiseModel) -> list[Term]:
    return [term for term in model.terms if term.role not in _KEPT_OR_LEFT_OUT]


def _processes(terms: Sequence[Term]) -> list[GaussMarkov]:
    return [term.gauss_markov for term in terms if term.gauss_markov is not None]


def _left_out(model: NoiseModel) -> list[str]:
    words = [
        f"{term.label} noise {term.in_words} is left out: its error does not grow"
        for term in model.terms
        if term.role is Role.NOT_GROWING
    ]
    lines = [term for term in model.terms if term.role is Role.NO_NOISE]
    if lines:
        words.append(f"{named(lines)}: left out, a line is no noise")
    return words


def _variance(terms: Sequence[Term], tau: float) -> float:
    return float(sum(term.allan_variance(np.array([tau]))[0] for term in terms))


def _nearest_process(slow: Sequence[Term], N: float, horizon: float) -> GaussMarkov:
    tau = np.geomspace(_SHORTEST * horizon, horizon, 60)
    white = N**2 / tau
    wanted = np.log(white + sum(term.allan_variance(tau) for term in slow))
    variance = _variance(slow, horizon)

    def process(T_B: float) -> GaussMarkov:
        unit = GaussMarkov(bias_instability(1.0, T_B), T_B)
        return GaussMarkov(bias_instability(variance / _variance([unit], horizon), T_B), T_B)

    times = np.geomspace(_SHORTEST * horizon, _LONGEST_TIME * horizon, _TRIED)
    errors = [
        float(np.mean((np.log(white + process(T_B).allan_variance(tau)) - wanted) ** 2))
        for T_B in times
    ]
    return process(float(times[int(np.argmin(errors))]))


def _compared(
    model: NoiseModel,
    replacement: NoiseModel,
    what: str,
    replaced: Sequence[Term],
    horizon: float,
    rate: float,
) -> Mapped:
    """Say what was replaced, and by how much the deviation is off."""
    noise = replace(model, Q=0.0, sinusoids=())

    def error(tau: Array) -> Array:
        return np.sqrt(replacement.allan_variance(tau) / noise.allan_variance(tau)) - 1.0

    half, twice = (float(x) for x in error(np.array([0.5, 2.0]) * horizon))
    tau = np.geomspace(1.0 / rate, horizon, 200)
    below = error(tau)
    worst = int(np.argmax(np.abs(below)))
    words = [
        f"{named(replaced)}: replaced by {what}, of the same Allan variance at the horizon of "
        f"{horizon:g} s; the Allan deviation of the whole is off by {100 * half:+.1f} % at "
        f"{horizon / 2:g} s, by {100 * twice:+.1f} % at {2 * horizon:g} s, and below the horizon "
        f"by at most {100 * float(below[worst]):+.1f} % (at {tau[worst]:.3g} s)"
    ]
    return Mapped(replacement, [*words, *_left_out(model)], half, twice, float(below[worst]))
