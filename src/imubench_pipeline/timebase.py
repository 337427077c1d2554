"""The time base of a recording: its rate, its missing samples and its segments.

Samples are put on a uniform grid. Stamps that lie on a grid give every sample its position,
and the positions without a sample are holes. Stamps that scatter by more than half a sampling
interval (stamped at arrival in a host, for instance) say only how long the recording was: then
the samples are taken as consecutive, and that is a finding.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray

from imubench_pipeline.config import QualitySettings
from imubench_pipeline.findings import Finding
from imubench_pipeline.readers.batch import RecordingError

Stamps = Callable[[], Iterator[NDArray[np.float64]]]
"""Gives the stamps of a file in s, block by block, afresh at each call."""

_OFF_GRID = 0.4
"""Part of a sampling interval beyond which a stamp does not say which grid point it means."""

_TRACKING = 0.01
"""Gain with which the grid follows a slow drift of the sampling rate against the stamps."""


@dataclass(frozen=True)
class TimeBase:
    """The uniform grid that the samples of a file lie on.

    Attributes
    ----------
    rate : float
        Hz.
    source : str
        Where the rate is from: ``stated`` or ``stamps``.
    rows : int
        Records in the file.
    grid : int
        Grid points from the first to the last sample, all segments together.
    segments : tuple of (int, int)
        First and one-past-last grid point of each; no difference may span two segments.
    uniform : bool
        The samples are the grid points: stamps need not be kept.
    stamped : bool
        The stamps say which grid point each sample is.
    findings : tuple of Finding
    """

    rate: float
    source: str
    rows: int
    grid: int
    segments: tuple[tuple[int, int], ...]
    uniform: bool
    stamped: bool
    findings: tuple[Finding, ...] = ()

    @property
    def missing(self) -> int:
        """Grid points without a sample."""
        return self.grid - self.rows


def without_stamps(rows: int, rate: float) -> TimeBase:
    """Return the time base of a file that has no stamps: the rate is the one stated."""
    return TimeBase(rate, "stated", rows, rows, ((0, rows),), uniform=True, stamped=False)


def from_stamps(stamps: Stamps, stated: float | None, settings: QualitySettings) -> TimeBase:
    """Find the time base of stamps.

    Parameters
    ----------
    stamps : callable
        Gives the stamps in s, in blocks; called several times.
    stated : float or None
        The rate that the sensor file states, Hz.
    settings : QualitySettings

    Raises
    ------
    RecordingError
        If the stamps do not advance.
    """
    interval = _typical_interval(stamps)
    tracks = [_Track(interval, settings.longest_hole)]
    for block in stamps():
        tracks[0].follow(block)
    found = tracks[0]
    # Many holes that are together longer than the log are pauses of the host, not losses.
    bursts = found.grid > 2 * found.rows and found.holes > 0.05 * found.rows
    if found.off_grid > settings.jitter * found.rows or bursts:
        return _arrival_order(stamps, found, stated, settings)
    # The mean over the whole recording is far better known than the typical interval.
    exact = found.elapsed / found.steps if found.steps else interval
    findings = _grid_findings(found, exact)
    rate = 1.0 / exact
    findings += _rate_findings(rate, stated, settings)
    uniform = found.grid == found.rows and len(found.starts) == 1 and not found.duplicates
    return TimeBase(
        rate, "stamps", found.rows, found.grid, found.segments, uniform, True, tuple(findings)
    )


def positions(
    base: TimeBase, stamps: Stamps, settings: QualitySettings
) -> Iterator[NDArray[np.int64]]:
    """Yield the grid point of each record, block by block; -1 for a repeated stamp."""
    if not base.stamped:
        start = 0
        for block in stamps():
            yield np.arange(start, start + len(block), dtype=np.int64)
            start += len(block)
        return
    track = _Track(_typical_interval(stamps), settings.longest_hole)
    for block in stamps():
        yield track.follow(block)


def _typical_interval(stamps: Stamps) -> float:
    """Return the mean of the intervals that are not longer than 1.75 times their median, s."""
    medians = []
    for block in stamps():
        steps = np.diff(block)
        steps = steps[steps > 0]
        if len(steps):
            medians.append(float(np.median(steps)))
    if not medians:
        raise RecordingError("the time stamps do not advance; is the right column named?")
    limit = 1.75 * float(np.median(medians))
    total, count = 0.0, 0
    for block in stamps():
        steps = np.diff(block)
        steps = steps[(steps > 0) & (steps <= limit)]
        total += float(steps.sum())
        count += len(steps)
    return total / count


@dataclass
class _Track:
    """Follows stamps along a grid of a given interval, in s."""

    interval: float
    longest_hole: float
    rows: int = 0
    grid: int = 0
    off_grid: int = 0
    duplicates: int = 0
    holes: int = 0
    longest: int = 0
    elapsed: float = 0.0
    steps: int = 0
    starts: list[int] = field(default_factory=list)
    unstamped: int = 0
    _state: NDArray[np.float64] = field(default_factory=lambda: np.full(2, np.nan))

    @property
    def segments(self) -> tuple[tuple[int, int], ...]:
        return tuple(zip(self.starts, [*self.starts[1:], self.grid], strict=True))

    def follow(self, block: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the grid points of a block of stamps and keep count of what is found."""
        points = np.empty(len(block), dtype=np.int64)
        breaks = np.empty(len(block), dtype=np.int64)
        counts = np.zeros(6, dtype=np.int64)
        seconds = np.zeros(1)
        _follow(
            block, self.interval, self.longest_hole, self.grid, self._state,
            points, breaks, counts, seconds,
        )  # fmt: skip
        self.starts += breaks[: counts[0]].tolist()
        self.off_grid += int(counts[1])
        self.duplicates += int(counts[2])
        self.holes += int(counts[3])
        self.longest = max(self.longest, int(counts[4]))
        self.unstamped += int(counts[5])
        self.rows += len(block)
        taken = points[points >= 0]
        if len(taken):
            self.grid = int(taken[-1]) + 1
        self.elapsed += float(seconds[0])
        # Grid steps inside segments: every point but the first of each segment.
        self.steps = self.grid - len(self.starts)
        return points


