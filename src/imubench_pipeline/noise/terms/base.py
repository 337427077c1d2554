"""Interface of the noise terms, and the joint input of several terms to a filter."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np

from imubench_pipeline.noise.growth import SensorStart, Uncalibrated
from imubench_pipeline.noise.state_space import ContinuousSpace, StateSpace, factor_covariance
from imubench_pipeline.noise.terms.traits import (
    Drive,
    Process,
    Reading,
    Role,
    SampleBlocks,
    TermParameter,
)
from imubench_pipeline.typing import Array

if TYPE_CHECKING:
    from imubench_pipeline.noise.terms.gauss_markov import GaussMarkov


@dataclass(frozen=True)
class Term(ABC):
    """One noise process of a model; frequencies in Hz, tau and interval in s, results SI.

    A term is a frozen dataclass of its parameters. What is abstract here, and the class variables
    without a value, are its own; `noise.terms.registry` refuses a term that lacks one.
    """

    symbol: ClassVar[str]
    """In the name of a model, such as ``GM`` in ``N+GM+K``."""

    label: ClassVar[str]
    """In words, such as ``white noise``."""

    standard_name: ClassVar[str]
    """The field's name; ``{signal}`` and ``{integral}``: rate and angle, or acceleration and
    velocity."""

    word: ClassVar[str]
    """In the source of an error: its first word."""

    role: ClassVar[Role]
    parameters: ClassVar[tuple[TermParameter, ...]]

    states: ClassVar[tuple[str, ...]]
    """Names of the states of `state_space`."""

    @abstractmethod
    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """Two-sided power spectral density in continuous time, SI^2/Hz."""

    @abstractmethod
    def allan_variance(self, tau: Array) -> Array:
        """Allan variance of the process averaged continuously over tau, SI^2."""

    @abstractmethod
    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """Allan variance of the sampled process at n samples a cluster, SI^2."""

    @abstractmethod
    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """Spectrum of the samples, SI^2; its mean over -pi..pi is their variance."""

    @abstractmethod
    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """Generalised covariance of the cumulative sum of the samples at whole lags, SI^2.

        For second differences at n samples a cluster: a constant and a square of the lag may
        differ.
        """

    @abstractmethod
    def state_space(self, interval: float) -> StateSpace:
        """Discrete state space at a sampling interval, exact."""

    def continuous_space(self) -> ContinuousSpace | None:
        """State space in continuous time; None: it has none."""
        return None

    @property
    @abstractmethod
    def drive(self) -> Drive | None:
        """Input to a filter after it; None if it has no density, or arises after the filter."""

    @abstractmethod
    def growth(self, order: int, time: float, start: SensorStart) -> float:
        """Return the variance of its integrated error (`noise.growth`), without the turn-on bias.

        ``order`` is m, 0 to 2; ``time`` is t, s, above 0. The unit is (rad/s)^2 or (m/s^2)^2 times
        s^(2m+2).
        """

    @abstractmethod
    def growth_from_known(self, time: Array) -> tuple[Array, Array]:
        """Return the variances of its first and second integral from a known state; 0 if none."""

    @abstractmethod
    def block_covariance(self, lags: Array, block: float) -> Array:
        """Return the generalised covariance of means over blocks of continuous time, SI^2.

        ``lags`` are whole numbers of blocks from 0, ``block`` is their length, s. (I. M. Gelfand
        and G. E. Shilov, "Generalized Functions", vol. 1, 1964: -ln|t| / pi and -|t| / 2 of 1/|f|
        and 1/f^2, with the densities of IEEE Std 952-1997, annex C.) Raises TypeError if the term
        is deterministic.
        """

    @abstractmethod
    def mean_covariance(self, blocks: SampleBlocks) -> Array:
        """Return the covariance of the means of b blocks of samples, in closed form, shape (b, b).

        A walk starts at the first sample of the first block.
        """

    @abstractmethod
    def block_sums(self, blocks: int, width: int, rate: float, rng: np.random.Generator) -> Array:
        """Draw the sums over adjacent blocks of ``width`` samples of a simulated log, exactly."""

    def reading(self, lowest_tau: float) -> Reading | None:
        """Return where a curve, lowest at a tau in s, shows its parameter; None: nowhere."""
        return None

    @property
    def values(self) -> dict[str, float]:
        """Parameters by symbol, SI."""
        return {parameter.symbol: getattr(self, parameter.symbol) for parameter in self.parameters}

    @property
    def in_words(self) -> str:
        """Its parameters with their values in SI."""
        return ", ".join(f"{symbol} = {value:.3e}" for symbol, value in self.values.items())

    @property
    def source(self) -> str:
        """Its name as the source of an error, such as ``K`` or ``GM 89.5 s``."""
        return self.word

    @property
    def gauss_markov(self) -> GaussMarkov | None:
        """The term as a first-order Gauss-Markov process, if this is its role; else None."""
        return None

    def realised(self, interval: float, longest: float) -> Sequence[Term]:
        """Return terms with a finite state space that approximate it up to a tau ``longest``, s."""
        return [self]

    def scaled(self, factor: float) -> Self:
        """Return the term of a signal that is larger by a factor; times do not change."""
        scaled = {
            parameter.symbol: getattr(self, parameter.symbol) * factor**parameter.signal
            for parameter in self.parameters
            if parameter.signal
        }
        return replace(self, **scaled)

    def as_unit(self) -> tuple[float, Term]:
        """Return a power and a term of the kind that times this power is this term.

        By default 1 and itself. If one parameter scales the term, the other serves all models.
        """
        return 1.0, self

    def sources(self, order: int, time: float, start: SensorStart) -> Iterator[tuple[str, float]]:
        """Yield name and standard deviation of its contribution to an error, see `growth`."""
        yield self.source, math.sqrt(self.growth(order, time, start))

    def mean_variance(self, time: float, on_time: float) -> float:
        """Return the variance of its mean over a window of length ``time``, (rad/s)^2 or (m/s^2)^2.

        The window begins at ``on_time`` after switch-on, s.
        """
        return self.growth(0, time, Uncalibrated(bias=0.0, on_time=on_time)) / time**2

    def passed(self, power: Callable[[float], Array]) -> float:
        """Return the part of its Allan variance that a low-pass passes, if it has no `drive`."""
        return 1.0

    def start(self, rng: np.random.Generator, interval: float) -> Array:
        """Draw the first state, shape (m,)."""
        space = self.state_space(interval)
        root = factor_covariance(space.initial_variance)
        return space.initial_mean + root @ rng.standard_normal(len(root))


@dataclass(frozen=True)
class Deterministic(Term):
    """A deterministic term: a signal of unlimited duration."""

    @abstractmethod
    def swing(self, weights: Array, block: float) -> tuple[float, float]:
        """Return the mean square and the frequency, Hz, of a weighted sum of adjacent block means.

        ``block`` is the length of a block, s.
        """

    @property
    def drive(self) -> Drive | None:
        """None: it has no density."""
        return None

    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """0: it has no density."""
        return np.zeros_like(omega)

    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """0: it has no variance."""
        return np.zeros_like(lags)

    def growth_from_known(self, time: Array) -> tuple[Array, Array]:
        """0: a filter with the term predicts it exactly."""
        return np.zeros_like(time), np.zeros_like(time)

    def block_covariance(self, lags: Array, block: float) -> Array:
        """Raise TypeError: it is deterministic (see `swing`)."""
        raise TypeError(f"{self} is deterministic")


@dataclass(frozen=True)
class Drives:
    """The joint input of terms to a filter."""

    white: float  # density N^2, SI^2/Hz
    flicker: float  # B^2 of flicker noise, SI^2
    processes: tuple[Process, ...]  # Gauss-Markov processes
    walks: tuple[Process, ...]  # random walks, whose correlation time is infinite


def drives_of(terms: Iterable[Term]) -> Drives:
    """Return the joint input of terms to a filter; terms without a density are left out."""
    drives = [term.drive for term in terms if term.drive is not None]
    processes = [drive.process for drive in drives if drive.process is not None]
    return Drives(
        sum(drive.white for drive in drives),
        sum(drive.flicker**2 for drive in drives),
        tuple(process for process in processes if math.isfinite(process.T_B)),
        tuple(process for process in processes if math.isinf(process.T_B)),
    )
