"""Dead-reckoning errors over windows of a static log.

A window is at rest for a time W, whose mean is the bias. It then moves for a time t, in which the
log less the bias is integrated m + 1 times (`error_budget.growth`). Windows begin one block apart.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from imubench_pipeline.allan.phase import average_finite
from imubench_pipeline.noise import Deterministic, NoiseModel, Term
from imubench_pipeline.typing import Array

BLOCK_COUNTS = range(8, 25)
"""Possible numbers of blocks in the shorter part of a window. With 8 blocks, windows one block
apart have 99 % of the information of windows at every sample, for white noise. The constant weights
over a block change the rms of a double integration by 0.2 %. More blocks are used if they divide
both parts evenly."""


Span = tuple[int, int]

MIN_PRESENT_SHARE = 0.9
"""Minimum share of the samples of a block, as for a cluster of the Allan variance."""


@dataclass(frozen=True)
class Window:
    """The parts of a window in blocks of a log."""

    block: float  # length of a block, s
    resting: int  # number of blocks at rest
    moving: int  # number of blocks in motion

    @property
    def blocks(self) -> int:
        """Number of blocks in the whole window."""
        return self.resting + self.moving

    @property
    def rest(self) -> float:
        """Time at rest, W, s."""
        return self.resting * self.block

    @property
    def time(self) -> float:
        """Time in motion, t, s."""
        return self.moving * self.block

    def weights(self, order: int) -> Array:
        """Return the weights of the block means in the error, s^(m+1), shape (blocks,); sum 0.

        In motion, for a time t, a weight is the integral of (t - s)^m / m! over the block, with s
        from the start of the motion. At rest, for a time W, it is -c / W times the length of the
        block, with c = t^(m+1) / (m+1)!. ``order`` is m, the number of integrations minus one.
        """
        left = self.block * np.arange(self.moving, -1, -1, dtype=np.float64)
        grown = left ** (order + 1) / math.factorial(order + 1)
        return np.concatenate((np.full(self.resting, -grown[0] / self.resting), -np.diff(grown)))


def choose_window(rest: float, time: float, rate: float) -> Window | None:
    """Return a window whose blocks divide both times, s, evenly; None if one has no sample."""
    shorter, longer = sorted((rest, time))
    # A rate that is estimated from time stamps may be slightly low.
    most = math.floor(1.001 * shorter * rate)
    if most < 1:
        return None
    counts = [number for number in BLOCK_COUNTS if number <= most] or [most]

    def estimate_variance_error(number: int) -> float:
        """Return the approximate relative error of the variance."""
        others, samples = number * longer / shorter, shorter * rate / number
        # Block sizes differ by one sample: the mean of 1 / size is above 1 / mean size.
        part = samples % 1.0
        return abs(round(others) / others - 1.0) + part * (1.0 - part) / samples**2

    number = min(counts, key=lambda n: (round(estimate_variance_error(n), 4), n))
    other = round(number * longer / shorter)
    resting, moving = (number, other) if rest <= time else (other, number)
    return Window(shorter / number, resting, moving)


@dataclass(frozen=True)
class Errors:
    """Statistics of the errors in the windows of a log."""

    mean_square: float  # of the errors; rad^2, (m/s)^2 or m^2. NaN without a window
    count: int  # number of windows without a gap
    # shape (lags,): number of pairs of windows of one segment that begin 0, 1, ... blocks apart
    pairs: Array


def compute_window_errors(means: Sequence[Array], weights: Array, lags: int) -> Errors:
    """Return the errors in all windows: sums of block means (NaN: missing) times weights."""
    total, count = 0.0, 0
    pairs = np.zeros(lags)
    for segment in means:
        if len(segment) < len(weights):
            continue
        gaps = ~np.isfinite(segment)
        # A constant cancels in the error: subtract it to keep precision.
        level = float(np.mean(segment[~gaps])) if not gaps.all() else 0.0
        window_errors = correlate(np.where(gaps, 0.0, segment - level), weights)
        before = np.concatenate(([0], np.cumsum(gaps)))
        whole = before[len(weights) :] == before[: -len(weights)]
        total += float(np.sum(window_errors[whole] ** 2))
        count += int(whole.sum())
        # Pairs of windows without a gap, by lag: an autocorrelation.
        length = 1 << (2 * len(whole) - 1).bit_length()
        power = np.abs(np.fft.rfft(whole.astype(np.float64), length)) ** 2
        counted = min(lags, len(whole))
        pairs[:counted] += np.rint(np.fft.irfft(power, length)[:counted])
    return Errors(total / count if count else math.nan, count, pairs)


def correlate(values: Array, weights: Array) -> Array:
    """Return the correlation of values (n,) with weights (p,) at full overlaps, (n - p + 1,)."""
    length = 1 << (len(values) - 1).bit_length()
    # The circular wrap-around affects only the part that is cut off.
    product = np.fft.rfft(values, length) * np.conj(np.fft.rfft(weights, length))
    return np.fft.irfft(product, length)[: len(values) - len(weights) + 1]


def average_blocks(
    parts: Iterable[NDArray[np.floating[Any]]],
    segments: Sequence[Span],
    rate: float,
    lengths: Iterable[float],
) -> dict[float, list[Array]]:
    """Return the means of consecutive blocks of each segment, NaN where samples are missing.

    ``parts`` are consecutive parts of the log, NaN where a sample is missing. ``segments`` are the
    first sample of each segment and the sample after its last. ``rate`` is in Hz; ``lengths`` of
    blocks are in s. Block sizes differ by one sample if the samples do not divide evenly. The
    result has, by length and segment, the means minus a constant of the log, rad/s or m/s^2.
    """
    edges: dict[float, list[NDArray[np.int64]]] = {}
    for length in lengths:
        samples = length * rate
        edges[length] = []
        for start, stop in segments:
            blocks = math.floor((stop - start) / samples + 1e-9)
            edges[length].append(start + np.rint(np.arange(blocks + 1) * samples).astype(np.int64))
    if not edges:
        return {}
    every = np.unique(np.concatenate([one for each in edges.values() for one in each]))
    # Sum and number of the samples before each edge
    sums, present = np.zeros(len(every)), np.zeros(len(every), dtype=np.int64)
    reached, total, count = 0, 0.0, 0
    level: float | None = None
    for part in parts:
        if level is None and not np.isnan(part).all():
            # Subtract gravity: it would cost precision in the sum.
            level = average_finite(part)
        values = part - (level or 0.0)
        gaps = np.isnan(values)
        holes = bool(gaps.any())
        running = np.cumsum(np.where(gaps, 0.0, values) if holes else values)
        first, last = np.searchsorted(every, [reached + 1, reached + len(part) + 1])
        places = every[first:last] - reached - 1
        sums[first:last] = total + running[places]
        if holes:
            counted = np.cumsum(~gaps)
            present[first:last] = count + counted[places]
            count += int(counted[-1])
        else:
            present[first:last] = count + places + 1
            count += len(part)
        reached, total = reached + len(part), total + float(running[-1])

    def compute_means(of_segment: NDArray[np.int64]) -> Array:
        places = np.searchsorted(every, of_segment)
        counts, size = np.diff(present[places]), np.diff(of_segment)
        means = np.full(len(size), np.nan)
        enough = (counts >= MIN_PRESENT_SHARE * size) & (counts > 0)
        np.divide(np.diff(sums[places]), counts, out=means, where=enough)
        return means

    return {length: list(map(compute_means, each)) for length, each in edges.items()}


MAX_CORRELATED_SPANS = 4
"""Maximum lag of correlated windows, in lengths of a window. Beyond it, the squared correlations of
flicker noise and of a similarly slow process add less than 1 % to their sum."""

_MIN_RELATIVE_VARIANCE = 1e-12
"""Minimum relative variance of a mean square: purely deterministic errors have no scatter."""


@dataclass(frozen=True)
class Spread:
    """Distribution of the mean square of the errors of a log, from a noise model."""

    # mean of the mean square, rad^2, (m/s)^2 or m^2; its variance, in the square of this unit
    mean: float
    variance: float

    @property
    def degrees(self) -> float:
        """Degrees of freedom of the chi-squared distribution with the same mean and variance."""
        return 2.0 * self.mean**2 / self.variance


@dataclass(frozen=True)
class WindowCovariance:
    """The covariance of the errors of windows, for any noise model."""

    window: Window
    order: int  # m: number of integrations minus one
    # multiplier of the errors: g if a gyro's attitude error projects gravity
    factor: float = 1.0
    _unit_covariances: dict[Term, Array] = field(default_factory=dict, init=False)

    @cached_property
    def weights(self) -> Array:
        """Weights of the blocks of a window (`Window.weights`), times the factor."""
        return self.factor * self.window.weights(self.order)

    @property
    def lags(self) -> int:
        """Number of lags, in blocks from 0, for which the covariance is calculated."""
        return MAX_CORRELATED_SPANS * self.window.blocks

    def of(self, model: NoiseModel) -> Array:
        """Return the covariance, SI^2, that a model gives the errors at lags in blocks, (lags,)."""
        total = np.zeros(self.lags)
        pairs = np.correlate(self.weights, self.weights, "full")  # from -(blocks - 1) to blocks - 1
        reach = self.window.blocks - 1
        lags = np.abs(np.arange(-reach, self.lags + reach, dtype=np.float64))
        for term in model.terms:
            if not isinstance(term, Deterministic):
                power, unit = term.as_unit()
                covariance = self._unit_covariances.get(unit)
                if covariance is None:
                    covariance = correlate(unit.block_covariance(lags, self.window.block), pairs)
                if unit is not term:  # all models share it
                    self._unit_covariances[unit] = covariance
                total += power * covariance
        return total

    def spread(self, model: NoiseModel, errors: Errors) -> Spread:
        """Return mean and variance of the mean square of the errors of a log.

        For Gaussian errors with covariance c, the variance is 2 / n^2 times the sum of c^2 over all
        pairs of windows, which ``errors`` counts. A ramp adds its square to the mean square. A
        line, at a random phase, adds half the square of its amplitude. Both add their products with
        the noise to the variance.
        """
        covariance = self.of(model)
        both_signs = np.concatenate((errors.pairs[:1], 2.0 * errors.pairs[1:]))
        share = both_signs / errors.count**2
        mean, variance = float(covariance[0]), 2.0 * float(share @ covariance**2)
        distance = self.window.block * np.arange(self.lags)
        for term in model.terms:
            if not isinstance(term, Deterministic):
                continue
            power, frequency = term.swing(self.weights, self.window.block)  # 0 Hz for a ramp
            mean += power
            wave = np.cos(2.0 * math.pi * frequency * distance)
            variance += 4.0 * power * max(float(share @ (covariance * wave)), 0.0)
            if frequency > 0.0:
                # Its mean square depends on the phase, unless the windows cover all phases.
                turn = 2.0 * math.pi * frequency * self.window.block
                half = math.remainder(turn, math.pi)
                coherence = 1.0  # squared mean of phasors that are two turns apart
                if abs(half) >= 1e-9:
                    mean_phasor = math.sin(errors.count * half) / (errors.count * math.sin(half))
                    coherence = mean_phasor**2
                variance += 0.5 * power**2 * coherence
        return Spread(mean, max(variance, _MIN_RELATIVE_VARIANCE * mean**2))
