"""Dwells and turns in the log of a turned gyro, and the times to leave out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.extensions.calibration.experiment import Dwell
from imubench_pipeline.extensions.earth_rate.alternation import Alternation

FoundBy = Literal["transient", "step", "schedule", "column"]

DETECTION_ORDER: tuple[FoundBy, ...] = ("column", "transient", "step", "schedule")
"""Ways to find a turn, the most reliable first."""


@dataclass(frozen=True)
class Turn:
    """A turn of the sensor."""

    # start, stop: s from the first sample; the time left out, with the margin
    start: float
    stop: float
    time: float  # its middle as found, s
    found_by: FoundBy
    peak: float | None = None  # largest rate during it, or height of the step, rad/s
    doubts: tuple[str, ...] = ()  # in words


@dataclass(frozen=True)
class FoundDwell:
    """A dwell between two turns, or between a turn and an end of the log."""

    # start, stop: s from the first sample, without turning
    start: float
    stop: float
    sense: int  # +1 or -1
    found_by: FoundBy = "schedule"  # of the two adjacent turns, the less reliable way
    # doubts about its length and sense, in words
    doubts: tuple[str, ...] = ()

    def in_samples(self, rate: float) -> Dwell:
        """Return the dwell in samples at a rate, Hz; raise ValueError if it has none."""
        first, last = (_find_first_sample(time, rate) for time in (self.start, self.stop))
        return Dwell(first, last, self.sense)


@dataclass(frozen=True)
class Turning:
    """The dwells and turns of a log."""

    dwells: tuple[FoundDwell, ...]  # in order; the sense alternates
    turns: tuple[Turn, ...]  # in order
    # start and stop of disturbances other than turns, s; to be left out, too
    knocks: tuple[tuple[float, float], ...]
    # whether the sense of the first dwell was assumed: all senses may be inverted
    ambiguous: bool
    # level of sense +1 less the mean of both, from A-B-A differences: the Earth's rate along the
    # axis, for information only
    alternation: Alternation
    doubts: tuple[str, ...] = ()  # about the log as a whole, in words

    @property
    def by_schedule(self) -> int:
        """Number of turns that only the schedule gives."""
        return sum(turn.found_by == "schedule" for turn in self.turns)

    def senses(self, samples: int, rate: float) -> NDArray[np.int8]:
        """Return the sense of each sample, 1 or -1, and 0 where it is not to be used.

        The shape is (samples,), the rate in Hz. Missing samples count like others.
        """
        sense = np.zeros(samples, dtype=np.int8)
        for dwell in self.dwells:
            first, last = (_find_first_sample(time, rate) for time in (dwell.start, dwell.stop))
            sense[first:last] = dwell.sense
        for knock in self.knocks:
            first, last = (max(0, _find_first_sample(time, rate)) for time in knock)
            sense[first:last] = 0
        return sense


def _find_first_sample(time: float, rate: float) -> int:
    """Return the first sample not before a time, with a tolerance for rounding."""
    return int(np.ceil(time * rate - 1e-6))
