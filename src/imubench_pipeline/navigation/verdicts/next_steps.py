"""Recommend the next steps that would change or strengthen the most verdicts."""

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar, get_args

from scipy.special import stdtrit

from imubench_pipeline.model.comparisons import NextStepRow
from imubench_pipeline.model.states import Action
from imubench_pipeline.model.verdicts import Condition, DoubtMark
from imubench_pipeline.navigation.verdicts.basis import Basis, Key
from imubench_pipeline.navigation.verdicts.judgement import (
    MAX_TIME_SHARE,
    WEAKNESS_REASONS,
    Judgement,
    find_longest_time,
)
from imubench_pipeline.navigation.verdicts.specimens import Expected
from imubench_pipeline.navigation.verdicts.standing import Standing
from imubench_pipeline.tables.keys import group_rows
from imubench_pipeline.words.verdicts import next_step_text

T = TypeVar("T")

_MAX_DURATION_FACTOR = 100.0
"""Maximum recommended duration over the present one: it makes limits ten times as narrow."""

_MAX_SPECIMENS = 20  # maximum number of specimens of a sensor that is recommended

_MIN_SPECIMENS = 3
"""Minimum number of specimens to estimate their spread: t is 4.3 with two degrees of freedom, 12.7
with one."""


@dataclass(frozen=True)
class _Step:
    action: Action
    key: tuple[str, str | None]
    requirement: str
    turns: bool
    duration: float | None = None
    specimens: int | None = None
    quantities: tuple[str, ...] = ()
    figures: tuple[Condition, ...] = ()
    doubts: tuple[DoubtMark, ...] = ()


def list_next_step_rows(judged: Sequence[Judgement], basis: Basis) -> list[NextStepRow]:
    """Return the rows of the table ``next_steps``, sorted by the number of changed verdicts."""
    proposed = (step for each in judged if not each.shortfalls for step in _list_steps(each, basis))
    groups = group_rows(proposed, lambda step: (step.key, step.action))
    rows = []
    for ((sensor, recording), action), steps in groups.items():
        turned = {step.requirement for step in steps if step.turns}
        row = NextStepRow(
            sensor=sensor,
            recording=recording,
            requirements=_unite(step.requirement for step in steps),
            action=action,
            quantities=_unite(name for step in steps for name in step.quantities),
            figures=_unite(figure for step in steps for figure in step.figures),
            doubts=_unite(doubt for step in steps for doubt in step.doubts),
            verdicts_turned=len(turned),
            verdicts_strengthened=len({step.requirement for step in steps} - turned),
            duration=max((step.duration for step in steps if step.duration), default=None),
            logged=basis.duration((sensor, recording)) if recording else None,
            specimens=max((step.specimens for step in steps if step.specimens), default=None),
        )
        rows.append(replace(row, text=next_step_text(row)))
    return sorted(
        rows,
        key=lambda row: (
            -row.verdicts_turned,
            -row.verdicts_strengthened,
            get_args(Action).index(row.action),
            row.sensor,
            row.recording or "",
        ),
    )


def _list_steps(judgement: Judgement, basis: Basis) -> Iterator[_Step]:
    unless, name = judgement.unless, judgement.name
    if unless is not None:
        action: Action = "check_unit" if unless.factors else "record_again"
        either = unless.logged, unless.corrected
        same = None not in either and len({each.verdict for each in either if each}) == 1
        for key, doubts in unless.doubts.items():
            quantities = tuple(basis.factors(key))
            removed = () if quantities else tuple(doubts)
            yield _Step(action, key, name, not same, quantities=quantities, doubts=removed)
    if not judgement.decides.known:
        # Channels may be missing, or the recording too short.
        total = judgement.decides.total
        key = judgement.sensor, total.recording
        if key in basis.apart:
            return
        needs = ("gyro",) if total.error in ("heading", "north") else ("gyro", "accel")
        missing = tuple(quantity for quantity in needs if basis.lacks(key, quantity))
        if missing:
            yield _Step("add_channels", key, name, turns=True, quantities=missing)
        elif (needed := _compute_duration_needed(judgement)) > (basis.duration(key) or math.inf):
            yield _Step("log_longer", key, name, turns=True, duration=needed)
        return
    if judgement.decides.verdict not in ("meets", "meets_if", "fails"):
        yield from _find_settling_steps(judgement, basis)
    if judgement.verdict == "meets_if":
        figures = tuple(
            replace(each, largest=None, within=None, printing=None)
            for each in _select_deciding(judgement)
        )
        yield _Step("find_figures", (judgement.sensor, None), name, True, figures=figures)
    for reason in judgement.reasons:
        yield from _find_strengthening_steps(judgement, reason, basis)