@njit(cache=True, nogil=True)
def _follow(block, interval, longest_hole, grid, state, points, breaks, counts, seconds):  # type: ignore[no-untyped-def]  # noqa: ANN001, ANN202
    """Track stamps; ``state`` holds the time of grid point ``grid - 1`` and the last stamp."""
    origin, last = state[0], state[1]
    point = grid - 1
    for i in range(block.size):
        stamp = block[i]
        if np.isnan(stamp):
            counts[5] += 1
            point += 1
            origin += interval
            points[i] = point
            continue
        step = stamp - last
        if np.isnan(last) or step < -0.5 * interval or step > longest_hole:
            point += 1
            breaks[counts[0]] = point
            counts[0] += 1
            origin = stamp
        else:
            steps = (stamp - origin) / interval
            whole = int(np.round(steps))
            error = stamp - origin - whole * interval
            if abs(error) > _OFF_GRID * interval or whole < 1:
                counts[1] += 1
            if whole < 1:
                counts[2] += 1
                points[i] = -1
                seconds[0] += max(step, 0.0)
                last = max(last, stamp)
                continue
            if whole > 1:
                counts[3] += 1
                counts[4] = max(counts[4], whole - 1)
            point += whole
            origin += whole * interval + _TRACKING * error
            seconds[0] += step
        last = stamp
        points[i] = point
    state[0], state[1] = origin, last


def _grid_findings(found: _Track, interval: float) -> list[Finding]:
    findings = []
    missing = found.grid - (found.rows - found.duplicates)
    if missing:
        findings.append(
            Finding(
                "missing_samples",
                "note" if missing < 0.01 * found.grid else "warning",
                f"{missing} of {found.grid} samples are missing in {found.holes} holes, the "
                f"longest {found.longest * interval:.3g} s; they are left out of the clusters",
                missing,
            )
        )
    if len(found.starts) > 1:
        findings.append(
            Finding(
                "segments",
                "warning",
                f"the clock jumps or stops {len(found.starts) - 1} times; the recording is "
                f"analysed as {len(found.starts)} segments",
                len(found.starts),
            )
        )
    if found.duplicates:
        findings.append(
            Finding(
                "repeated_stamps",
                "note",
                f"{found.duplicates} records repeat a stamp or fall on an earlier one; left out",
                found.duplicates,
            )
        )
    if found.unstamped:
        findings.append(
            Finding(
                "missing_stamps",
                "warning",
                f"{found.unstamped} records have no time stamp; taken as consecutive",
                found.unstamped,
            )
        )
    return findings


def _rate_findings(rate: float, stated: float | None, settings: QualitySettings) -> list[Finding]:
    if stated is None or abs(rate / stated - 1.0) <= settings.rate_tolerance:
        return []
    return [
        Finding(
            "rate_contradicts_stamps",
            "warning",
            f"the sensor file states {stated:.6g} Hz, the stamps say {rate:.6g} Hz, which is "
            "used; mend 'rate', or drop it",
            rate,
        )
    ]


def _arrival_order(
    stamps: Stamps, found: _Track, stated: float | None, settings: QualitySettings
) -> TimeBase:
    """Return the time base of stamps that lie on no grid: consecutive samples at the mean rate."""
    rows, elapsed, last = 0, 0.0, np.nan
    starts = [0]
    mean = _span(stamps) / max(found.rows - 1, 1)
    gap = max(1.0, 100 * mean)
    worst = 0.0
    for block in stamps():
        joined = np.concatenate(([last], block[~np.isnan(block)]))
        steps = np.diff(joined)
        cut = np.flatnonzero((steps < 0) | (steps > gap))
        starts += [rows + int(i) for i in cut]
        inside = steps[(steps >= 0) & (steps <= gap)]
        elapsed += float(inside.sum())
        worst = max(worst, float(inside.max(initial=0.0)))
        rows += len(block)
        last = joined[-1]
    steps_inside = rows - len(starts)
    if elapsed <= 0:
        raise RecordingError("the time stamps do not advance; is the right column named?")
    rate = steps_inside / elapsed
    findings = [
        Finding(
            "jittered_stamps",
            "warning",
            f"the stamps lie on no uniform grid ({100 * found.off_grid / found.rows:.0f} % of them "
            f"off it, {found.holes} pauses, intervals up to {1e3 * worst:.3g} ms); "
            f"the samples are taken as consecutive at the mean rate of {rate:.6g} Hz, so lost "
            "samples cannot be seen",
            worst,
        ),
        *_rate_findings(rate, stated, settings),
    ]
    segments = tuple(zip(starts, [*starts[1:], rows], strict=True))
    if len(segments) > 1:
        findings.append(
            Finding(
                "segments",
                "warning",
                f"the stamps stop or run backwards {len(segments) - 1} times; the recording is "
                f"analysed as {len(segments)} segments",
                len(segments),
            )
        )
    return TimeBase(rate, "stamps", rows, rows, segments, False, False, tuple(findings))


def _span(stamps: Stamps) -> float:
    """Return the sum of all steps forward, s."""
    total, last = 0.0, np.nan
    for block in stamps():
        steps = np.diff(np.concatenate(([last], block)))
        total += float(steps[steps > 0].sum())
        last = block[-1]
    return total
