"""The time base of a recording: its rate, its missing samples and its segments.

Stamps on a uniform grid give the position of every sample; positions without one are holes. Stamps
that scatter by more than half a sampling interval, such as arrival times, give only the length:
the samples are then treated as consecutive, with a finding.
"""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.model.states import Severity
from imubench_pipeline.recordings import stamps as tracking
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.tables.findings import Finding, RecordingError, find
from imubench_pipeline.typing import Array
from imubench_pipeline.words.findings import time_base

_MAX_INTERVAL_ERROR = 1e-5  # relative error at which stamps get the same grid points
_MIN_INTERVAL, _MAX_INTERVAL = 1e-18, 1e8  # s, wide enough for a wrong unit of time
_MAX_MISSING_PER_SAMPLE, _MAX_EXTRA_POINTS = 100, 10_000_000  # of the grid: a point takes memory
MIN_MISSING = 0.01  # least share of missing samples for the test of a change of the sampling rate
_MAX_RATE_ERROR_WITHOUT_LOSSES = 0.05
"""Largest relative difference of stated and mean rate if no sample is missing; the last burst may
be incomplete."""

_RATE_WINDOW, _MIN_REGULAR_STEPS, _MIN_SLOW_WINDOWS = 32, 0.9, 0.05
"""Test for a lower rate in a part of the log: samples of a window, least share of equal steps in a
regular window, and least share of such windows."""

_MAX_PAIRS = 10_000  # of size and duration of groups; more are not regular
_MIN_GROUP_SIZE, _MIN_GROUPS, _MIN_REGULAR_GROUPS = 5, 5, 0.8
"""Least samples per stamp, number of stamps, and share of equal groups, for which the rate is taken
from the equal groups alone."""

_MAX_SEGMENTS = 10_000  # largest number of segments; each takes 0.1 ms in a step of the pipeline


@dataclass(frozen=True)
class TimeBase:
    """The uniform grid of the samples of a file."""

    rate: float  # Hz
    source: str  # source of the rate: ``stated`` or ``stamps``
    rows: int  # records in the file
    grid: int  # grid points from the first to the last sample, all segments together
    segments: tuple[tuple[int, int], ...]  # first and one-past-last grid point of each
    uniform: bool  # every grid point has one sample, so that stamps need not be stored
    stamped: bool  # the stamps give the grid point of each sample
    findings: tuple[Finding, ...] = ()
    tracking_interval: float | None = None  # initial one of the grid that follows, s
    repeated: int = 0  # records left out because an earlier one has the same grid point
    rate_error: float | None = None  # standard deviation, Hz; None for a stated rate

    @property
    def missing(self) -> int:
        """Grid points without a sample."""
        return self.grid - self.samples

    @property
    def samples(self) -> int:
        """Number of records with a grid point of their own."""
        return self.rows - self.repeated


def assume_stated_rate(rows: int, rate: float) -> TimeBase:
    """Return the time base of a file without stamps, at the stated rate."""
    return TimeBase(rate, "stated", rows, rows, ((0, rows),), uniform=True, stamped=False)


