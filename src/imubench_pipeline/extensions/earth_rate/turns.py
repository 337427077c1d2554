"""Dwells and turns in the log of a turned gyro, and the alternation of its level."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from imubench_pipeline.extensions.calibration.experiment import Dwell
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

BLOCK_LENGTH = 0.125  # s: four to a turn of half a second, the quickest by hand
_WINDOW_LENGTHS = (1, 2, 4, 8, 16, 32)  # of the energy detector, in blocks: 0.125 to 4 s
_MAX_BLOCK_SIGMAS = 8.0  # clipping limit: one knocked block cannot outweigh a turn
_MAX_LEVEL_WINDOW = 30.0  # of the running median, s: the bias hardly drifts over it
_MIN_LOG_LIKELIHOOD = 9.0  # of a transient against noise, which exceeds it once in about 1,000 s
CLEAR_LOG_LIKELIHOOD = 14.0  # of a transient that is hardly noise: noise exceeds it once a day
_EDGE_SIGMAS = 3.0  # standard deviations above which a block belongs to the neighbouring transient
_MAX_CALM_BLOCKS = 4  # largest number of calm blocks within one transient
_MAX_KNOCK_TIME = 0.2  # s; a transient above the noise for less is a knock: no hand turns so fast
_OUTLIER_SIGMAS = 6.0  # of a sample: in noise, one sample in 500 million

_KNOCK_ONSET_SIGMAS, _KNOCK_FULL_SIGMAS, _MAX_KNOCK_LOG_ODDS = 8.0, 30.0, 12.0
"""Standard deviations of a sample between which the log odds of a knock rise from 0 to 12, if the
transient is short enough for one."""

_MIN_STEP_SIGMAS = 8.0  # standard deviations above which a step is an event without a transient
_MAX_TRANSIENTS = 2000  # largest number of transients; a gyro at rest has fewer


@dataclass(frozen=True)
class LevelBlocks:
    """A log as means of short blocks."""

    length: float  # of a block, s
    level: Array  # shape (b,); running median, rad/s; NaN where there are no samples
    z: Array  # shape (b,); mean less level in standard deviations; 0 where there are no samples
    present: NDArray[np.bool_]  # shape (b,); where there are samples
    sigma: float  # standard deviation of the noise of a full block, rad/s
    rough: bool  # whether the log is noisier, or calmer, by half than the noise model given


@dataclass(frozen=True)
class Event:
    """A transient or a step of the level, which may be a turn."""

    # start, stop: s from the first sample; equal for a step
    start: float
    stop: float
    kind: Literal["transient", "step"]
    likelihood: float  # log-likelihood ratio against noise alone, with clipped outliers
    peak: float  # largest distance from the level, or height of the step, rad/s
    strength: float  # logarithm of the likelihood ratio over the detection limit
    haste: float  # log odds of a knock against a turn, for a short one, else 0

    @property
    def time(self) -> float:
        """The middle, s."""
        return 0.5 * (self.start + self.stop)

    @property
    def is_clear(self) -> bool:
        """Whether the event is neither noise nor a knock."""
        return self.likelihood > CLEAR_LOG_LIKELIHOOD and not self.haste


def average_log_blocks(
    log: Array, rate: float, dwell: float, model: NoiseModel | None = None
) -> LevelBlocks:
    """Average a log over blocks, with their level and noise.

    The level is a running median over less than a dwell. The noise is from the median absolute
    deviation from it, or from the model if both agree within a factor of 1.5. The log, shape (n,),
    is in rad/s, NaN where a sample is missing; the rate in Hz, the dwell in s. Raises ValueError
    if there are too few samples, or hardly any differ.
    """
    size = max(1, round(BLOCK_LENGTH * rate))
    length = size / rate
    padded = np.full(-(-len(log) // size) * size, np.nan)
    padded[: len(log)] = log
    rows = padded.reshape(-1, size)
    count = np.isfinite(rows).sum(axis=1)
    present = count > 0
    if present.sum() < 8 * len(_WINDOW_LENGTHS):
        raise ValueError(f"the log has {int(count.sum())} samples, too few to find turns in it")
    mean = np.full(len(rows), np.nan)
    mean[present] = np.nansum(rows[present], axis=1) / count[present]
    width = round(min(_MAX_LEVEL_WINDOW, 0.7 * dwell) / length) // 2 * 2 + 1
    level = np.full(len(rows), np.nan)
    # "nearest" would repeat the first block: its noise would shift the level after it.
    level[present] = median_filter(mean[present], width, mode="reflect")
    weight = np.sqrt(count / size)
    residual = np.where(present, (mean - level) * weight, 0.0)
    own = _estimate_sigma(residual[present])
    if own == 0.0:
        raise ValueError("all or nearly all samples of the log are equal, so no turn is visible")
    sigma, rough = own, False
    if model is not None:
        of_model = math.sqrt(float(model.allan_variance(length, rate)))
        rough = not 2 / 3 < own / of_model < 1.5
        sigma = own if rough else of_model
    return LevelBlocks(length, level, residual / sigma, present, sigma, rough)


def _estimate_sigma(residual: Array) -> float:
    calm = np.abs(residual)
    sigma = math.inf
    for _ in range(4):
        calm = calm[calm < 3.5 * sigma]
        sigma = float(np.median(calm)) / 0.6745
        if sigma == 0.0:
            # On a coarse grid most readings equal the median.
            return float(np.sqrt(np.mean(calm**2)))
    return sigma


def detect_transients(blocks: LevelBlocks, log: Array, rate: float) -> list[Event]:
    """Return the transients in order of time.

    A window of n blocks with a mean square of r times the noise has the log-likelihood ratio (n/2)
    (r - 1 - ln r) of a larger variance. If calm blocks are correlated, n is divided by a bound on
    the largest eigenvalue of their correlation. The log has shape and units of
    `average_log_blocks`.
    """
    # Autocorrelation of calm blocks, from lag 1 until it is not significant.
    calm = np.where(blocks.present & (np.abs(blocks.z) < _EDGE_SIGMAS), blocks.z, 0.0)
    seen = (calm != 0.0).astype(float)
    power = float(np.mean(calm[seen > 0.0] ** 2))
    correlation: list[float] = []
    for k in range(1, min(_WINDOW_LENGTHS[-1], len(calm))):
        pairs = max(float(seen[k:] @ seen[:-k]), 1.0)
        value = float(calm[k:] @ calm[:-k]) / pairs / power
        if value < 3.0 / math.sqrt(pairs):
            break
        correlation.append(value)
    lag = np.arange(1, len(correlation) + 1)
    square = np.minimum(blocks.z**2, _MAX_BLOCK_SIGMAS**2)
    present = blocks.present.astype(float)
    ratios: list[Array] = []  # of the windows that begin at each block
    for window in _WINDOW_LENGTHS:
        if window < len(blocks.z):
            count = _sum_windows(present, window)
            r = np.maximum(_sum_windows(square, window) / np.maximum(count, 1.0), 1.0)
            share = np.maximum(1.0 - lag / window, 0.0)
            largest = 1.0 + 2.0 * float(np.sum(share * correlation))
            ratios.append(0.5 * count / largest * (r - 1.0 - np.log(r)))
    stretches: list[tuple[int, int, float]] = []
    while len(stretches) < _MAX_TRANSIENTS:
        best = [int(np.argmax(ratio)) for ratio in ratios]
        k = int(np.argmax([ratio[b] for ratio, b in zip(ratios, best, strict=True)]))
        likelihood = float(ratios[k][best[k]])
        if likelihood < _MIN_LOG_LIKELIHOOD:
            break
        first, last = _find_edges(blocks.z, best[k], best[k] + _WINDOW_LENGTHS[k])
        stretches.append((first, last, likelihood))
        for window, ratio in zip(_WINDOW_LENGTHS, ratios, strict=False):
            ratio[max(0, first - window + 1) : last] = 0.0
    return list(_merge_events(blocks, log, rate, sorted(stretches)))


def _sum_windows(values: Array, window: int) -> Array:
    total = np.concatenate(([0.0], np.cumsum(values)))
    return np.asarray(total[window:] - total[:-window])


def _find_edges(z: Array, first: int, last: int) -> tuple[int, int]:
    """Remove calm blocks from the ends of a window, and add adjacent loud blocks."""
    loud = np.abs(z) > _EDGE_SIGMAS
    inside = np.flatnonzero(
        np.abs(z[first:last]) > min(_EDGE_SIGMAS, 0.8 * np.abs(z[first:last]).max())
    )
    first, last = first + int(inside[0]), first + int(inside[-1]) + 1
    while (near := loud[max(0, first - _MAX_CALM_BLOCKS) : first]).any():
        first += int(np.argmax(near)) - len(near)
    while (near := loud[last : last + _MAX_CALM_BLOCKS]).any():
        last += int(np.flatnonzero(near)[-1]) + 1
    return first, last


def _merge_events(
    blocks: LevelBlocks, log: Array, rate: float, stretches: list[tuple[int, int, float]]
) -> Iterator[Event]:
    joined: list[tuple[int, int, float]] = []
    for first, last, likelihood in stretches:
        if joined and first - joined[-1][1] < _MAX_CALM_BLOCKS:
            before = joined.pop()
            first, last = before[0], max(last, before[1])
            likelihood = max(likelihood, before[2])
        joined.append((first, last, likelihood))
    size = round(blocks.length * rate)
    noise = blocks.sigma * math.sqrt(size)
    for first, last, likelihood in joined:
        peak = float(np.abs(blocks.z[first:last]).max()) * blocks.sigma
        samples = log[first * size : last * size]
        level = np.repeat(blocks.level[first:last], size)[: len(samples)]
        away = np.abs(samples - level)
        highest = float(np.nanmax(away))
        # Missing samples may have belonged to the transient: count them.
        out = int(np.count_nonzero(~(away <= 3.0 * noise)))
        haste = 0.0
        if highest > _KNOCK_ONSET_SIGMAS * noise:
            peak = max(peak, highest)
            if out / rate < _MAX_KNOCK_TIME:
                # Only the top of a weak turn is above the noise, so the odds rise with the peak.
                haste = _MAX_KNOCK_LOG_ODDS * min(
                    1.0,
                    (highest / noise - _KNOCK_ONSET_SIGMAS)
                    / (_KNOCK_FULL_SIGMAS - _KNOCK_ONSET_SIGMAS),
                )
        start, stop = first * blocks.length, min(last * blocks.length, len(log) / rate)
        strength = math.log(likelihood / _MIN_LOG_LIKELIHOOD)
        yield Event(start, stop, "transient", likelihood, peak, strength, haste)


def find_outliers(blocks: LevelBlocks, log: Array, rate: float) -> list[tuple[float, float]]:
    """Return start and stop of outliers, s, of a log, shape (n,), merged within a block."""
    size = round(blocks.length * rate)
    away = np.abs(log - np.repeat(blocks.level, size)[: len(log)])
    noise = float(np.nanmedian(away)) / 0.6745
    out = np.flatnonzero(away > _OUTLIER_SIGMAS * max(noise, blocks.sigma))
    if len(out) == 0:
        return []
    groups = np.split(out, np.flatnonzero(np.diff(out) > size) + 1)
    return [(float(group[0]) / rate, float(group[-1] + 1) / rate) for group in groups]


def detect_steps(
    blocks: LevelBlocks, dwell: float, model: NoiseModel | None = None, rate: float | None = None
) -> list[Event]:
    """Return significant steps of the level, in order of time.

    The means over a third of a dwell, s, before and after a step differ by 8 standard deviations.
    Only a gyro far better than the SiRRS01-03 of Silva et al. shows steps. The standard deviation
    includes the drift of a model, by default white noise. The rate, Hz, is for quantization noise.
    """
    width = round(dwell / 3.0 / blocks.length)
    if width < 4 or 2 * width >= len(blocks.z):
        return []
    value = clip_block_means(blocks)
    count = _sum_windows(blocks.present.astype(float), width)
    mean = _sum_windows(value, width) / np.maximum(count, 1.0)
    difference = mean[width:] - mean[:-width]
    enough = np.minimum(count[width:], count[:-width])
    variance = 2.0 * blocks.sigma**2 / np.maximum(enough, 1.0)
    if model is not None:
        variance = np.maximum(variance, 2.0 * model.allan_variance(width * blocks.length, rate))
    z = np.where(enough > width / 2, np.abs(difference) / np.sqrt(variance), 0.0)
    events: list[Event] = []
    while z[k := int(np.argmax(z))] > _MIN_STEP_SIGMAS and len(events) < _MAX_TRANSIENTS:
        at = (k + width) * blocks.length
        height = float(np.abs(difference[k]))
        strength = math.log(float(z[k]) / _MIN_STEP_SIGMAS)
        likelihood = min(0.5 * float(z[k]) ** 2, 200.0)
        events.append(Event(at, at, "step", likelihood, height, strength, 0.0))
        z[max(0, k - width) : k + width] = 0.0
    return sorted(events, key=lambda event: event.start)


def clip_block_means(blocks: LevelBlocks) -> Array:
    """Return the means of the blocks, rad/s, shape (b,), clipped to 4 sigma; 0 without samples."""
    within = np.clip(blocks.z, -4.0, 4.0) * blocks.sigma
    return np.where(blocks.present, np.nan_to_num(blocks.level) + within, 0.0)


FoundBy = Literal["transient", "step", "schedule", "column"]

DETECTION_ORDER: tuple[FoundBy, ...] = ("column", "transient", "step", "schedule")
"""Ways to find a turn, the most reliable first."""

_MIN_CONTRADICTION_SIGMAS = 3.5  # least size of the alternations before and after an extra turn
# Variance of the mean of a dwell over the variance of an A-B-A difference / 4, in white noise
_WHITE_VARIANCE_RATIO = 16.0 / 6.0


@dataclass(frozen=True)
class Alternation:
    """Mean of the dwells of the first sense minus the mean of both senses (north and south)."""

    # value, sigma: rad/s; the difference, and its standard error
    value: float
    sigma: float

    @property
    def z(self) -> float:
        """The value in standard errors."""
        return self.value / self.sigma


@dataclass(frozen=True)
class Turn:
    """A turn of the sensor."""

    # start, stop: s from the first sample; the time left out, with the margin
    start: float
    stop: float
    time: float  # its middle as found, s
    found_by: FoundBy
    peak: float | None = None  # largest rate during it, or height of the step, rad/s
    doubts: tuple[str, ...] = ()  # in words


@dataclass(frozen=True)
class FoundDwell:
    """A dwell between two turns, or between a turn and an end of the log."""

    # start, stop: s from the first sample, without turning
    start: float
    stop: float
    sense: int  # +1 or -1
    found_by: FoundBy = "schedule"  # of the two adjacent turns, the less reliable way
    doubts: tuple[str, ...] = ()  # in words

    def in_samples(self, rate: float) -> Dwell:
        """Return the dwell in samples at a rate, Hz; raise ValueError if it has none."""
        return Dwell(*_find_samples(self.start, self.stop, rate), self.sense)


@dataclass(frozen=True)
class Turning:
    """The dwells and turns of a log."""

    dwells: tuple[FoundDwell, ...]  # in order; the sense alternates
    turns: tuple[Turn, ...]  # in order
    knocks: tuple[tuple[float, float], ...]  # start and stop of other disturbances, s
    ambiguous: bool  # whether the sense of the first dwell was assumed
    alternation: Alternation  # from A-B-A differences: about the Earth's rate along the axis
    doubts: tuple[str, ...] = ()  # about the log as a whole, in words

    @property
    def by_schedule(self) -> int:
        """Number of turns that only the schedule gives."""
        return sum(turn.found_by == "schedule" for turn in self.turns)

    def senses(self, samples: int, rate: float) -> NDArray[np.int8]:
        """Return the sense (1, -1) of each sample, (samples,); 0: not used; rate in Hz."""
        sense = np.zeros(samples, dtype=np.int8)
        for dwell in self.dwells:
            sense[slice(*_find_samples(dwell.start, dwell.stop, rate))] = dwell.sense
        for knock in self.knocks:
            sense[slice(*_find_samples(*knock, rate))] = 0
        return sense


def _find_samples(start: float, stop: float, rate: float) -> tuple[int, int]:
    """Return the first samples not before two times, with a tolerance for rounding."""
    return math.ceil(start * rate - 1e-6), math.ceil(stop * rate - 1e-6)


def compute_differences(
    blocks: LevelBlocks, stretches: Sequence[tuple[float, float]]
) -> tuple[Array, Array]:
    """Return the A-B-A differences of n dwells, and the variances of the means of the dwells.

    With m_i the means, they are (-1)^i (2 m_i - m_(i-1) - m_(i+1)) / 4, rad/s, shape (n - 2,); for
    two dwells, half their difference. The variances, (rad/s)^2, shape (n,), follow from the noise.
    """
    total = np.concatenate(([0.0], np.cumsum(clip_block_means(blocks))))
    present = np.concatenate(([0], np.cumsum(blocks.present)))
    edges = np.clip(np.rint(np.asarray(stretches) / blocks.length), 0, len(blocks.z)).astype(int)
    count = present[edges[:, 1]] - present[edges[:, 0]]
    has = count > 0
    mean = (total[edges[:, 1]] - total[edges[:, 0]]) / np.maximum(count, 1)
    mean[~has] = np.nan
    white = np.where(has, blocks.sigma**2 / np.maximum(count, 1), np.nan)
    if len(mean) == 2:
        return np.array([0.5 * (mean[0] - mean[1])]), white
    sign = (-1.0) ** np.arange(1, len(mean) - 1)
    return sign * (2.0 * mean[1:-1] - mean[:-2] - mean[2:]) / 4.0, white


def estimate_alternation(
    blocks: LevelBlocks, stretches: Sequence[tuple[float, float]]
) -> Alternation:
    """Return the mean of the A-B-A differences, with its standard error for white noise."""
    return _average(*compute_differences(blocks, stretches))


def _average(difference: Array, white: Array) -> Alternation:
    finite = np.isfinite(difference)
    if not finite.any():
        return Alternation(0.0, math.inf)
    n = int(finite.sum())
    # If dwells have no samples, few of the others belong to a difference.
    variance = float(np.nanmean(white)) / min(len(white), n + 2)
    if n > 2:
        variance = max(
            variance, _WHITE_VARIANCE_RATIO * float(np.var(difference[finite], ddof=1)) / (n + 2)
        )
    return Alternation(float(difference[finite].mean()), math.sqrt(variance))


def find_contradiction(blocks: LevelBlocks, stretches: Sequence[tuple[float, float]]) -> int | None:
    """Return the index of the dwell from which the alternation has the opposite sign, or None."""
    difference, white = compute_differences(blocks, stretches)
    if len(difference) < 6:
        return None
    worst, place = _MIN_CONTRADICTION_SIGMAS, None
    for k in range(3, len(difference) - 2):
        before = _average(difference[:k], white[: k + 2]).z
        after = _average(difference[k:], white[k:]).z
        size = min(abs(before), abs(after))
        if before * after < 0.0 and size > worst:
            worst, place = size, k + 1
    return place


def find_best_shift(
    blocks: LevelBlocks, turns: Array, half_width: float, longest: float, duration: float
) -> tuple[float, float, float]:
    """Return the delay of turns, s, with the largest alternation; z with, and z without delay.

    All shifts, up to ``longest``, s, share one standard error, so that z^2 is twice the
    log-likelihood. The turns are the scheduled ones (see `split_at_turns`).
    """
    shifts = np.arange(-math.floor(longest / 0.5), math.floor(longest / 0.5) + 1) * 0.5
    alternations = []
    for shift in shifts:
        moved = turns + shift
        moved = moved[(moved > half_width) & (moved < duration - half_width)]
        alternations.append(
            estimate_alternation(blocks, split_at_turns(moved, half_width, duration))
        )
    z = np.array([shifted.value for shifted in alternations]) / np.median(
        [shifted.sigma for shifted in alternations]
    )
    best = int(np.argmax(np.abs(z)))
    return float(shifts[best]), float(z[best]), float(z[shifts == 0.0][0])


def split_at_turns(turns: Array, half_width: float, duration: float) -> list[tuple[float, float]]:
    """Return the n + 1 stretches, start and stop in s, between turns.

    ``turns``: their middles, shape (n,); ``half_width``: left out on either side of each;
    ``duration``: of the log; all in s.
    """
    starts = np.concatenate(([0.0], turns + half_width))
    stops = np.concatenate((turns - half_width, [duration]))
    return list(zip(starts.tolist(), np.maximum(stops, starts).tolist(), strict=True))
