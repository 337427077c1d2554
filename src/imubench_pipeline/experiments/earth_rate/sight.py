"""Turns from what a log shows of them, and from the schedule where it shows nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from imubench_pipeline.experiments.earth_rate.alternation import alternation, best_shift, between
from imubench_pipeline.experiments.earth_rate.choice_of_turns import (
    EDGE,
    choose,
    closest,
    may_be_silent,
    shorter_dwell,
)
from imubench_pipeline.experiments.earth_rate.found import Turn
from imubench_pipeline.experiments.earth_rate.transients import CLEAR, Blocks, Event
from imubench_pipeline.typing import Array

_ENOUGH = 0.4
"""Part of the schedule's turns that must be seen, for what is seen to decide."""

ALTERNATES = 3.0
"""Standard errors of the alternation at which a log without transients is taken to be turned."""

_SHIFTED = 6.0
"""Standard errors of the alternation at which the start of the schedule is taken from it."""

_CALMING = 0.25
"""Left out on either side of a knock, s."""


@dataclass(frozen=True)
class Plan:
    """What is known before the log is looked at.

    Attributes
    ----------
    dwell, start, turning, tolerance, margin : float
        As `imubench_pipeline.experiments.earth_rate.turning.find_turning` takes them, s.
    duration : float
        Of the log, s.
    """

    dwell: float
    start: float
    turning: float
    tolerance: float
    margin: float
    duration: float


def by_sight(
    blocks: Blocks, events: list[Event], plan: Plan, trust: bool
) -> tuple[list[Turn], list[tuple[float, float]], list[str]]:
    """Return turns, knocks and doubts where there is no column.

    Parameters
    ----------
    blocks : Blocks
    events : list of Event
        In order of time.
    plan : Plan
    trust : bool
        Take the schedule's word where nothing is seen.

    Returns
    -------
    turns : list of Turn
        In order; at least one.
    knocks : list of (float, float)
        Start and stop of what is left out besides, s.
    doubts : list of str

    Raises
    ------
    ValueError
        If nothing shows that the log was turned, and the schedule is not trusted.
    """
    chosen = choose(events, plan.dwell, plan.tolerance, plan.duration)
    declared = plan.dwell
    pace = shorter_dwell(events, chosen, declared)
    if pace is not None:
        plan = replace(
            plan,
            dwell=pace,
            tolerance=plan.tolerance * pace / declared,
            turning=min(plan.turning, 0.4 * pace),
        )
        chosen = choose(events, plan.dwell, plan.tolerance, plan.duration)
    expected = max(1.0, round((plan.duration - plan.start) / plan.dwell) - 1.0)
    doubts: list[str] = []
    if len(chosen) >= _ENOUGH * expected:
        turns, rest = _of_events(events, chosen, plan)
        seen = _filled([events[k] for k in chosen], turns, plan, blocks)
    else:
        seen, rest, doubts = _scheduled(blocks, events, plan, trust)
    quick = [e for e in rest if e.kind == "transient"]
    ends = sum(_at_end(event, plan) and event.likelihood > CLEAR for event in quick)
    if ends:
        doubts.append("handling at the ends of the log is left out")
    silent = sum(turn.found_by == "schedule" for turn in seen)
    if silent:
        doubts.append(f"{silent} of {len(seen)} turns rest on the schedule: nothing shows them")
    usual = float(np.median(np.diff([turn.time for turn in seen]))) if len(seen) > 1 else declared
    if abs(usual / declared - 1.0) > 0.25:
        doubts.append(f"the usual dwell is {usual:.1f} s, not {declared:g} s")
    return seen, disturbances(quick), doubts


def _of_events(
    events: list[Event], chosen: Sequence[int], plan: Plan
) -> tuple[list[Turn], list[Event]]:
    """Return the turns of the events chosen, with what came of the same turn, and the others."""
    near = closest(plan.dwell)
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
                # What is near belongs to the turn: it was overrun and came back.
                gap = max(other.start - stop, start - other.stop)
                if gap > near:
                    break
                if not other.haste and other.likelihood > CLEAR and other.kind == "transient":
                    start, stop = min(start, other.start), max(stop, other.stop)
                    peak = max(peak, other.peak)
                    used.add(i)
                    doubts = ["overrun and come back, or handled beside the turn"]
                i += step
        if event.likelihood < CLEAR:
            doubts.append("hardly above the noise")
        if event.haste:
            doubts.append("as short as a knock")
        if event.kind == "step":
            doubts.append("no transient: a step of the level alone")
        middle = 0.5 * (start + stop)
        margin = plan.margin + (0.5 * plan.turning if event.kind == "step" else 0.0)
        turns.append(Turn(start - margin, stop + margin, middle, event.kind, peak, tuple(doubts)))
    return turns, [event for i, event in enumerate(events) if i not in used]


