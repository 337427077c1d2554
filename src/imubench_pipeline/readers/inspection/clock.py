"""Which column has the time, and in what unit: from its name, else from its stamps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.readers.batch import SECONDS
from imubench_pipeline.readers.file_format import LogColumn, LogTable
from imubench_pipeline.readers.inspection.draft import UNKNOWN, Entry
from imubench_pipeline.readers.inspection.names import words_of
from imubench_pipeline.readers.stamps import date_of
from imubench_pipeline.readers.stated_units import divided, unit_of
from imubench_pipeline.readers.text.stamps import DAY

_WORDS = frozenset(
    ("t", "time", "timestamp", "timestamps", "stamp", "stamps", "ts", "elapsed", "clock", "tow",
     "itow", "ticks", "tick", "epoch", "utc", "datetime", "timetag", "tag", "zeit", "zeitstempel",
     "temps", "tiempo", "tempo", "sec", "secs", "seconds", "ms", "millis", "us", "micros", "usec",
     "msec", "ns", "nsec", "nanos", "unix", "s")
)  # fmt: skip
_COUNTERS = frozenset(
    ("counter", "count", "cnt", "cntr", "sample", "samples", "index", "idx", "frame", "seq",
     "sequence", "n", "no", "nr", "packet", "row", "record", "id", "num", "number")
)  # fmt: skip
_TICKS, _PACKETS = "sampletimefine", "packetcounter"
_LIKELY = (10.0, 5000.0)
"""Hz: the rates that a clock of unknown unit is thought to show."""

_LONGEST_STEP, _HIGHEST_COUNT = 1e6, 2.0**63
_STEPS = (1e-9, 1e15)
"""Steps that stamps may have, in any unit."""

_WRAPS = (
    *(1 << bits for bits in (8, 16, 24, 32, 40, 48)),
    *(
        period * parts
        for period in (1, 60, 3600, 86_400, 604_800)
        for parts in (1, 1000, 10**6, 10**9)
    ),
)
"""Where clocks start again: after so many bits, or after a second to a week."""

_SCATTER, _MOST, _FEW = 0.6, 0.8, 0.02
_AGREE = 0.1
_MINUTES = {"min": 60, "h": 3600}
_UNIT_HINT = "the file does not say: s, ms, us or ns?"
_RATE_HINT = "the file does not say: such as 100 Hz"


@dataclass(frozen=True, eq=False)
class Clock:
    """The time of a table, as a sensor file states it."""

    column: LogColumn
    entry: Entry
    """``time`` of the sensor file."""
    counts: bool
    """It counts samples: ``rate`` is needed."""
    order: tuple[int, ...]
    """The lower, the better."""


def clocks(table: LogTable, columns: Sequence[LogColumn], rate: float | None) -> list[Clock]:
    """Return the columns that may be the time, the likeliest first.

    ``columns``: those of the table that are no channel, and vectors beside it.
    ``rate``: that the file states, Hz.
    """
    likely = []
    for place, column in enumerate(columns):
        if (names := table.file_format.time_columns) and column.label not in names:
            continue
        clock = _dated(column, table) if column.kind == "date" else _counted(column, rate)
        if clock is not None:
            counts_alone = clock.counts and rate is None
            order = (*clock.order, int(counts_alone), place)
            likely.append(Clock(clock.column, clock.entry, clock.counts, order))
    return sorted(likely, key=lambda clock: clock.order)


def rate_entry(table: LogTable | None) -> Entry:
    """Return ``rate`` of a sensor file where no stamps tell it."""
    if table is None or table.rate is None:
        return Entry(UNKNOWN, _RATE_HINT)
    return Entry(f"{table.rate:.10g} Hz", "stated in the file")


def _source(column: LogColumn) -> str | int:
    return column.source if column.address is None else column.address


# ----------------------------------------------------------------------------------- dates


def _dated(column: LogColumn, table: LogTable) -> Clock | None:
    form = column.forms[0]
    has_day = form == "iso8601" or "%d" in form
    has_hour = form == "iso8601" or "%H" in form or "%I" in form
    if not has_hour or not advances(column.values, DAY):
        return None
    value: dict[str, Any] = {"column": _source(column), "format": form}
    if not has_day:
        days = [c for c in table.columns if c.kind == "date" and not _has_hour(c.forms[0])]
        if days and days[0].forms:
            value = {
                "column": _source(column),
                "date": _source(days[0]),
                "format": f"{days[0].forms[0]} {form}",
            }
            return Clock(column, Entry(value, _day_comment(days[0])), False, (_coarse(column), 1))
    return Clock(column, Entry(value, _day_comment(column)), False, (_coarse(column), 1))


def _has_hour(form: str) -> bool:
    return form == "iso8601" or any(field in form for field in ("%H", "%I"))


def _day_comment(column: LogColumn) -> str:
    """Say where day and month may be the other way round."""
    form = column.forms[0]
    others = [other for other in column.forms[1:] if sorted(other) == sorted(form)]
    return f"or {others[0]}? {column.first[0]!r} does not tell" if others else ""


# --------------------------------------------------------------------------------- numbers


def _counted(column: LogColumn, rate: float | None) -> Clock | None:
    """Return the clock that a column of numbers is; None: it is none."""
    if column.kind != "number" or not advances(column.values):
        return None
    words = words_of(column.label)
    joined = "".join(words)
    if joined.endswith(_TICKS):
        return _tick_clock(column)
    value: dict[str, Any] = {"column": _source(column)}
    if joined == _PACKETS or (not _WORDS.intersection(words) and _COUNTERS.intersection(words)):
        return _counter(column, value, joined == _PACKETS)
    unit, scale = _stated(column)
    wrap = _wrap(column.values)
    again = {} if wrap is None else {"wraps": wrap}
    if unit is not None:
        value["unit"] = unit
        if scale != 1:
            value["scale"] = scale
        comment = "'wraps' is guessed from the stamps" if again else ""
        return Clock(column, Entry(value | again, comment), False, (_coarse(column), 0))
    named = bool(_WORDS.intersection(words))
    value["unit"], comment = _guessed(column.values, rate)
    if not named:
        grows = "grows evenly" if _regular(column.values) else "" if column.label else "grows"
        if value["unit"] == UNKNOWN or not grows or (_steps(column.values) < 0).any():
            return None
        comment = f"guessed, since it {grows}; {comment.removeprefix('guessed: ')}"
    order = (_coarse(column) + (0 if named else 2), 0 if value["unit"] != UNKNOWN else 2)
    return Clock(column, Entry(value | again, comment), False, order)


def _counter(column: LogColumn, value: dict[str, Any], of_16_bits: bool) -> Clock | None:
    steps = _steps(column.values)
    step = float(np.median(steps[steps > 0]))
    highest = float(np.nanmax(column.values))
    if not step.is_integer() or not step <= _LONGEST_STEP or not highest < _HIGHEST_COUNT:
        return None
    value["unit"] = "samples"
    if step > 1:
        value["scale"] = 1 / step
    falls = (steps < 0).any()
    comment = "a count of samples"
    if of_16_bits and highest < 1 << 16:
        value["wraps"] = 1 << 16
    elif falls:
        value["wraps"] = 1 << max(int(highest).bit_length(), 1)
        comment = "a count of samples; 'wraps' is guessed from the highest one"
    return Clock(column, Entry(value, comment), True, (1, 3))


def _tick_clock(column: LogColumn) -> Clock:
    """Return the clock of Xsens: of 0.1 ms in a motion tracker, of 1 us in a wearable one."""
    step = typical_step(column.values)
    of_microseconds = step is not None and step > 8000
    value: dict[str, Any] = {"column": _source(column), "unit": "us" if of_microseconds else "ms"}
    if not of_microseconds:
        value["scale"] = 0.1
    value["wraps"] = 1 << 32
    rate = "" if step is None else f", {(1e6 if of_microseconds else 1e4) / step:.5g} Hz"
    tick = "1 us" if of_microseconds else "0.1 ms"
    return Clock(column, Entry(value, f"ticks of {tick}{rate}"), False, (0, 0))


def _stated(column: LogColumn) -> tuple[str | None, float]:
    """Return the unit that the file states, s, ms, us or ns, and how many of it are one."""
    unit = unit_of(column.unit or "", "time")
    if unit is None:
        unit = divided(column.label, "time")[1]
    if unit is None:
        words = [unit_of(word, "time") for word in words_of(column.label) if len(word) > 1]
        unit = next((word for word in reversed(words) if word), None)
    return ("s", _MINUTES[unit]) if unit in _MINUTES else (unit, 1)


def _guessed(values: NDArray[np.float64], rate: float | None) -> tuple[str, str]:
    """Return the unit of stamps, or that it is not known; and why."""
    first = float(values[np.isfinite(values)][0])
    step = typical_step(values)
    if step is None:
        return UNKNOWN, _UNIT_HINT
    for unit, seconds in SECONDS.items():
        nanoseconds = first * seconds * 1e9
        date = date_of(round(nanoseconds)) if abs(nanoseconds) < 1e19 else None
        if date is not None:
            return unit, f"guessed: since 1970 it is {date[:16]} then"
    rates = {unit: 1 / (step * seconds) for unit, seconds in SECONDS.items()}
    shown = f"the stamps advance by {step:.5g}"
    for unit, guess in rates.items():
        if rate is not None and abs(guess / rate - 1) < _AGREE:
            return unit, f"guessed: {shown}, and the file states {rate:.5g} Hz"
    likely = [unit for unit, guess in rates.items() if _LIKELY[0] <= guess <= _LIKELY[1]]
    if len(likely) != 1 or step == 1:
        return UNKNOWN, f"{_UNIT_HINT} {shown}"
    return likely[0], f"guessed: {shown}, that is {rates[likely[0]]:.5g} Hz"


# ------------------------------------------------------------------------------------ steps


def _steps(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.diff(values[np.isfinite(values)])


def typical_step(values: NDArray[np.float64]) -> float | None:
    """Return the step from sample to sample; None where stamps do not advance.

    Where steps are alike, those over missing samples do not count; where they scatter, as they do
    in stamps of arrival in a host, it is the mean. Samples may share a stamp.
    """
    steps = _steps(values)
    forward = steps[steps > 0]
    if not len(forward):
        return None
    median = float(np.median(forward))
    usual = forward[forward <= 1.75 * median]
    alike = np.mean(np.abs(forward - median) <= _SCATTER * median) >= _MOST
    # Few long pauses are holes, many are those of a host between its bursts.
    few = len(forward) - len(usual) <= _FEW * len(forward) + 1
    if not (alike and (few or usual.sum() >= 0.5 * forward.sum())):
        usual = forward
    shared = np.count_nonzero(steps == 0) / len(forward)
    step = float(np.mean(usual) / (1 + shared))
    return step if _STEPS[0] <= step <= _STEPS[1] else None


def _wrap(values: NDArray[np.float64]) -> int | None:
    """Return where stamps start again from 0; None: they do not, or at no usual place."""
    steps, step = _steps(values), typical_step(values)
    falls = steps[steps < 0]
    if not len(falls) or step is None:
        return None
    range_of = step - float(falls[0])
    return next((end for end in _WRAPS if abs(range_of - end) <= max(2 * step, 1e-9 * end)), None)


def advances(values: NDArray[np.float64], wrap: float | None = None) -> bool:
    """Tell whether stamps go forward, but for a new start now and then."""
    steps = _steps(values)
    if wrap is not None:
        steps = np.where(steps < -wrap / 2, steps + wrap, steps)
    forward, back = np.count_nonzero(steps > 0), np.count_nonzero(steps < 0)
    return bool(forward > 10 * back and back <= 0.02 * len(steps) + 1)


def _coarse(column: LogColumn) -> int:
    """Return 2 for stamps that most samples share with others, else 0."""
    steps = _steps(column.values)
    return 2 if len(steps) and np.mean(steps == 0) > 0.5 else 0


def _regular(values: NDArray[np.float64]) -> bool:
    steps = _steps(values)
    if len(steps) < 5 or not (steps > 0).all():
        return False
    return bool(np.ptp(np.quantile(steps, (0.1, 0.9))) <= 0.5 * np.median(steps))
