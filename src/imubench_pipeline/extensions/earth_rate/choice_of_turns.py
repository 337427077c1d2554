"""Choose the transients and steps that are turns, by dynamic programming with the schedule."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.stats import norm

from imubench_pipeline.extensions.earth_rate.transients import CLEAR_LOG_LIKELIHOOD, Event
from imubench_pipeline.typing import Array

EDGE_DWELL_FRACTION = 0.2
"""Part of a dwell at either end of a log; a transient there is handling, not a turn."""

_MIN_CALM, _MIN_CALM_PER_DWELL, _MAX_REQUIRED_CALM = 2.5, 0.2, 6.0
"""Least calm between two turns, in s, in dwells, and its upper limit in s; closer events belong to
the same turn."""

_DOUBLE_DWELL_SHARE = 0.07  # prior share of the dwells that last twice as long
_EXTRA_DWELL_FACTOR = 0.35  # factor on the prior share for each further dwell without a turn
_KNOCKS_PER_DWELL = 0.01  # expected disturbances as long as a turn, per dwell

_MAX_WEAKNESS_COST = 3.5
"""Largest log-likelihood cost of a clear transient that is weaker than the usual turn; noise is
excluded for it."""

_FALSE_ALARM_PLACES = 8.0  # independent places where noise can look like a transient, 1/s
# Weight of the given tolerance, as a number of dwells, against the dwells found
_PRIOR_DWELLS = 5.0

_MIN_STRENGTH_SIGMA, _MIN_STEP_STRENGTH_SIGMA = 0.4, 0.15
"""Least standard deviation of the strengths of turns. Turns by hand vary more than steps, whose
height is set by the Earth's rate."""

# Strength below which a turn is hardly detectable, and the largest share of such turns
_WEAK_STRENGTH, _MAX_WEAK_SHARE = math.log(2.0), 0.02
# Least number of transients, and least share of equal intervals, that show a pace of their own
_MIN_PACE_TRANSIENTS, _MIN_EQUAL_INTERVAL_SHARE = 5, 0.75
# Probability that a turn is not detected, above which the schedule fills a gap
_MAX_MISS_PROBABILITY = 0.05


def compute_min_calm(dwell: float) -> float:
    """Return the shortest calm between two turns, s, for a nominal dwell, s."""
    return min(max(_MIN_CALM, _MIN_CALM_PER_DWELL * dwell), _MAX_REQUIRED_CALM, 0.5 * dwell)


def choose(events: Sequence[Event], dwell: float, tolerance: float, duration: float) -> list[int]:
    """Choose the turns among events in order of time; return their indices, in order.

    An event is a turn, a disturbance, or noise. The density of an interval between turns is a
    mixture about the multiples of the dwell (Student's t of 3 degrees of freedom, so that an
    unequal dwell costs no more than a doubt); disturbances and noise come at random. The sequence
    of the greatest likelihood is searched again with the properties of the turns found: their
    strength, so that noise does not replace a missed turn among strong ones, the usual dwell, and
    the scatter of the dwells, so that dwells may be unequal if most of them are.

    Nominal dwell, tolerance (the standard deviation of the interval between two turns) and duration
    of the log are in s.
    """
    if not events:
        return []
    time = np.array([[event.start, event.time, event.stop] for event in events])
    chance = _KNOCKS_PER_DWELL / dwell * np.exp([event.haste for event in events])
    chance = chance + _FALSE_ALARM_PLACES * np.exp([-event.likelihood for event in events])
    gain = -np.log(chance)
    planned = dwell, tolerance
    chosen = _find_best_sequence(time, gain, dwell, tolerance, duration)
    for _ in range(3):
        if len(chosen) < 3:
            break
        dwell, tolerance = _estimate_dwell(time[chosen, 1], *planned)
        usual, scatter = strength([events[k] for k in chosen])
        weak = np.minimum(np.array([event.strength for event in events]) - usual, 0.0) / scatter
        clear = np.array([event.likelihood > CLEAR_LOG_LIKELIHOOD for event in events])
        cost = np.minimum(0.5 * weak**2, np.where(clear, _MAX_WEAKNESS_COST, np.inf))
        chosen = _find_best_sequence(time, gain - cost, dwell, tolerance, duration)
    return chosen


def shorter_dwell(events: Sequence[Event], chosen: Sequence[int], dwell: float) -> float | None:
    """Return the dwell of the clear transients, s, if it is far shorter than nominal.

    If turns come at twice the declared pace, each second turn is taken for a knock, halfway
    between two others. Knocks and handling are not periodic. The events are in order of time, with
    the indices of the turns chosen by the nominal dwell, s. None if the other transients are few,
    weaker, or not periodic.
    """
    turns = [events[k] for k in chosen]
    if len(turns) < 2:
        return None
    usual, scatter = strength(turns)
    alike = [
        event
        for event in events
        if event.kind == "transient"
        and event.likelihood > CLEAR_LOG_LIKELIHOOD
        and not event.haste
        and event.strength > usual - 2.0 * scatter
    ]
    if len(alike) < max(_MIN_PACE_TRANSIENTS, 1.5 * len(turns)):
        return None
    interval = np.diff([event.time for event in alike])
    pace = float(np.median(interval))
    even = float(np.mean(np.abs(interval - pace) < 0.2 * pace))
    return pace if pace < 0.75 * dwell and even >= _MIN_EQUAL_INTERVAL_SHARE else None


