"""Interface of the noise terms, and the joint input of several terms to a filter."""

import inspect
import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from enum import Enum
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.model.states import NoiseSource, SourcePath
from imubench_pipeline.noise.growth import SensorStart, Uncalibrated
from imubench_pipeline.noise.state_space import (
    ContinuousSpace,
    StateSpace,
    draw_block_sums,
    factor_covariance,
)
from imubench_pipeline.typing import Array

if TYPE_CHECKING:
    from imubench_pipeline.noise.terms.gauss_markov import GaussMarkov


class Role(Enum):
    """Kind of noise with which filters and simulators represent a term; most know few kinds."""

    WHITE = "white noise"
    RANDOM_WALK = "a random walk"
    GAUSS_MARKOV = "a first-order Gauss-Markov process (`Term.gauss_markov`)"
    SLOW = "expressed by none: a walk or a process of its Allan variance stands for it"
    NOT_GROWING = "left out: its error does not grow"
    NO_NOISE = "left out: it is no noise"


@dataclass(frozen=True)
class SearchRange:
    """Range of a time constant in a fit."""

    samples: float  # shortest, sampling intervals
    of_log: float  # longest, as a part of the log


@dataclass(frozen=True)
class TermParameter:
    """A parameter of a term: a field of its dataclass."""

    symbol: str  # name of the field
    label: str  # in words
    signal: float
    seconds: float
    """Its dimension: powers of the unit of the signal, rad/s or m/s^2, and of seconds."""
    signed: bool = False  # whether it may be negative
    search: SearchRange | None = None  # of a time constant

    def check(self, value: float) -> None:
        """Raise ValueError if the value is not finite or out of range."""
        time = (self.signal, self.seconds) == (0.0, 1.0)
        if math.isfinite(value) and (self.signed or value > 0.0 or (value == 0.0 and not time)):
            return
        expected = "a finite number" if self.signed else "a finite number, 0 or more"
        if time:
            expected = "a time above 0 s"
        raise ValueError(f"the {self.label} {self.symbol} is {value}, expected {expected}")


@dataclass(frozen=True)
class Process:
    """White noise through a first-order lag."""

    T_B: float  # correlation time, s; infinite: a random walk
    density: float  # of the driving white noise, SI^2/s


@dataclass(frozen=True)
class Drive:
    """Noise that one term adds at the input of a filter."""

    white: float = 0.0  # density N^2, SI^2/Hz
    flicker: float = 0.0  # B of flicker noise, SI
    process: Process | None = None


@dataclass(frozen=True)
class Reading:
    """The point of an Allan deviation at which a parameter can be read."""

    tau: float
    level: float
    """Position, s, and Allan deviation, SI."""
    symbol: str
    factor: float = 1.0  # level over the parameter
    peak: bool = False  # the term is nowhere higher


@dataclass(frozen=True, kw_only=True)
class SampleBlocks:
    """Blocks of samples of a log; the arrays have the shape (b,)."""

    # start, stop: first and one-past-last sample of each block, counted in the log
    start: NDArray[np.int64]
    stop: NDArray[np.int64]
    count: NDArray[np.int64]  # samples that are present
    rate: float  # Hz

    @property
    def middle(self) -> Array:
        """Mean time of the samples of each block, s from the first sample, shape (b,)."""
        return np.asarray((0.5 * (self.start + self.stop - 1) - self.start[0]) / self.rate)


