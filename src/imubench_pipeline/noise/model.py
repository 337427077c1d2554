"""The noise model of one axis: the sum of its terms."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from imubench_pipeline.noise.state_space import StateSpace
from imubench_pipeline.noise.terms import PARAMETERS
from imubench_pipeline.noise.terms.base import Deterministic, Term
from imubench_pipeline.noise.terms.flicker import Flicker
from imubench_pipeline.noise.terms.gauss_markov import GaussMarkov
from imubench_pipeline.noise.terms.power_laws import Quantization, Ramp, RandomWalk, WhiteNoise
from imubench_pipeline.noise.terms.sinusoid import Sinusoid
from imubench_pipeline.typing import Array

_MAX_FLICKER_TAU = 1e5  # default longest tau of a bank for flicker noise, s
_KINDS_WITH_PARAMETER = (Quantization, WhiteNoise, Flicker, RandomWalk, Deterministic)
"""Kinds of terms with a parameter of their own in a model."""


@dataclass(frozen=True, kw_only=True)
class NoiseModel:
    """The stochastic error of one axis: the sum of its terms (Maia et al., eq. 2; IEEE Std 952).

    Parameters
    ----------
    Q : float
        Quantization, rad or m/s.
    N : float
        White noise density, rad/s/sqrt(Hz) or m/s^2/sqrt(Hz).
    B, T_B : float
        Bias instability, rad/s or m/s^2. With a correlation time T_B, s, it is the Gauss-Markov
        process of Maia et al.; without T_B it is flicker noise, as in IEEE Std 952.
    K : float
        Random walk, rad/s/sqrt(s) or m/s^2/sqrt(s).
    R : float
        Ramp, rad/s^2 or m/s^3; its sign is kept.
    further : sequence of Term
        More terms, such as Gauss-Markov processes, of kinds without a parameter above.
    sinusoids : sequence of Sinusoid
        Lines.

    Raises
    ------
    ValueError
        If a parameter is negative (except R) or not finite, T_B is not above 0, or a further term
        is of a kind that has a parameter above.
    """

    Q: float = 0.0
    N: float = 0.0
    B: float = 0.0
    T_B: float | None = None
    K: float = 0.0
    R: float = 0.0
    further: Sequence[Term] = ()
    sinusoids: Sequence[Sinusoid] = ()

    def __post_init__(self) -> None:
        for name in ("Q", "N", "B", "K", "R"):
            PARAMETERS[name].check(getattr(self, name))
        if self.T_B is not None:
            PARAMETERS["T_B"].check(self.T_B)
        for term in self.further:
            if isinstance(term, _KINDS_WITH_PARAMETER):
                raise ValueError(
                    f"{term} cannot be in 'further': NoiseModel has its own parameter for it; use "
                    "that"
                )
        for term in (*self.further, *self.sinusoids):
            for parameter in term.parameters:
                parameter.check(getattr(term, parameter.symbol))

    @cached_property
    def terms(self) -> Sequence[Term]:
        """The terms that are not zero."""
        terms: list[Term] = []
        if self.Q > 0:
            terms.append(Quantization(self.Q))
        if self.N > 0:
            terms.append(WhiteNoise(self.N))
        if self.B > 0:
            terms.append(Flicker(self.B) if self.T_B is None else GaussMarkov(self.B, self.T_B))
        terms.extend(self.further)
        if self.K > 0:
            terms.append(RandomWalk(self.K))
        if self.R != 0:
            terms.append(Ramp(self.R))
        terms.extend(self.sinusoids)
        return tuple(terms)

    @property
    def name(self) -> str:
        """The terms, such as ``N+GM+K`` (F: flicker, S: a line); ``none`` where there are none."""
        return "+".join(term.symbol for term in self.terms) or "none"

    @property
    def further_processes(self) -> list[GaussMarkov]:
        """The further terms, as Gauss-Markov processes; ValueError if one is of another kind."""
        processes = []
        for term in self.further:
            if term.gauss_markov is None:
                raise ValueError(f"{term} is in 'further'; expected only Gauss-Markov processes")
            processes.append(term.gauss_markov)
        return processes

    def scaled(self, factor: float) -> "NoiseModel":
        """Return the model of the signal multiplied by a factor; times do not change."""
        return replace(
            self,
            **{name: getattr(self, name) * factor for name in ("Q", "N", "B", "K", "R")},
            further=tuple(term.scaled(factor) for term in self.further),
            sinusoids=tuple(line.scaled(factor) for line in self.sinusoids),
        )

    def psd(self, frequency: ArrayLike, rate: float | None = None) -> Array:
        """Return the two-sided power spectral density at frequencies in Hz, in squared SI units/Hz.

        Lines have no density. Only quantization noise depends on the rate, Hz. Raises ValueError if
        there is quantization noise, and no rate.
        """
        f = np.asarray(frequency, dtype=np.float64)
        interval = None if rate is None else 1.0 / rate
        return _sum([term.psd(f, interval) for term in self.terms], f)

    def allan_variance(self, tau: ArrayLike, rate: float | None = None) -> Array:
        """Return the Allan variance at tau in s, (rad/s)² or (m/s²)².

        With a rate, Hz, it is exact for the process sampled at this rate, and the number of samples
        in a cluster is rounded. Raises ValueError if a cluster then has no sample.
        """
        t = np.asarray(tau, dtype=np.float64)
        if rate is None:
            parts = [term.allan_variance(t) for term in self.terms]
        else:
            n = np.rint(t * rate)
            if (n < 1.0).any():
                raise ValueError(
                    f"a cluster of {t.min():g} s has no sample at {rate:g} Hz; expected a tau of "
                    f"{1.0 / rate:g} s or more"
                )
            parts = [term.sampled_allan_variance(n, 1.0 / rate) for term in self.terms]
        return _sum(parts, t)

    def sampled_spectrum(self, omega: ArrayLike, rate: float) -> Array:
        """Return the spectrum of the samples at angular frequencies in rad per sample, SI^2.

        Ramps and lines are left out.
        """
        w = np.asarray(omega, dtype=np.float64)
        return _sum([term.sampled_spectrum(w, 1.0 / rate) for term in self.terms], w)

    def realised(self, interval: float, longest: float) -> Sequence[Term]:
        """Return the terms, with flicker noise as Gauss-Markov processes up to ``longest``, s."""
        return [part for term in self.terms for part in term.realised(interval, longest)]

    def state_space(self, rate: float, longest: float = _MAX_FLICKER_TAU) -> StateSpace:
        """Return the discrete state space with exact noise covariances, at a rate in Hz.

        The states follow the order of the terms; N is the measurement noise (Maia et al., eq.
        18-23; the printed first entry of Q_d, S_B T, is an approximation). Flicker noise is
        approximated by several states up to a tau of ``longest``, s.
        """
        spaces = [term.state_space(1.0 / rate) for term in self.realised(1.0 / rate, longest)]
        return StateSpace.together(spaces)


def _sum(parts: Sequence[Array], like: Array) -> Array:
    return np.asarray(np.sum(parts, axis=0)) if parts else np.zeros_like(like)


def stack_models(models: Sequence[NoiseModel]) -> Iterator[tuple[NDArray[np.intp], Term]]:
    """Yield terms with array parameters, each with the indices of the models that have the term.

    Closed forms of a stacked term, such as `Term.allan_variance`, return a value for each of its
    models. A model with two terms of a kind is in two stacked terms of that kind.
    """
    groups: dict[tuple[type[Term], int], list[tuple[int, Term]]] = {}
    for number, model in enumerate(models):
        before: Counter[type[Term]] = Counter()
        for term in model.terms:
            kind = type(term)
            groups.setdefault((kind, before[kind]), []).append((number, term))
            before[kind] += 1
    for (kind, _), members in groups.items():
        names = [field.name for field in fields(kind)]
        values = [np.array([getattr(term, name) for _, term in members]) for name in names]
        yield np.array([number for number, _ in members]), kind(*values)


def sum_over_stacked_terms(
    number: int,
    stacked: Iterable[tuple[NDArray[np.intp], Term]],
    figure: Callable[[Term], Array],
    places: int | None = None,
) -> Array:
    """Return a quantity of ``number`` models that is the sum over their terms, such as a variance.

    ``stacked`` is from `stack_models`; ``figure`` returns an array for a term with array parameters
    of shape (k,): (k,), or (places, k). The result has the shape (number,), or (places, number).
    """
    total = np.zeros((number,) if places is None else (places, number))
    for numbers, term in stacked:
        total[..., numbers] += figure(term)
    return total
