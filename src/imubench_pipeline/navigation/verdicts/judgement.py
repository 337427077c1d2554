"""Judge each sensor by each requirement, with the conditions of the verdict."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from scipy.special import ndtr

from imubench_pipeline.estimators.estimate import CURVE
from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.model.states import Verdict
from imubench_pipeline.model.verdicts import Condition, DoubtMark, Shortfall
from imubench_pipeline.navigation import suitability
from imubench_pipeline.navigation.pooled import NORMAL_QUANTILE
from imubench_pipeline.navigation.verdicts.basis import Basis, Key
from imubench_pipeline.navigation.verdicts.specimens import Spread, pool_spreads
from imubench_pipeline.navigation.verdicts.standing import (
    Standing,
    find_deciding_limit,
    list_standings,
    make_limit_key,
)
from imubench_pipeline.noise import TERMS
from imubench_pipeline.noise.terms.base import Role
from imubench_pipeline.settings.requirements import Requirement
from imubench_pipeline.tables.keys import group_rows
from imubench_pipeline.units import parse_quantity
from imubench_pipeline.words.numbers import join_names
from imubench_pipeline.words.reasons import pools as texts
from imubench_pipeline.words.verdicts import doubts_text

PARAMETERS_OF_SOURCE: dict[str, frozenset[str]] = {}
"""Noise parameters by the code of a source (`Term.word`). Bias instability determines the lowest
part of the curve, so its terms include the parameters of the curve."""

for _kind in TERMS:
    _symbols = frozenset(parameter.symbol for parameter in _kind.parameters)
    if "B" in _symbols or _kind.role is Role.GAUSS_MARKOV:
        _symbols |= frozenset(CURVE)
    PARAMETERS_OF_SOURCE[_kind.word] = _symbols

Reason = Literal["one_specimen", "short_log", "wide_interval", "few_axes"]
"""Reasons for weak evidence, in addition to the codes of doubts."""

WEAKNESS_REASONS: tuple[str, ...] = get_args(Reason)

MAX_TIME_SHARE = 1 / 9
"""Maximum time of an error as a fraction of the log. There, the Allan deviation of white noise has
8 differences of adjacent clusters, and a relative error of about a quarter."""

_AXIS_COUNT = 3


def list_weaknesses(standing: Standing, requirement: Requirement, basis: Basis) -> list[str]:
    """Return why the evidence on a limit with a known error is weak; empty if it is strong.

    They are `WEAKNESS_REASONS` and codes of the table ``doubts``. Axes and doubts count if at least
    half of the recordings have them.
    """
    reasons = []
    if standing.expected.specimens == 1:
        reasons.append("one_specimen")
    longest = basis.longest(standing.totals)
    asked = find_longest_time(standing.total, requirement)
    if longest is not None and asked > MAX_TIME_SHARE * longest:
        reasons.append("short_log")
    if standing.wide:
        reasons.append("wide_interval")
    of_logs = Counter[str]()
    for total in standing.totals:
        key = total.sensor, total.recording
        own: list[str] = []
        answering = {"gyro": total.gyro, "accel": total.accel}
        for quantity, channel in answering.items():
            axes = basis.axes(key, quantity) if channel else None
            if requirement.axis == "worst" and axes is not None and axes < _AXIS_COUNT:
                own.append("few_axes")
        if standing.source is not None:
            behind = PARAMETERS_OF_SOURCE.get(standing.source.source, frozenset())
            channel = answering[standing.source.quantity or "gyro"]
            for doubt in basis.doubts.get(key, ()):
                affected = behind.intersection(doubt.parameters) if doubt.parameters else behind
                if doubt.channel in (None, channel) and affected:
                    own.append(doubt.code)
        of_logs.update(dict.fromkeys(own, 1))
    half = len(standing.totals) / 2.0
    order = [*WEAKNESS_REASONS, *of_logs]
    reasons += [reason for reason, count in of_logs.items() if count >= half]
    return sorted(reasons, key=order.index)


def find_longest_time(total: ErrorBudgetRow, requirement: Requirement) -> float:
    """Return the time of a limit or its static window, s, whichever is longer."""
    window = requirement.static_window
    # North-finding has no static window before it.
    before = parse_quantity(window, "time") if window and total.error != "north" else 0.0
    return max(total.time, before)


Factors = Mapping[str, float]  # by quantity


@dataclass(frozen=True)
class Unless:
    """Alternative verdicts on a sensor: with figures as logged, and with corrected units."""

    # the deciding limit with the figures as logged; None if it is the present one
    logged: Standing | None
    corrected: Standing | None  # with corrected units; None if there is no correction
    factors: Factors  # by quantity
    doubts: Mapping[Key, tuple[DoubtMark, ...]]  # by sensor and recording


def judge_with_corrected_units(
    sensor: str, rows: Sequence[ErrorBudgetRow], basis: Basis
) -> Unless | None:
    """Return the verdict on a sensor with doubtful units corrected.

    The rows belong to one requirement. The result is None if no error is known, or if the verdict
    would not change. If all recordings were left out, it includes the verdict from their figures
    as logged.
    """
    keys = list(dict.fromkeys((sensor, row.recording) for row in rows))
    apart = [key for key in keys if key in basis.apart]
    unjudged = len(apart) == len(keys) and bool(keys)
    doubted = [key for key in keys if basis.factors(key) and (unjudged or key not in apart)]
    if not unjudged and not doubted:
        return None
    own = [row for row in rows if unjudged or (sensor, row.recording) not in apart]
    devices = {name: basis.device((of, name)) for of, name in keys}
    logged = find_deciding_limit(list_standings(own, devices))
    factors = {key: basis.factors(key) for key in doubted}
    corrected = None
    if factors:
        by_total = group_rows(own, lambda row: (row.recording, make_limit_key(row)))
        in_other_unit = [
            row
            for (recording, _), parts in by_total.items()
            for row in scale_errors(parts, factors.get((sensor, recording), {}))
        ]
        corrected = find_deciding_limit(list_standings(in_other_unit, devices))
    if corrected is not None and not unjudged and corrected.verdict == logged.verdict:
        corrected = None
    if not logged.known or (corrected is None and not unjudged):
        return None
    doubts = {key: basis.doubted(key) for key in (doubted or apart)}
    together = {name: f for of_recording in factors.values() for name, f in of_recording.items()}
    return Unless(logged if unjudged else None, corrected, together, doubts)


def scale_errors(parts: Sequence[ErrorBudgetRow], factors: Factors) -> list[ErrorBudgetRow]:
    """Return the rows of one error of a recording, with noise multiplied by factors."""
    own = [row for row in parts if row.source != "total"]
    sources = []
    for row, sigma in suitability.select_known_errors(own):
        quantity = row.quantity if row.source in PARAMETERS_OF_SOURCE else None
        sources.append((row, factors.get(quantity or "", 1.0) * sigma))
    missing = [row for row in own if row.sigma is None]
    (total,) = (row for row in parts if row.source == "total")
    if not total.sigma or not sources or total.lower is None or total.upper is None:
        return list(parts)
    sigma = math.hypot(*(size for _, size in sources))
    by = sigma / total.sigma
    lower, upper = by * total.lower, by * total.upper
    within = None
    if total.limit is not None:
        # The error is log-normal on either side; without a lower limit, either is possible.
        away = math.log(total.limit / sigma)
        if away <= 0.0 and lower <= 0.0:
            within = 0.5
        elif (half := math.log(upper / sigma if away > 0.0 else sigma / lower)) > 0.0:
            within = float(ndtr(NORMAL_QUANTILE * away / half))
        else:
            within = 1.0 if away >= 0.0 else 0.0
    return [
        replace(total, sigma=sigma, lower=lower, upper=upper, within=within, reached_after=None),
        *(replace(row, sigma=size) for row, size in sources),
        *missing,
    ]


_WORST_FIRST: tuple[Verdict, ...] = (
    "fails",
    "likely_fails",
    "not_enough_data",
    "meets_if",
    "likely_meets",
    "meets",
)


@dataclass(frozen=True)
class Judgement:
    """The verdict on a sensor for one requirement, with everything that it depends on."""

    name: str  # of the requirement
    requirement: Requirement
    sensor: str
    standings: Sequence[Standing]  # one for each limit
    decides: Standing  # the limit that decides the verdict
    # reasons for weak evidence, by limit; also empty if nothing is known
    weak: Sequence[Sequence[str]]
    price: Shortfall | None  # if the price class is another, or not known
    open: suitability.Conditions  # conditions other than the known errors
    unless: Unless | None  # verdict with doubtful units corrected

    @property
    def verdict(self) -> Verdict:
        """Verdict on the sensor."""
        return "excluded" if self.price else self.open.judge(self._verdict_on_errors)[0]

    @property
    def conditions(self) -> tuple[Condition, ...]:
        """Conditions on which the verdict holds."""
        return () if self.price else self.open.judge(self._verdict_on_errors)[1]

    @property
    def shortfalls(self) -> tuple[Shortfall, ...]:
        """Required properties that the sensor does not have."""
        return (*filter(None, (self.price,)), *self.open.shortfalls)

    @property
    def _verdict_on_errors(self) -> Verdict:
        if not self.decides.known:
            return self.decides.verdict
        return min((each.verdict for each in self.standings), key=_WORST_FIRST.index)

    @property
    def compared(self) -> bool:
        """Whether the sensor is ranked: its error is known, and it has all required properties."""
        return self.decides.known and not self.shortfalls and not self.open.unknown

    @property
    def reasons(self) -> Sequence[str]:
        """Reasons for weak evidence on the deciding limit."""
        pairs = zip(self.standings, self.weak, strict=True)
        return next(weak for standing, weak in pairs if standing is self.decides)


def judge_sensors(
    errors: Iterable[ErrorBudgetRow],
    requirements: Mapping[str, Requirement],
    sensors: Mapping[str, Mapping[str, Any]],
    basis: Basis,
) -> Iterator[Judgement]:
    """Yield the judgement of each sensor by each requirement.

    ``errors`` are of all recordings; ``basis`` describes them. ``sensors`` have ``price_class``
    and, if known, ``abilities``. Recordings not used in comparisons are ignored.
    """
    by_requirement: dict[str | None, dict[str, list[ErrorBudgetRow]]] = {}
    for row in errors:
        of_sensors = by_requirement.setdefault(row.requirement, {})
        of_sensors.setdefault(row.sensor, []).append(row)
    for name, requirement in requirements.items():
        of_sensors = by_requirement.get(name, {})
        usual = {made: _pool_spreads(of_sensors, basis, simulated=made) for made in (False, True)}
        for sensor, rows in of_sensors.items():
            devices, made = _map_specimens(sensor, rows, basis)
            by_limit = list_standings(_select_deciding_rows(rows, basis), devices, usual[made])
            price_class, price = sensors[sensor]["price_class"], None
            if not requirement.admits(price_class):
                asked = join_names(requirement.price_class or (), "or")
                price = Shortfall("price_class", price_class or "", asked)
            yield Judgement(
                name,
                requirement,
                sensor,
                by_limit,
                find_deciding_limit(by_limit),
                [
                    list_weaknesses(each, requirement, basis) if each.known else []
                    for each in by_limit
                ],
                price,
                suitability.Conditions.of(
                    requirement,
                    suitability.Abilities.model_validate(sensors[sensor].get("abilities", {})),
                    [row for each in by_limit for row in each.conditions],
                ),
                judge_with_corrected_units(sensor, rows, basis),
            )


def _map_specimens(
    sensor: str, rows: Iterable[ErrorBudgetRow], basis: Basis
) -> tuple[dict[str, str], bool]:
    """Return the specimen of each recording in rows, and whether all are simulated."""
    keys = [(sensor, row.recording) for row in rows]
    devices = {recording: basis.device((sensor, recording)) for _, recording in keys}
    recordings = [basis.recordings.get(key) for key in keys]
    return devices, all(row is not None and row.simulated for row in recordings)


def _select_deciding_rows(rows: Sequence[ErrorBudgetRow], basis: Basis) -> list[ErrorBudgetRow]:
    """Return rows without the figures of recordings that are not used in comparisons."""
    selected = []
    for row in rows:
        doubts = basis.apart.get((row.sensor, row.recording))
        if doubts is not None:
            reason = texts.recording_not_used(row.recording, doubts_text(doubts))
            row = replace(row, sigma=None, lower=None, upper=None, within=None)
            row = replace(row, reached_after=None, reasons=(reason,))
        selected.append(row)
    return selected


def _pool_spreads(
    of_sensors: Mapping[str, Sequence[ErrorBudgetRow]], basis: Basis, *, simulated: bool
) -> dict[tuple[Any, ...], Spread]:
    by_limit: dict[tuple[Any, ...], list[Spread]] = {}
    for sensor, rows in of_sensors.items():
        devices, made = _map_specimens(sensor, rows, basis)
        if made is not simulated:
            continue
        for standing in list_standings(_select_deciding_rows(rows, basis), devices):
            if standing.expected.spread is not None and standing.expected.spread_of == "specimens":
                by_limit.setdefault(make_limit_key(standing.total), []).append(
                    standing.expected.spread
                )
    usual = {key: pool_spreads(spreads) for key, spreads in by_limit.items()}
    return {key: spread for key, spread in usual.items() if spread is not None}