@dataclass(frozen=True)
class Term(ABC):
    """One noise process of a model; frequencies in Hz, tau and interval in s, results SI.

    A term is a frozen dataclass of its parameters. Each kind defines the abstract methods and the
    class variables that have no value here; `register_terms` refuses an incomplete kind. In
    formulas, T is ``interval`` or 1 / ``rate``, n a number of samples, k a lag, d ``block``.
    """

    symbol: ClassVar[str]
    """In the name of a model, such as ``GM`` in ``N+GM+K``."""

    label: ClassVar[str]
    """In words, such as ``white noise``."""

    standard_name: ClassVar[str]
    """Name in standards; ``{signal}`` and ``{integral}`` are filled in: rate and angle, or
    acceleration and velocity."""

    word: ClassVar[NoiseSource]
    """Its code as the source of an error (`model.states.NoiseSource`)."""

    role: ClassVar[Role]
    parameters: ClassVar[tuple[TermParameter, ...]]

    @abstractmethod
    def psd(self, frequency: Array, interval: float | None = None) -> Array:
        """Two-sided power spectral density in continuous time, SI^2/Hz."""

    @abstractmethod
    def allan_variance(self, tau: Array) -> Array:
        """Allan variance of the process averaged continuously over tau, SI^2."""

    @abstractmethod
    def sampled_allan_variance(self, n: Array, interval: float) -> Array:
        """Allan variance of the sampled process at n samples per cluster, SI^2."""

    @abstractmethod
    def sampled_spectrum(self, omega: Array, interval: float) -> Array:
        """Spectrum of the samples, SI^2; its mean over -pi..pi is their variance."""

    @abstractmethod
    def sum_covariance(self, lags: Array, n: int, interval: float) -> Array:
        """Covariance of cumulative sums at lags, SI^2, without any a + b lag^2; n: cluster size."""

    @abstractmethod
    def state_space(self, interval: float) -> StateSpace:
        """Discrete state space at a sampling interval, exact."""

    def continuous_space(self) -> ContinuousSpace | None:
        """State space in continuous time; None: it has none."""
        return None

    @property
    @abstractmethod
    def drive(self) -> Drive | None:
        """Noise at the input of a filter; None if it has no density or arises after the filter."""

    @abstractmethod
    def growth(self, order: int, time: float, start: SensorStart) -> float:
        """Return the variance of the integrated error (`noise.growth`), without turn-on bias.

        ``order`` is m, 0 to 2; ``time`` is t, s, above 0. W is the static window of ``start``, A
        its time since switch-on, s; c is t^(m+1) / (m+1)!. The unit is (rad/s)^2 or (m/s^2)^2 times
        s^(2m+2).
        """

    def growth_from_known(self, time: Array) -> tuple[Array, Array]:
        """Return the variances of the term's first and second integral at times from a known state.

        By default 0: the term does not grow, or a filter with the term predicts it exactly, or it
        has no finite state.
        """
        return np.zeros_like(time), np.zeros_like(time)

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

    def block_sums(self, blocks: int, width: int, rate: float, rng: np.random.Generator) -> Array:
        """Draw the sums over adjacent blocks of ``width`` samples of a simulated log, exactly.

        By default for a term with one state; raises TypeError for another number of states.
        """
        space = self.state_space(1.0 / rate)
        if len(space.output) != 1:
            count = len(space.output)
            raise TypeError(f"{self} has {count} states; expected one, or its own block_sums()")
        return draw_block_sums(space, self.start(rng, 1.0 / rate), blocks, width, rng)

    def reading(self, lowest_tau: float) -> Reading | None:
        """Return where to read the parameter on a curve with its minimum at a tau, s; or None."""
        return None

    @property
    def values(self) -> dict[str, float]:
        """Parameters by symbol, SI."""
        return {parameter.symbol: getattr(self, parameter.symbol) for parameter in self.parameters}

    @property
    def in_words(self) -> str:
        """The parameters of the term with their values in SI."""
        return ", ".join(f"{symbol} = {value:.3e}" for symbol, value in self.values.items())

    @property
    def gauss_markov(self) -> "GaussMarkov | None":
        """The term as a first-order Gauss-Markov process, if this is its role; else None."""
        return None

    def realised(self, interval: float, longest: float) -> "Sequence[Term]":
        """Return finite-state terms that approximate it at tau from ``interval`` to ``longest``."""
        return [self]

    def scaled(self, factor: float) -> Self:
        """Return the term of the signal multiplied by a factor; times do not change."""
        scaled = {
            parameter.symbol: getattr(self, parameter.symbol) * factor**parameter.signal
            for parameter in self.parameters
            if parameter.signal
        }
        return replace(self, **scaled)

    def as_unit(self) -> "tuple[float, Term]":
        """Return a factor, and a unit term whose variances times the factor are this term's.

        By default 1 and the term itself. If a kind has one amplitude, its terms share a unit term.
        """
        return 1.0, self

    def sources(
        self, order: int, time: float, start: SensorStart
    ) -> Iterator[tuple[SourcePath | None, float]]:
        """Yield path and standard deviation of each contribution to an error (see `growth`)."""
        yield None, math.sqrt(self.growth(order, time, start))

    def mean_variance(self, time: float, on_time: float) -> float:
        """Return the variance of the term's mean over ``time``, from ``on_time`` after power-on."""
        return self.growth(0, time, Uncalibrated(bias=0.0, on_time=on_time)) / time**2

    def start(self, rng: np.random.Generator, interval: float) -> Array:
        """Draw the initial state, shape (m,)."""
        space = self.state_space(interval)
        root = factor_covariance(space.initial_variance)
        return space.initial_mean + root @ rng.standard_normal(len(root))


