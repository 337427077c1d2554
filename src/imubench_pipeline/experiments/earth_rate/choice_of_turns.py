"""Which transients and steps are turns: a dynamic programme that weighs them and the schedule."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import norm

from imubench_pipeline.experiments.earth_rate.transients import CLEAR, Event
from imubench_pipeline.typing import Array

EDGE = 0.2
"""Part of a dwell at either end of a log in which a transient is handling, and no turn."""

_APART, _CLOSEST, _LONGEST = 2.5, 0.2, 6.0
"""So many s, or dwells, at most so many s, of calm lie between two turns: what is nearer came of
the same turn."""

_MISSED = 0.07
"""Part of the dwells that last twice as long, before anything is seen."""

_RARER = 0.35
"""How much rarer each dwell more is."""

_KNOCKS = 0.01
"""Disturbances, as long as a turn, in a dwell."""

_UNLIKE = 3.5
"""What a clear transient far weaker than the usual turn costs, at most: noise it cannot be."""

_CHANCES = 8.0
"""Independent places for noise to look like a transient, 1/s."""

_BELIEF = 5.0
"""Dwells that the tolerance given counts for, beside those found."""

_SCATTER, _SCATTER_OF_STEPS = 0.4, 0.15
"""Least standard deviation of the strengths of turns: hands differ, the Earth does not."""

_WEAK, _OFTEN = math.log(2.0), 0.02
"""Strength of a turn that is hardly seen, and the part of the turns that may be so."""

_PACE, _EVEN = 5, 0.75
"""So many transients, so many of whose intervals are alike, keep a pace of their own."""

_SILENT = 0.05
"""Chance of a turn that is not seen from which a gap is filled by the schedule."""


def closest(dwell: float) -> float:
    """Return the shortest calm between two turns, s, of a nominal dwell, s."""
    return min(max(_APART, _CLOSEST * dwell), _LONGEST, 0.5 * dwell)


def choose(events: Sequence[Event], dwell: float, tolerance: float, duration: float) -> list[int]:
    """Return which events, in order of time, are turns: their places, in order.

    An event is a turn, a disturbance, or noise. The density of an interval between turns is a
    mixture about the multiples of the dwell (Student's t of 3 degrees of freedom, so that an
    unequal dwell costs no more than a doubt); disturbances and noise come at random. The sequence
    of the greatest likelihood is found again with what the turns found have in common: their
    strength, so that noise does not stand in for a missed turn among strong ones, the usual dwell,
    and how far they are from it, so that dwells may be unequal where most of them are.

    Nominal dwell, tolerance (the standard deviation of the interval between two turns) and duration
    of the log are in s.
    """
    if not events:
        return []
    time = np.array([[event.start, event.time, event.stop] for event in events])
    chance = _KNOCKS / dwell * np.exp([event.haste for event in events])
    chance = chance + _CHANCES * np.exp([-event.likelihood for event in events])
    gain = -np.log(chance)
    planned = dwell, tolerance
    chosen = _best(time, gain, dwell, tolerance, duration)
    for _ in range(3):
        if len(chosen) < 3:
            break
        dwell, tolerance = _learnt(time[chosen, 1], *planned)
        usual, scatter = strength([events[k] for k in chosen])
        weak = np.minimum(np.array([event.strength for event in events]) - usual, 0.0) / scatter
        clear = np.array([event.likelihood > CLEAR for event in events])
        cost = np.minimum(0.5 * weak**2, np.where(clear, _UNLIKE, np.inf))
        chosen = _best(time, gain - cost, dwell, tolerance, duration)
    return chosen


def shorter_dwell(events: Sequence[Event], chosen: Sequence[int], dwell: float) -> float | None:
    """Return the dwell, s, that clear transients keep, where it is far shorter than nominal.

    Where turns come at twice the pace that is declared, each second one would be a knock, evenly
    halfway. Knocks and handling do not keep a pace. Of events in order of time, with the places of
    the turns by the nominal dwell, s; None where the transients that are no turns are few, weaker,
    or at odd places.
    """
    turns = [events[k] for k in chosen]
    if len(turns) < 2:
        return None
    usual, scatter = strength(turns)
    alike = [
        event
        for event in events
        if event.kind == "transient"
        and event.likelihood > CLEAR
        and not event.haste
        and event.strength > usual - 2.0 * scatter
    ]
    if len(alike) < max(_PACE, 1.5 * len(turns)):
        return None
    interval = np.diff([event.time for event in alike])
    pace = float(np.median(interval))
    even = float(np.mean(np.abs(interval - pace) < 0.2 * pace))
    return pace if pace < 0.75 * dwell and even >= _EVEN else None


def _learnt(time: Array, dwell: float, tolerance: float) -> tuple[float, float]:
    """Return the usual dwell of a sequence, and the scale of what the dwells are off it."""
    interval = np.diff(time)
    many = np.maximum(np.rint(interval / dwell), 1.0)
    usual = float(np.median(interval / many))
    usual = min(max(usual, 0.75 * dwell), 1.25 * dwell)
    scale = float(np.median(np.abs(interval - many * usual) / np.sqrt(many))) / 0.6745
    n = len(interval)
    scale = (n * scale + _BELIEF * tolerance) / (n + _BELIEF)
    return usual, max(scale, 0.03 * dwell)


def _best(time: Array, gain: Array, dwell: float, tolerance: float, duration: float) -> list[int]:
    """Return the sequence of the greatest sum of gains and logarithms of interval densities."""
    total = np.empty(len(time))
    before = np.full(len(time), -1)
    for k in range(len(time)):
        total[k] = _at_edge(float(time[k, 1]), dwell)
        if k:
            density = interval_density(time[k, 1] - time[:k, 1], dwell, tolerance)
            calm = time[k, 0] - time[:k, 2]
            reached = total[:k] + np.where(calm < closest(dwell), -np.inf, density)
            best = int(np.argmax(reached))
            if reached[best] > total[k]:
                total[k], before[k] = reached[best], best
        total[k] += gain[k]
    ends = total + [_at_edge(duration - float(at), dwell) for at in time[:, 1]]
    k = int(np.argmax(ends))
    chosen = []
    # The last edge has a density of its own: beside it, no turn at all has two.
    while k >= 0 and ends.max() > -2.0 * math.log(dwell):
        chosen.append(k)
        k = int(before[k])
    return chosen[::-1]


def interval_density(interval: Array, dwell: float, tolerance: float) -> Array:
    """Return the logarithm of the density, 1/s, of the interval between two turns, shape (n,).

    The intervals, the nominal dwell, and the standard deviation for one dwell (for k dwells it is
    sqrt(k) times that) are in s.
    """
    nearest = np.maximum(np.rint(interval / dwell), 1.0)
    density = np.zeros(len(interval))
    for offset in (-1.0, 0.0, 1.0):
        k = nearest + offset
        weight = np.where(k > 1.0, _MISSED * _RARER ** (k - 2.0), 1.0 - _MISSED)
        scale = tolerance * np.sqrt(np.maximum(k, 1.0))
        off = (interval - k * dwell) / scale
        student = 2.0 / (math.pi * math.sqrt(3.0) * (1.0 + off**2 / 3.0) ** 2)
        density += np.where(k > 0.0, weight * student / scale, 0.0)
    # Of hundreds of dwells without a turn the density is 0, and the sequence is none.
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(density))


def _at_edge(interval: float, dwell: float) -> float:
    """Return the logarithm of the density from the end of the log to the turn next to it."""
    if interval < EDGE * dwell:
        return -math.inf
    more = max(0.0, interval / dwell - 1.3)
    return -math.log(dwell) + more * math.log(_MISSED)


def strength(turns: Sequence[Event]) -> tuple[float, float]:
    """Return what the strengths of turns are about, the median, and how they scatter.

    The scatter is the standard deviation from the median distance.
    """
    values = np.array([event.strength for event in turns])
    usual = float(np.median(values))
    stepped = sum(event.kind == "step" for event in turns) > len(turns) / 2
    least = _SCATTER_OF_STEPS if stepped else _SCATTER
    return usual, max(least, float(np.median(np.abs(values - usual))) / 0.6745)


def may_be_silent(turns: Sequence[Event]) -> bool:
    """Tell whether a turn as these are may leave nothing to see.

    By the median and scatter of their strengths, or where some are hardly above what can be seen.
    """
    usual, scatter = strength(turns)
    weak = np.mean([event.kind == "transient" and event.strength < _WEAK for event in turns])
    return bool(norm.cdf(-usual / scatter) > _SILENT or weak > _OFTEN)
