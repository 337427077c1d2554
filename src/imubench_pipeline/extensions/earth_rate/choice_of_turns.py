"""Find turns by the events of a log, and by the schedule where there are none.

The events that are turns are chosen by dynamic programming with the schedule (`choose_turns`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from imubench_pipeline.extensions.earth_rate.turns import (
    CLEAR_LOG_LIKELIHOOD,
    Event,
    LevelBlocks,
    Turn,
    estimate_alternation,
    find_best_shift,
    split_at_turns,
)
from imubench_pipeline.typing import Array

EDGE_DWELL_FRACTION = 0.2  # of a dwell at either end of a log: a transient there is handling

_MIN_CALM, _MIN_CALM_PER_DWELL, _MAX_REQUIRED_CALM = 2.5, 0.2, 6.0
"""Least calm between two turns, in s, in dwells, and its upper limit in s; closer events belong to
the same turn."""

_DOUBLE_DWELL_SHARE = 0.07  # prior share of the dwells that last twice as long
_EXTRA_DWELL_FACTOR = 0.35  # factor on the prior share for each further dwell without a turn
_KNOCKS_PER_DWELL = 0.01  # expected disturbances as long as a turn, per dwell
_MAX_WEAKNESS_COST = 3.5  # log-likelihood cost of a clear transient weaker than the usual turn
_FALSE_ALARM_PLACES = 8.0  # independent places where noise can look like a transient, 1/s
_PRIOR_DWELLS = 5.0  # weight of the given tolerance, in dwells, against the dwells found

_MIN_STRENGTH_SIGMA, _MIN_STEP_STRENGTH_SIGMA = 0.4, 0.15
"""Least standard deviation of the strengths of turns. Turns by hand vary more than steps, whose
height is set by the Earth's rate."""

# Strength below which a turn is hardly detectable, and the largest share of such turns
_WEAK_STRENGTH, _MAX_WEAK_SHARE = math.log(2.0), 0.02
# Least number of transients, and least share of equal intervals, that show a pace of their own
_MIN_PACE_TRANSIENTS, _MIN_EQUAL_INTERVAL_SHARE = 5, 0.75
_MAX_MISS_PROBABILITY = 0.05  # of a turn, above which the schedule fills a gap
_MIN_SEEN_SHARE = 0.4  # of the scheduled turns, for the events to decide
_MIN_ALTERNATION_SIGMAS = 3.0  # least alternation of a log without transients that was turned
_MIN_SHIFT_SIGMAS = 6.0  # least alternation that may shift the start of the schedule
_KNOCK_MARGIN = 0.25  # margin that is left out on either side of a knock, s


@dataclass(frozen=True)
class TurnSchedule:
    """The turns as stated with the log: dwell, start and tolerances."""

    # dwell, start, turning, margin: as of `turning.find_turning`, s
    dwell: float
    start: float
    turning: float
    tolerance: float  # standard deviation of a turn from the schedule, s; left out on both sides
    margin: float
    duration: float  # of the log, s


def find_turns(
    blocks: LevelBlocks, events: list[Event], schedule: TurnSchedule, trust: bool
) -> tuple[list[Turn], list[tuple[float, float]], list[str]]:
    """Return turns (at least one), knocks and doubts of a log without a position column, in order.

    The events are in order of time; ``trust`` accepts the schedule if nothing is detected. Knocks
    are start and stop, s. Raises ValueError if there is no evidence of turns, nor trust.
    """
    chosen = choose_turns(events, schedule.dwell, schedule.tolerance, schedule.duration)
    declared = schedule.dwell
    pace = find_shorter_dwell(events, chosen, declared)
    if pace is not None:
        schedule = replace(
            schedule,
            dwell=pace,
            tolerance=schedule.tolerance * pace / declared,
            turning=min(schedule.turning, 0.4 * pace),
        )
        chosen = choose_turns(events, schedule.dwell, schedule.tolerance, schedule.duration)
    expected = max(1.0, round((schedule.duration - schedule.start) / schedule.dwell) - 1.0)
    doubts: list[str] = []
    if len(chosen) >= _MIN_SEEN_SHARE * expected:
        turns, rest = _merge_into_turns(events, chosen, schedule)
        seen = _fill_gaps([events[k] for k in chosen], turns, schedule, blocks)
    else:
        seen, rest, doubts = _follow_schedule(blocks, events, schedule, trust)
    quick = [e for e in rest if e.kind == "transient"]
    edge = EDGE_DWELL_FRACTION * schedule.dwell
    if any(
        event.is_clear and not edge <= event.time <= schedule.duration - edge for event in quick
    ):
        doubts.append("handling at the ends of the log is left out")
    silent = sum(turn.found_by == "schedule" for turn in seen)
    if silent:
        doubts.append(
            f"{silent} of {len(seen)} turns are from the schedule only: they are not visible in "
            "the log"
        )
    usual = float(np.median(np.diff([turn.time for turn in seen]))) if len(seen) > 1 else declared
    if abs(usual / declared - 1.0) > 0.25:
        doubts.append(f"the usual dwell is {usual:.1f} s, not {declared:g} s")
    return seen, list_disturbances(quick), doubts