def _select_deciding(judgement: Judgement) -> Sequence[Condition]:
    """Return the condition with the largest part of the error; without figures, all of them."""
    sizes: dict[tuple[str | None, str | None], float] = {
        (row.quantity, row.source): row.sigma or 0.0
        for standing in judgement.standings
        for row in standing.conditions
    }
    figures = [each for each in judgement.conditions if each.figure is not None]
    if not figures:
        return judgement.conditions
    return [max(figures, key=lambda each: sizes.get((each.subject, each.figure), 0.0))]


def _find_settling_steps(judgement: Judgement, basis: Basis) -> Iterator[_Step]:
    decides, sensor, name = judgement.decides, judgement.sensor, judgement.name
    away = abs(math.log(decides.margin))
    if decides.expected.spread is not None:
        more = count_specimens_needed(decides.expected, away)
        if more:
            yield _Step("add_specimens", (sensor, None), name, True, specimens=more)
        return
    key, duration = _find_longest(sensor, decides, basis)
    low, high = decides.margins
    if duration is None or not low or math.isinf(high):
        return
    # The half of the interval that includes 1.
    half = (
        math.log(decides.margin / low) if decides.margin > 1.0 else math.log(high / decides.margin)
    )
    if 0.0 < half <= away * math.sqrt(_MAX_DURATION_FACTOR):
        needed = max(duration * (half / away) ** 2, _compute_duration_needed(judgement))
        yield _Step("log_longer", key, name, True, duration=needed)


def count_specimens_needed(expected: Expected, away: float) -> int | None:
    """Return how many additional specimens give a verdict; None if 20 in all are not enough.

    The half width t sqrt(tau^2 (1 + 1/n)) of the prediction interval from n specimens must not
    exceed ``away``, the absolute logarithm of the margin. The errors of the logs are neglected.
    """
    assert expected.spread is not None
    for number in range(expected.specimens + 1, _MAX_SPECIMENS + 1):
        half = float(stdtrit(number - 1, 0.975)) * math.sqrt(
            expected.spread.variance * (1.0 + 1.0 / number)
        )
        if half <= away:
            return number - expected.specimens
    return None


def _find_strengthening_steps(judgement: Judgement, reason: str, basis: Basis) -> Iterator[_Step]:
    decides, sensor, name = judgement.decides, judgement.sensor, judgement.name
    key, duration = _find_longest(sensor, decides, basis)
    if reason == "one_specimen":
        more = _MIN_SPECIMENS - decides.expected.specimens
        yield _Step("add_specimens", (sensor, None), name, False, specimens=more)
    elif reason == "short_log" and duration is not None:
        yield _Step("log_longer", key, name, False, duration=_compute_duration_needed(judgement))
    elif reason == "few_axes":
        yield _Step("add_channels", key, name, False)
    elif reason not in WEAKNESS_REASONS:
        for total in decides.totals:
            own = sensor, total.recording
            doubts = [row for row in basis.doubts.get(own, ()) if row.code == reason]
            if any(row.factor is not None for row in doubts):
                yield _Step("check_unit", own, name, False, quantities=tuple(basis.factors(own)))
            elif doubts:
                channels = _unite(row.channel for row in doubts if row.channel)
                mark = DoubtMark(total.recording, reason, channels)
                yield _Step("record_again", own, name, False, doubts=(mark,))


def _find_longest(sensor: str, standing: Standing, basis: Basis) -> tuple[Key, float | None]:
    keys = [(sensor, row.recording) for row in standing.totals]
    key = max(keys, key=lambda candidate: basis.duration(candidate) or 0.0)
    return key, basis.duration(key)


def _compute_duration_needed(judgement: Judgement) -> float:
    """Return the length of a log that can determine the error of the deciding limit, s."""
    return find_longest_time(judgement.decides.total, judgement.requirement) / MAX_TIME_SHARE


def _unite(values: Iterable[T]) -> tuple[T, ...]:
    return tuple(dict.fromkeys(values))
