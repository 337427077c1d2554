"""The noise model of one axis: the sum of its terms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from imubench_pipeline.noise.state_space import StateSpace
from imubench_pipeline.noise.terms import (
    PARAMETERS,
    Deterministic,
    Flicker,
    GaussMarkov,
    Quantization,
    Ramp,
    RandomWalk,
    Sinusoid,
    Term,
    WhiteNoise,
)
from imubench_pipeline.typing import Array

_MAX_FLICKER_TAU = 1e5
"""Default longest tau, s, up to which a state space approximates flicker noise."""

_KINDS_WITH_PARAMETER = (Quantization, WhiteNoise, Flicker, RandomWalk, Deterministic)
"""Kinds of terms with a parameter of their own in a model."""


@dataclass(frozen=True, kw_only=True)
class NoiseModel:
    """The stochastic error of one axis: the sum of its terms.

    See Maia et al., eq. 2; IEEE Std 952 and 647.

    Parameters
    ----------
    Q : float
        Quantization, rad or m/s; 0: none.
    N : float
        White noise density, rad/s/sqrt(Hz) or m/s^2/sqrt(Hz); 0: none.
    B, T_B : float
        Bias instability, rad/s or m/s^2. With a correlation time, s, it is the Gauss-Markov
        process of the papers; without one it is flicker noise, as IEEE Std 952 has it.
        B = 0: none.
    K : float
        Random walk, rad/s/sqrt(s) or m/s^2/sqrt(s); 0: none.
    R : float
        Ramp, rad/s^2 or m/s^3; its sign is kept; 0: none.
    further : sequence of Term
        More terms of noise, such as Gauss-Markov processes: of any kind that has no parameter
        above.
    sinusoids : sequence of Sinusoid
        Lines.

    Raises
    ------
    ValueError
        If a parameter is negative (R apart) or not finite, T_B is not above 0, or a further term
        has a place of its own.
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
                raise ValueError(f"{term} is no further term, expected it in its own parameter")
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
        """The further terms as Gauss-Markov processes, for what knows no others.

        Raises
        ------
        ValueError
            If one is none.
        """
        processes = []
        for term in self.further:
            if term.gauss_markov is None:
                raise ValueError(f"{term} is no Gauss-Markov process")
            processes.append(term.gauss_markov)
        return processes

    def psd(self, frequency: ArrayLike, rate: float | None = None) -> Array:
        """Return the two-sided power spectral density.

        Parameters
        ----------
        frequency : array_like
            Hz, not 0.
        rate : float, optional
            Hz; only quantization noise depends on it.

        Returns
        -------
        ndarray
            (rad/s)²/Hz or (m/s²)²/Hz, in the shape of ``frequency``; lines have none.

        Raises
        ------
        ValueError
            If there is quantization noise, and no rate.
        """
        f = np.asarray(frequency, dtype=np.float64)
        interval = None if rate is None else 1.0 / rate
        return _sum([term.psd(f, interval) for term in self.terms], f)

    def allan_variance(self, tau: ArrayLike, rate: float | None = None) -> Array:
        """Return the Allan variance.

        Parameters
        ----------
        tau : array_like
            Cluster length, s.
        rate : float, optional
            Hz; given, the result is that of the process sampled at this rate, exactly.

        Returns
        -------
        ndarray
            (rad/s)² or (m/s²)², in the shape of ``tau``.

        Raises
        ------
        ValueError
            If a rate is given and a cluster holds no sample: it is taken to the nearest number.
        """
        t = np.asarray(tau, dtype=np.float64)
        if rate is None:
            parts = [term.allan_variance(t) for term in self.terms]
        else:
            n = np.rint(t * rate)
            if (n < 1.0).any():
                raise ValueError(
                    f"a cluster of {t.min():g} s holds no sample at {rate:g} Hz, expected one"
                )
            parts = [term.sampled_allan_variance(n, 1.0 / rate) for term in self.terms]
        return _sum(parts, t)

    def sampled_spectrum(self, omega: ArrayLike, rate: float) -> Array:
        """Return the spectrum of the samples at angular frequencies in rad a sample, SI^2.

        The mean is left out: ramps and lines have none.
        """
        w = np.asarray(omega, dtype=np.float64)
        return _sum([term.sampled_spectrum(w, 1.0 / rate) for term in self.terms], w)

    def realised(self, interval: float, longest: float) -> Sequence[Term]:
        """Return terms of finite state spaces: flicker noise is Gauss-Markov processes.

        Up to ``longest`` flicker noise is followed; both are in s.
        """
        terms: list[Term] = []
        for term in self.terms:
            terms.extend(term.realised(interval, longest))
        return terms

    def state_space(self, rate: float, longest: float = _MAX_FLICKER_TAU) -> StateSpace:
        """Return the discrete state space with exact noise covariances.

        The states follow the order of the terms; N is the measurement noise (Maia et
        al., eq. 18-23; the printed first entry of Q_d, S_B T, is an approximation).

        Parameters
        ----------
        rate : float
            Hz.
        longest : float
            Tau up to which flicker noise is followed, s; only then it has several states.
        """
        spaces = [term.state_space(1.0 / rate) for term in self.realised(1.0 / rate, longest)]
        return StateSpace.together([*spaces, StateSpace.without_states(0.0)])


def _sum(parts: Sequence[Array], like: Array) -> Array:
    return np.asarray(np.sum(parts, axis=0)) if parts else np.zeros_like(like)
