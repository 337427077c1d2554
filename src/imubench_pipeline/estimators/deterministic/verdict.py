"""Findings from the deterministic signals of a channel, and caveats on its parameters.

The slow noise of both halves of a log is compared by a likelihood ratio (`compare_halves`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import ndtri

from imubench_pipeline.estimators.deterministic.courses import (
    DeterministicSignal,
    DeterministicSignals,
)
from imubench_pipeline.estimators.deterministic.means import (
    Means,
    assess_stationarity,
)
from imubench_pipeline.estimators.deterministic.ordinates import Ordinates
from imubench_pipeline.estimators.deterministic.search import MAX_REGRESSORS
from imubench_pipeline.estimators.estimate import (
    FAMILY,
    SIGMAS,
    Estimate,
    JointDraws,
    Parameter,
    Status,
)
from imubench_pipeline.estimators.whittle import Maximum, Shapes
from imubench_pipeline.model.estimates import DeterministicRow
from imubench_pipeline.tables.findings import Finding, find
from imubench_pipeline.typing import Array
from imubench_pipeline.words.findings.base import FindingData
from imubench_pipeline.words.findings.changes import (
    BiasStep,
    HeavyTails,
    NoiseTrend,
    NoiseVaries,
    PeriodicDrift,
    RandomWalkChanges,
    SlowNoiseChanges,
    TelegraphNoise,
    WarmUpDrift,
)

_MIN_EXCESS_KURTOSIS = 0.3  # excess kurtosis above which the interval of N is widened
_MIN_BLOCKS = 256  # blocks that a part needs to be halved
_POWER_RATIOS = np.concatenate(([0.0], np.geomspace(1e-4, 1e4, 241)))
"""Grid of the ratio of slow power in a half of the log to the whole log."""

_WHITE_ROUNDS = 4
_MIN_WHITE_RATIO = 0.1

_MAX_LOG_LIKELIHOOD_RATIO = 13.0
"""Twice the log likelihood ratio above which the halves differ.

