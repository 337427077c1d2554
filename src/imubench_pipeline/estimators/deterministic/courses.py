"""Deterministic signals of a log: bias steps, warm-ups and periodic drift, with their sizes."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from imubench_pipeline.allan.phase import Span
from imubench_pipeline.estimators.deterministic.means import Means, average_blocks
from imubench_pipeline.estimators.deterministic.ordinates import Fit, Ordinates, average_covariance
from imubench_pipeline.estimators.deterministic.regressors import Regressor
from imubench_pipeline.estimators.deterministic.scores import MIN_CYCLES, Gain
from imubench_pipeline.estimators.deterministic.search import (
    SearchResult,
    move_regressors,
    search_signals,
)
from imubench_pipeline.estimators.estimate import SIGMAS
from imubench_pipeline.typing import Array
from imubench_pipeline.words.reasons import estimates as texts

Kind = Literal["bias_step", "warm_up_drift", "periodic_drift"]

_KIND_NAMES: dict[str, Kind] = {
    "step": "bias_step",
    "restart": "bias_step",
    "exponential": "warm_up_drift",
    "sinusoid": "periodic_drift",
}
"""Pulses are single bad blocks, and ramps a term of the noise model: neither is removed."""

_MIN_STEP_SIGMAS = 8.0  # in errors of a block; larger steps are placed to the sample
_MAX_STEPS = 8  # more steps, when the search reaches its maximum of regressors, are telegraph noise
_DELTA_LOG_LIKELIHOOD_95 = 1.92
_MAX_WALK_LEVERAGE = 0.5  # fraction of the information on the random walk that signals may take


@dataclass(frozen=True)
class DeterministicSignal:
    """A deterministic signal in a log, with its size and interval."""

    kind: Kind
    start: float
    end: float
    """Start and end in the log, s from the first sample; both are the place of a step."""
    size: float
    size_lower: float
    size_upper: float
    """Change at a step; initial value of a decaying warm-up; amplitude of periodic drift; with 95 %
    limits, rad/s or m/s²."""
    time: float | None
    time_lower: float | None
    time_upper: float | None
    """Time constant of a warm-up, or period, s, with 95 % limits."""
    place_error: float | None  # half width of the 95 % interval of the position of a step, s
    gain: float  # twice the loss of log likelihood without it
    regressor: Regressor
    amplitudes: Array  # (1,) or (2,): of the regressor, SI


@dataclass(frozen=True)
class DeterministicSignals:
    """The deterministic signals of a log."""

    signals: tuple[DeterministicSignal, ...]
    means: Means | None  # the block means that were searched; None where the log is too short
    searched: SearchResult | None
    telegraph: bool = False
    """Whether there are too many steps to resolve; no signal is then removed."""

    def subtract_from(self, blocks: Iterable[Array]) -> Iterator[Array]:
        """Yield the blocks of a log, in order, SI, less the signals."""
        reached = 0
        for values in blocks:
            stop = reached + len(values)
            yield values - self.at(reached, stop) if self.signals else values
            reached = stop

    def at(self, start: int, stop: int) -> Array:
        """Return the sum of all signals at samples of the log, SI."""
        total = np.zeros(stop - start)
        if self.means is None:
            return total
        for signal in self.signals:
            number, parts = signal.regressor.part, self.means.parts
            part = parts[number]
            # A signal lasts until the next part begins.
            last = parts[number + 1].start if number + 1 < len(parts) else stop
            low, high = max(start, part.start), min(stop, last)
            if high <= low:
                continue
            places = (np.arange(low, high) + 0.5 - part.start) / self.means.block
            total[low - start : high - start] += signal.amplitudes @ signal.regressor.at(places)
        return total

    def without(self) -> Means:
        """Return the block means less the signals; the log must have been searched."""
        if self.means is None:
            raise ValueError("the log is too short to be searched")
        parts = []
        for number, part in enumerate(self.means.parts):
            mean = part.mean.copy()
            for signal in self.signals:
                if signal.regressor.part == number:
                    mean -= signal.amplitudes @ signal.regressor.means(len(mean))
            parts.append(replace(part, mean=mean))
        return replace(self.means, parts=tuple(parts))

    @property
    def against_random_walk(self) -> str | None:
        """Reason why random walk and deterministic signal are not distinguishable, or None."""
        if self.searched is None or self.means is None or self.searched.many:
            return None
        rival = self.searched.rival
        if rival is not None:
            return texts.signal_or_walk(_describe_alternative(rival.signals, self.means))
        if self.signals and _compute_walk_leverage(self.searched.fit) > _MAX_WALK_LEVERAGE:
            return texts.SIGNALS_HIDE_WALK
        return None


def _describe_alternative(signals: Sequence[Regressor], means: Means) -> str:
    regressor = signals[0]
    if regressor.kind == "restart":
        return texts.pause_steps(len(signals))
    start = means.parts[regressor.part].start / means.rate
    where = regressor.where * means.interval
    if regressor.kind == "step":
        return texts.step_at(start + where)
    if regressor.kind == "exponential":
        return texts.warm_up(where)
    return texts.periodic_drift(means.interval / regressor.where)


def _compute_walk_leverage(fit: Fit) -> float:
    """Return the part of the information on a random walk that the regressors take."""
    # The information on K is in the lowest ordinates, where the density rises as 1/f^2.
    information = np.minimum(fit.density / np.median(fit.density), 1e300) - 1.0
    slow = np.clip(information / (1.0 + information), 0.0, 1.0) ** 2
    return float(np.sum(slow * fit.leverage) / max(float(np.sum(slow)), 1e-300))


def find_deterministic_signals(
    blocks: Callable[[], Iterable[Array]],
    samples: int,
    rate: float,
    *,
    segments: Sequence[Span] | None = None,
    highest: float | None = None,
) -> DeterministicSignals:
    """Return the steps, warm-ups and periodic drift in a log; none if it is too short.

    ``blocks`` returns the log in order, in SI, NaN where a sample is missing; ``segments`` are the
    first and one-past-last sample of each; ``highest`` is the highest frequency without effect of
    a filter, Hz.
    """
    means = average_blocks(blocks(), samples, rate, segments)
    ordinates = Ordinates(means, highest) if means.parts else None
    if ordinates is None or not ordinates.is_usable:
        return DeterministicSignals((), None, None)
    searched = search_signals(ordinates)
    if searched.many:
        steps = sum(x.kind in ("step", "restart") for x in searched.fit.regressors)
        # Bursts of noise look like pulses, and have a finding of their own.
        return DeterministicSignals((), means, searched, telegraph=steps > _MAX_STEPS)
    if any(x.kind == "step" for x in searched.fit.regressors):
        placed = _place_steps(blocks, means, searched.fit)
        if placed != searched.fit.regressors:
            searched = move_regressors(ordinates, searched, placed)
    return DeterministicSignals(tuple(_describe(ordinates, searched)), means, searched)


def _describe(ordinates: Ordinates, searched: SearchResult) -> Iterator[DeterministicSignal]:
    """Yield the signals with their sizes and intervals."""
    fit, means = searched.fit, ordinates.means
    covariance = average_covariance(ordinates, fit)
    column = 0
    for regressor, gain in zip(fit.regressors, searched.gains, strict=True):
        own = slice(column, column + regressor.columns)
        column = own.stop
        if regressor.kind not in _KIND_NAMES:
            continue
        amplitudes = fit.sizes[own]
        part = means.parts[regressor.part]
        start = part.start / means.rate
        end = start + len(part.mean) * means.interval
        size = _compute_size(amplitudes)
        along = amplitudes / size if len(amplitudes) > 1 else np.ones(1)
        error = SIGMAS * math.sqrt(float(along @ covariance[own, own] @ along))
        low, high = _find_limits(ordinates, fit, regressor)
        if regressor.kind not in ("exponential", "restart"):
            # The place was selected to maximise the size; and the amplitude of less than one
            # period depends on the period.
            sizes = [size]
            for where in (low, high):
                moved = tuple(
                    replace(x, where=where) if x is regressor else x for x in fit.regressors
                )
                sizes.append(_compute_size(ordinates.solve(moved, fit.density)[0][own]))
            error = math.hypot(error, 0.5 * float(np.ptp(sizes)))
        place = start + regressor.where * means.interval
        step = regressor.kind in ("step", "restart")
        times: tuple[float | None, ...] = (None, None, None)
        if regressor.kind == "sinusoid":
            times = tuple(means.interval / f for f in (regressor.where, high, low))
        elif not step:
            times = tuple(means.interval * t for t in (regressor.where, low, high))
        yield DeterministicSignal(
            kind=_KIND_NAMES[regressor.kind],
            start=place if step else start,
            end=place if step else end,
            size=size,
            size_lower=size - error,
            size_upper=size + error,
            time=times[0],
            time_lower=times[1],
            time_upper=times[2],
            place_error=0.5 * (high - low) * means.interval if step else None,
            gain=gain,
            regressor=regressor,
            amplitudes=amplitudes,
        )


def _find_limits(ordinates: Ordinates, fit: Fit, regressor: Regressor) -> tuple[float, float]:
    """Return the 95 % profile likelihood limits of a place, time constant or frequency."""
    if regressor.kind == "restart":
        half = 0.5 * regressor.length
        return regressor.where - half, regressor.where + half
    others = tuple(x for x in fit.regressors if x is not regressor)
    gain = Gain(ordinates, others, fit.density, regressor.part)
    best = gain.of(regressor)
    n = ordinates.sizes[regressor.part]
    unit = {"step": 0.25, "exponential": 0.02 * regressor.where, "sinusoid": 0.02 / n}
    least = MIN_CYCLES / n if regressor.kind == "sinusoid" else 1e-6
    limits = []
    for side in (-1.0, 1.0):
        away = unit[regressor.kind]
        for _ in range(24):
            moved = regressor.where + side * away
            if not least < moved < n:
                break
            if best - gain.of(replace(regressor, where=moved)) > 2.0 * _DELTA_LOG_LIKELIHOOD_95:
                break
            away *= 1.5
        limits.append(min(max(regressor.where + side * away, least), float(n)))
    return limits[0], limits[1]


def _compute_size(amplitudes: Array) -> float:
    """Return the amplitude of a sinusoid, or the signed size of another signal."""
    return float(np.hypot(*amplitudes)) if len(amplitudes) > 1 else float(amplitudes[0])


def _place_steps(
    blocks: Callable[[], Iterable[Array]], means: Means, fit: Fit
) -> tuple[Regressor, ...]:
    """Return the regressors with large steps at the least-squares change point of the samples."""
    size = means.block
    wanted: dict[int, tuple[int, int, float]] = {}
    column = 0
    for i, regressor in enumerate(fit.regressors):
        change = float(fit.sizes[column])
        column += regressor.columns
        if regressor.kind != "step" or size == 1:
            continue
        part = means.parts[regressor.part]
        white = math.sqrt(float(np.nanmedian(part.power)) / size)
        if abs(change) > _MIN_STEP_SIGMAS * white:
            middle = part.start + round(regressor.where * size)
            first = max(part.start, middle - 3 * size)
            last = min(part.start + len(part.mean) * size, middle + 3 * size)
            wanted[i] = (first, last, change)
    if not wanted:
        return fit.regressors
    pieces: dict[int, list[Array]] = {i: [] for i in wanted}
    reached = 0
    for values in blocks():
        for i, (first, last, _) in wanted.items():
            low, high = max(first, reached), min(last, reached + len(values))
            if low < high:
                pieces[i].append(np.asarray(values[low - reached : high - reached], np.float64))
        reached += len(values)
    placed = list(fit.regressors)
    for i, (first, _, _) in wanted.items():
        samples = np.concatenate(pieces[i])
        if np.isfinite(samples).sum() < 4:
            continue
        at = first + _find_change_point(samples)
        part = means.parts[placed[i].part]
        placed[i] = replace(placed[i], where=(at - part.start) / size)
    # A step inside a block may be found as two, which coincide once placed.
    return tuple(dict.fromkeys(placed))


def _find_change_point(samples: Array) -> int:
    """Return the least-squares change point: the index of the first sample of the second level."""
    present = np.isfinite(samples)
    values = np.where(present, samples - np.nanmean(samples), 0.0)
    count = np.cumsum(present)
    total = np.cumsum(values)
    before, after = count[:-1], count[-1] - count[:-1]
    left, right = total[:-1], total[-1] - total[:-1]
    explained = left**2 / np.maximum(before, 1) + right**2 / np.maximum(after, 1)
    explained[(before == 0) | (after == 0)] = -np.inf
    return int(np.argmax(explained)) + 1
