"""What the deterministic courses of a channel mean: findings, and parameters to be doubted."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import ndtri

from imubench_pipeline.estimators.deterministic.courses import Course, Courses
from imubench_pipeline.estimators.deterministic.halves import Halves, compare_halves
from imubench_pipeline.estimators.deterministic.means import Steadiness, steadiness_of
from imubench_pipeline.estimators.deterministic.search import MOST
from imubench_pipeline.estimators.estimate import (
    FAMILY,
    SIGMAS,
    Estimate,
    JointDraws,
    Parameter,
    Status,
)
from imubench_pipeline.model.estimates import DeterministicRow
from imubench_pipeline.tables.findings import Finding

_HEAVY = 0.3
"""Excess kurtosis from which N is known less well than of normal samples."""

_TAKEN_OUT = "it is taken out of the noise"


@dataclass(frozen=True)
class Verdict:
    """What a log that changes in time means for its estimates."""

    findings: tuple[Finding, ...]
    caveats: Mapping[str, tuple[Status, str]]
    """Status and reason of the parameters that are not to be relied on."""
    widening: float = 1.0  # times the interval of N that a normal distribution would give
    growth: float = 0.0
    """Logarithm of N at the end of the log over that at its beginning, where it grows."""
    scatter: float = 0.0
    """Standard deviation of the logarithm of N over the log, where it varies otherwise."""

    @property
    def spread(self) -> float:
        """Standard deviation of the logarithm of N over the log."""
        return math.hypot(self.growth / math.sqrt(12.0), self.scatter)

    def applied(self, estimate: Estimate) -> Estimate:
        """Return an estimate with the caveats on the parameters that have a value.

        The interval of N holds for N at any time of the log, as its draws do.
        """
        if not self.caveats and self.widening == 1.0:
            return estimate

        def of(parameters: Mapping[str, Parameter]) -> dict[str, Parameter]:
            judged = {
                name: _with(parameter, self.caveats.get(name))
                for name, parameter in parameters.items()
            }
            if "N" in judged:
                judged["N"] = _widened(judged["N"], self.widening, self.spread)
            return judged

        slow = [self.caveats[name] for name in ("B", "K") if name in self.caveats]
        # The lowest point of the curve is where its slow terms begin.
        lowest = next((caveat for caveat in slow if caveat[0] == "doubtful"), None)
        of_curve = {"B_curve": self.caveats.get("B"), "sigma_min": lowest, "tau_min": lowest}

        return replace(
            estimate,
            parameters=of(estimate.parameters),
            further=[of(group) for group in estimate.further],
            curve={
                name: _with(parameter, of_curve.get(name))
                for name, parameter in estimate.curve.items()
            },
            draws=self._drawn(estimate.draws),
        )

    def _drawn(self, draws: JointDraws | None) -> JointDraws | None:
        """Return draws with N as wide as its interval, each with N of some time of the log."""
        if draws is None:
            return None
        first, place = draws.first.copy(), FAMILY.index("N")
        N = first[:, place]
        positive = N > 0.0
        if not positive.any():
            return draws
        middle = float(np.median(N[positive]))
        # Evenly over the log, and in an order that no other parameter has.
        even = (np.arange(len(N)) + 0.5) / len(N)
        even = np.random.default_rng(len(N)).permutation(even)
        other_times = np.exp(self.growth * (even - 0.5) + self.scatter * ndtri(even))
        first[positive, place] = (middle * (N / middle) ** self.widening * other_times)[positive]
        return replace(draws, first=first)


def _with(parameter: Parameter, caveat: tuple[Status, str] | None) -> Parameter:
    """Return a parameter with a caveat, if there is one and it has a value."""
    if caveat is None or parameter.status not in ("ok", "doubtful"):
        return parameter
    status, reason = caveat
    if status == "not_identified":
        return replace(
            parameter, value=None, status=status, reason=reason, fitted=parameter.in_model
        )
    return replace(parameter, status=status, reason=reason)


def _widened(parameter: Parameter, times: float, spread: float) -> Parameter:
    """Return a parameter with limits so many times as far, and a spread of its logarithm added."""
    value, lower, upper = parameter.value, parameter.lower, parameter.upper
    if value is None or lower is None or upper is None or (times, spread) == (1.0, 0.0):
        return parameter

    def far(ratio: float) -> float:
        return math.exp(math.hypot(times * math.log(ratio), SIGMAS * spread))

    # On the logarithm: no limit passes 0.
    return replace(
        parameter,
        lower=value / far(value / lower) if lower > 0.0 else lower,
        upper=value * far(upper / value),
    )


def verdict_of(channel: str, unit: str, courses: Courses) -> Verdict:
    """Return what was found of a channel, with its SI unit, and what it casts doubt on."""
    findings = [_finding(channel, unit, course) for course in courses.courses]
    caveats: dict[str, tuple[Status, str]] = {}
    if courses.means is None or courses.searched is None:
        return Verdict((), {})
    widening = 1.0
    kurtosis = courses.means.longest.kurtosis
    if kurtosis > _HEAVY:
        # The power of L samples has a relative variance of (2 + kurtosis) / L.
        widening = math.sqrt(1.0 + 0.5 * kurtosis)
        findings.append(_heavy(channel, kurtosis, widening))
    growth = scatter = 0.0
    steady = steadiness_of(courses.means)
    if steady is not None and (steady.grows or steady.varies):
        finding = _unsteady(channel, steady)
        findings.append(finding)
        caveats["N"] = ("doubtful", finding.detail)
        growth, scatter = (math.log1p(steady.trend), 0.0) if steady.grows else (0.0, steady.spread)
    if courses.telegraph:
        reason = (
            f"the bias of {channel} steps {MOST} times or more, as telegraph noise does: the steps "
            "are left in the noise, where they pass for B, T_B and K"
        )
        findings.append(Finding("telegraph_noise", "warning", reason, float(MOST), channel))
        caveats |= {name: ("doubtful", reason) for name in ("B", "T_B", "K")}
        return Verdict(tuple(findings), caveats, widening, growth, scatter)
    noise = courses.searched.fit.noise
    for halves in compare_halves(courses.without(), noise):
        if halves.differ:
            finding = _differ(channel, halves)
            findings.append(finding)
            doubted = ("K",) if halves.of == "K" else ("B", "T_B", "K")
            caveats |= {name: ("doubtful", finding.detail) for name in doubted}
            break
    reason_against = courses.against_random_walk
    if reason_against is not None:
        caveats["K"] = ("not_identified", reason_against)
    return Verdict(tuple(findings), caveats, widening, growth, scatter)


def deterministic_rows(
    key: Mapping[str, str], unit: str, courses: Courses
) -> Iterator[DeterministicRow]:
    """Yield the rows of the table ``deterministic``; the key is sensor, recording and channel."""
    for course in courses.courses:
        yield DeterministicRow(
            sensor=key["sensor"],
            recording=key["recording"],
            channel=key["channel"],
            kind=course.kind,
            start=course.start,
            end=course.end,
            size=course.size,
            size_lower=course.size_lower,
            size_upper=course.size_upper,
            unit=unit,
            time=course.time,
            time_lower=course.time_lower,
            time_upper=course.time_upper,
            place_error=course.place_error,
            gain=course.gain,
        )


def _finding(channel: str, unit: str, course: Course) -> Finding:
    size = f"{course.size:.4g} {unit}"
    limits = f"95 %: {course.size_lower:.4g} to {course.size_upper:.4g} {unit}"
    if course.kind == "bias_step":
        name = "bias_step"
        detail = (
            f"the bias of {channel} steps by {size} ({limits}) at {course.start:.6g} s "
            f"(± {course.place_error or 0.0:.2g} s); {_TAKEN_OUT}"
        )
    elif course.kind == "warm_up_drift":
        name = "warm_up_drift"
        detail = (
            f"{channel} begins {size} ({limits}) away from where it settles, with a time constant "
            f"of {course.time:.4g} s ({course.time_lower:.4g} to {course.time_upper:.4g} s); "
            f"{_TAKEN_OUT}"
        )
    else:
        name = "periodic_drift"
        detail = (
            f"the bias of {channel} swings with an amplitude of {size} ({limits}) and a period of "
            f"{course.time:.5g} s ({course.time_lower:.5g} to {course.time_upper:.5g} s); "
            f"{_TAKEN_OUT}"
        )
    return Finding(name, "warning", detail, course.size, channel, course.start, course.end)


def _heavy(channel: str, kurtosis: float, widening: float) -> Finding:
    detail = (
        f"the fast noise of {channel} has heavier tails than a normal distribution (excess "
        f"kurtosis {kurtosis:.3g}); the interval of N is made {widening:.3g} times as wide"
    )
    return Finding("heavy_tails", "note", detail, kurtosis, channel)


def _unsteady(channel: str, steady: Steadiness) -> Finding:
    if steady.grows:
        word = "grows" if steady.trend > 0.0 else "falls"
        detail = (
            f"the fast noise of {channel} {word} by {100 * abs(steady.trend):.3g} % "
            f"(± {196 * steady.trend_error:.2g} %) from beginning to end; N is its mean over the "
            "log"
        )
        return Finding(
            "noise_grows", "warning", detail, steady.trend, channel, steady.start, steady.end
        )
    detail = (
        f"the fast noise of {channel} differs by {100 * steady.spread:.3g} % (one standard "
        "deviation) between sixteenths of the log, beyond chance; N is its mean over the log"
    )
    return Finding(
        "noise_varies", "warning", detail, steady.spread, channel, steady.start, steady.end
    )


def _differ(channel: str, halves: Halves) -> Finding:
    name = "K_differs" if halves.of == "K" else "slow_noise_differs"
    noise = "K" if halves.of == "K" else "the slow noise"
    detail = (
        f"{noise} of {channel} up to {halves.middle:.5g} s is {halves.first:.3g} times, from there "
        f"on {halves.second:.3g} times that of the whole log, beyond chance: it is not one process"
    )
    return Finding(name, "warning", detail, halves.ratio, channel, halves.begin, halves.end)
