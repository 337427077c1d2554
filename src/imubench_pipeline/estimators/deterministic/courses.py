"""Deterministic signals of a log: bias steps, warm-ups and periodic drift, with their sizes."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from imubench_pipeline.allan.phase import Span
from imubench_pipeline.estimators.deterministic import search
from imubench_pipeline.estimators.deterministic.means import Means, average_blocks
from imubench_pipeline.estimators.deterministic.ordinates import Fit, Ordinates, Regressor
from imubench_pipeline.estimators.estimate import SIGMAS
from imubench_pipeline.typing import Array

Kind = Literal["bias_step", "warm_up_drift", "periodic_drift"]

_KIND_NAMES: dict[str, Kind] = {
    "step": "bias_step",
    "exponential": "warm_up_drift",
    "sinusoid": "periodic_drift",
}
"""Ramps are a term of the noise model, and are not removed."""

_DELTA_LOG_LIKELIHOOD_95 = 1.92


@dataclass(frozen=True)
class DeterministicSignal:
    """A deterministic signal in a log, with its size, start and end."""

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
    searched: search.SearchResult | None

    @property
    def telegraph(self) -> bool:
        """Whether there are too many steps to resolve; no signal is then removed."""
        return self.searched is not None and self.searched.many

    def subtract_from(self, blocks: Iterable[Array]) -> Iterator[Array]:
        """Yield the blocks of a log, in order, SI, with the signals removed."""
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
    first and one-past-last sample of each segment; ``highest`` is the highest frequency, Hz, at
    which a filter has no effect.
    """
    means = average_blocks(blocks(), samples, rate, segments)
    ordinates = Ordinates(means, highest) if means.parts else None
    if ordinates is None or not ordinates.is_usable:
        return DeterministicSignals((), None, None)
    searched = search.search_signals(ordinates)
    if searched.many:
        return DeterministicSignals((), means, searched)
    return DeterministicSignals(tuple(_describe(ordinates, searched)), means, searched)


def _describe(ordinates: Ordinates, searched: search.SearchResult) -> Iterator[DeterministicSignal]:
    fit, means = searched.fit, ordinates.means
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
        error = SIGMAS * math.sqrt(float(along @ fit.covariance[own, own] @ along))
        low, high = _find_limits(ordinates, fit, regressor)
        if regressor.kind != "exponential" and not regressor.length:
            # The place was selected to maximise the size; and the amplitude of less than one
            # period depends on the period.
            sizes = [size]
            for where in (low, high):
                moved = [
                    x if x is not regressor else replace(x, where=where) for x in fit.regressors
                ]
                sizes.append(_compute_size(ordinates.solve(moved, fit.density)[0][own]))
            error = math.hypot(error, 0.5 * float(np.ptp(sizes)))
        place = start + regressor.where * means.interval
        step = regressor.kind == "step"
        times: tuple[float | None, ...] = (None, None, None)
        if not step:
            times = tuple(means.interval * x for x in (regressor.where, low, high))
        if regressor.kind == "sinusoid":
            times = tuple(means.interval / f for f in (regressor.where, high, low))
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
    if regressor.length:
        half = 0.5 * regressor.length
        return regressor.where - half, regressor.where + half
    others = tuple(x for x in fit.regressors if x is not regressor)
    gain = search.Gain(ordinates, others, fit.density, regressor.part)
    best = gain.of(regressor)
    n = ordinates.sizes[regressor.part]
    unit = {"step": 0.25, "exponential": 0.02 * regressor.where, "sinusoid": 0.02 / n}
    least = search.MIN_CYCLES / n if regressor.kind == "sinusoid" else 1e-6
    limits = []
    for side in (-1.0, 1.0):
        away = unit[regressor.kind]
        while least < (end := regressor.where + side * away) < n:
            if best - gain.of(replace(regressor, where=end)) > 2.0 * _DELTA_LOG_LIKELIHOOD_95:
                break
            away *= 1.5
        limits.append(min(max(end, least), float(n)))
    return limits[0], limits[1]


def _compute_size(amplitudes: Array) -> float:
    """Return the amplitude of a sinusoid, or the signed size of another signal."""
    return float(np.hypot(*amplitudes)) if len(amplitudes) > 1 else float(amplitudes[0])