It is the 99.97 % quantile of chi-squared, as the other terms are fixed although they are uncertain.
"""


@dataclass(frozen=True)
class Verdict:
    """Consequences of a nonstationary log for its estimates."""

    findings: tuple[Finding, ...]
    caveats: Mapping[str, tuple[Status, str]]
    """Status and reason of the unreliable parameters."""
    widening: float = 1.0  # factor on the interval of N for normal samples
    growth: float = 0.0
    """Logarithm of the ratio of N at the end of the log and at its start, if it has a trend."""
    scatter: float = 0.0
    """Standard deviation of the logarithm of N over the log, if it varies without a trend."""

    @property
    def spread(self) -> float:
        """Standard deviation of the logarithm of N over the log."""
        return math.hypot(self.growth / math.sqrt(12.0), self.scatter)

    def apply(self, estimate: Estimate) -> Estimate:
        """Return an estimate with the caveats on the parameters that have a value.

        The interval and the draws of N are widened to include N at any time of the log.
        """
        if not self.caveats and self.widening == 1.0:
            return estimate

        def of(parameters: Mapping[str, Parameter]) -> dict[str, Parameter]:
            judged = {
                name: _add_caveat(parameter, self.caveats.get(name))
                for name, parameter in parameters.items()
            }
            if "N" in judged:
                judged["N"] = _widen_limits(judged["N"], self.widening, self.spread)
            return judged

        slow = [self.caveats[name] for name in ("B", "K") if name in self.caveats]
        # The lowest point of the curve depends on its slow terms.
        lowest = next((caveat for caveat in slow if caveat[0] == "doubtful"), None)
        of_curve = {"B_curve": self.caveats.get("B"), "sigma_min": lowest, "tau_min": lowest}

        return replace(
            estimate,
            parameters=of(estimate.parameters),
            further=[of(group) for group in estimate.further],
            curve={
                name: _add_caveat(parameter, of_curve.get(name))
                for name, parameter in estimate.curve.items()
            },
            draws=self._widen_draws(estimate.draws),
        )

    def _widen_draws(self, draws: JointDraws | None) -> JointDraws | None:
        """Return draws with N as wide as its interval, each with N at one time of the log."""
        if draws is None:
            return None
        first, place = draws.first.copy(), FAMILY.index("N")
        N = first[:, place]
        positive = N > 0.0
        if not positive.any():
            return draws
        middle = float(np.median(N[positive]))
        # Times are uniform over the log, in a random order, independent of other parameters.
        even = np.random.default_rng(len(N)).permutation((np.arange(len(N)) + 0.5) / len(N))
        other_times = np.exp(self.growth * (even - 0.5) + self.scatter * ndtri(even))
        first[positive, place] = (middle * (N / middle) ** self.widening * other_times)[positive]
        return replace(draws, first=first)


def _add_caveat(parameter: Parameter, caveat: tuple[Status, str] | None) -> Parameter:
    """Return a parameter with a caveat, if there is one and it has a value."""
    if caveat is None or parameter.status not in ("ok", "doubtful"):
        return parameter
    status, reason = caveat
    if status == "not_identified":
        return replace(
            parameter, value=None, status=status, reason=reason, fitted=parameter.in_model
        )
    return replace(parameter, status=status, reason=reason)


def _widen_limits(parameter: Parameter, times: float, spread: float) -> Parameter:
    """Return a parameter with limits ``times`` as wide, plus a ``spread`` of its logarithm."""
    value, lower, upper = parameter.value, parameter.lower, parameter.upper
    if value is None or lower is None or upper is None or (times, spread) == (1.0, 0.0):
        return parameter

    def far(ratio: float) -> float:
        return math.exp(math.hypot(times * math.log(ratio), SIGMAS * spread))

    # On a logarithmic scale no limit becomes negative.
    return replace(
        parameter,
        lower=value / far(value / lower) if lower > 0.0 else lower,
        upper=value * far(upper / value),
    )


def assess_signals(channel: str, signals: DeterministicSignals) -> Verdict:
    """Return the findings of a channel, and the caveats on its parameters."""
    findings = [_describe_signal(channel, signal) for signal in signals.signals]
    caveats: dict[str, tuple[Status, str]] = {}
    if signals.means is None or signals.searched is None:
        return Verdict((), {})
    widening = 1.0
    kurtosis = signals.means.longest.kurtosis
    if kurtosis > _MIN_EXCESS_KURTOSIS:
        # The power of L samples has a relative variance of (2 + kurtosis) / L.
        widening = math.sqrt(1.0 + 0.5 * kurtosis)
        findings.append(find(HeavyTails(kurtosis, widening), "note", kurtosis, channel))
    growth = scatter = 0.0
    steady = assess_stationarity(signals.means)
    if steady is not None and (steady.has_trend or steady.is_variable):
        data: FindingData = NoiseVaries(steady.spread)
        value = steady.spread
        if steady.has_trend:
            data, value = NoiseTrend(steady.trend, SIGMAS * steady.trend_error), steady.trend
        finding = find(data, "warning", value, channel, steady.start, steady.end)
        findings.append(finding)
        caveats["N"] = ("doubtful", finding.detail)
        if steady.has_trend:
            growth = math.log1p(steady.trend)
        else:
            scatter = steady.spread
    if signals.telegraph:
        finding = find(TelegraphNoise(MAX_REGRESSORS), "warning", float(MAX_REGRESSORS), channel)
        findings.append(finding)
        caveats |= {name: ("doubtful", finding.detail) for name in ("B", "T_B", "K")}
        return Verdict(tuple(findings), caveats, widening, growth, scatter)
    for halves in compare_halves(signals.without(), signals.searched.fit.noise):
        if halves.differ:
            change = RandomWalkChanges if halves.of == "K" else SlowNoiseChanges
            data = change(halves.middle, halves.first, halves.second)
            finding = find(data, "warning", halves.ratio, channel, halves.begin, halves.end)
            findings.append(finding)
            doubted = ("K",) if halves.of == "K" else ("B", "T_B", "K")
            caveats |= {name: ("doubtful", finding.detail) for name in doubted}
            break
    if (against := signals.against_random_walk) is not None:
        caveats["K"] = ("not_identified", against)
    return Verdict(tuple(findings), caveats, widening, growth, scatter)


def tabulate_signals(
    key: Mapping[str, str], unit: str, signals: DeterministicSignals
) -> Iterator[DeterministicRow]:
    """Yield the rows of the table ``deterministic``; the key is sensor, recording and channel."""
    for signal in signals.signals:
        columns = {**key, **vars(signal), "unit": unit}
        del columns["regressor"], columns["amplitudes"]
        yield DeterministicRow(**columns)


def _describe_signal(channel: str, signal: DeterministicSignal) -> Finding:
    size = (signal.size, signal.size_lower, signal.size_upper)
    data: FindingData
    if signal.kind == "bias_step":
        data = BiasStep(*size, signal.start, signal.place_error or 0.0)
    else:
        assert signal.time is not None
        assert signal.time_lower is not None
        assert signal.time_upper is not None
        time = (signal.time, signal.time_lower, signal.time_upper)
        kind = WarmUpDrift if signal.kind == "warm_up_drift" else PeriodicDrift
        data = kind(*size, *time)
    return find(data, "warning", signal.size, channel, signal.start, signal.end)


@dataclass(frozen=True)
class Halves:
    """The slow noise of the two halves of a log, with the other terms fixed."""

    of: Literal["K", "slow noise"]  # the random walk, or all terms but the white noise together
    first: float
    second: float
    """Ratio of the slow-noise amplitude in each half to the whole log."""
    ratio: float  # twice the log likelihood ratio of two values against one
    begin: float
    middle: float
    end: float
    """Limits of the halves, s from the first sample."""

    @property
    def differ(self) -> bool:
        """Whether one value does not fit both halves."""
        return self.ratio > _MAX_LOG_LIKELIHOOD_RATIO


def compare_halves(means: Means, noise: Maximum) -> Iterator[Halves]:
    """Yield comparisons of the slow noise on the two halves of the longest part of a log.

    First for the random walk, if there is one, then for all slow noise; none for short logs.
    ``means`` are without deterministic signals, ``noise`` is the fit to the whole log.
    """
    part = means.longest
    size = len(part.mean) // 2
    if size < _MIN_BLOCKS // 2:
        return
    densities = []
    for first in (0, size):
        half = replace(part, mean=part.mean[first : first + size], power=part.power[:size])
        ordinates = Ordinates(replace(means, parts=(half,)))
        if not ordinates.is_usable:
            return
        spectrum = ordinates.spectrum(ordinates.coefficient, np.ones_like(ordinates.length))
        shapes = Shapes(spectrum)
        units = {"N": shapes.white, "F": shapes.flicker, "K": shapes.random_walk}
        columns = {letter: noise.parameter(letter) ** 2 * units[letter]() for letter in "NFK"}
        columns["G"] = np.zeros(len(spectrum.density))
        for B, time in zip(noise.biases, noise.times, strict=True):
            columns["G"] += B**2 * shapes.gauss_markov(float(time))
        densities.append((spectrum.ordinates, spectrum.density, columns))
    begin = part.start / means.rate
    length = size * means.interval
    compared: list[tuple[Literal["K", "slow noise"], str]] = [("K", "K"), ("slow noise", "FKG")]
    for name, scaled in compared:
        earlier, later = (_evaluate_log_likelihoods(*of_half, scaled) for of_half in densities)
        if earlier is None or later is None:
            continue
        best = [int(np.argmax(earlier)), int(np.argmax(later))]
        ratio = 2.0 * float(earlier[best[0]] + later[best[1]] - np.max(earlier + later))
        before, after = (math.sqrt(_POWER_RATIOS[place]) for place in best)
        yield Halves(name, before, after, ratio, begin, begin + length, begin + 2.0 * length)


def _evaluate_log_likelihoods(
    nu: Array, data: Array, columns: dict[str, Array], scaled: str
) -> Array | None:
    """Return the log likelihood of a half for each power of ``scaled`` terms; None: they are 0."""
    slow = sum((columns[name] for name in scaled), np.zeros(len(nu)))
    if not slow.any() or not columns["N"].any():
        return None
    white = columns["N"]
    others = [columns[name] for name in columns if name not in scaled and name != "N"]
    rest = sum(others, np.zeros(len(nu))) + _POWER_RATIOS[:, None] * slow
    # White noise has its own power on each half, lest a change of it appear as slow noise.
    power = np.ones((len(rest), 1))
    for _ in range(_WHITE_ROUNDS):
        weight = nu / (rest + power * white) ** 2
        above = np.sum(weight * white * (data - rest), axis=1)
        power = (above / np.sum(weight * white**2, axis=1))[:, None]
        power = np.clip(power, _MIN_WHITE_RATIO, 1.0 / _MIN_WHITE_RATIO)
    density = rest + power * white
    return np.asarray(-0.5 * np.sum(nu * (np.log(density) + data / density), axis=1))
