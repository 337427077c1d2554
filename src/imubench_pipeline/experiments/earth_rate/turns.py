"""What is found in the log of a gyro that was turned: dwells, turns, and what to leave out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.experiments.earth_rate.alternation import Alternation
from imubench_pipeline.experiments.earth_rate.experiment import Dwell

FoundBy = Literal["transient", "step", "schedule", "column"]

SURE: tuple[FoundBy, ...] = ("column", "transient", "step", "schedule")
"""What turns are found by, the surest first."""


@dataclass(frozen=True)
class Turn:
    """A turn of the sensor."""

    # start, stop: s from the first sample; what is left out for it, with the margin
    start: float
    stop: float
    time: float  # its middle as found, s
    found_by: FoundBy
    peak: float | None = None  # largest rate sensed of it, or the step, rad/s
    doubts: tuple[str, ...] = ()  # what speaks against it, in words


@dataclass(frozen=True)
class FoundDwell:
    """A dwell between two turns, or between a turn and an end of the log."""

    # start, stop: s from the first sample; the turning beside it is left out
    start: float
    stop: float
    sense: int  # +1 or -1
    found_by: FoundBy = "schedule"  # how the less sure of the turns beside it was found
    # what to doubt about its length and sense, in words; empty where nothing is
    doubts: tuple[str, ...] = ()

    def in_samples(self, rate: float) -> Dwell:
        """Return the dwell as an experiment at a rate, Hz, has it: the samples that lie in it.

        Raises
        ------
        ValueError
            If none does.
        """
        return Dwell(_whole(self.start, rate), _whole(self.stop, rate), self.sense)


@dataclass(frozen=True)
class Turning:
    """The dwells and turns of a log."""

    dwells: tuple[FoundDwell, ...]  # in order; the sense alternates
    turns: tuple[Turn, ...]  # in order
    # start and stop of disturbances that are no turns, s: not to be used either
    knocks: tuple[tuple[float, float], ...]
    # whether the sense of the first dwell was assumed: all senses may be the other way round
    ambiguous: bool
    # level of sense +1 less the mean of both, from A-B-A differences: the Earth's rate as sensed,
    # for a look at it and no more
    alternation: Alternation
    doubts: tuple[str, ...] = ()  # about the log as a whole, in words

    @property
    def by_schedule(self) -> int:
        """How many turns rest on the schedule alone."""
        return sum(turn.found_by == "schedule" for turn in self.turns)

    def senses(self, samples: int, rate: float) -> NDArray[np.int8]:
        """Return the sense of each sample, 1 or -1, and 0 where it is not to be used.

        The shape is (samples,), the rate in Hz. Missing samples are not told apart.
        """
        sense = np.zeros(samples, dtype=np.int8)
        for dwell in self.dwells:
            sense[_whole(dwell.start, rate) : _whole(dwell.stop, rate)] = dwell.sense
        for start, stop in self.knocks:
            sense[max(0, _whole(start, rate)) : max(0, _whole(stop, rate))] = 0
        return sense


def _whole(time: float, rate: float) -> int:
    """Return the first sample that is not before a time; a last digit does not move it."""
    return int(np.ceil(time * rate - 1e-6))
