"""Time stamps put on a uniform grid, block by block."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

Stamps = Callable[[], Iterator[NDArray[np.float64]]]
"""Gives the stamps of a file in s, block by block, afresh at each call; NaN where missing."""

_OFF_GRID = 0.48
"""Part of a sampling interval beyond which a stamp does not say which grid point it means."""

_TRACKING = 0.02
"""Gain with which the grid follows the stamps; its interval, with a quarter of
the square."""

_LONG, _TWO = 1.75, 2.2
"""Steps, over their median, that are more than one, and no more than two."""

SHARED = 0.2
"""Share of the records that repeat a stamp above which each stamp belongs to a group of samples."""

_MAX_ROUNDED = 1.05 * SHARED
"""Share of repeated stamps up to which they are tested for being rounded."""

_NEGLIGIBLE = 0.02
"""Share of repeated stamps below which it makes 1 % of N whether they are rounded or copies."""

_MIDDLE = 0.45
"""Level of the quantile that stands for the median: of as many short and long steps the short."""

SET_BACK = 0.45
"""s; a step back that may be a clock that was set back, as by a leap second. Shorter ones are
records that were written twice, or in another order."""

_AROUND = 16
"""Records on each side of a step that tell whether the clock was set back, or one stamp is late."""

_ENOUGH = 1 << 17
"""Stamps of a block that tell its typical interval; all are then followed."""


@dataclass(frozen=True)
class Interval:
    """The interval between samples that stamps show at first sight."""

    mean: float
    """Mean of the intervals between which no sample is missing, s."""
    other: float | None = None
    """The mean, s, if double steps at regular distances are lost samples, or repeated stamps at
    regular distances are records written twice; None where there are none. Rounded stamps look the
    same, and are assumed."""

    @property
    def has_repeats(self) -> bool:
        """Whether stamps repeat at regular distances: the rate exceeds their resolution."""
        return self.other is not None and self.other > self.mean


def typical_interval(stamps: Stamps) -> Interval | None:
    """Return the interval between samples; None where the stamps do not advance."""
    medians, rounded, repeated = [], [], []
    for block in stamps():
        steps = _advances(block)
        if len(steps):
            medians.append(float(np.quantile(steps, _MIDDLE, method="lower")))
            long = (steps > _LONG * medians[-1]) & (steps < _TWO * medians[-1])
            rounded.append(_are_regular(long))
            zero = np.diff(block[:_ENOUGH]) == 0.0
            repeated.append(_NEGLIGIBLE <= np.mean(zero) <= _MAX_ROUNDED and _are_regular(zero))
    if not medians:
        return None
    median = float(np.median(medians))
    # Two steps for one are a missing sample.
    total, count = _steps_up_to(stamps, _LONG * median)
    single = total / count
    if np.mean(repeated) > 0.5:
        count += sum(int(np.count_nonzero(np.diff(block) == 0.0)) for block in stamps())
        return Interval(total / count, single)
    if np.mean(rounded) <= 0.5:
        return Interval(single)
    total, count = _steps_up_to(stamps, _TWO * median)
    return Interval(total / count, single)


def _steps_up_to(stamps: Stamps, limit: float) -> tuple[float, int]:
    """Return the sum of the steps up to a limit, s, and their number."""
    total, count = 0.0, 0
    for block in stamps():
        steps = _advances(block)
        steps = steps[steps <= limit]
        total += float(steps.sum())
        count += len(steps)
    return total, count


def _advances(block: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the steps forward in a block, from its first stamps if they have any."""
    for part in (block[:_ENOUGH], block):
        steps = np.diff(part)
        steps = steps[steps > 0]
        if len(steps):
            break
    return steps


def _are_regular(chosen: NDArray[np.bool_]) -> bool:
    """Return whether some steps come at regular distances in the whole block.

    Rounded stamps have them at two neighbouring distances. Losses have them at any distance, a
    lower rate in a part of the block at one distance but in that part alone.
    """
    places = np.flatnonzero(chosen)
    if len(places) < 10:
        return False
    distances = np.diff(places)
    median = np.median(distances)
    throughout = abs(len(chosen) / len(places) - median) <= 0.55 + 0.05 * median
    return bool(throughout and np.mean(np.abs(distances - median) <= 1) > 0.9)


_MARK = 1 << 10
"""Records between two marks."""


