"""Rankings and error budgets, formatted for pages and terminal."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from markupsafe import Markup

from imubench_pipeline.model.comparisons import ErrorBudgetRow, RankingRow
from imubench_pipeline.model.estimates import BacktestRow
from imubench_pipeline.navigation.suitability import compute_variance_shares
from imubench_pipeline.report.payload import Json
from imubench_pipeline.report.practical import System, choose_unit
from imubench_pipeline.settings.requirements import DIMENSIONS
from imubench_pipeline.tables.keys import group_rows
from imubench_pipeline.words import numbers, verdicts


class SourcedNumber(str):
    """A number as text, which as HTML also names the value of a table that it comes from.

    ``source`` is ``ranking/<requirement>/<sensor>/<error>/<time>/<column>``. For a total of the
    table ``error_budget``, the recording follows the sensor. Two columns with a colon, such as
    ``limit:upper``, are a ratio. ``unit`` is the unit of the number.
    """

    __slots__ = ("source", "unit")
    source: str
    unit: str

    def __new__(cls, text: str, source: str, unit: str = "") -> "SourcedNumber":
        """Return the text, with its source."""
        number = super().__new__(cls, text)
        number.source, number.unit = source, unit
        return number

    def __html__(self) -> Markup:
        """Return it as an element with its source."""
        unit = Markup(' data-in="{}"').format(self.unit) if self.unit else ""
        return Markup('<span data-from="{}"{}>{}</span>').format(self.source, unit, str(self))


class SourcedInterval(str):
    """An interval as text, such as ``1.7 to 2.4``, whose limits name their sources in HTML."""

    __slots__ = ("ends",)
    ends: tuple[SourcedNumber, SourcedNumber]

    def __new__(cls, lower: SourcedNumber, upper: SourcedNumber) -> "SourcedInterval":
        """Return ``lower to upper``."""
        interval = super().__new__(cls, f"{lower} to {upper}")
        interval.ends = (lower, upper)
        return interval

    def __html__(self) -> Markup:
        """Return them as elements with their sources."""
        return Markup("{} to {}").format(*self.ends)


_MAX_DIGITS = 3  # of errors, whose intervals do not include the limits of a class
_MAX_REASONS = 2  # of an error in a cell; the tables of a run have all


def source_number(
    row: RankingRow | ErrorBudgetRow, column: str, text: str, unit: str = ""
) -> SourcedNumber:
    """Return ``text`` as a number whose source is ``column`` of a row of a table."""
    names = [row.table, row.requirement or "", row.sensor]
    names += [row.recording] if isinstance(row, ErrorBudgetRow) else []
    return SourcedNumber(text, "/".join([*names, row.error, f"{row.time:g}", column]), unit)


def format_margin(row: RankingRow) -> tuple[SourcedNumber, SourcedNumber, SourcedNumber] | None:
    """Return margin, lower and upper 95 % limit of a row of ``ranking``; None without a margin."""
    if row.margin is None:
        return None
    low, high = compute_margin_limits(row)
    digits = min(numbers.count_digits(row.margin, low, high), _MAX_DIGITS)
    named = (("margin", row.margin), ("limit:upper", low), ("limit:lower", high))
    first, lower, upper = (
        source_number(row, name, numbers.number_text(x, digits)) for name, x in named
    )
    return first, lower, upper


def compute_margin_limits(row: RankingRow) -> tuple[float | None, float | None]:
    """Return the 95 % limits of a margin: the limit divided by the 95 % limits of the error."""
    # Infinite where the error is zero, None where it is unknown.
    low, high = (
        None if row.limit is None or error is None else row.limit / error if error else math.inf
        for error in (row.upper, row.lower)
    )
    return low, high


Simulated = Mapping[tuple[str, str], bool]  # whether a recording is, by sensor and name

_NAMES = {
    "attitude": "attitude (tilt)",
    "heading": "heading",
    "velocity": "velocity, one axis",
    "position": "position, one axis",
    "cross_track": "cross-track",
    "north": "north, found at rest",
}
_NAMES_IN_NOTES = {**_NAMES, "attitude": "attitude"}
_NAMES_IN_LIMITS = {
    **_NAMES,
    "velocity": "horizontal velocity",
    "position": "horizontal position",
}
_ERRORS = tuple(_NAMES)
_QUARTER_TURN = math.pi / 2.0


@dataclass(frozen=True)
class LimitLine:
    """A line of a ranking: a limit of a requirement and the error of a sensor, as texts."""

    limit: str  # error and time
    allowed: SourcedNumber  # the limit as 1 sigma
    sigma: str  # expected error
    interval: str  # of sigma, 95 %
    margin: str
    margins: str  # 95 % interval of the margin
    other_margins: str  # margin of the noise without other errors, and likely margin
    chance: str  # probability that sigma is within the limit
    source: str  # largest source of the error, with its share of the variance
    parts: Sequence[str]  # sources of the error, with their shares of the variance
    reached: str  # time after which the error reaches the limit
    decides: bool  # whether this limit gives the verdict
    reason: str
    backtest: str


@dataclass(frozen=True)
class Group:
    """A sensor in the ranking for a requirement: its verdict, reasons, and a line per limit."""

    row: RankingRow  # of the deciding limit
    simulated: bool
    rank: str
    verdict: str
    stated: str  # verdict with its conditions, or shortfalls
    weak: str  # reasons for weak evidence
    doubts: str
    corrected: str  # verdict with a corrected unit, or with recordings that are not used
    limits: Sequence[LimitLine]

    @property
    def sensor(self) -> str:
        """Name of the sensor file."""
        return self.row.sensor


def format_rankings(
    rows: Sequence[RankingRow], requirements: Iterable[str], simulated: Simulated, system: System
) -> Iterator[tuple[str, list[Group]]]:
    """Yield each requirement with its sensors by rank; sensors without a rank are last."""
    by_requirement = group_rows(rows, lambda row: row.requirement)
    for name in requirements:
        by_sensor = group_rows(by_requirement.get(name, ()), lambda row: row.sensor)
        groups = [_group(limits, simulated, system) for limits in by_sensor.values()]
        # By rank, then by margin; sensors without a rank come last.
        groups.sort(key=lambda group: (group.row.rank or 10**6, -(group.row.margin or 0.0)))
        yield name, groups


def _group(limits: Sequence[RankingRow], simulated: Simulated, system: System) -> Group:
    row = next(row for row in limits if row.decides)
    used = {limit.recording for limit in limits}
    return Group(
        row,
        simulated=all(simulated.get((row.sensor, name or ""), False) for name in used),
        rank=str(row.rank or numbers.NO_VALUE),
        verdict=verdicts.VERDICT_WORDS[row.verdict],
        stated=verdicts.stated_verdict(row),
        weak=verdicts.evidence_text(row) if row.rank else "",
        doubts=verdicts.used_doubts_text(row) if row.rank else "",
        corrected=verdicts.corrected_text(row),
        limits=[_limit(limit, system) for limit in limits],
    )


def _limit(row: RankingRow, system: System) -> LimitLine:
    size = format_margin(row)
    chance = "–" if row.sigma is None else source_number(row, "chance", _percent(row.chance), "%")
    unit = choose_unit(DIMENSIONS[row.error], system, row.limit)
    return LimitLine(
        limit=describe_limit(row),
        allowed=source_number(row, "limit", f"{unit.text(row.limit)} {unit.sign}", unit.sign),
        sigma=_expected(row, system),
        interval=_interval(row, system),
        margin=size[0] if size else numbers.NO_VALUE,
        margins=SourcedInterval(size[1], size[2]) if size else "",
        other_margins=verdicts.other_margins_text(row) if size else "",
        chance=chance,
        source=f"{verdicts.source_text(row.parts[0])} ({_percent(row.share)})"
        if row.parts
        else numbers.NO_VALUE,
        parts=[verdicts.share_text(share) for share in row.parts] or [numbers.NO_VALUE],
        reached=numbers.duration_text(row.reached_after),
        decides=row.decides,
        reason=numbers.join_first(row.reasons, _MAX_REASONS),
        backtest=describe_backtest(row),
    )


ErrorRow = RankingRow | ErrorBudgetRow


def _expected(row: ErrorRow, system: System) -> str:
    if row.sigma is None:
        return numbers.NO_VALUE
    unit = choose_unit(DIMENSIONS[row.error], system, row.sigma)
    text = _format_error(row, row.sigma, unit)
    return source_number(row, "sigma", text, unit.sign) if _is_sensible(row, row.sigma) else text


def _interval(row: ErrorRow, system: System) -> str:
    if row.sigma is None or row.lower is None or row.upper is None:
        return numbers.NO_VALUE
    if not _is_sensible(row, row.sigma):
        return numbers.NO_VALUE
    unit = choose_unit(DIMENSIONS[row.error], system, row.sigma)
    digits = min(unit.digits(row.sigma, row.lower, row.upper), _MAX_DIGITS)
    lower, upper = (
        source_number(row, name, unit.text(value, digits), unit.sign)
        for name, value in (("lower", row.lower), ("upper", row.upper))
    )
    return SourcedInterval(lower, upper)


def format_recording_error(total: ErrorBudgetRow, system: System) -> tuple[str, str]:
    """Return the expected error (1σ) and its 95 % interval, from a total of ``error_budget``."""
    if total.sigma is None:
        return "–", ""
    return _expected(total, system), _interval(total, system)


def describe_limit(row: RankingRow) -> str:
    """Return the error and the time of a limit as text, such as ``heading, 60 s``."""
    drive = f" without GNSS ({row.trajectory})" if row.trajectory else ""
    names = _NAMES if row.trajectory else _NAMES_IN_LIMITS
    return f"{names[row.error]}, {numbers.duration_text(row.time)}{drive}"


def make_budget_tables(
    rows: Sequence[ErrorBudgetRow], simulated: Simulated, system: System
) -> Iterator[Json]:
    """Yield the error budget of each recording: a line per error and axis, a column per time."""
    own = [row for row in rows if row.requirement is None]
    for key, parts in group_rows(own, lambda row: (row.sensor, row.recording)).items():
        times = list(dict.fromkeys(row.time for row in parts))
        lines: dict[tuple[str, tuple[float | None, ...]], Json] = {}
        missing: dict[str, None] = {}
        for (error, axis), chosen in group_rows(parts, lambda row: (row.error, row.axis)).items():
            sigmas = tuple(row.sigma for row in chosen if row.source == "total")
            if not any(sigmas):
                missing[f"{_NAMES[error]}: {'; '.join(chosen[0].reasons) or 'not known'}"] = None
            elif (error, sigmas) in lines:
                # One channel is the worst and the median.
                lines[error, sigmas]["axis"] += f", {axis}"
            else:
                cells = [_cell([r for r in chosen if r.time == t], system) for t in times]
                lines[error, sigmas] = {"error": _NAMES[error], "axis": axis, "cells": cells}
        notes: dict[str, dict[str, None]] = {}  # the errors of each note
        for (error, _), line in lines.items():
            for note in (cell["note"] for cell in line["cells"] if cell["note"]):
                notes.setdefault(note, {})[_NAMES_IN_NOTES[error]] = None
        yield {
            "sensor": key[0],
            "recording": key[1],
            "simulated": simulated.get(key, False),
            "times": [numbers.duration_text(time) for time in times],
            "lines": list(lines.values()),
            "missing": "; ".join(missing),
            "notes": [f"{', '.join(of).capitalize()}: {note}" for note, of in notes.items()],
        }


def make_budget_bars(rows: Sequence[ErrorBudgetRow], system: System) -> list[Json]:
    """Return a bar per error and time of the worst axes, with its sources as shares of variance."""
    own = [row for row in rows if row.requirement is None]
    worst = (row for row in own if row.axis == own[0].axis)
    groups = group_rows(worst, lambda row: (row.error, row.time))
    bars: list[Json] = []
    for (error, time), parts in sorted(groups.items(), key=lambda of: _ERRORS.index(of[0][0])):
        total = _total(parts)
        sigma = total.sigma if total else None
        if not total or not sigma:
            continue
        size = _format_error(total, sigma, choose_unit(DIMENSIONS[error], system, sigma))
        shares = [
            (
                verdicts.source_text(row),
                float(f"{(row.sigma / sigma) ** 2:.3g}"),
                verdicts.source_text(row, sized=False),
            )
            for row in parts
            if row.source != "total" and row.sigma
        ]
        bars.append({"label": f"{error} {numbers.duration_text(time)}: {size}", "shares": shares})
    return bars


def _total(rows: Iterable[ErrorBudgetRow]) -> ErrorBudgetRow | None:
    return next((row for row in rows if row.source == "total"), None)


def _cell(rows: Sequence[ErrorBudgetRow], system: System) -> Json:
    total = _total(rows)
    if total is None or total.sigma is None:
        return {
            "lines": [numbers.NO_VALUE],
            "note": "; ".join(total.reasons) if total else "",
            "known": False,
        }
    unit = choose_unit(DIMENSIONS[total.error], system, total.sigma)
    lines = [_format_error(total, total.sigma, unit)]
    if _is_sensible(total, total.sigma):
        lines.append(numbers.interval_text(total.lower, total.upper, unit, total.sigma))
    sources = [row for row in rows if row.source != "total"]
    if total.sigma > 0.0:
        lines += [
            verdicts.share_text(share) for share in compute_variance_shares(total.sigma, sources)
        ] or [""]
    return {"lines": lines, "note": "; ".join(total.reasons), "known": True}


def _is_sensible(row: ErrorRow, sigma: float) -> bool:
    """Return whether an error is below 90°, beyond which an angle has no meaning."""
    return DIMENSIONS[row.error] != "angle" or sigma <= _QUARTER_TURN


def _format_error(row: ErrorRow, sigma: float, unit: numbers.Unit) -> str:
    """Return the error of a row with its unit, and as many digits as its limits allow."""
    if not _is_sensible(row, sigma):
        north = row.error == "north"
        return "not determined" if north else f"over {unit.text(_QUARTER_TURN, 3)} {unit.sign}"
    digits = min(unit.digits(sigma, row.lower, row.upper), _MAX_DIGITS)
    return f"{unit.text(sigma, digits)} {unit.sign}"


def _percent(share: float | None) -> str:
    return numbers.NO_VALUE if share is None else f"{100 * share:.0f} %"


def explain_budget(settings: Mapping[str, Any]) -> str:
    """Return how the errors are calculated, in words, from the section ``error_budget``."""
    return (
        "Errors that the noise causes in dead reckoning, with 95 % intervals and the parts of the "
        f"variance of 1 % or more. Biases and tilt are taken over {settings['static_window']} at "
        "rest right before; a tilt keeps the turn-on bias of the accelerometers, which is marked "
        "as it is from the datasheet. North is found at rest at a latitude of "
        f"{settings['latitude']}, by a gyro whose bias is known."
    )


def format_backtest(
    rows: Sequence[BacktestRow], requirements: Mapping[str, Any], system: System
) -> list[Mapping[str, object]]:
    """Return a line per row of ``backtest``: an error in the log and the predicted error."""
    lines: list[Mapping[str, object]] = []
    for row in rows:
        unit = choose_unit(DIMENSIONS[row.error], system)
        line: dict[str, object] = {
            "requirement": requirements.get(row.requirement, {}).get("title") or row.requirement,
            "channel": row.channel.replace("_", " "),
            "error": f"{row.error}, {numbers.duration_text(row.time)}",
            "window": numbers.duration_text(row.window),
            "measured": numbers.NO_VALUE,
            "predicted": numbers.NO_VALUE,
            "ratio": numbers.number_text(row.ratio, 3),
            "range": "",
            "windows": numbers.NO_VALUE,
            "verdict": row.verdict,
            "contradicted": row.contradicted,
            "why": row.reason or "",
        }
        if row.predicted is not None:
            line["predicted"] = f"{unit.text(row.predicted)} {unit.sign}"
        if row.ratio is not None:
            line["measured"] = f"{unit.text(row.measured)} {unit.sign}"
            line["range"] = format_range(row.ratio_lower, row.ratio_upper)
            independent = f"({numbers.number_text(row.independent, 2)} independent)"
            line["windows"] = f"{numbers.number_text(row.windows, 9)} {independent}"
        if row.taken_out and not row.reason:
            line["why"] = (
                f"in the log, not in the model: {', '.join(row.taken_out).replace('_', ' ')}"
            )
        lines.append(line)
    return lines


def format_range(lower: float | None, upper: float | None) -> str:
    """Return the expected range of a ratio near 1 as text, such as ``0.97 to 1.04``."""
    digits = numbers.count_digits(1.0, lower, upper)
    return f"{numbers.number_text(lower, digits)} to {numbers.number_text(upper, digits)}"


def describe_backtest(row: RankingRow) -> str:
    """Return the observed error relative to the predicted one, in words; empty if not tested."""
    if row.backtest_ratio is None:
        return ""
    channel = (row.backtest_channel or "all channels").replace("_", " ")
    lower, upper = row.backtest_ratio_lower, row.backtest_ratio_upper
    place = ""
    if lower is not None and upper is not None:
        place = ": inside" if lower <= row.backtest_ratio <= upper else ": outside"
    digits = numbers.count_digits(row.backtest_ratio, lower, upper)
    return (
        f"the observed {row.error} of {channel} after {numbers.duration_text(row.time)} is "
        f"{numbers.number_text(row.backtest_ratio, digits)} of the predicted one (expected "
        f"{format_range(lower, upper)}){place}"
    )