@dataclass(frozen=True)
class Deterministic(Term):
    """A deterministic term: a signal of unlimited duration."""

    @abstractmethod
    def swing(self, weights: Array, block: float) -> tuple[float, float]:
        """Return mean square and frequency, Hz, of a weighted sum of means over ``block``, s."""

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

    def block_covariance(self, lags: Array, block: float) -> Array:
        """Raise TypeError: it is deterministic (see `swing`)."""
        raise TypeError(f"{self} is deterministic and has no covariance; use swing()")


@dataclass(frozen=True)
class Drives:
    """The joint input of terms to a filter."""

    white: float  # density N^2, SI^2/Hz
    flicker: float  # B^2 of flicker noise, SI^2
    # times, densities: shape (n,); correlation time, s, and driving density of Gauss-Markov
    # processes, and then of random walks, whose time is infinite
    times: Array
    densities: Array


def drives_of(terms: Iterable[Term]) -> Drives:
    """Return the joint input of terms to a filter; terms without a density are left out."""
    drives = [term.drive for term in terms if term.drive is not None]
    slow = [(each.process.T_B, each.process.density) for each in drives if each.process is not None]
    slow.sort(key=lambda part: math.isinf(part[0]))
    times, densities = np.array(slow, dtype=np.float64).reshape(-1, 2).T
    white, flicker = sum(each.white for each in drives), sum(each.flicker**2 for each in drives)
    return Drives(white, flicker, times, densities)


_REQUIRED_VARIABLES = ("symbol", "label", "standard_name", "word", "role", "parameters")
"""Class variables that every kind must define."""


def register_terms(*kinds: type[Term]) -> tuple[type[Term], ...]:
    """Return the kinds of terms, after checking that each is complete.

    Raises TypeError if a kind lacks a method, a class variable or the search range of a time
    constant; if its parameters are not its fields; if two kinds share a symbol or a word; or if
    two different parameters share a symbol.
    """
    for kind in kinds:
        name = kind.__name__
        if inspect.isabstract(kind):
            missing = ", ".join(sorted(kind.__abstractmethods__))
            raise TypeError(f"the noise term {name} lacks {missing}; implement these methods")
        lacking = [variable for variable in _REQUIRED_VARIABLES if not hasattr(kind, variable)]
        if lacking:
            raise TypeError(f"the noise term {name} lacks the class variable {', '.join(lacking)}")
        symbols = [parameter.symbol for parameter in kind.parameters]
        own = [field.name for field in fields(kind)]
        if symbols != own:
            raise TypeError(f"the noise term {name} has parameters {symbols}, but fields {own}")
        for parameter in kind.parameters:
            if (parameter.signal, parameter.seconds) == (0.0, 1.0) and parameter.search is None:
                raise TypeError(
                    f"{parameter.symbol} of {name} is a time without a range for its search; set "
                    "search=SearchRange(...)"
                )
        if (kind.role is Role.GAUSS_MARKOV) != (kind.gauss_markov is not Term.gauss_markov):
            raise TypeError(f"{name} has the role GAUSS_MARKOV or `gauss_markov`; expected both")
    for name in ("symbol", "word"):
        stated = [getattr(kind, name) for kind in kinds]
        for value in stated:
            if stated.count(value) > 1:
                raise TypeError(f"{name} {value!r} belongs to two noise terms")
    parameters: dict[str, TermParameter] = {}
    for kind in kinds:
        for parameter in kind.parameters:
            if parameters.setdefault(parameter.symbol, parameter) != parameter:
                symbol, name = parameter.symbol, kind.__name__
                raise TypeError(f"{symbol} of {name} is not {symbol} of another term; rename it")
    return kinds
