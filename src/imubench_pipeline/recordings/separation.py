"""Columns of one table that have rates of their own, taken apart: each clock becomes a part.

Phones and programs that merge logs write a row for each stamp and leave the cell of a sensor empty
that has no new sample. A channel has a clock of its own where the records with a number lie on a
uniform grid that is slower than the grid of all records, or where all records together
lie on no grid. Numbers that are missing at random do not lie on a slower grid: such a channel
stays on the common one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
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
from imubench_pipeline.tables import checked_parquet, checked_row_group
from imubench_pipeline.tables.findings import Finding, RecordingError

_SAME_CLOCK = 0.5
"""Least share of common records, of the sparser channel, for two channels of one clock."""

_WITHIN = 0.95
"""Least share of the records of a channel that are also records of the channel it joins."""

_APART = 0.05
"""Share of the records of a channel below which it is not read together with another one."""

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

    def base(self, bits: int, *, numbered: bool = False) -> TimeBase:
        """Return the time base of the records that have a number in one of some columns.

        The stated rate belongs to all records: it decides only whether steps of one and two are
        samples lost.

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
        base = timebase.from_stamps(stamps, None, settings)
        if self._stated and any(found.finding == "coarse_stamps" for found in base.findings):
            lossy = timebase.from_stamps(stamps, self._stated, settings)
            if abs(lossy.rate / self._stated - 1.0) <= settings.rate_tolerance:
                base = lossy
        by_number = numbered or not self._part.stamped
        return replace(base, source="stated", rate_error=None) if by_number else base


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
    on_grid = base is not None and (base.uniform or base.stamped)
    limit = (1.0 - settings.rate_tolerance) * (base.rate if base is not None else math.inf)
    own = {}
    for name in channels:
        found = _own_clock(name, channels, part, records, on_grid=on_grid)
        if found is not None:
            own[name] = found
    if on_grid and all(found.rate >= limit for found in own.values()):
        return [part]
    clocks = _grouped(own, records, settings)
    rest = _place(channels, own, clocks, records)
    if not clocks:
        return [part]
    if rest:
        clocks.append(_Clock(base or whole(), rest, EVERY))
    for clock in clocks:
        if clock.bits != EVERY:
            clock.base = records.base(clock.bits)
    return _written(part, clocks, records, scratch)


def _own_clock(
    name: str, channels: list[str], part: Part, records: _Records, *, on_grid: bool
) -> TimeBase | None:
    """Return the time base of the records of a channel; None where they have none of their own.

    ``on_grid``: all records together lie on a grid.
    """
    number = records.count(name)
    try:
        base = records.base(records.bit[name])
        if base.stamped:
            return base
        if on_grid or number == part.rows:
            return None
        # Stamps of arrival: that a channel is in every second record, the numbers of these tell.
        if records.base(records.bit[name], numbered=True).stamped:
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


def _place(
    channels: list[str], own: dict[str, TimeBase], clocks: list[_Clock], records: _Records
) -> list[str]:
    """Add channels with samples lost to the clock they are read with; return the others."""
    rest = []
    for name in channels:
        if name in own:
            continue
        within = [
            clock
            for clock in clocks
            if records.common[name, clock.channels[0]] >= _WITHIN * records.count(name)
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