def _merge_into_turns(
    events: list[Event], chosen: Sequence[int], schedule: TurnSchedule
) -> tuple[list[Turn], list[Event]]:
    """Return turns from the chosen events, merged with events of the same turn, and the others."""
    near = compute_min_calm(schedule.dwell)
    turns: list[Turn] = []
    used = set(chosen)
    for k in chosen:
        event = events[k]
        doubts = []
        start, stop, peak = event.start, event.stop, event.peak
        for step in (-1, 1):
            i = k + step
            while 0 <= i < len(events) and i not in used:
                other = events[i]
                # A near event belongs to the turn: overshoot and return.
                gap = max(other.start - stop, start - other.stop)
                if gap > near:
                    break
                if other.is_clear and other.kind == "transient":
                    start, stop = min(start, other.start), max(stop, other.stop)
                    peak = max(peak, other.peak)
                    used.add(i)
                    doubts = ["overrun and returned, or handled near the turn"]
                i += step
        if event.likelihood < CLEAR_LOG_LIKELIHOOD:
            doubts.append("only slightly above the noise")
        if event.haste:
            doubts.append("as short as a knock")
        if event.kind == "step":
            doubts.append("no transient: a step of the level alone")
        middle = 0.5 * (start + stop)
        margin = schedule.margin + (0.5 * schedule.turning if event.kind == "step" else 0.0)
        turns.append(Turn(start - margin, stop + margin, middle, event.kind, peak, tuple(doubts)))
    return turns, [event for i, event in enumerate(events) if i not in used]


def _fill_gaps(
    chosen: list[Event], turns: list[Turn], schedule: TurnSchedule, blocks: LevelBlocks
) -> list[Turn]:
    """Insert scheduled turns where turns may be missed: too weak, or without samples."""
    silent = is_detection_uncertain(chosen)
    time = np.array([turn.time for turn in turns])
    gaps = np.diff(time)
    single = gaps[(gaps > 0.5 * schedule.dwell) & (gaps < 1.5 * schedule.dwell)]
    usual = float(np.median(single)) if len(single) else schedule.dwell
    filled: list[Turn] = []
    edge = (EDGE_DWELL_FRACTION + 0.3) * schedule.dwell
    if silent:
        more = np.arange(time[0] - usual, edge, -usual)[::-1]
        filled += [_make_silent_turn(float(at), schedule) for at in more]
    for k, turn in enumerate(turns):
        many = max(1, round(float(gaps[k - 1]) / usual)) if k else 1
        missed = 0
        for at in np.linspace(time[k - 1], time[k], many + 1)[1:-1].tolist() if many > 1 else []:
            first = max(0, int((at - 0.5 * schedule.turning) / blocks.length))
            last = int((at + 0.5 * schedule.turning) / blocks.length)
            if silent or not blocks.present[first : last + 1].any():
                filled.append(_make_silent_turn(at, schedule))
            else:
                missed += 1
        if missed:
            words = f"{gaps[k - 1]:.0f} s after the turn before: {missed} turn missed?"
            turn = replace(turn, doubts=(*turn.doubts, words))
        filled.append(turn)
    if silent:
        more = np.arange(time[-1] + usual, schedule.duration - edge, usual)
        filled += [_make_silent_turn(float(at), schedule) for at in more]
    return filled


def _make_silent_turn(time: float, schedule: TurnSchedule) -> Turn:
    half = _compute_half_width(schedule)
    words = ("not visible: from the schedule only",)
    return Turn(time - half, time + half, time, "schedule", None, words)