@dataclass
class Track:
    """Follows stamps along a grid, and counts what it meets."""

    interval: float
    """Of the grid at its beginning, s."""
    longest_hole: float
    """A longer step forward begins a segment, s."""
    rows: int = 0
    grid: int = 0
    """Records, and points of the grid up to the last one."""
    off_grid: int = 0
    duplicates: int = 0
    unstamped: int = 0
    """Records whose stamp lies between two points, repeats a point, or is missing."""
    holes: int = 0
    longest: int = 0
    longest_at: int = 0
    """Number of holes, the points of the longest, and the first of them."""
    elapsed: float = 0.0
    steps: int = 0
    """s, and grid points, between stamped records of the same segment."""
    starts: list[int] = field(default_factory=list)
    """First grid point of each segment."""
    jumps: list[float] = field(default_factory=list)
    """Step of the stamps at each of them, s; NaN at the first."""
    marks: list[tuple[int, float]] = field(default_factory=list)
    """Grid point and stamp of a record now and then, to see the rate drift."""
    _state: NDArray[np.float64] = field(
        default_factory=lambda: np.array([np.nan, np.nan, np.nan, np.nan, 0.0])
    )

    @property
    def scatter(self) -> float:
        """Sum of the squared distances of stamps from the grid, s²."""
        return float(self._state[4])

    @property
    def segments(self) -> tuple[tuple[int, int], ...]:
        """First and one-past-last grid point of each segment."""
        return tuple(zip(self.starts, [*self.starts[1:], self.grid], strict=True))

    @property
    def mean_interval(self) -> float | None:
        """Mean interval of the grid, s; None where no two stamps are in one segment."""
        return self.elapsed / self.steps if self.steps else None

    def follow(self, block: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the grid point of each record of a block; -1 for a repeated one."""
        points = np.empty(len(block), dtype=np.int64)
        breaks = np.empty(len(block), dtype=np.int64)
        jumps = np.empty(len(block))
        counts = np.zeros(8, dtype=np.int64)
        if np.isnan(self._state[2]):
            self._state[2] = self.interval
        self.elapsed += _follow(
            block, self.longest_hole, self.grid, self._state, points, breaks, jumps, counts
        )
        self.starts += breaks[: counts[0]].tolist()
        self.jumps += jumps[: counts[0]].tolist()
        self.off_grid += int(counts[1])
        self.duplicates += int(counts[2])
        self.holes += int(counts[3])
        if counts[4] > self.longest:
            self.longest, self.longest_at = int(counts[4]), int(counts[7])
        self.unstamped += int(counts[5])
        self.steps += int(counts[6])
        for start in range(0, len(block), _MARK):
            if points[start] >= 0 and np.isfinite(block[start]):
                self.marks.append((int(points[start]), float(block[start])))
        self.rows += len(block)
        self.grid = max(self.grid, int(points.max(initial=-1)) + 1)
        return points


def tracked(stamps: Stamps, interval: float, longest_hole: float) -> Track:
    """Return the track of all stamps of a file."""
    track = Track(interval, longest_hole)
    for block in stamps():
        track.follow(block)
    return track


@njit(cache=True, nogil=True)
def is_set_back(stamps: NDArray[np.float64], i: int, step: float, interval: float) -> bool:
    """Return whether the clock was set back before a record.

    The stamps on both sides increase, but their median decreases. Scattered stamps and late
    records do not behave so.

    Parameters
    ----------
    stamps : ndarray
        s, shape (n,); NaN where missing.
    i : int
        Place of the record.
    step : float
        From the previous stamp to this one, s.
    interval : float
        Between samples, s.
    """
    if not step < -max(SET_BACK, 1.5 * interval):
        return False
    count = min(_AROUND, i, stamps.size - i)
    if count < 1:
        return False
    for k in range(i - count + 1, i + count):
        if k != i and stamps[k] < stamps[k - 1]:
            return False
    advance = np.nanmedian(stamps[i : i + count]) - np.nanmedian(stamps[i - count : i])
    return bool(advance < count * interval + 0.5 * step)


@njit(cache=True, nogil=True)
def _follow(
    block: NDArray[np.float64],
    longest_hole: float,
    grid: int,
    state: NDArray[np.float64],
    points: NDArray[np.int64],
    breaks: NDArray[np.int64],
    jumps: NDArray[np.float64],
    counts: NDArray[np.int64],
) -> float:
    """Give each stamp its grid point; return the seconds between stamps.

    ``state``: time of the last grid point, last stamp, interval, last stamped grid point, sum of
    the squared distances from the grid.
    """
    origin, last, interval, stamped = state[0], state[1], state[2], state[3]
    point = grid - 1
    elapsed = 0.0
    late = after_hole = False
    for i in range(block.size):
        stamp = block[i]
        # One stamp far from where the next ones go on is no jump of the clock.
        astray = (
            i + 1 < block.size
            and abs(stamp - last) > 10.0 * interval
            and abs(block[i + 1] - last - 2.0 * interval) < interval
        )
        if np.isnan(stamp) or astray:
            counts[5] += 1
            late = after_hole = False
            point += 1
            origin += interval
            points[i] = point
            continue
        step = stamp - last
        if (
            np.isnan(last)
            or step < -max(1.0, 10.0 * interval)
            or step > longest_hole
            or is_set_back(block, i, step, interval)
        ):
            point += 1
            breaks[counts[0]] = point
            jumps[counts[0]] = step
            counts[0] += 1
            origin = stamp
            late = after_hole = False
        else:
            whole = int(np.round((stamp - origin) / interval))
            error = stamp - origin - whole * interval
            # Records that were written twice advance as all others do.
            twice = whole < 1 and i > 0 and abs(stamp - block[i - 1] - interval) < 0.1 * interval
            if step != 0.0 and not twice and (abs(error) > _OFF_GRID * interval or whole < 1):
                counts[1] += 1
            if whole == 0 and ((step > 0.0 and late) or (step == 0.0 and after_hole)):
                # The sample before came late by half an interval, or its stamp is rounded up to
                # this one's: it belongs into the hole.
                points[i - 1] -= 1
                points[i] = point
                counts[3] -= 1
                late = after_hole = False
                elapsed += step
                last = stamp
                continue
            if (
                whole == 0
                and step >= 0.0
                and i + 1 < block.size
                and np.round((block[i + 1] - origin) / interval) == 2
            ):
                # This one came early, or its stamp is rounded down: the next leaves a hole for it.
                whole = 1
                error = stamp - origin - interval
            if whole < 1:
                late = after_hole = False
                counts[2] += 1
                points[i] = -1
                continue
            after_hole = whole == 2 and i > 0
            late = after_hole and error < 0.0
            if whole > 1:
                counts[3] += 1
                if whole - 1 > counts[4]:
                    counts[4], counts[7] = whole - 1, point + 1
            point += whole
            origin += whole * interval + _TRACKING * error
            interval += _TRACKING**2 / 4.0 * error
            elapsed += step
            state[4] += error * error
            counts[6] += point - int(stamped)
        last = stamp
        stamped = point
        points[i] = point
    state[0], state[1], state[2], state[3] = origin, last, interval, stamped
    return elapsed