def _estimate_dwell(time: Array, dwell: float, tolerance: float) -> tuple[float, float]:
    """Return the usual dwell of a sequence, and the scale of the deviations from it, s."""
    interval = np.diff(time)
    many = np.maximum(np.rint(interval / dwell), 1.0)
    usual = float(np.median(interval / many))
    usual = min(max(usual, 0.75 * dwell), 1.25 * dwell)
    scale = float(np.median(np.abs(interval - many * usual) / np.sqrt(many))) / 0.6745
    n = len(interval)
    scale = (n * scale + _PRIOR_DWELLS * tolerance) / (n + _PRIOR_DWELLS)
    return usual, max(scale, 0.03 * dwell)


def _find_best_sequence(
    time: Array, gain: Array, dwell: float, tolerance: float, duration: float
) -> list[int]:
    """Return the sequence of the greatest sum of gains and logarithms of interval densities."""
    total = np.empty(len(time))
    before = np.full(len(time), -1)
    for k in range(len(time)):
        total[k] = _compute_edge_log_density(float(time[k, 1]), dwell)
        if k:
            density = interval_density(time[k, 1] - time[:k, 1], dwell, tolerance)
            calm = time[k, 0] - time[:k, 2]
            reached = total[:k] + np.where(calm < compute_min_calm(dwell), -np.inf, density)
            best = int(np.argmax(reached))
            if reached[best] > total[k]:
                total[k], before[k] = reached[best], best
        total[k] += gain[k]
    ends = total + [_compute_edge_log_density(duration - float(at), dwell) for at in time[:, 1]]
    k = int(np.argmax(ends))
    chosen = []
    # A log without a turn has two such edge densities; a sequence must exceed them.
    while k >= 0 and ends.max() > -2.0 * math.log(dwell):
        chosen.append(k)
        k = int(before[k])
    return chosen[::-1]


def interval_density(interval: Array, dwell: float, tolerance: float) -> Array:
    """Return the logarithm of the density, 1/s, of the interval between two turns, shape (n,).

    The intervals, the nominal dwell, and the standard deviation for one dwell (for k dwells it is
    sqrt(k) times as large) are in s.
    """
    nearest = np.maximum(np.rint(interval / dwell), 1.0)
    density = np.zeros(len(interval))
    for offset in (-1.0, 0.0, 1.0):
        k = nearest + offset
        weight = np.where(
            k > 1.0,
            _DOUBLE_DWELL_SHARE * _EXTRA_DWELL_FACTOR ** (k - 2.0),
            1.0 - _DOUBLE_DWELL_SHARE,
        )
        scale = tolerance * np.sqrt(np.maximum(k, 1.0))
        off = (interval - k * dwell) / scale
        student = 2.0 / (math.pi * math.sqrt(3.0) * (1.0 + off**2 / 3.0) ** 2)
        density += np.where(k > 0.0, weight * student / scale, 0.0)
    # The density of hundreds of dwells without a turn is 0, which excludes the sequence.
    with np.errstate(divide="ignore"):
        return np.asarray(np.log(density))


def _compute_edge_log_density(interval: float, dwell: float) -> float:
    """Return the log density of the interval from an end of the log to the nearest turn."""
    if interval < EDGE_DWELL_FRACTION * dwell:
        return -math.inf
    more = max(0.0, interval / dwell - 1.3)
    return -math.log(dwell) + more * math.log(_DOUBLE_DWELL_SHARE)


def strength(turns: Sequence[Event]) -> tuple[float, float]:
    """Return the median strength of turns, and its standard deviation.

    The standard deviation follows from the median absolute deviation.
    """
    values = np.array([event.strength for event in turns])
    usual = float(np.median(values))
    stepped = sum(event.kind == "step" for event in turns) > len(turns) / 2
    least = _MIN_STEP_STRENGTH_SIGMA if stepped else _MIN_STRENGTH_SIGMA
    return usual, max(least, float(np.median(np.abs(values - usual))) / 0.6745)


def may_be_silent(turns: Sequence[Event]) -> bool:
    """Return whether a turn like these may be too weak to detect.

    It follows from the median and scatter of their strengths, or from the share of turns that are
    hardly above the detection limit.
    """
    usual, scatter = strength(turns)
    weak = np.mean(
        [event.kind == "transient" and event.strength < _WEAK_STRENGTH for event in turns]
    )
    return bool(norm.cdf(-usual / scatter) > _MAX_MISS_PROBABILITY or weak > _MAX_WEAK_SHARE)
