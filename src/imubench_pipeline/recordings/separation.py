"""Separate the columns of one table by their sampling rates: each clock becomes a part.

Merged logs have empty cells for sensors without a new sample. A channel has a clock of its own if
its numbers lie on a slower uniform grid than all records, or if all records together lie on no
grid. An axis with fewer numbers than another axis of its sensor has missing samples.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.recordings import timebase
from imubench_pipeline.recordings.parts import STAMP_BLOCK, Part, open_part
from imubench_pipeline.recordings.recording import BESIDE
from imubench_pipeline.recordings.timebase import TimeBase
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.settings.sensor import quantity_of
from imubench_pipeline.tables.findings import RecordingError, find
from imubench_pipeline.tables.parquet import open_parquet, read_row_group
from imubench_pipeline.typing import Array
from imubench_pipeline.words.findings.time_base import OwnRate

_MIN_COMMON_RECORDS = 0.5  # of the sparser channel, for two channels of one clock
_MIN_CONTAINED_RECORDS = 0.95  # of a channel in the channel it joins
_MAX_COMMON_IF_SEPARATE = 0.05
"""Largest share of common records of two channels that are not sampled together; also the least
relative difference of two numbers of records, or rates, that counts."""

_MAX_STRIDE, _MIN_ON_STRIDE = 50, 0.98  # records; share of samples on a slower clock
ALL_RECORDS = -1  # used instead of a bit mask of columns: all records, also those without a number


@dataclass
class _Clock:
    """Channels with samples in the same records."""

    base: TimeBase
    channels: list[str]
    bits: int  # bit mask of the channels in `Part.present`


class _Records:
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
        return self.common[channel, channel]

    def times(self, *, numbered: bool = False) -> Iterator[Array]:
        """Yield the stamps of all records, s; without them, or if ``numbered``, the indices."""
        part = self._part
        if part.stamped and not numbered:
            yield from part.stamps()
            return
        for start in range(0, part.rows, STAMP_BLOCK):
            yield np.arange(start, min(start + STAMP_BLOCK, part.rows)) / (self._stated or 1.0)

    def base(self, bits: int, *, numbered: bool = False, known: float | None = None) -> TimeBase:
        """Return the time base of the records with a number in any of the columns of a bit mask.

        The stated rate only decides whether double steps are lost samples. ``known``: the interval,
        s. Raises RecordingError if their stamps do not advance, or jump too often.
        """

        def stamps() -> Iterator[Array]:
            times = self.times(numbered=numbered)
            for block, present in zip(times, self._part.present(), strict=True):
                yield block[has_one(present, bits)]

        settings = self._settings
        base = timebase.fit_time_base(stamps, None, settings, known=known)
        if self._stated and any(found.finding == "coarse_stamps" for found in base.findings):
            lossy = timebase.fit_time_base(stamps, self._stated, settings)
            if abs(lossy.rate / self._stated - 1.0) <= settings.rate_tolerance:
                base = lossy
        by_number = numbered or not self._part.stamped
        return replace(base, source="stated", rate_error=None) if by_number else base

    def points(self, base: TimeBase, bits: int) -> Iterator[NDArray[np.int64]]:
        """Yield the grid points of the records with a number, in the time base of all records."""
        places = timebase.locate_samples(base, self.times, self._settings)
        for points, present in zip(places, self._part.present(), strict=True):
            chosen = points[has_one(present, bits)]
            yield chosen[chosen >= 0]

    def stride(self, base: TimeBase, bits: int) -> int:
        """Return the sampling interval of a channel, in records, with any samples missing."""
        hits = np.zeros(_MAX_STRIDE + 1)
        total = 0
        for points in self.points(base, bits):
            total += len(points)
            for stride in range(2, _MAX_STRIDE + 1):
                hits[stride] += np.bincount(points % stride).max(initial=0)
        strides = np.flatnonzero(hits >= _MIN_ON_STRIDE * max(total, 1))
        return int(strides.max(initial=1))


def has_one(present: NDArray[np.uint16], bits: int) -> NDArray[np.bool_]:
    """Return a mask of the records with a number in any of these columns, or of `ALL_RECORDS`."""
    if bits == ALL_RECORDS:
        return np.ones(len(present), np.bool_)
    return present & np.uint16(bits) != 0


def separate_clocks(
    part: Part,
    stated: float | None,
    whole: Callable[[], TimeBase],
    settings: QualitySettings,
    scratch: Path,
) -> list[Part]:
    """Return one part for each clock of a file, or the part itself if there is only one clock.

    ``stated``: stated rate of the records, Hz. ``whole``: returns the time base of all records.
    Raises RecordingError if neither channels nor all records together have a clock.
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
    found = {name: _find_own_clock(name, channels, part, records, grid) for name in channels}
    own = {name: clock for name, clock in found.items() if clock is not None}
    leaders = {name: _find_complete_sibling(name, own, records) for name in own}
    own = {name: clock for name, clock in own.items() if leaders[name] is None}
    if grid is not None and all(clock.rate >= limit for clock in own.values()):
        # By stamps of arrival, losses cannot be located.
        for name in channels if grid.stamped or not part.stamped else ():
            if records.count(name) < (1.0 - timebase.MIN_MISSING) * part.rows:
                points = records.points(grid, records.bit[name])
                part.findings += timebase.find_rate_changes(points, grid.rate, name)
        return [part]
    clocks = _group_by_clock(own, records, settings)
    rest = _assign_to_clocks(channels, own, clocks, records, leaders)
    if not clocks:
        return [part]
    if grid is None:  # each channel by its own records
        clocks += _group_by_clock(
            {name: records.base(records.bit[name]) for name in rest}, records, settings
        )
        rest = []
    if rest:
        clocks.append(_Clock(base or whole(), rest, ALL_RECORDS))
    for group in clocks:
        if group.bits != ALL_RECORDS:
            rate, joint = group.base.rate, records.base(group.bits)
            same = joint.stamped and abs(joint.rate / rate - 1.0) <= settings.rate_tolerance
            if not same and group.base.stamped:
                joint = records.base(group.bits, known=1.0 / rate)
            group.base = joint
    return _write_parts(part, clocks, records, scratch)