def _filled(chosen: list[Event], turns: list[Turn], plan: Plan, blocks: Blocks) -> list[Turn]:
    """Put turns of the schedule where turns may be unseen: too weak, or without samples."""
    silent = may_be_silent(chosen)
    time = np.array([turn.time for turn in turns])
    gaps = np.diff(time)
    single = gaps[(gaps > 0.5 * plan.dwell) & (gaps < 1.5 * plan.dwell)]
    usual = float(np.median(single)) if len(single) else plan.dwell
    filled: list[Turn] = []
    if silent:
        more = np.arange(time[0] - usual, (EDGE + 0.3) * plan.dwell, -usual)[::-1]
        filled += [_silent(float(at), plan) for at in more]
    for k, turn in enumerate(turns):
        many = max(1, round(float(gaps[k - 1]) / usual)) if k else 1
        missed = 0
        for at in np.linspace(time[k - 1], time[k], many + 1)[1:-1].tolist() if many > 1 else []:
            if silent or _hole(blocks, at, plan):
                filled.append(_silent(at, plan))
            else:
                missed += 1
        if missed:
            words = f"{gaps[k - 1]:.0f} s after the turn before: {missed} turn missed?"
            turn = replace(turn, doubts=(*turn.doubts, words))
        filled.append(turn)
    if silent:
        last = plan.duration - (EDGE + 0.3) * plan.dwell
        filled += [_silent(float(at), plan) for at in np.arange(time[-1] + usual, last, usual)]
    return filled


def _hole(blocks: Blocks, time: float, plan: Plan) -> bool:
    """Tell whether the samples are missing where a turn would be."""
    first = max(0, int((time - 0.5 * plan.turning) / blocks.length))
    return not blocks.there[first : int((time + 0.5 * plan.turning) / blocks.length) + 1].any()


def _silent(time: float, plan: Plan) -> Turn:
    half = _half(plan)
    words = ("nothing is seen of it: the schedule says so",)
    return Turn(time - half, time + half, time, "schedule", None, words)


def _half(plan: Plan) -> float:
    """Return half of what is left out about a turn that is not seen."""
    return min(plan.tolerance + 0.5 * plan.turning, 0.4 * plan.dwell)


def _scheduled(
    blocks: Blocks, events: list[Event], plan: Plan, trust: bool
) -> tuple[list[Turn], list[Event], list[str]]:
    """Return the turns of the schedule; where a clear transient is near one, that is it."""
    half, longest = _half(plan), plan.duration - EDGE * plan.dwell
    count = max(0, math.ceil((longest - plan.start) / plan.dwell))
    slots: Array = plan.start + plan.dwell * np.arange(1.0, count) + 0.5 * plan.turning
    slots = slots[(slots > half) & (slots < longest)]
    if len(slots) == 0:
        raise ValueError("the schedule has no turn within the log")
    calm = without(blocks, disturbances([e for e in events if e.kind == "transient"]))
    longest_shift = min(plan.dwell / 3.0, 3.0 * plan.tolerance)
    shift, z, unshifted = best_shift(calm, slots, 0.5 * plan.turning, longest_shift, plan.duration)
    doubts: list[str] = []
    by_step = abs(z) > _SHIFTED and z**2 - unshifted**2 > 2.0 * CLEAR
    if by_step:
        slots = slots + shift
        slots = slots[(slots > half) & (slots < plan.duration - half)]
        doubts.append(f"the level alternates {shift:+.1f} s from the schedule: that is used")
    else:
        # Of what is used, and not of the best shift: a search finds 3 in one log of 50 at rest.
        size = abs(alternation(calm, between(slots, half, plan.duration)).z)
        if not (size >= ALTERNATES or trust):
            raise ValueError(
                f"nothing shows that the log was turned every {plan.dwell:g} s: no transients, and "
                f"its level alternates by {size:.1f} standard errors (trust_schedule takes the "
                "schedule's word)"
            )
        doubts.append(
            f"no turns are seen: the schedule decides, and the level alternates with it by "
            f"{size:.1f} standard errors"
        )
    turns, used = [], set()
    for slot in slots.tolist():
        near = [
            k
            for k, e in enumerate(events)
            if abs(e.time - slot) < 2.0 * plan.tolerance
            and (e.likelihood > CLEAR and not e.haste and k not in used)
        ]
        if near:
            best = max(near, key=lambda k: events[k].likelihood)
            used.update(near)
            turns += _of_events([events[best]], [0], plan)[0]
        elif by_step:
            words = ("no transient: the level alternates with the schedule",)
            turns.append(Turn(slot - half, slot + half, slot, "step", None, words))
        else:
            turns.append(_silent(slot, plan))
    return turns, [e for k, e in enumerate(events) if k not in used], doubts


def _at_end(event: Event, plan: Plan) -> bool:
    edge = EDGE * plan.dwell
    return not event.haste and not edge <= event.time <= plan.duration - edge


def disturbances(events: Sequence[Event]) -> list[tuple[float, float]]:
    """Return what to leave out of transients that are no turns, and are not noise.

    Returns
    -------
    list of (float, float)
        Start and stop, s.
    """
    return [
        (event.start - _CALMING, event.stop + _CALMING)
        for event in events
        if event.haste or event.likelihood > CLEAR
    ]


def without(blocks: Blocks, knocks: Sequence[tuple[float, float]]) -> Blocks:
    """Return the blocks without those of knocks.

    Parameters
    ----------
    blocks : Blocks
    knocks : sequence of (float, float)
        Start and stop, s.
    """
    there = blocks.there.copy()
    for start, stop in knocks:
        there[max(0, int(start / blocks.length)) : max(0, math.ceil(stop / blocks.length))] = False
    return replace(blocks, there=there)
