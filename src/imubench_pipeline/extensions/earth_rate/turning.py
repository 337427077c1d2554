"""Dwells and turning points of a gyro that is turned end for end, from its log.

Turning a sensitive axis end for end is a rotation about an axis perpendicular to it: the gyro
senses cross-axis coupling and handling, which may be strong or absent. Turns are taken from a
column with the position, else from events in the log, else from the schedule. `find_stays` reads
turns from such a column.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.extensions.earth_rate.choice_of_turns import (
    EDGE_DWELL_FRACTION,
    TurnSchedule,
    find_turns,
    leave_out_knocks,
    list_disturbances,
)
from imubench_pipeline.extensions.earth_rate.turns import (
    DETECTION_ORDER,
    Event,
    FoundDwell,
    Turn,
    Turning,
    average_log_blocks,
    detect_steps,
    detect_transients,
    estimate_alternation,
    find_contradiction,
    find_outliers,
)
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

_POSITION_TOLERANCE = 0.1  # about a position, as a share of the distance between the two


@dataclass(frozen=True)
class Stays:
    """Intervals in which a sensor stays in one of its two positions."""

    # start, stop: shape (n,); s; between two of them, the gyro turns
    start: Array
    stop: Array
    high: NDArray[np.bool_]  # shape (n,); whether it is the larger position; alternates
    senses: bool  # whether the column has +1 and -1, and so gives the sense
    away: bool  # whether the column is in neither position for a twentieth of the time


def find_stays(position: Array, rate: float, shortest: float) -> Stays:
    """Find the intervals in which a sensor stays in one of two positions, from a column.

    The positions are the medians of the values below and above mid-range; samples within a tenth of
    their distance belong to a position. The column, shape (n,), is in any unit, NaN where it is not
    known; an angle must not wrap at a position. The rate is in Hz; stays below ``shortest``, s, are
    overshoots. Raises ValueError if the column has fewer than two positions.
    """
    finite = np.flatnonzero(np.isfinite(position))
    if len(finite) == 0:
        raise ValueError("the column with the position has no numbers")
    value = position[finite]
    middle = 0.5 * (float(value.min()) + float(value.max()))
    if value.min() == value.max():
        raise ValueError(f"the position is {middle:g} throughout: the log never turns")
    low, high = float(np.median(value[value <= middle])), float(np.median(value[value > middle]))
    near = _POSITION_TOLERANCE * (high - low)
    state = np.where(np.abs(value - high) <= near, 1, np.where(np.abs(value - low) <= near, 0, -1))
    change = np.flatnonzero(np.diff(state)) + 1
    first = np.concatenate(([0], change))
    last = np.concatenate((change, [len(state)])) - 1
    merged: list[list[float]] = []
    away = 0.0
    for a, b in zip(first, last, strict=True):
        start, stop = finite[a] / rate, (finite[b] + 1) / rate
        if state[a] < 0 or stop - start < shortest:
            away += (stop - start) if stop - start > shortest else 0.0
            continue
        if merged and merged[-1][2] == state[a]:
            merged[-1][1] = stop
        else:
            merged.append([start, stop, state[a]])
    if len(merged) < 2:
        raise ValueError(
            "the column with the position does not show two positions: the log has no turns"
        )
    table = np.array(merged)
    return Stays(
        table[:, 0],
        table[:, 1],
        table[:, 2] == 1,
        bool(np.allclose([low, high], [-1.0, 1.0], atol=0.05)),
        away > 0.05 * len(position) / rate,
    )


def find_turning(
    log: Array,
    rate: float,
    dwell: float,
    *,
    turning: float = 2.0,
    start: float = 0.0,
    first_sense: int | None = None,
    position: Array | None = None,
    model: NoiseModel | None = None,
    margin: float = 0.5,
    trust_schedule: bool = False,
) -> Turning:
    """Find the dwells and the turning points of a log.

    A column with the position is used if there is one. Else the transients and steps that fit the
    schedule best are chosen (`extensions.earth_rate.choice_of_turns.choose_turns`), and weak turns
    are inserted from the schedule; it gives all turns if fewer than 40 % are detected. A transient
    within a fifth of a dwell of an end of the log is handling. ``benchmarks/dwell_detection.py``
    measures how often turns are found.

    The sense alternates at each turn; an extra or a missed turn inverts all later senses, which
    raises a doubt. The first sense is given, or +1 is assumed and the result is ``ambiguous``. The
    known rate of the Earth is not used. Without a transient, the log must alternate by 3 standard
    errors with the schedule, which favours large estimates, unless ``trust_schedule``.

    The log, shape (n,), is in rad/s, NaN where a sample is missing; the rate in Hz. ``dwell`` is
    from the start of a turn to the start of the next, ``margin`` is left out on both sides of a
    detected turn; ``turning`` and ``start`` of the first dwell are for turns that are not detected;
    all in s. ``position``, shape (n,): see `find_stays`. ``model``: the noise at rest, SI, by
    default estimated from the log. Raises ValueError if the log is shorter than two dwells, or
    there is no evidence of turns.
    """
    duration = len(log) / rate
    if duration < 2.0 * dwell - 1.0 / rate:
        raise ValueError(f"the log lasts {duration:g} s, less than two dwells of {dwell:g} s")
    tolerance = max(0.1 * dwell, min(2.0, 0.2 * dwell))
    schedule = TurnSchedule(dwell, start, turning, tolerance, margin, duration)
    blocks = average_log_blocks(log, rate, dwell, model)
    # Transients and steps; of near ones, the greater.
    events = detect_transients(blocks, log, rate)
    near = max(3.0, 0.1 * dwell)
    for step in detect_steps(blocks, dwell, model, rate):
        beside = [e for e in events if e.start - near < step.time < e.stop + near]
        # The level follows a step at once, except in the blocks of the step itself.
        greater = [e for e in beside if e.kind == "transient" and e.peak > 1.5 * step.peak]
        if all(event.haste for event in greater):
            events = [e for e in events if e not in beside or e in greater]
            events.append(step)
    events.sort(key=lambda event: event.time)
    doubts = []
    if blocks.rough:
        doubts.append("the noise of the log differs from the model: the noise of the log is used")
    column_sense = None
    if position is not None:
        turns, knocks, column_sense, more_doubts = _find_turns_in_column(
            position, rate, events, schedule
        )
    else:
        turns, knocks, more_doubts = find_turns(blocks, events, schedule, trust_schedule)
    doubts += more_doubts
    stretches = _find_stretches(turns, knocks, schedule)
    short = sum(stop - start < 0.1 * dwell for start, stop in stretches)
    if short:
        doubts.append(f"{short} dwells are shorter than a tenth of {dwell:g} s")
    knocks = sorted([*knocks, *_select_outliers(find_outliers(blocks, log, rate), turns, knocks)])
    knocks = [(max(start, 0.0), min(stop, schedule.duration)) for start, stop in knocks]
    signs = leave_out_knocks(blocks, knocks)
    size = estimate_alternation(signs, stretches)
    first = column_sense or first_sense or 1
    if first_sense not in (None, first):
        doubts.append(f"the first sense is {first:+d} by the column, {first_sense:+d} was given")
    ambiguous = first_sense is None and column_sense is None
    if ambiguous:
        doubts.append("the sense of the first dwell is assumed: all signs may be wrong")
    place = find_contradiction(signs, stretches)
    if place is not None:
        doubts.append(
            f"from {stretches[place][0]:.0f} s on the log alternates the other way: "
            "a turn too many or too few near there?"
        )
    return Turning(
        tuple(_build_dwells(stretches, turns, first, schedule)),
        tuple(turns),
        tuple(knocks),
        ambiguous,
        replace(size, value=first * size.value),
        tuple(doubts),
    )


def _find_turns_in_column(
    position: Array, rate: float, events: list[Event], schedule: TurnSchedule
) -> tuple[list[Turn], list[tuple[float, float]], int | None, list[str]]:
    column_stays = find_stays(position, rate, 0.1 * schedule.dwell)
    turns, used = [], set()
    for stop, start in zip(column_stays.stop[:-1], column_stays.start[1:], strict=True):
        first, last, peak = float(stop), float(start), None
        for k, event in enumerate(events):
            near = event.stop > stop - 3.0 and event.start < start + 3.0
            if near and event.is_clear:
                first, last = min(first, event.start), max(last, event.stop)
                peak = max(peak or 0.0, event.peak)
                used.add(k)
        time = 0.5 * float(stop + start)
        turns.append(Turn(first - schedule.margin, last + schedule.margin, time, "column", peak))
    doubts = (
        ["the column is in neither position for long: more than two?"] if column_stays.away else []
    )
    rest = [e for k, e in enumerate(events) if k not in used and e.kind == "transient"]
    sense = (1 if column_stays.high[0] else -1) if column_stays.senses else None
    return turns, list_disturbances(rest), sense, doubts


def _select_outliers(
    out: Sequence[tuple[float, float]], turns: Sequence[Turn], knocks: Sequence[tuple[float, float]]
) -> list[tuple[float, float]]:
    """Return the outliers outside of turns and knocks."""
    left_out = sorted([*knocks, *((turn.start, turn.stop) for turn in turns)])
    starts = np.array([start for start, _ in left_out])
    latest = np.maximum.accumulate([stop for _, stop in left_out])
    before = np.searchsorted(starts, [start for start, _ in out], side="right") - 1
    return [
        (start, stop)
        for (start, stop), k in zip(out, before.tolist(), strict=True)
        if k < 0 or latest[k] < stop
    ]


def _find_stretches(
    turns: Sequence[Turn], knocks: Sequence[tuple[float, float]], schedule: TurnSchedule
) -> list[tuple[float, float]]:
    """Return start and stop of the dwells between turns; handling at the ends is cut off."""
    edge = EDGE_DWELL_FRACTION * schedule.dwell
    first = max((stop for _, stop in knocks if stop < min(edge, turns[0].start)), default=0.0)
    late = max(schedule.duration - edge, turns[-1].stop)
    last = min((start for start, _ in knocks if start > late), default=schedule.duration)
    starts = [first, *(turn.stop for turn in turns)]
    stops = [*(turn.start for turn in turns), last]
    return [(start, max(start, stop)) for start, stop in zip(starts, stops, strict=True)]


def _build_dwells(
    stretches: Sequence[tuple[float, float]],
    turns: Sequence[Turn],
    first: int,
    schedule: TurnSchedule,
) -> list[FoundDwell]:
    """Return the dwells with their senses, which also alternate over an empty dwell."""
    dwells = []
    for k, (start, stop) in enumerate(stretches):
        beside = turns[max(0, k - 1) : k + 1]
        doubts = [word for turn in beside for word in turn.doubts]
        if stop - start > 1.5 * schedule.dwell:
            doubts.append(f"it lasts {(stop - start) / schedule.dwell:.1f} dwells: a missed turn?")
        if stop <= start:
            continue
        by = max((turn.found_by for turn in beside), key=DETECTION_ORDER.index)
        sense = first if k % 2 == 0 else -first
        dwells.append(FoundDwell(start, stop, sense, by, tuple(dict.fromkeys(doubts))))
    return dwells
