"""Find the time column and its unit, from its name or else from its stamps."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.batch import SECONDS
from imubench_pipeline.readers.file_format import LogColumn, LogTable
from imubench_pipeline.readers.inspection.draft import UNKNOWN, Entry, Source
from imubench_pipeline.readers.inspection.names import split_label
from imubench_pipeline.readers.stamps import format_date
from imubench_pipeline.readers.stated_units import parse_unit, split_unit
from imubench_pipeline.readers.text.stamps import DAY

_TIME_WORDS = frozenset(
    ("t", "time", "timestamp", "timestamps", "stamp", "stamps", "ts", "elapsed", "clock", "tow",
     "itow", "ticks", "tick", "epoch", "utc", "datetime", "timetag", "tag", "zeit", "zeitstempel",
     "temps", "tiempo", "tempo", "sec", "secs", "seconds", "ms", "millis", "us", "micros", "usec",
     "msec", "ns", "nsec", "nanos", "unix", "s")
)  # fmt: skip
_COUNTER_WORDS = frozenset(
    ("counter", "count", "cnt", "cntr", "sample", "samples", "index", "idx", "frame", "seq",
     "sequence", "n", "no", "nr", "packet", "row", "record", "id", "num", "number")
)  # fmt: skip
_XSENS_TICKS, _XSENS_PACKETS = "sampletimefine", "packetcounter"
_PLAUSIBLE_RATES = (10.0, 5000.0)  # plausible sampling rates, Hz, for guessing the unit of a clock
_MAX_COUNTER_STEP, _MAX_COUNT = 1e6, 2.0**63
_STEP_RANGE = (1e-9, 1e15)  # range of the steps of stamps, in any unit
_WRAP_CANDIDATES = (
    *(1 << bits for bits in (8, 16, 24, 32, 40, 48)),
    *(
        period * parts
        for period in (1, 60, 3600, 86_400, 604_800)
        for parts in (1, 1000, 10**6, 10**9)
    ),
)
"""Values at which clocks wrap to 0: powers of 2, and a second to a week in s, ms, us and ns."""

_MAX_STEP_SCATTER, _MIN_EQUAL_STEPS, _MAX_PAUSES = 0.6, 0.8, 0.02
"""Largest relative deviation of a step from the median, least share of such steps, and largest
share of pauses, for steps that count as equal."""

_RATE_TOLERANCE = 0.1  # largest relative difference of a guessed rate and the stated one
_SECONDS_PER_UNIT = {"min": 60, "h": 3600}
_UNIT_HINT = "not stated in the file: s, ms, us or ns?"


@dataclass(frozen=True, eq=False)
class Clock:
    """A column that may be the time of a table, with its entry in a sensor file."""

    column: LogColumn
    entry: Entry[Source]  # `time` of the sensor file
    counts: bool  # the column counts samples, so that `rate` is needed
    order: tuple[int, ...]  # sort key; a lower one is more plausible


def find_clocks(table: LogTable, columns: Sequence[LogColumn]) -> list[Clock]:
    """Return the columns that may be the time of a table, the most plausible first."""
    likely = []
    for place, column in enumerate(columns):
        if (names := table.file_format.time_columns) and column.label not in names:
            continue
        recognised = _recognise_date if column.kind == "date" else _recognise_number
        if (clock := recognised(column, table)) is not None:
            counts_alone = clock.counts and table.rate is None
            likely.append(replace(clock, order=(*clock.order, int(counts_alone), place)))
    return sorted(likely, key=lambda clock: clock.order)


def _get_source(column: LogColumn) -> str | int:
    return column.source if column.address is None else column.address


def _recognise_date(column: LogColumn, table: LogTable) -> Clock | None:
    form = column.forms[0]
    if not _has_hour(form) or not is_advancing(column.values, DAY):
        return None
    source = Source(column=_get_source(column), format=form)
    day = column
    if form != "iso8601" and "%d" not in form:
        days = [c for c in table.columns if c.kind == "date" and not _has_hour(c.forms[0])]
        if days:
            day = days[0]
            source = replace(source, date=_get_source(day), format=f"{day.forms[0]} {form}")
    # Day and month may be exchanged.
    others = [other for other in day.forms[1:] if sorted(other) == sorted(day.forms[0])]
    comment = f"or {others[0]}? {day.first[0]!r} does not tell" if others else ""
    return Clock(column, Entry(source, comment), False, (_rank_resolution(column), 1))


def _has_hour(form: str) -> bool:
    return form == "iso8601" or any(field in form for field in ("%H", "%I"))


def _recognise_number(column: LogColumn, table: LogTable) -> Clock | None:
    if column.kind != "number" or not is_advancing(column.values):
        return None
    words = split_label(column.label)
    joined = "".join(words)
    if joined.endswith(_XSENS_TICKS):
        # The clock of Xsens: 0.1 ms in motion trackers, 1 us in wearables
        step = estimate_step(column.values)
        in_microseconds = step is not None and step > 8000
        of_ticks, scale = ("us", None) if in_microseconds else ("ms", 0.1)
        source = Source(column=_get_source(column), unit=of_ticks, scale=scale, wraps=1 << 32)
        rate = "" if step is None else f", {(1e6 if in_microseconds else 1e4) / step:.5g} Hz"
        tick = "1 us" if in_microseconds else "0.1 ms"
        return Clock(column, Entry(source, f"ticks of {tick}{rate}"), False, (0, 0))
    source = Source(column=_get_source(column))
    if joined == _XSENS_PACKETS or (
        not _TIME_WORDS.intersection(words) and _COUNTER_WORDS.intersection(words)
    ):
        steps = _take_steps(column.values)
        step = float(np.median(steps[steps > 0]))
        highest = float(np.nanmax(column.values))
        if not step.is_integer() or not step <= _MAX_COUNTER_STEP or not highest < _MAX_COUNT:
            return None
        scale, wraps = 1 / step if step > 1 else None, None
        falls = (steps < 0).any()
        comment = "a count of samples"
        if joined == _XSENS_PACKETS and highest < 1 << 16:
            wraps = 1 << 16
        elif falls:
            wraps = 1 << max(int(highest).bit_length(), 1)
            comment = "a count of samples; 'wraps' is guessed from the highest one"
        source = Source(column=_get_source(column), unit="samples", scale=scale, wraps=wraps)
        return Clock(column, Entry(source, comment), True, (1, 3))
    unit = parse_unit(column.unit or "", "time") or split_unit(column.label, "time")[1]
    if unit is None:
        units = [parse_unit(word, "time") for word in words if len(word) > 1]
        unit = next((word for word in reversed(units) if word), None)
    scale = _SECONDS_PER_UNIT.get(unit or "", 1)
    wrap = _guess_wrap(column.values)
    source = replace(source, wraps=wrap)
    if unit is not None:
        source = replace(source, unit=unit)
        if scale != 1:
            source = replace(source, unit="s", scale=scale)
        comment = "" if wrap is None else "'wraps' is guessed from the stamps"
        return Clock(column, Entry(source, comment), False, (_rank_resolution(column), 0))
    named = bool(_TIME_WORDS.intersection(words))
    unit, comment = _guess_unit(column.values, table.rate)
    if not named:
        grows = "grows evenly" if _is_regular(column.values) else "" if column.label else "grows"
        if unit == UNKNOWN or not grows or (_take_steps(column.values) < 0).any():
            return None
        comment = f"guessed, since it {grows}; {comment.removeprefix('guessed: ')}"
    order = (_rank_resolution(column) + (0 if named else 2), 0 if unit != UNKNOWN else 2)
    return Clock(column, Entry(replace(source, unit=unit), comment), False, order)


def _guess_unit(values: NDArray[np.float64], rate: float | None) -> tuple[str, str]:
    first = float(values[np.isfinite(values)][0])
    step = estimate_step(values)
    if step is None:
        return UNKNOWN, _UNIT_HINT
    for unit, seconds in SECONDS.items():
        nanoseconds = first * seconds * 1e9
        date = format_date(round(nanoseconds)) if abs(nanoseconds) < 1e19 else None
        if date is not None:
            return unit, f"guessed: since 1970 it is {date[:16]} then"
    rates = {unit: 1 / (step * seconds) for unit, seconds in SECONDS.items()}
    shown = f"the stamps advance by {step:.5g}"
    for unit, guess in rates.items():
        if rate is not None and abs(guess / rate - 1) < _RATE_TOLERANCE:
            return unit, f"guessed: {shown}, and the file states {rate:.5g} Hz"
    likely = [
        unit for unit, guess in rates.items() if _PLAUSIBLE_RATES[0] <= guess <= _PLAUSIBLE_RATES[1]
    ]
    if len(likely) != 1 or step == 1:
        return UNKNOWN, f"{_UNIT_HINT} {shown}"
    return likely[0], f"guessed: {shown}, that is {rates[likely[0]]:.5g} Hz"


def _take_steps(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.diff(values[np.isfinite(values)])


def estimate_step(values: NDArray[np.float64]) -> float | None:
    """Return the step between samples, in the unit of the stamps; None if they do not advance.

    If most steps are equal, steps over missing samples are ignored; else, all steps are averaged.
    """
    steps = _take_steps(values)
    forward = steps[steps > 0]
    if not len(forward):
        return None
    median = float(np.median(forward))
    usual = forward[forward <= 1.75 * median]
    alike = np.mean(np.abs(forward - median) <= _MAX_STEP_SCATTER * median) >= _MIN_EQUAL_STEPS
    # Few long steps are holes; many are pauses of a host between bursts.
    few = len(forward) - len(usual) <= _MAX_PAUSES * len(forward) + 1
    if not (alike and (few or usual.sum() >= 0.5 * forward.sum())):
        usual = forward
    shared = np.count_nonzero(steps == 0) / len(forward)
    step = float(np.mean(usual) / (1 + shared))
    return step if _STEP_RANGE[0] <= step <= _STEP_RANGE[1] else None


def _guess_wrap(values: NDArray[np.float64]) -> int | None:
    """Return the value at which stamps wrap to 0; None if they do not, or at no usual value."""
    steps, step = _take_steps(values), estimate_step(values)
    falls = steps[steps < 0]
    if not len(falls) or step is None:
        return None
    range_of = step - float(falls[0])
    return next(
        (end for end in _WRAP_CANDIDATES if abs(range_of - end) <= max(2 * step, 1e-9 * end)), None
    )


def is_advancing(values: NDArray[np.float64], wrap: float | None = None) -> bool:
    """Return whether stamps increase, except for wraps to 0 at ``wrap``, and a few steps back."""
    steps = _take_steps(values)
    if wrap is not None:
        steps = np.where(steps < -wrap / 2, steps + wrap, steps)
    forward, back = np.count_nonzero(steps > 0), np.count_nonzero(steps < 0)
    return bool(forward > 10 * back and back <= 0.02 * len(steps) + 1)


def _rank_resolution(column: LogColumn) -> int:
    """Return 2 for a coarse clock, whose stamps mostly repeat, else 0."""
    steps = _take_steps(column.values)
    return 2 if len(steps) and np.mean(steps == 0) > 0.5 else 0


def _is_regular(values: NDArray[np.float64]) -> bool:
    steps = _take_steps(values)
    if len(steps) < 5 or not (steps > 0).all():
        return False
    return bool(np.ptp(np.quantile(steps, (0.1, 0.9))) <= 0.5 * np.median(steps))
