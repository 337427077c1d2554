"""What a log shows of turns: transients and steps, before anybody asks which of them are turns.

Turning a sensitive axis end for end is a rotation about an axis perpendicular to it: the gyro
senses cross-axis coupling and handling alone. The shape of the transient is not known, so its
energy is what is looked for.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.typing import Array

BLOCK = 0.125
"""Length of a block in s: four to a turn of half a second, the quickest by hand."""

_WINDOWS = (1, 2, 4, 8, 16, 32)
"""Lengths in blocks over which energy is taken: 0.125 to 4 s."""

_CLIP = 8.0
"""Standard deviations of a block that count: a knock of one block cannot outweigh a turn."""

_LEVEL = 30.0
"""Longest stretch in s whose median is the level: over it the bias hardly drifts."""

_LEAST = 9.0
"""Log-likelihood ratio from which a transient is listed; noise has one in some 1,000 s."""

CLEAR = 14.0
"""Log-likelihood ratio of a transient that hardly is noise: a day has one."""

_EDGE = 3.0
"""Standard deviations of a block that still belongs to the transient beside it."""

_BRIDGE = 4
"""Blocks of calm within one transient."""

_SHORT = 0.2
"""A transient that is above the noise for less, in s, is a knock: no hand turns so fast."""

_OUT = 6.0
"""Standard deviations from which a single sample is an outlier: noise has one in 500 million."""

_FAR, _LOUD, _HASTE = 8.0, 30.0, 12.0
"""Between so many standard deviations of a sample, the odds for a knock then grow to e^12."""

_STEP = 8.0
"""Standard deviations from which a step counts without a transient."""

_MOST = 2000
"""Transients that are looked for; a log with more is not one of a gyro at rest."""


@dataclass(frozen=True)
class LevelBlocks:
    """A log as means of short blocks."""

    length: float  # of a block, s
    # mean, level: shape (b,); mean of the samples present (NaN where there are none), and the
    # running median, rad/s
    mean: Array
    level: Array
    z: Array  # shape (b,); mean less level in standard deviations; 0 where there are no samples
    present: NDArray[np.bool_]  # shape (b,); where there are samples
    sigma: float  # standard deviation of the noise of a full block, rad/s
    rough: bool  # whether the log is noisier, or calmer, by half than the noise model given


@dataclass(frozen=True)
class Event:
    """A transient or a step: perhaps a turn, perhaps not."""

    # start, stop: s from the first sample; equal for a step
    start: float
    stop: float
    kind: Literal["transient", "step"]
    likelihood: float  # logarithm of the likelihood ratio against noise alone, its outliers clipped
    # largest distance from the level of a block, or of a sample that is far out; or height of the
    # step; rad/s
    peak: float
    strength: float  # logarithm of the likelihood ratio over the least that can be found
    # logarithm of how much likelier a knock is over so soon than a turn; 0 where it lasted
    haste: float

    @property
    def time(self) -> float:
        """The middle, s."""
        return 0.5 * (self.start + self.stop)


def blocks_of(
    log: Array, rate: float, dwell: float, model: NoiseModel | None = None
) -> LevelBlocks:
    """Take a log together to blocks, with their level and noise.

    The level is a running median over less than a dwell, which follows a step at once. The noise is
    the median distance from it, with what is far away left out. The log, shape (n,), is in rad/s,
    NaN where a sample is missing; the rate in Hz, the nominal dwell in s. The noise of the sensor
    at rest, if given, is taken where the log's is within half of it.

    Raises
    ------
    ValueError
        If there are hardly any samples, or all are the same.
    """
    size = max(1, round(BLOCK * rate))
    length = size / rate
    padded = np.full(-(-len(log) // size) * size, np.nan)
    padded[: len(log)] = log
    rows = padded.reshape(-1, size)
    count = np.isfinite(rows).sum(axis=1)
    present = count > 0
    if present.sum() < 8 * len(_WINDOWS):
        raise ValueError(f"the log has {int(count.sum())} samples, too few to find turns in it")
    mean = np.full(len(rows), np.nan)
    mean[present] = np.nansum(rows[present], axis=1) / count[present]
    width = round(min(_LEVEL, 0.7 * dwell) / length) // 2 * 2 + 1
    level = np.full(len(rows), np.nan)
    # "nearest" would repeat the first block: its noise would be the level, and all after it off.
    level[present] = median_filter(mean[present], width, mode="reflect")
    weight = np.sqrt(count / size)
    residual = np.where(present, (mean - level) * weight, 0.0)
    own = _spread(residual[present])
    if own == 0.0:
        raise ValueError("all samples of the log are the same, or nearly all: no noise, no turns")
    sigma, rough = own, False
    if model is not None:
        of_model = math.sqrt(float(model.allan_variance(length, rate)))
        rough = not 2 / 3 < own / of_model < 1.5
        sigma = own if rough else of_model
    return LevelBlocks(length, mean, level, residual / sigma, present, sigma, rough)


def _spread(residual: Array) -> float:
    """Return the standard deviation of what is not an outlier."""
    calm = np.abs(residual)
    sigma = math.inf
    for _ in range(4):
        calm = calm[calm < 3.5 * sigma]
        sigma = float(np.median(calm)) / 0.6745
        if sigma == 0.0:
            # Readings on a coarse grid: most of them are the median itself.
            return float(np.sqrt(np.mean(calm**2)))
    return sigma


def transients(blocks: LevelBlocks, log: Array, rate: float) -> list[Event]:
    """Return the transients in order of time.

    A window of n blocks whose mean square is r times that of the noise has the log-likelihood ratio
    (n/2) (r - 1 - ln r) of a larger variance, maximised over its length and place. Where blocks of
    the calm parts are correlated, n is divided by the largest eigenvalue that their covariance can
    have, 1 + 2 sum (1 - k/n) rho_k: so slowly falls the tail of r then. The log is the same as of
    `blocks_of`, in its shape and units.
    """
    correlation = _correlation(blocks)
    ratios = [_ratio(blocks, window, correlation) for window in _WINDOWS if window < len(blocks.z)]
    stretches: list[tuple[int, int, float]] = []
    while len(stretches) < _MOST:
        best = [int(np.argmax(ratio)) for ratio in ratios]
        k = int(np.argmax([ratio[b] for ratio, b in zip(ratios, best, strict=True)]))
        likelihood = float(ratios[k][best[k]])
        if likelihood < _LEAST:
            break
        first, last = _edges(blocks.z, best[k], best[k] + _WINDOWS[k])
        stretches.append((first, last, likelihood))
        for window, ratio in zip(_WINDOWS, ratios, strict=False):
            ratio[max(0, first - window + 1) : last] = 0.0
    return list(_events(blocks, log, rate, sorted(stretches)))


def _correlation(blocks: LevelBlocks) -> Array:
    """Return the correlation of calm blocks, from that of neighbours on until it is lost."""
    calm = np.where(blocks.present & (np.abs(blocks.z) < _EDGE), blocks.z, 0.0)
    seen = (calm != 0.0).astype(float)
    square = float(np.mean(calm[seen > 0.0] ** 2))
    correlations: list[float] = []
    for k in range(1, min(_WINDOWS[-1], len(calm))):
        pairs = max(float(seen[k:] @ seen[:-k]), 1.0)
        value = float(calm[k:] @ calm[:-k]) / pairs / square
        if value < 3.0 / math.sqrt(pairs):
            break
        correlations.append(value)
    return np.array(correlations)


def _ratio(blocks: LevelBlocks, window: int, correlation: Array) -> Array:
    """Return the log-likelihood ratio of the windows that begin at each block."""
    square = np.minimum(blocks.z**2, _CLIP**2)
    energy = _sums(square, window)
    count = _sums(blocks.present.astype(float), window)
    r = np.maximum(energy / np.maximum(count, 1.0), 1.0)
    lag = np.arange(1, len(correlation) + 1)
    largest = 1.0 + 2.0 * float(np.sum(np.maximum(1.0 - lag / window, 0.0) * correlation))
    return np.asarray(0.5 * count / largest * (r - 1.0 - np.log(r)))


def _sums(values: Array, window: int) -> Array:
    total = np.concatenate(([0.0], np.cumsum(values)))
    return np.asarray(total[window:] - total[:-window])


def _edges(z: Array, first: int, last: int) -> tuple[int, int]:
    """Cut calm blocks off a window, and join the loud ones beside it."""
    loud = np.abs(z) > _EDGE
    inside = np.flatnonzero(np.abs(z[first:last]) > min(_EDGE, 0.8 * np.abs(z[first:last]).max()))
    first, last = first + int(inside[0]), first + int(inside[-1]) + 1
    while first > 0 and loud[max(0, first - _BRIDGE) : first].any():
        first = max(0, first - _BRIDGE) + int(np.argmax(loud[max(0, first - _BRIDGE) : first]))
    while last < len(z) and loud[last : last + _BRIDGE].any():
        last += int(np.flatnonzero(loud[last : last + _BRIDGE])[-1]) + 1
    return first, last


def _events(
    blocks: LevelBlocks, log: Array, rate: float, stretches: list[tuple[int, int, float]]
) -> Iterator[Event]:
    """Yield what was found, stretches that touch as one, with the peak and the duration."""
    joined: list[tuple[int, int, float]] = []
    for first, last, likelihood in stretches:
        if joined and first - joined[-1][1] < _BRIDGE:
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
        # Samples that are missing may have been of it.
        out = int(np.count_nonzero(~(away <= 3.0 * noise)))
        haste = 0.0
        if highest > _FAR * noise:
            peak = max(peak, highest)
            if out / rate < _SHORT:
                # Of a weak turn, only the top is above the noise.
                haste = _HASTE * min(1.0, (highest / noise - _FAR) / (_LOUD - _FAR))
        start, stop = first * blocks.length, min(last * blocks.length, len(log) / rate)
        strength = math.log(likelihood / _LEAST)
        yield Event(start, stop, "transient", likelihood, peak, strength, haste)


def outliers(blocks: LevelBlocks, log: Array, rate: float) -> list[tuple[float, float]]:
    """Return where single samples are far out, which in the mean of a block may not be seen.

    Start and stop, s; those nearer than a block are one. The log has shape and units as of
    `blocks_of`.
    """
    size = round(blocks.length * rate)
    residual = log - np.repeat(blocks.level, size)[: len(log)]
    away = np.abs(residual)
    noise = float(np.nanmedian(away)) / 0.6745
    out = np.flatnonzero(away > _OUT * max(noise, blocks.sigma))
    if len(out) == 0:
        return []
    groups = np.split(out, np.flatnonzero(np.diff(out) > size) + 1)
    return [(float(group[0]) / rate, float(group[-1] + 1) / rate) for group in groups]


def steps(
    blocks: LevelBlocks, dwell: float, model: NoiseModel | None = None, rate: float | None = None
) -> list[Event]:
    """Return steps of the level that stand out alone, in order of time.

    The mean over a third of a nominal dwell, s, after a place, less that before it, in its standard
    deviations: a place where that is largest, and above 8. Only a gyro far better than the paper's
    (N below some 0.001 deg/sqrt(s)) shows the Earth's rate so. The drift of a noise model over a
    third of a dwell is no step; without one, the noise is taken as white. The rate of the log, Hz,
    is for its quantization noise only.
    """
    width = round(dwell / 3.0 / blocks.length)
    if width < 4 or 2 * width >= len(blocks.z):
        return []
    value = calm_means(blocks)
    count = _sums(blocks.present.astype(float), width)
    mean = _sums(value, width) / np.maximum(count, 1.0)
    difference = mean[width:] - mean[:-width]
    enough = np.minimum(count[width:], count[:-width])
    variance = 2.0 * blocks.sigma**2 / np.maximum(enough, 1.0)
    if model is not None:
        variance = np.maximum(variance, 2.0 * model.allan_variance(width * blocks.length, rate))
    z = np.where(enough > width / 2, np.abs(difference) / np.sqrt(variance), 0.0)
    events: list[Event] = []
    while (k := int(np.argmax(z))) >= 0 and z[k] > _STEP and len(events) < _MOST:
        at = (k + width) * blocks.length
        height = float(np.abs(difference[k]))
        strength = math.log(float(z[k]) / _STEP)
        likelihood = min(0.5 * float(z[k]) ** 2, 200.0)
        events.append(Event(at, at, "step", likelihood, height, strength, 0.0))
        z[max(0, k - width) : k + width] = 0.0
    return sorted(events, key=lambda event: event.start)


def calm_means(blocks: LevelBlocks) -> Array:
    """Return the means of the blocks, rad/s, shape (b,), outliers drawn to 4 standard deviations.

    0 where none is.
    """
    within = np.clip(blocks.z, -4.0, 4.0) * blocks.sigma
    return np.where(blocks.present, np.nan_to_num(blocks.level) + within, 0.0)
