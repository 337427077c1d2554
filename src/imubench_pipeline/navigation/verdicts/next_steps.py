"""Recommend the next steps that would change or strengthen the most verdicts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

from scipy.special import stdtrit

from imubench_pipeline.model.comparisons import NextStepRow
from imubench_pipeline.navigation.verdicts.basis import Basis, Key
from imubench_pipeline.navigation.verdicts.evidence import (
    MAX_TIME_SHARE,
    WEAKNESS_REASONS,
    longest_asked,
)
from imubench_pipeline.navigation.verdicts.judgement import Judgement
from imubench_pipeline.navigation.verdicts.specimens import Expected
from imubench_pipeline.navigation.verdicts.standing import Standing
from imubench_pipeline.settings.printed import SENSORS

Action = Literal[
    "check_unit", "find_figures", "add_channels", "record_again", "log_longer", "add_specimens"
]
"""Possible steps, the cheapest first."""

_ACTION_ORDER = get_args(Action)

_MAX_DURATION_FACTOR = 100.0
"""Maximum recommended duration over the present one: it makes limits ten times as narrow."""

_MAX_SPECIMENS = 20
"""Maximum number of specimens of a sensor that is recommended."""

_MIN_SPECIMENS = 3
"""Minimum number of specimens to estimate their spread: t is 4.3 with two degrees of freedom, 12.7
with one."""


@dataclass(frozen=True)
class _Step:
    """One step for one requirement."""

    action: Action
    key: tuple[str, str | None]
    requirement: str
    turns: bool
    duration: float | None = None
    specimens: int | None = None
    what: str = ""


def next_step_rows(judged: Sequence[Judgement], basis: Basis) -> list[NextStepRow]:
    """Return the rows of the table ``next_steps``, sorted by the number of changed verdicts."""
    groups: dict[tuple[Any, ...], list[_Step]] = {}
    for judgement in judged:
        if judgement.outside is None and not judgement.rests.lacking:
            for step in _list_steps(judgement, basis):
                groups.setdefault((step.key, step.action), []).append(step)
    rows = [_make_row(steps, basis) for steps in groups.values()]
    return sorted(
        rows,
        key=lambda row: (
            -row.verdicts_turned,
            -row.verdicts_strengthened,
            _ACTION_ORDER.index(row.action),
            row.sensor,
            row.recording or "",
        ),
    )


def _list_steps(judgement: Judgement, basis: Basis) -> Iterator[_Step]:
    """Yield the steps that could change one verdict or make its evidence stronger."""
    unless, name = judgement.unless, judgement.name
    if unless is not None:
        action: Action = "check_unit" if unless.factors else "record_again"
        either = unless.logged, unless.mended
        same = None not in either and len({each.verdict for each in either if each}) == 1
        for key, doubts in unless.doubts.items():
            what = _join_quantities(basis.factors(key)) or doubts
            yield _Step(action, key, name, turns=not same, what=what)
    if not judgement.decides.known:
        yield from _find_missing_data(judgement, basis)
        return
    if judgement.decides.verdict not in ("passes", "surely fails"):
        yield from _find_settling_steps(judgement, basis)
    if judgement.compared and (unknown := judgement.rests.unknown_figures()):
        what = ", ".join(unknown)
        yield _Step("find_figures", (judgement.sensor, None), name, turns=False, what=what)
    for reason in judgement.reasons:
        yield from _find_strengthening_steps(judgement, reason, basis)


def _find_missing_data(judgement: Judgement, basis: Basis) -> Iterator[_Step]:
    """Yield the missing channels, or the needed length, of a recording without a figure."""
    total = judgement.decides.total
    key = judgement.sensor, total.recording
    if key in basis.apart:
        return
    needs = ("gyro",) if total.error in ("heading", "north") else ("gyro", "accel")
    missing = [name for name in needs if basis.lacks(key, name)]
    if missing:
        yield _Step("add_channels", key, judgement.name, turns=True, what=_join_quantities(missing))
    elif (needed := _compute_duration_needed(judgement)) > (basis.duration(key) or math.inf):
        yield _Step("log_longer", key, judgement.name, turns=True, duration=needed)


def _find_settling_steps(judgement: Judgement, basis: Basis) -> Iterator[_Step]:
    decides, sensor, name = judgement.decides, judgement.sensor, judgement.name
    away = abs(math.log(decides.margin))
    if decides.expected.spread is not None:
        more = specimens_needed(decides.expected, away)
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


def specimens_needed(expected: Expected, away: float) -> int | None:
    """Return how many more specimens would bring the limits of an error within a distance.

    The half width of the prediction interval is t sqrt(tau^2 (1 + 1/n)) with n - 1 degrees of
    freedom. The spread is assumed to remain the same, and the errors of the logs are neglected.
    ``away`` is the logarithm of the margin, the maximum distance of the limits. None if 20
    specimens are not enough.
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
        yield _Step("add_channels", key, name, False, what="all three axes")
    elif reason not in WEAKNESS_REASONS:
        for total in decides.totals:
            own = sensor, total.recording
            doubts = [row for row in basis.doubts.get(own, ()) if row.code == reason]
            if any(row.factor is not None for row in doubts):
                what = _join_quantities(basis.factors(own))
                yield _Step("check_unit", own, name, False, what=what)
            elif doubts:
                what = reason.replace("_", " ")
                yield _Step("record_again", own, name, False, what=what)