def _find_complete_sibling(name: str, own: Mapping[str, TimeBase], records: _Records) -> str | None:
    """Return the most complete axis of the same sensor with the records of this one, or None."""
    siblings = [
        other
        for other in records.bit
        if quantity_of(other) == quantity_of(name)
        and records.count(other) > (1.0 + _MAX_COMMON_IF_SEPARATE) * records.count(name)
        and records.common[name, other] >= _MIN_CONTAINED_RECORDS * records.count(name)
        and (other not in own or own[other].rate > (1.0 + _MAX_COMMON_IF_SEPARATE) * own[name].rate)
    ]
    return max(siblings, key=records.count, default=None)


def _find_own_clock(
    name: str, channels: list[str], part: Part, records: _Records, grid: TimeBase | None
) -> TimeBase | None:
    """Return the time base of the records of a channel; None if it has no clock of its own."""
    number = records.count(name)
    bits = records.bit[name]
    try:
        if grid is not None and number < (1.0 - _MAX_COMMON_IF_SEPARATE) * part.rows:
            stride = records.stride(grid, bits)
            if stride > 1:
                return records.base(bits, known=stride / grid.rate)
        base = records.base(bits)
        if base.stamped:
            return base
        if grid is not None or number == part.rows:
            return None
        # Stamps of arrival: the indices of the records show a channel in every second record.
        if records.base(bits, numbered=True).stamped:
            return base
    except RecordingError:
        return None
    alone = any(
        records.common[name, other] <= _MAX_COMMON_IF_SEPARATE * min(number, records.count(other))
        for other in channels
    )
    return base if alone else None


def _group_by_clock(
    own: dict[str, TimeBase], records: _Records, settings: QualitySettings
) -> list[_Clock]:
    clocks: list[_Clock] = []
    for name in sorted(own, key=records.count, reverse=True):
        for clock in clocks:
            first = clock.channels[0]
            alike = abs(own[name].rate / clock.base.rate - 1.0) <= settings.rate_tolerance
            if alike and records.common[name, first] >= _MIN_COMMON_RECORDS * records.count(name):
                clock.channels.append(name)
                clock.bits |= records.bit[name]
                break
        else:
            clocks.append(_Clock(own[name], [name], records.bit[name]))
    return clocks


def _assign_to_clocks(
    channels: list[str],
    own: dict[str, TimeBase],
    clocks: list[_Clock],
    records: _Records,
    leaders: Mapping[str, str | None],
) -> list[str]:
    """Add channels with missing samples to the clock of their records; return the others."""
    rest = []
    for name in channels:
        if name in own:
            continue
        leader = leaders.get(name)
        least = _MIN_CONTAINED_RECORDS * records.count(name)
        if leader:
            within = [clock for clock in clocks if leader in clock.channels]
        else:
            within = [c for c in clocks if records.common[name, c.channels[0]] >= least]
        if within:
            clock = min(within, key=lambda clock: records.count(clock.channels[0]))
            clock.channels.append(name)
            clock.bits |= records.bit[name]
        else:
            rest.append(name)
    return rest


def _write_parts(part: Part, clocks: list[_Clock], records: _Records, scratch: Path) -> list[Part]:
    """Write the records of each clock; other readings go into the next record of each."""
    part.writer.finish({})
    beside = [name for name in part.columns if name in BESIDE]
    with ExitStack() as stack:
        made = []
        for number, clock in enumerate(clocks):
            names = [name for name in part.columns if name in clock.channels]
            stem = f"{part.data.stem}.{number}"
            made.append(stack.enter_context(open_part(part.source, names + beside, scratch, stem)))
        waiting = [dict.fromkeys(beside, math.nan) for _ in clocks]
        with open_parquet(part.data) as file:
            blocks = zip(records.times(), part.present(), strict=True)
            for group, (times, present) in enumerate(blocks):
                table = read_row_group(file, group)
                for clock, (of_clock, write), readings in zip(clocks, made, waiting, strict=True):
                    chosen = has_one(present, clock.bits)
                    columns = {}
                    for name in of_clock.columns:
                        values = np.asarray(table.column(name).to_numpy(), dtype=np.float64)
                        if name in readings:
                            columns[name], readings[name] = _carry(values, chosen, readings[name])
                        else:
                            columns[name] = values[chosen]
                    write(times[chosen], columns)
    part.data.unlink()
    parts = [of_clock for of_clock, _ in made]
    for clock, of_clock in zip(clocks, parts, strict=True):
        of_clock.stamped = part.stamped
        base = clock.base
        findings = [
            replace(each, channel=name) for name in clock.channels for each in base.findings
        ]
        if of_clock.rows < part.rows:
            own = tuple(name for name in of_clock.columns if name in clock.channels)
            data = OwnRate(own, of_clock.rows, part.rows, base.rate)
            findings.append(find(data, "note", base.rate))
        of_clock.base = replace(base, findings=tuple(findings))
    parts[0].left_out = {
        name: column
        for name, column in part.columns.items()
        if name not in BESIDE and not any(name in clock.channels for clock in clocks)
    }
    return parts


def _carry(values: Array, chosen: NDArray[np.bool_], waiting: float) -> tuple[Array, float]:
    """Return for each chosen record the latest reading since the one before, and the one left."""
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