def fit_time_base(
    stamps: tracking.Stamps,
    stated: float | None,
    settings: QualitySettings,
    *,
    known: float | None = None,
) -> TimeBase:
    """Return the time base of a file from its stamps, which are read several times.

    ``stated``: rate, Hz. ``known``: interval, s, if most samples are missing. Raises RecordingError
    if the stamps do not advance, their unit is implausible, or too many samples are missing.
    """
    typical = tracking.estimate_interval(stamps) if known is None else tracking.Interval(known)
    if typical is None:
        raise RecordingError("the time stamps do not advance; correct 'column' of 'time'")
    interval = typical.mean
    if not _MIN_INTERVAL <= interval <= _MAX_INTERVAL:
        raise RecordingError(
            f"the time stamps are {interval:.3g} s apart; correct 'unit' of 'time' in the sensor "
            "file (s, ms, us or ns)"
        )
    if typical.other is not None and _is_rate_of(stated, typical.other, settings):
        interval = typical.other
    track = tracking.track_stamps(stamps, interval, settings.longest_hole)
    mean = track.mean_interval or interval
    if abs(mean / interval - 1.0) > _MAX_INTERVAL_ERROR:
        # The mean interval is more accurate than the typical one: track again.
        track = tracking.track_stamps(stamps, mean, settings.longest_hole)
    if track.grid > _MAX_EXTRA_POINTS + _MAX_MISSING_PER_SAMPLE * track.rows:
        raise RecordingError(
            f"only {track.rows} of {track.grid} samples at {1.0 / interval:.6g} Hz are present; "
            f"expected at least 1 in {_MAX_MISSING_PER_SAMPLE}: correct 'unit' of 'time' in the "
            "sensor file, or split the log at its gaps"
        )
    # Many holes with more points than the log has records are pauses of the host, not losses.
    bursts = known is None and track.grid > 2 * track.rows and track.holes > 0.05 * track.rows
    mean = _measure_span(stamps) / max(track.rows - 1, 1)
    complete = stated is not None and abs(mean * stated - 1.0) <= _MAX_RATE_ERROR_WITHOUT_LOSSES
    bursts |= complete and known is None and track.grid > 2 * track.rows
    shared = track.duplicates > tracking.MIN_SHARED_STAMPS * track.rows
    # Stamps repeat at regular distances where the rate exceeds their resolution.
    repeated = typical.other is not None and typical.other > typical.mean
    if repeated and interval == typical.mean:
        base = _assume_consecutive(stamps, track, stated, settings)
        if stated:
            return base
        data = time_base.CoarseStamps(base.rate, 1.0 / (typical.other or interval))
        return replace(base, findings=(*base.findings, find(data, "warning", base.rate)))
    if track.off_grid > settings.jitter * track.rows or bursts or shared:
        if stated and known is None and not complete:  # many samples may be missing
            of_stated = fit_time_base(stamps, stated, settings, known=1.0 / stated)
            if of_stated.stamped and _is_rate_of(stated, 1.0 / of_stated.rate, settings):
                return of_stated
        return _assume_consecutive(stamps, track, stated, settings)
    _check_segments(len(track.starts))
    exact = track.mean_interval or interval
    findings = _describe_grid(track, exact)
    rate = 1.0 / exact
    if typical.other is not None and stated is None:
        findings.append(find(time_base.CoarseStamps(rate, 1.0 / typical.other), "warning", rate))
    findings += _compare_rates(rate, stated, settings)
    findings += _find_drift(track, settings)
    if track.grid - track.rows > MIN_MISSING * track.grid:
        follow = tracking.Track(track.interval, settings.longest_hole)
        findings += find_rate_changes((follow.follow(block) for block in stamps()), rate)
    jitter = math.sqrt(track.scatter / max(track.steps, 1))
    uniform = track.grid == track.rows and len(track.starts) == 1 and not track.duplicates
    return TimeBase(
        rate,
        "stamps",
        track.rows,
        track.grid,
        track.segments,
        uniform,
        True,
        tuple(findings),
        track.interval,
        track.duplicates,
        rate * math.sqrt(2.0) * jitter / max(track.elapsed, exact),
    )


def locate_samples(
    base: TimeBase, stamps: tracking.Stamps, settings: QualitySettings
) -> Iterator[NDArray[np.int64]]:
    """Yield the grid point of each record, block by block; -1 for a repeated stamp."""
    if not base.stamped:
        start = 0
        for block in stamps():
            yield np.arange(start, start + len(block), dtype=np.int64)
            start += len(block)
        return
    assert base.tracking_interval is not None  # from_stamps sets it if stamped
    track = tracking.Track(base.tracking_interval, settings.longest_hole)
    for block in stamps():
        yield track.follow(block)


def find_rate_changes(
    points: Iterator[NDArray[np.int64]], rate: float, channel: str | None = None
) -> list[Finding]:
    """Return a finding if a part of a log has only every second (third, ...) sample.

    ``points``: grid points of the samples, by block; negative ones are ignored. ``rate``: of the
    grid, Hz.
    """
    samples: Counter[int] = Counter()
    begin: dict[int, int] = {}
    end: dict[int, int] = {}
    total = 0
    for block in points:
        kept = block[block >= 0]
        number = (len(kept) - 1) // _RATE_WINDOW
        if number < 1:
            continue
        steps = np.diff(kept[: number * _RATE_WINDOW + 1]).reshape(number, _RATE_WINDOW)
        typical = np.median(steps, axis=1).astype(np.int64)
        regular = np.mean(steps == typical[:, None], axis=1) >= _MIN_REGULAR_STEPS
        total += number
        for step in np.unique(typical[regular & (typical > 1)]).tolist():
            windows = np.flatnonzero(regular & (typical == step))
            samples[step] += len(windows)
            begin.setdefault(step, int(kept[windows[0] * _RATE_WINDOW]))
            end[step] = int(kept[(windows[-1] + 1) * _RATE_WINDOW])
    findings = []
    for step, count in sorted(samples.items()):
        if count < _MIN_SLOW_WINDOWS * total:
            continue
        first, last = begin[step] / rate, end[step] / rate
        data = time_base.RateChanges(count / total, first, last, rate / step, rate)
        findings.append(find(data, "warning", rate / step, channel, first, last))
    return findings


