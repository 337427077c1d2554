"""Put time stamps on a uniform grid, block by block."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.typing import Array

Stamps = Callable[[], Iterator[Array]]  # iterates over the stamps of a file, s, by block
_MAX_GRID_DISTANCE = 0.48  # of a stamp, in intervals; it is ambiguous beyond
_TRACKING_GAIN = 0.02
"""Gain of the loop that makes the grid follow the stamps. The gain for its interval is a quarter of
the square (critical damping)."""

_MIN_DOUBLE_STEP, _MAX_DOUBLE_STEP = 1.75, 2.2  # range of a double step, over the median step
MIN_SHARED_STAMPS = 0.2  # share of repeated stamps if they are of groups of samples
_MAX_ROUNDED_REPEATS = 1.05 * MIN_SHARED_STAMPS  # share that may be due to rounding
_MIN_ROUNDED_REPEATS = 0.02
"""Least share of repeated stamps that is tested: below it, rounding or copies change N by 1 %
only."""

_MEDIAN_LEVEL = 0.45  # below 0.5: the short step is chosen if both are as frequent
MIN_SET_BACK = 0.45
"""Least step back, s, of a clock that was set back, as by a leap second. Shorter steps back are
from records that were written twice or out of order."""

_RECORDS_ON_EACH_SIDE = 16  # to tell a clock that was set back from a late stamp
_MAX_EXAMINED_STAMPS = 1 << 17  # stamps of a block that are used for its typical interval


@dataclass(frozen=True)
class Interval:
    """First estimate of the interval between samples."""

    mean: float  # mean of the intervals without missing samples, s
    other: float | None = None
    """Mean, s, if double steps at regular distances are lost samples, or if repeated stamps at
    regular distances are records written twice; None if there are none. Rounded stamps cause the
    same pattern, and ``mean`` assumes rounding."""


def estimate_interval(stamps: Stamps) -> Interval | None:
    """Return the interval between samples; None if the stamps do not advance."""
    medians, rounded, repeated = [], [], []
    for block in stamps():
        steps = _take_forward_steps(block)
        if len(steps):
            medians.append(float(np.quantile(steps, _MEDIAN_LEVEL, method="lower")))
            long = steps > _MIN_DOUBLE_STEP * medians[-1]
            long &= steps < _MAX_DOUBLE_STEP * medians[-1]
            rounded.append(_are_regular(long))
            zero = np.diff(block[:_MAX_EXAMINED_STAMPS]) == 0.0
            few = _MIN_ROUNDED_REPEATS <= np.mean(zero) <= _MAX_ROUNDED_REPEATS
            repeated.append(few and _are_regular(zero))
    if not medians:
        return None
    median = float(np.median(medians))
    # Double steps are missing samples, and are left out.
    total, count = _sum_steps_up_to(stamps, _MIN_DOUBLE_STEP * median)
    single = total / count
    if np.mean(repeated) > 0.5:
        count += sum(int(np.count_nonzero(np.diff(block) == 0.0)) for block in stamps())
        return Interval(total / count, single)
    if np.mean(rounded) <= 0.5:
        return Interval(single)
    total, count = _sum_steps_up_to(stamps, _MAX_DOUBLE_STEP * median)
    return Interval(total / count, single)


def _sum_steps_up_to(stamps: Stamps, limit: float) -> tuple[float, int]:
    total, count = 0.0, 0
    for block in stamps():
        steps = _take_forward_steps(block)
        steps = steps[steps <= limit]
        total += float(steps.sum())
        count += len(steps)
    return total, count


def _take_forward_steps(block: Array) -> Array:
    """Return the positive steps of the first stamps of a block, or else of the whole block."""
    for part in (block[:_MAX_EXAMINED_STAMPS], block):
        steps = np.diff(part)
        steps = steps[steps > 0]
        if len(steps):
            break
    return steps


def _are_regular(chosen: NDArray[np.bool_]) -> bool:
    """Return whether chosen steps have regular distances in the whole block, unlike losses."""
    places = np.flatnonzero(chosen)
    if len(places) < 10:
        return False
    distances = np.diff(places)
    median = np.median(distances)
    throughout = abs(len(chosen) / len(places) - median) <= 0.55 + 0.05 * median
    return bool(throughout and np.mean(np.abs(distances - median) <= 1) > 0.9)


_RECORDS_PER_MARK = 1 << 10  # records from one mark to the next


@dataclass
class Track:
    """Follows stamps along a grid and counts holes, repeats, jumps and missing stamps."""

    interval: float  # initial interval of the grid, s
    longest_hole: float  # longest hole within a segment, s; a longer step begins a new segment
    rows: int = 0
    grid: int = 0  # number of records, and of grid points up to the last record
    off_grid: int = 0
    duplicates: int = 0
    unstamped: int = 0  # records with a missing or wrong stamp, placed on the next grid point
    holes: int = 0
    longest: int = 0
    longest_at: int = 0  # number of holes; length of the longest, first point of it
    elapsed: float = 0.0
    steps: int = 0  # time, s, and grid points between stamped records of a segment
    starts: list[int] = field(default_factory=list)  # first grid point of each segment
    jumps: list[float] = field(default_factory=list)  # at the start of a segment, s; first: NaN
    marks: list[tuple[int, float]] = field(default_factory=list)  # of every 1024th record
    _state: Array = field(default_factory=lambda: np.array([np.nan, np.nan, np.nan, np.nan, 0.0]))

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
        """Mean interval of the grid, s; None if no segment has two stamps."""
        return self.elapsed / self.steps if self.steps else None

    def follow(self, block: Array) -> NDArray[np.int64]:
        """Return the grid point of each record of a block; -1 for a repeated stamp."""
        points = np.empty(len(block), dtype=np.int64)
        breaks = np.empty(len(block), dtype=np.int64)
        jumps = np.empty(len(block))
        counts = np.zeros(8, dtype=np.int64)
        if np.isnan(self._state[2]):
            self._state[2] = self.interval
        self.elapsed += _assign_grid_points(
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
        for start in range(0, len(block), _RECORDS_PER_MARK):
            if points[start] >= 0 and np.isfinite(block[start]):
                self.marks.append((int(points[start]), float(block[start])))
        self.rows += len(block)
        self.grid = max(self.grid, int(points.max(initial=-1)) + 1)
        return points


def track_stamps(stamps: Stamps, interval: float, longest_hole: float) -> Track:
    """Return the grid and its irregularities from all stamps of a file; arguments as in `Track`."""
    track = Track(interval, longest_hole)
    for block in stamps():
        track.follow(block)
    return track


@njit(cache=True, nogil=True)
def is_set_back(stamps: Array, i: int, step: float, interval: float) -> bool:
    """Return whether the clock was set back before record ``i``.

    In that case the stamps on both sides, s, increase, but their median decreases. Scattered stamps
    and late records do not behave so. ``step``: from the previous stamp to this one, s.
    """
    if not step < -max(MIN_SET_BACK, 1.5 * interval):
        return False
    count = min(_RECORDS_ON_EACH_SIDE, i, stamps.size - i)
    if count < 1:
        return False
    for k in range(i - count + 1, i + count):
        if k != i and stamps[k] < stamps[k - 1]:
            return False
    advance = _compute_median(stamps, i, i + count) - _compute_median(stamps, i - count, i)
    return bool(advance < count * interval + 0.5 * step)


@njit(cache=True, nogil=True)
def _compute_median(stamps: Array, first: int, stop: int) -> float:
    """Return the median of few stamps, s, or NaN; compiles ten times as fast as `np.nanmedian`."""
    present, number = np.empty(stop - first), 0
    for k in range(first, stop):
        if not np.isnan(stamps[k]):
            place = number
            while place > 0 and present[place - 1] > stamps[k]:
                present[place] = present[place - 1]
                place -= 1
            present[place] = stamps[k]
            number += 1
    if number == 0:
        return np.nan
    return 0.5 * (present[(number - 1) // 2] + present[number // 2])


@njit(cache=True, nogil=True)
def _assign_grid_points(
    block: Array,
    longest_hole: float,
    grid: int,
    state: Array,
    points: NDArray[np.int64],
    breaks: NDArray[np.int64],
    jumps: Array,
    counts: NDArray[np.int64],
) -> float:
    """Assign a grid point to each stamp; return the time between stamps within segments, s.

    ``state``: time of the last point, last stamp, interval, last stamped point, sum of squares.
    """
    origin, last, interval, stamped = state[0], state[1], state[2], state[3]
    point = grid - 1
    elapsed = 0.0
    late = after_hole = False
    for i in range(block.size):
        stamp = block[i]
        # A single wrong stamp, after which the next one continues the series, is no jump.
        wrong = (
            i + 1 < block.size
            and abs(stamp - last) > 10.0 * interval
            and abs(block[i + 1] - last - 2.0 * interval) < interval
        )
        if np.isnan(stamp) or wrong:
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
            # A series of records that was written twice advances at the normal interval.
            twice = whole < 1 and i > 0 and abs(stamp - block[i - 1] - interval) < 0.1 * interval
            off_grid = abs(error) > _MAX_GRID_DISTANCE * interval or whole < 1
            if step != 0.0 and not twice and off_grid:
                counts[1] += 1
            if whole == 0 and ((step > 0.0 and late) or (step == 0.0 and after_hole)):
                # The previous sample was late by half an interval, or its stamp was rounded up to
                # this one: it fills the hole before it.
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
                # This sample was early, or its stamp was rounded down: the next step has a hole
                # for it.
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
            origin += whole * interval + _TRACKING_GAIN * error
            interval += _TRACKING_GAIN**2 / 4.0 * error
            elapsed += step
            state[4] += error * error
            counts[6] += point - int(stamped)
        last = stamp
        stamped = point
        points[i] = point
    state[0], state[1], state[2], state[3] = origin, last, interval, stamped
    return elapsed