def _join_quantities(names: Iterable[str]) -> str:
    return " and ".join(f"the {SENSORS[name]}" for name in names)


def _find_longest(sensor: str, standing: Standing, basis: Basis) -> tuple[Key, float | None]:
    """Return the longest recording of a standing, and its duration."""
    keys = [(sensor, row.recording) for row in standing.totals]
    key = max(keys, key=lambda candidate: basis.duration(candidate) or 0.0)
    return key, basis.duration(key)


def _compute_duration_needed(judgement: Judgement) -> float:
    """Return the length of a log that can determine the error of the deciding limit, s."""
    return longest_asked(judgement.decides.total, judgement.requirement) / MAX_TIME_SHARE


def _make_row(steps: Sequence[_Step], basis: Basis) -> NextStepRow:
    first = steps[0]
    turned = {step.requirement for step in steps if step.turns}
    strengthened = {step.requirement for step in steps} - turned
    duration = max((step.duration for step in steps if step.duration), default=None)
    specimens = max((step.specimens for step in steps if step.specimens), default=None)
    whats = ", ".join(
        dict.fromkeys(part for step in steps if step.what for part in step.what.split(", "))
    )
    sensor, recording = first.key
    effect = _describe_effect(first.action, len(turned), len(strengthened))
    logged = basis.duration((sensor, recording)) if recording else None
    what = _describe_action(first.action, recording, whats, duration, logged, specimens)
    return NextStepRow(
        sensor=sensor,
        recording=recording,
        requirements=", ".join(dict.fromkeys(step.requirement for step in steps)),
        action=first.action,
        verdicts_turned=len(turned),
        verdicts_strengthened=len(strengthened),
        duration=duration,
        specimens=specimens,
        text=f"{what}: {effect}",
    )


def _describe_action(
    action: Action,
    recording: str | None,
    what: str,
    duration: float | None,
    logged: float | None,
    specimens: int | None,
) -> str:
    match action:
        case "check_unit":
            return f"check the unit of {what} in {recording}"
        case "find_figures":
            return f"find out what its file does not say: {what}"
        case "record_again":
            return f"record {recording} again ({what})"
        case "add_channels":
            return f"log {what}, which {recording} does not have"
        case "log_longer":
            assert duration is not None  # of every such step
            more = duration - (logged or 0.0)
            return f"log {recording} for {_format_time(more)} more, {_format_time(duration)} in all"
    return f"log {specimens} more {'specimen' if specimens == 1 else 'specimens'}"


_EFFECT_VERBS = {"check_unit": "turn", "record_again": "allow", "add_channels": "allow"}
"""Effect of a step on verdicts. Other steps settle them, if the figures remain the same."""


def _describe_effect(action: Action, turned: int, strengthened: int) -> str:
    if action == "find_figures":
        return f"it would free {_count_verdicts(strengthened)} of a condition"
    parts = []
    if turned:
        parts.append(f"would {_EFFECT_VERBS.get(action, 'settle')} {_count_verdicts(turned)}")
    if strengthened:
        parts.append(f"would give {_count_verdicts(strengthened)} stronger evidence")
    return "it " + " and ".join(parts)


def _count_verdicts(number: int) -> str:
    return f"{number} {'verdict' if number == 1 else 'verdicts'}"


def _format_time(seconds: float) -> str:
    """Return a duration in a suitable unit, to two digits, rounded up."""
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= size:
            number = seconds / size
            return f"{math.ceil(number) if number >= 10 else math.ceil(10 * number) / 10:g} {unit}"
    return f"{math.ceil(seconds)} s"