def _is_rate_of(stated: float | None, interval: float, settings: QualitySettings) -> bool:
    return stated is not None and abs(interval * stated - 1.0) <= settings.rate_tolerance


def _describe_grid(track: tracking.Track, interval: float) -> list[Finding]:
    findings = []
    missing = track.grid - (track.rows - track.duplicates)
    if missing:
        begin = track.longest_at * interval
        end = (track.longest_at + track.longest) * interval
        severity: Severity = "note" if missing < 0.01 * track.grid else "warning"
        data = time_base.MissingSamples(missing, track.grid, track.holes, end - begin, begin)
        if missing > 0.5 * track.grid:
            share = (track.rows - track.duplicates) / track.grid
            data = replace(data, rate_of_bursts=share / interval, noise_ratio=share**-0.5)
        findings.append(find(data, severity, missing, start=begin, end=end))
    if len(track.starts) > 1:
        times = [point * interval for point in track.starts[1:]]
        findings.append(_describe_segments(times, track.jumps[1:], has_grid=True))
    if track.duplicates:
        findings.append(find(time_base.RepeatedStamps(track.duplicates), "note", track.duplicates))
    if track.unstamped:
        findings.append(find(time_base.MissingStamps(track.unstamped), "warning", track.unstamped))
    return findings


def _check_segments(number: int) -> None:
    if number > _MAX_SEGMENTS:
        raise RecordingError(
            f"the time stamps jump or stop so often that there are {number} segments; expected at "
            f"most {_MAX_SEGMENTS}: correct 'column' of 'time' in the sensor file, state 'wraps' "
            "if the stamps return to 0, or split the log at its pauses"
        )


def _describe_segments(times: list[float], jumps: list[float], *, has_grid: bool) -> Finding:
    """Return the finding about pauses, by samples before them, s, and jumps of the stamps, s."""
    jump, at = max(zip(jumps, times, strict=True), key=lambda place: abs(place[0]))
    data = time_base.Segments(has_grid, len(jumps), float(jump), float(at))
    return find(data, "warning", len(jumps) + 1, start=at, end=at)


def _compare_rates(rate: float, stated: float | None, settings: QualitySettings) -> list[Finding]:
    if stated is None or abs(rate / stated - 1.0) <= settings.rate_tolerance:
        return []
    thousands = np.log10(rate / stated) / 3.0
    if abs(thousands) > 0.9 and abs(thousands - round(thousands)) < 0.01:
        raise RecordingError(
            f"the rate is {rate:.6g} Hz by the stamps, but {stated:.6g} Hz as stated; 'unit' of "
            "'time' in the sensor file is probably wrong: try another one of s, ms, us, ns"
        )
    return [find(time_base.RateContradictsStamps(stated, rate), "warning", rate)]


def _find_drift(track: tracking.Track, settings: QualitySettings) -> list[Finding]:
    if len(track.starts) > 1 or len(track.marks) < 8:
        return []
    points, stamps = np.array(track.marks, dtype=np.float64).T
    half = len(points) // 2
    early, late = (
        (stamps[b] - stamps[a]) / (points[b] - points[a])
        for a, b in ((0, half), (half, len(points) - 1))
    )
    drift = late / early - 1.0
    if abs(drift) < settings.rate_drift:
        return []
    return [find(time_base.RateDrifts(drift), "warning", drift)]