def _compute_half_width(schedule: TurnSchedule) -> float:
    """Return half of the time that is left out about a turn that is not detected, s."""
    return min(schedule.tolerance + 0.5 * schedule.turning, 0.4 * schedule.dwell)


def _follow_schedule(
    blocks: LevelBlocks, events: list[Event], schedule: TurnSchedule, trust: bool
) -> tuple[list[Turn], list[Event], list[str]]:
    """Return the turns of the schedule, each replaced by a clear transient near it."""
    half = _compute_half_width(schedule)
    longest = schedule.duration - EDGE_DWELL_FRACTION * schedule.dwell
    count = max(0, math.ceil((longest - schedule.start) / schedule.dwell))
    slots: Array = schedule.start + schedule.dwell * np.arange(1.0, count) + 0.5 * schedule.turning
    slots = slots[(slots > half) & (slots < longest)]
    if len(slots) == 0:
        raise ValueError(f"the schedule has no turn within the log of {schedule.duration:g} s")
    calm = leave_out_knocks(blocks, list_disturbances([e for e in events if e.kind == "transient"]))
    longest_shift = min(schedule.dwell / 3.0, 3.0 * schedule.tolerance)
    shift, z, unshifted = find_best_shift(
        calm, slots, 0.5 * schedule.turning, longest_shift, schedule.duration
    )
    doubts: list[str] = []
    by_step = abs(z) > _MIN_SHIFT_SIGMAS and z**2 - unshifted**2 > 2.0 * CLEAR_LOG_LIKELIHOOD
    if by_step:
        slots = slots + shift
        slots = slots[(slots > half) & (slots < schedule.duration - half)]
        doubts.append(f"the level alternates {shift:+.1f} s from the schedule: that is used")
    else:
        # At the used shift, not the best one: a search exceeds 3 in one of 50 logs at rest.
        size = abs(estimate_alternation(calm, split_at_turns(slots, half, schedule.duration)).z)
        if not (size >= _MIN_ALTERNATION_SIGMAS or trust):
            raise ValueError(
                f"nothing shows that the log was turned every {schedule.dwell:g} s: no transients, "
                f"and its level alternates by {size:.1f} standard errors; if the log was turned by "
                "the clock, set trust_schedule"
            )
        doubts.append(
            f"no turns are visible: the schedule is used, and the level alternates with it by "
            f"{size:.1f} standard errors"
        )
    turns, used = [], set()
    for slot in slots.tolist():
        near = [
            k
            for k, e in enumerate(events)
            if abs(e.time - slot) < 2.0 * schedule.tolerance and e.is_clear and k not in used
        ]
        if near:
            best = max(near, key=lambda k: events[k].likelihood)
            used.update(near)
            turns += _merge_into_turns([events[best]], [0], schedule)[0]
        elif by_step:
            words = ("no transient: the level alternates with the schedule",)
            turns.append(Turn(slot - half, slot + half, slot, "step", None, words))
        else:
            turns.append(_make_silent_turn(slot, schedule))
    return turns, [e for k, e in enumerate(events) if k not in used], doubts


def list_disturbances(events: Sequence[Event]) -> list[tuple[float, float]]:
    """Return start and stop, s, of the transients to leave out, which are clear or short."""
    return [
        (event.start - _KNOCK_MARGIN, event.stop + _KNOCK_MARGIN)
        for event in events
        if event.haste or event.likelihood > CLEAR_LOG_LIKELIHOOD
    ]


def leave_out_knocks(blocks: LevelBlocks, knocks: Sequence[tuple[float, float]]) -> LevelBlocks:
    """Mark the blocks from start to stop, s, of each knock as missing; return all blocks."""
    present = blocks.present.copy()
    for start, stop in knocks:
        first, last = int(start / blocks.length), math.ceil(stop / blocks.length)
        present[max(0, first) : max(0, last)] = False
    return replace(blocks, present=present)


def compute_min_calm(dwell: float) -> float:
    """Return the shortest calm between two turns, s, for a nominal dwell, s."""
    return min(max(_MIN_CALM, _MIN_CALM_PER_DWELL * dwell), _MAX_REQUIRED_CALM, 0.5 * dwell)


