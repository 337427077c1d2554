"""Columns of one table that have rates of their own, taken apart: each clock becomes a part.

Phones and programs that merge logs write a row for each stamp and leave the cell of a sensor empty
that has no new sample. A channel has a clock of its own where the records with a number lie on a
uniform grid that is slower than the grid of all records, or where all records together
lie on no grid. Numbers that are missing at random do not lie on a slower grid: such a channel
stays on the common one. The axes of a gyro, or of an accelerometer, are sampled together: an axis
with fewer numbers than another one has lost them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.recordings import timebase
from imubench_pipeline.recordings.parts import STAMP_BLOCK, Part, new_part
from imubench_pipeline.recordings.recording import BESIDE
from imubench_pipeline.recordings.timebase import TimeBase
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.tables import checked_parquet, checked_row_group
from imubench_pipeline.tables.findings import Finding, RecordingError

_SAME_CLOCK = 0.5
"""Least share of common records, of the sparser channel, for two channels of one clock."""

_WITHIN = 0.95
"""Least share of the records of a channel that are also records of the channel it joins."""

_APART = 0.05
"""Share of the records of a channel below which it is not read together with another one."""

_MAX_STRIDE, _MIN_ON_STRIDE = 50, 0.98
"""Records between two samples of a slower clock, at most; share of the samples that lie on it."""

EVERY = -1
"""In the place of the bits of columns: all records, also those without a number."""


@dataclass
class _Clock:
    """Channels that have their samples in the same records."""

    base: TimeBase
    channels: list[str]
    bits: int
    """Those of the channels in `Part.present`."""


class _Records:
    """The records of a part: in which of them the columns have a number."""

    def __init__(self, part: Part, stated: float | None, settings: QualitySettings) -> None:
        self._part, self._stated, self._settings = part, stated, settings
        bits = np.arange(len(part.patterns))[:, None] >> np.arange(len(part.columns)) & 1
        common = bits.T @ (part.patterns[:, None] * bits)
        names = list(part.columns)
        self.bit = {name: 1 << place for place, name in enumerate(names)}
        self.common = {
            (a, b): int(common[i, j]) for i, a in enumerate(names) for j, b in enumerate(names)
        }

    def count(self, channel: str) -> int:
        """Return how many records have a number of a channel."""
        return self.common[channel, channel]

    def times(self, *, numbered: bool = False) -> Iterator[NDArray[np.float64]]:
        """Yield the stamps of all records, s; without stamps, or if asked for, their numbers.

        Numbers are divided by the stated rate, where there is one.
        """
        part = self._part
        if part.stamped and not numbered:
            yield from part.stamps()
            return
        for start in range(0, part.rows, STAMP_BLOCK):
            yield np.arange(start, min(start + STAMP_BLOCK, part.rows)) / (self._stated or 1.0)

    def base(self, bits: int, *, numbered: bool = False, known: float | None = None) -> TimeBase:
        """Return the time base of the records that have a number in one of some columns.

        The stated rate belongs to all records: it decides only whether steps of one and two are
        samples lost. ``known``: the interval, s, if it is known.

        Raises
        ------
        RecordingError
            If their stamps do not advance, or jump too often.
        """

        def stamps() -> Iterator[NDArray[np.float64]]:
            for block, present in zip(
                self.times(numbered=numbered), self._part.present(), strict=True
            ):
                yield block[has_one(present, bits)]

        settings = self._settings
        base = timebase.from_stamps(stamps, None, settings, known=known)
        if self._stated and any(found.finding == "coarse_stamps" for found in base.findings):
            lossy = timebase.from_stamps(stamps, self._stated, settings)
            if abs(lossy.rate / self._stated - 1.0) <= settings.rate_tolerance:
                base = lossy
        by_number = numbered or not self._part.stamped
        return replace(base, source="stated", rate_error=None) if by_number else base

    def points(self, base: TimeBase, bits: int) -> Iterator[NDArray[np.int64]]:
        """Yield the grid points, in the time base of all records, of those with a number."""
        places = timebase.positions(base, self.times, self._settings)
        for points, present in zip(places, self._part.present(), strict=True):
            chosen = points[has_one(present, bits)]
            yield chosen[chosen >= 0]

    def stride(self, base: TimeBase, bits: int) -> int:
        """Return the distance of the samples of a channel, in intervals of all records.

        It is found however many samples are missing. 1: the samples lie on no slower clock of
        which the interval is a multiple of that of all records.
        """
        hits = np.zeros(_MAX_STRIDE + 1)
        total = 0
        for points in self.points(base, bits):
            total += len(points)
            for stride in range(2, _MAX_STRIDE + 1):
                hits[stride] += np.bincount(points % stride).max(initial=0)
        strides = np.flatnonzero(hits >= _MIN_ON_STRIDE * max(total, 1))
        return int(strides.max(initial=1))


def has_one(present: NDArray[np.uint16], bits: int) -> NDArray[np.bool_]:
    """Return which records have a number in one of some columns (`EVERY`: all records)."""
    return np.ones(len(present), np.bool_) if bits == EVERY else present & np.uint16(bits) != 0


def separate_clocks(
    part: Part,
    stated: float | None,
    whole: Callable[[], TimeBase],
    settings: QualitySettings,
    scratch: Path,
) -> list[Part]:
    """Return the parts of a file whose channels have clocks of their own; else the part alone.

    Parameters
    ----------
    part : Part
        Its scratch file is read once more where it is taken apart.
    stated : float or None
        The rate of its records, Hz, as it is stated.
    whole : callable
        Returns the time base of all records.
    scratch : Path
        Folder for the scratch files.

    Raises
    ------
    RecordingError
        If channels without a clock of their own are left, and all records together have none.
    """
    records = _Records(part, stated, settings)
    channels = [
        name
        for name in part.columns
        if name not in BESIDE and records.count(name) >= settings.shortest
    ]
    complete = (1.0 - settings.jitter) * part.rows
    if all(records.count(name) >= complete for name in channels):
        return [part]
    try:
        base: TimeBase | None = whole()
    except RecordingError:
        base = None
    grid = base if base is not None and (base.uniform or base.stamped) else None
    limit = (1.0 - settings.rate_tolerance) * (base.rate if base is not None else math.inf)
    own = {}
    for name in channels:
        found = _own_clock(name, channels, part, records, grid)
        if found is not None:
            own[name] = found
    leaders = {name: _complete_sibling(name, own, records) for name in own}
    own = {name: found for name, found in own.items() if leaders[name] is None}
    if grid is not None and all(found.rate >= limit for found in own.values()):
        part.findings = _rate_changes(channels, grid, records, part)
        return [part]
    clocks = _grouped(own, records, settings)
    rest = _place(channels, own, clocks, records, leaders)
    if not clocks:
        return [part]
    if grid is None:  # each in the order of its records
        clocks += _grouped(
            {name: records.base(records.bit[name]) for name in rest}, records, settings
        )
        rest = []
    if rest:
        clocks.append(_Clock(base or whole(), rest, EVERY))
    for clock in clocks:
        if clock.bits != EVERY:
            clock.base = _base_of_group(clock, records, settings)
    return _written(part, clocks, records, scratch)


def _complete_sibling(name: str, own: Mapping[str, TimeBase], records: _Records) -> str | None:
    """Return the axis of the same sensor that has the numbers of this one, and the most others.

    ``own``: time bases of the channels with a clock of their own.
    """
    siblings = [
        other
        for other in records.bit
        if quantity_of(other) == quantity_of(name)
        and records.count(other) > (1.0 + _APART) * records.count(name)
        and records.common[name, other] >= _WITHIN * records.count(name)
        and (other not in own or own[other].rate > (1.0 + _APART) * own[name].rate)
    ]
    return max(siblings, key=records.count, default=None)


def _rate_changes(
    channels: list[str], grid: TimeBase, records: _Records, part: Part
) -> list[Finding]:
    """Return a finding for each channel that has a lower rate in a part of the log."""
    if not grid.stamped and part.stamped:  # stamps of arrival: losses cannot be located
        return []
    findings = []
    for name in channels:
        if records.count(name) < (1.0 - timebase.MIN_MISSING) * part.rows:
            points = records.points(grid, records.bit[name])
            findings += timebase.rate_changes(points, grid.rate, name)
    return findings


def _own_clock(
    name: str, channels: list[str], part: Part, records: _Records, grid: TimeBase | None
) -> TimeBase | None:
    """Return the time base of the records of a channel; None where they have none of their own.

    ``grid``: that of all records, if they lie on a grid.
    """
    number = records.count(name)
    bits = records.bit[name]
    try:
        if grid is not None and number < (1.0 - _APART) * part.rows:
            stride = records.stride(grid, bits)
            if stride > 1:
                return records.base(bits, known=stride / grid.rate)
        base = records.base(bits)
        if base.stamped:
            return base
        if grid is not None or number == part.rows:
            return None
        # Stamps of arrival: that a channel is in every second record, the numbers of these tell.
        if records.base(bits, numbered=True).stamped:
            return base
    except RecordingError:
        return None
    alone = any(
        records.common[name, other] <= _APART * min(number, records.count(other))
        for other in channels
    )
    return base if alone else None


def _grouped(
    own: dict[str, TimeBase], records: _Records, settings: QualitySettings
) -> list[_Clock]:
    """Group channels that have one rate and most of their records in common."""
    clocks: list[_Clock] = []
    for name in sorted(own, key=records.count, reverse=True):
        for clock in clocks:
            first = clock.channels[0]
            alike = abs(own[name].rate / clock.base.rate - 1.0) <= settings.rate_tolerance
            if alike and records.common[name, first] >= _SAME_CLOCK * records.count(name):
                clock.channels.append(name)
                clock.bits |= records.bit[name]
                break
        else:
            clocks.append(_Clock(own[name], [name], records.bit[name]))
    return clocks


def _base_of_group(clock: _Clock, records: _Records, settings: QualitySettings) -> TimeBase:
    """Return the time base of the records in which any channel of a clock has a number."""
    rate = clock.base.rate
    base = records.base(clock.bits)
    same = base.stamped and abs(base.rate / rate - 1.0) <= settings.rate_tolerance
    return base if same or not clock.base.stamped else records.base(clock.bits, known=1.0 / rate)


def _place(
    channels: list[str],
    own: dict[str, TimeBase],
    clocks: list[_Clock],
    records: _Records,
    leaders: Mapping[str, str | None],
) -> list[str]:
    """Add channels with samples lost to the clock they are read with; return the others.

    ``leaders``: axes of the same sensor whose clock a channel has.
    """
    rest = []
    for name in channels:
        if name in own:
            continue
        leader = leaders.get(name)
        within = [
            clock
            for clock in clocks
            if (
                leader in clock.channels
                if leader
                else records.common[name, clock.channels[0]] >= _WITHIN * records.count(name)
            )
        ]
        if within:
            clock = min(within, key=lambda clock: records.count(clock.channels[0]))
            clock.channels.append(name)
            clock.bits |= records.bit[name]
        else:
            rest.append(name)
    return rest


def _written(part: Part, clocks: list[_Clock], records: _Records, scratch: Path) -> list[Part]:
    """Write the records of each clock to a part of its own.

    What is beside the channels, such as the temperature, goes with each clock: a reading with the
    next record.
    """
    part.writer.finish({})
    beside = [name for name in part.columns if name in BESIDE]
    with ExitStack() as stack:
        made = []
        for number, clock in enumerate(clocks):
            names = [name for name in part.columns if name in clock.channels]
            stem = f"{part.data.stem}.{number}"
            made.append(stack.enter_context(new_part(part.source, names + beside, scratch, stem)))
        waiting = [dict.fromkeys(beside, math.nan) for _ in clocks]
        with checked_parquet(part.data) as file:
            for group, (times, present) in enumerate(
                zip(records.times(), part.present(), strict=True)
            ):
                table = checked_row_group(file, group)
                for clock, (of_clock, writer), readings in zip(clocks, made, waiting, strict=True):
                    chosen = has_one(present, clock.bits)
                    columns = {}
                    for name in of_clock.columns:
                        values = np.asarray(table.column(name).to_numpy(), dtype=np.float64)
                        if name in readings:
                            columns[name], readings[name] = _carry(values, chosen, readings[name])
                        else:
                            columns[name] = values[chosen]
                    writer.add(times[chosen], columns)
    part.data.unlink()
    parts = [of_clock for of_clock, _ in made]
    for clock, of_clock in zip(clocks, parts, strict=True):
        of_clock.stamped = part.stamped
        _describe(of_clock, clock, part)
    parts[0].left_out = {
        name: column
        for name, column in part.columns.items()
        if name not in BESIDE and not any(name in clock.channels for clock in clocks)
    }
    return parts


def _describe(of_clock: Part, clock: _Clock, part: Part) -> None:
    """Set the time base of a part, with its findings."""
    names = ", ".join(name for name in of_clock.columns if name in clock.channels)
    base = clock.base
    findings = [replace(found, channel=name) for name in clock.channels for found in base.findings]
    if of_clock.rows < part.rows:
        verb = "has a number" if len(clock.channels) == 1 else "have numbers"
        detail = (
            f"{names}: {verb} in {of_clock.rows} of {part.rows} records, and a clock of its own: "
            f"analysed at {base.rate:.6g} Hz"
        )
        findings.append(Finding("own_rate", "note", detail, base.rate))
    of_clock.base = replace(base, findings=tuple(findings))


def _carry(
    values: NDArray[np.float64], chosen: NDArray[np.bool_], waiting: float
) -> tuple[NDArray[np.float64], float]:
    """Return the readings for the chosen records: the latest since the chosen one before.

    ``waiting``: that since the last chosen record of the records before; it is returned, too, of
    these.
    """
    there = np.where(np.isfinite(values), np.arange(len(values)), -1)
    latest = np.maximum.accumulate(there)
    records = np.flatnonzero(chosen)
    at = latest[records]
    before = np.concatenate(([-1], records[:-1])) if len(records) else records
    carried = np.where(at > before, values[at], math.nan)
    if len(records) and at[0] < 0:
        carried[0] = waiting
    last = int(latest[-1]) if len(latest) else -1
    if len(records) and last <= records[-1]:
        return carried, math.nan
    return carried, float(values[last]) if last >= 0 else waiting