def _assume_consecutive(
    stamps: tracking.Stamps, track: tracking.Track, stated: float | None, settings: QualitySettings
) -> TimeBase:
    """Return the time base for stamps without a grid: consecutive samples at the mean rate."""
    # A pause is long compared with the mean interval and with the steps between shared stamps.
    mean = _measure_span(stamps) / max(track.rows - 1, 1)
    gap = max(1.0, 100 * mean, 10 * track.interval) * (1 + 1e-6)
    rows, last, worst, worst_at = 0, np.nan, 0.0, 0
    starts, jumps = [0], []
    # Time is measured between changes of the stamp, so that groups with one stamp are complete.
    changed_at, changed_stamp = 0, np.nan
    groups = Groups()
    for block in stamps():
        # Missing stamps are replaced by the latest one: the next step includes their time.
        latest = np.concatenate(([last], block))
        good = np.maximum.accumulate(np.where(np.isnan(latest), 0, np.arange(len(latest))))
        latest = latest[good]
        steps = np.diff(latest)
        cut = np.abs(steps) > gap
        for i in np.flatnonzero(steps < -tracking.MIN_SET_BACK):
            cut[i] |= tracking.is_set_back(latest, i + 1, steps[i], mean)
        starts += [rows + int(i) for i in np.flatnonzero(cut)]
        jumps += steps[cut].tolist()
        usual = np.where(np.isfinite(steps) & ~cut, steps, 0.0)
        if usual.max(initial=0.0) > worst:
            worst, worst_at = float(usual.max()), rows + int(usual.argmax())
        changes = np.flatnonzero((steps != 0) & np.isfinite(steps))
        if len(changes):
            at = np.concatenate(([changed_at], rows + changes))
            when = np.concatenate(([changed_stamp], latest[changes + 1]))
            inside = ~cut[changes] & np.isfinite(when[:-1])
            groups.add(np.diff(at)[inside], np.diff(when)[inside])
            changed_at, changed_stamp = int(at[-1]), float(when[-1])
        rows += len(block)
        last = latest[-1]
    if groups.elapsed <= 0:
        raise RecordingError("the time stamps do not advance; correct 'column' of 'time'")
    _check_segments(len(starts))
    rate, others = groups.rate()
    at_worst = worst_at / rate
    off_grid = track.off_grid / track.rows
    data = time_base.JitteredStamps(off_grid, track.holes, worst, at_worst, rate)
    findings = [find(data, "warning", worst, start=at_worst, end=at_worst)]
    if others:
        findings.append(find(time_base.IrregularStamps(others, rate), "warning", others))
    findings += _compare_rates(rate, stated, settings)
    segments = tuple(zip(starts, [*starts[1:], rows], strict=True))
    if len(segments) > 1:
        times = [start / rate for start in starts[1:]]
        findings.append(_describe_segments(times, jumps, has_grid=False))
    found, error = tuple(findings), rate * worst / groups.elapsed
    return TimeBase(rate, "stamps", rows, rows, segments, False, False, found, rate_error=error)


class Groups:
    """Groups of consecutive samples with the same stamp: their sizes and durations."""

    def __init__(self) -> None:
        self.samples, self.elapsed, self._number = 0, 0.0, 0
        # Number of groups by size and duration in ns; None: no regular groups.
        self._pairs: Counter[tuple[int, int]] | None = Counter()

    def add(self, samples: NDArray[np.int64], times: Array) -> None:
        """Add consecutive groups: their sizes, and their durations in s; shape (n,) each."""
        self.samples += int(samples.sum())
        self.elapsed += float(times.sum())
        self._number += len(samples)
        if self._pairs is None or self._number * _MIN_GROUP_SIZE > self.samples:
            self._pairs = None
            return
        pairs = np.stack([samples, np.rint(1e9 * times).astype(np.int64)])
        kinds, numbers = np.unique(pairs, axis=1, return_counts=True)
        for (samples_of, time), number in zip(kinds.T.tolist(), numbers.tolist(), strict=True):
            self._pairs[samples_of, time] += number
        if len(self._pairs) > _MAX_PAIRS:
            self._pairs = None

    def rate(self) -> tuple[float, int]:
        """Return the rate, Hz, and the number of irregular groups that were left out of it."""
        everything = self.samples / self.elapsed, 0
        if not self._pairs:
            return everything
        (samples, time), _ = max(self._pairs.items(), key=lambda pair: pair[1])
        if samples < _MIN_GROUP_SIZE or time <= 0:
            return everything
        regular = {
            pair: number
            for pair, number in self._pairs.items()
            if abs(pair[0] * time - pair[1] * samples) <= max(1.5, 0.02 * samples) * time
        }
        number = sum(regular.values())
        if number < max(_MIN_GROUPS, _MIN_REGULAR_GROUPS * self._number):
            return everything
        counted = sum(pair[0] * number_of for pair, number_of in regular.items())
        duration = sum(pair[1] * number_of for pair, number_of in regular.items())
        return 1e9 * counted / duration, self._number - number


def _measure_span(stamps: tracking.Stamps) -> float:
    low, high = np.inf, -np.inf
    for block in stamps():
        if np.isfinite(block).any():
            low, high = min(low, float(np.nanmin(block))), max(high, float(np.nanmax(block)))
    return high - low