def choose_turns(
    events: Sequence[Event], dwell: float, tolerance: float, duration: float
) -> list[int]:
    """Choose the turns among events in order of time; return their indices, in order.

    An event is a turn, a disturbance, or noise. The density of an interval between turns is a
    mixture about the multiples of the dwell (Student's t of 3 degrees of freedom). The sequence of
    the greatest likelihood is searched again with strength, usual dwell and scatter of the turns
    found. Dwell, tolerance (standard deviation of an interval) and duration of the log are in s.
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
        # The usual dwell, and the scale of the deviations from it, s.
        interval = np.diff(time[chosen, 1])
        many = np.maximum(np.rint(interval / planned[0]), 1.0)
        dwell = float(np.median(interval / many))
        dwell = min(max(dwell, 0.75 * planned[0]), 1.25 * planned[0])
        scale = float(np.median(np.abs(interval - many * dwell) / np.sqrt(many))) / 0.6745
        n = len(interval)
        scale = (n * scale + _PRIOR_DWELLS * planned[1]) / (n + _PRIOR_DWELLS)
        tolerance = max(scale, 0.03 * planned[0])
        usual, scatter = estimate_strength([events[k] for k in chosen])
        weak = np.minimum(np.array([event.strength for event in events]) - usual, 0.0) / scatter
        clear = np.array([event.likelihood > CLEAR_LOG_LIKELIHOOD for event in events])
        cost = np.minimum(0.5 * weak**2, np.where(clear, _MAX_WEAKNESS_COST, np.inf))
        chosen = _find_best_sequence(time, gain - cost, dwell, tolerance, duration)
    return chosen


def find_shorter_dwell(
    events: Sequence[Event], chosen: Sequence[int], dwell: float
) -> float | None:
    """Return the dwell between clear transients, s, if far shorter than nominal; else None.

    If turns are twice as frequent as declared, `choose_turns` takes every second one for a knock,
    but these knocks are periodic. The events are in order of time; ``chosen`` are the indices of
    the turns by the nominal dwell.
    """
    turns = [events[k] for k in chosen]
    if len(turns) < 2:
        return None
    usual, scatter = estimate_strength(turns)
    alike = [
        event
        for event in events
        if event.kind == "transient" and event.is_clear and event.strength > usual - 2.0 * scatter
    ]
    if len(alike) < max(_MIN_PACE_TRANSIENTS, 1.5 * len(turns)):
        return None
    interval = np.diff([event.time for event in alike])
    pace = float(np.median(interval))
    even = float(np.mean(np.abs(interval - pace) < 0.2 * pace))
    return pace if pace < 0.75 * dwell and even >= _MIN_EQUAL_INTERVAL_SHARE else None


def _find_best_sequence(
    time: Array, gain: Array, dwell: float, tolerance: float, duration: float
) -> list[int]:
    """Return the sequence of the greatest sum of gains and logarithms of interval densities."""
    total = np.empty(len(time))
    before = np.full(len(time), -1)
    for k in range(len(time)):
        total[k] = _compute_edge_log_density(float(time[k, 1]), dwell)
        if k:
            density = compute_interval_log_density(time[k, 1] - time[:k, 1], dwell, tolerance)
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


def compute_interval_log_density(interval: Array, dwell: float, tolerance: float) -> Array:
    """Return the log density, 1/s, of intervals between turns, shape (n,); all arguments in s."""
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


def estimate_strength(turns: Sequence[Event]) -> tuple[float, float]:
    """Return the median strength of turns, and its robust standard deviation."""
    values = np.array([event.strength for event in turns])
    usual = float(np.median(values))
    stepped = sum(event.kind == "step" for event in turns) > len(turns) / 2
    least = _MIN_STEP_STRENGTH_SIGMA if stepped else _MIN_STRENGTH_SIGMA
    return usual, max(least, float(np.median(np.abs(values - usual))) / 0.6745)


def is_detection_uncertain(turns: Sequence[Event]) -> bool:
    """Return whether further turns, as strong as the detected ones, may be undetected."""
    usual, scatter = estimate_strength(turns)
    weak = np.mean(
        [event.kind == "transient" and event.strength < _WEAK_STRENGTH for event in turns]
    )
    return bool(norm.cdf(-usual / scatter) > _MAX_MISS_PROBABILITY or weak > _MAX_WEAK_SHARE)
