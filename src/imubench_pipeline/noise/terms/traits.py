"""Properties of a noise term: role, parameters, drive, reading."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.typing import Array


class Role(Enum):
    """Representation of a term in filters and simulators, most of which have few terms."""

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
        expected = "a finite number" if self.signed else "a number from 0"
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
    """Input of a term to a filter after it."""

    white: float = 0.0  # density N^2, SI^2/Hz
    flicker: float = 0.0  # B of flicker noise, SI
    process: Process | None = None


@dataclass(frozen=True)
class Reading:
    """The point of a curve that shows a parameter."""

    tau: float
    level: float
    """Position, s, and Allan deviation, SI."""
    symbol: str
    factor: float = 1.0  # level over the parameter
    peak: bool = False  # the term is nowhere higher


class SampleBlocks(Protocol):
    """Blocks of samples of a log; b is their number."""

    @property
    def rate(self) -> float:
        """Sampling rate, Hz."""

    @property
    def start(self) -> NDArray[np.int64]:
        """First sample of each block, shape (b,)."""

    @property
    def stop(self) -> NDArray[np.int64]:
        """One-past-last sample of each block, shape (b,)."""

    @property
    def count(self) -> NDArray[np.int64]:
        """Number of samples present in each block, shape (b,)."""

    @property
    def middle(self) -> Array:
        """Mean time of each block, s from the first sample of the first block."""
