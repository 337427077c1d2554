"""What could have put the printed estimates of a turned gyro off, and what each cause asks for.

A printed estimate v of the rate w is the mean over pairs (003 eq. 14) of a run. Where noise does
not explain v - w, some other cause does, and each must have had a certain size. The sizes follow
from the printed figures alone; where a run is printed whole and by its last part, its first part
follows, and a cause that is the same throughout must put both off alike. With P the time between
turns, D the data in a dwell and L the latitude:

- a bias that drifts by r moves a pair that begins in the north by -r P / (2 cos L);
- an angle a of the turning that is left in each dwell, its sign that of the turn, by
  a / (D cos L);
- turns miscounted so that the part f of the time has the wrong sense: v = (1 - 2 f) w, so that all
  estimates lie between -w and w;
- an axis that is off the meridian by A: v = w cos A;
- a log that is cut by a clock that is off, and slips by s dwells: a dwell then holds the part s of
  its neighbour, v = (1 - 2 s) w up to one dwell, and back up to the next.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from imubench_pipeline.typing import Array

_SLIPS = 20_001
"""Rates of a clock that are tried."""


@dataclass(frozen=True)
class PrintedRun:
    """A run as its source prints it, or a part of it."""

    duration: float  # s
    value: float  # printed estimate, rad/s
    sigma: float  # what noise gives the mean over pairs, rad/s

    def without(self, last: PrintedRun) -> PrintedRun:
        """Return what is left of a run without its last part, whose pairs are others."""
        rest = self.duration - last.duration
        value = (self.duration * self.value - last.duration * last.value) / rest
        # Disjoint pairs: the variance of the whole is that of both parts by their lengths squared.
        squares = (self.duration * self.sigma) ** 2 - (last.duration * last.sigma) ** 2
        return PrintedRun(rest, value, math.sqrt(max(squares, 0.0)) / rest)


def drift_needed(off: float, period: float, latitude: float) -> float:
    """Return the drift of the bias that puts pairs off, rad/s^2, the north being first.

    ``off``: rad/s; ``period``: from turn to turn, s; the latitude in rad.
    """
    return -2.0 * math.cos(latitude) * off / period


def angle_needed(off: float, dwell: float, latitude: float) -> float:
    """Return the angle of the turning that is left in each dwell of so many s of data, rad."""
    return off * dwell * math.cos(latitude)


def wrong_part(value: float, true: float) -> float | None:
    """Return the part of a run that has the wrong sense; None where none explains the value."""
    part = 0.5 * (1.0 - value / true)
    return part if 0.0 <= part <= 1.0 else None


def heading_needed(value: float, true: float) -> float | None:
    """Return by how much the axis is off the meridian, rad; None where no angle explains it."""
    return math.acos(value / true) if abs(value) <= abs(true) else None


def apart(one: PrintedRun, other: PrintedRun) -> float:
    """Return by how many standard deviations two estimates of disjoint pairs differ."""
    return (one.value - other.value) / math.hypot(one.sigma, other.sigma)


@dataclass(frozen=True)
class WarmUp:
    """A bias that goes to its end as exp(-t / time_constant)."""

    time_constant: float  # s
    total: float  # change of the bias over the run, rad/s


def warm_up(first: float, last: float, duration: float, last_duration: float) -> WarmUp | None:
    """Return the warm-up whose mean drift is ``first`` before, and ``last`` in, a last part.

    Drifts in rad/s^2, durations in s; None where the drift does not fall, or changes its sign.
    """
    if not 0.0 < last / first < 1.0:
        return None
    rest = duration - last_duration

    def ratio(time_constant: float) -> float:
        before = -math.expm1(-rest / time_constant) / rest
        decayed = math.exp(-rest / time_constant)
        return decayed * -math.expm1(-last_duration / time_constant) / last_duration / before

    # The slower, the more alike; the ratio rises with the time constant.
    low, high = 1e-3 * duration, 1e4 * duration
    for _ in range(200):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if ratio(middle) < last / first else (low, middle)
    return WarmUp(low, first * rest + last * last_duration)


def one_miscount(whole: PrintedRun, last: PrintedRun, true: float) -> float:
    """Return how far, in sigma, the best single miscount is from both printed values at once.

    The senses are right up to a turn and wrong after it, or the other way round: the root of the
    least sum of squares over the first and the last part.
    """
    first = whole.without(last)
    flips = np.linspace(0.0, whole.duration, 6001)
    before = np.clip(flips / first.duration, 0.0, 1.0)
    after = np.clip((flips - first.duration) / last.duration, 0.0, 1.0)
    misfits = [
        np.hypot(
            (sign * (2.0 * before - 1.0) * true - first.value) / first.sigma,
            (sign * (2.0 * after - 1.0) * true - last.value) / last.sigma,
        ).min()
        for sign in (1.0, -1.0)
    ]
    return float(min(misfits))


def slipped(slip: Array) -> Array:
    """Return what is left of the rate where dwells are cut so many dwells too late, each."""
    return np.asarray(np.abs(2.0 * np.mod(slip, 2.0) - 2.0) - 1.0)


def slip_needed(parts: Sequence[PrintedRun], period: float, true: float) -> tuple[float, float]:
    """Return the relative error of a clock that explains parts in a row best, and its misfit.

    Up to a twentieth of the clock is tried, either way alike; the misfit is the root of the sum of
    squares in sigma. The period is from turn to turn, s.
    """
    errors = np.linspace(0.0, 0.05, _SLIPS)
    edges = np.cumsum([0.0, *(part.duration for part in parts)])
    squares = np.zeros(_SLIPS)
    for part, start, stop in zip(parts, edges[:-1], edges[1:], strict=True):
        ratio = (_area(errors * stop / period) - _area(errors * start / period)) / np.where(
            errors > 0.0, errors * part.duration / period, 1.0
        )
        ratio[0] = 1.0
        squares += ((ratio * true - part.value) / part.sigma) ** 2
    best = int(np.argmin(squares))
    return float(errors[best]), math.sqrt(float(squares[best]))


def _area(slip: Array) -> Array:
    """Return the integral of `slipped` from 0 on."""
    place = np.mod(slip, 2.0)
    return np.where(place <= 1.0, place - place**2, (place - 1.0) * (place - 2.0))
