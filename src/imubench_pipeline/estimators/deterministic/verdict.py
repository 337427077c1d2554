"""Findings from the deterministic signals of a channel, and doubts about its parameters."""

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from imubench_pipeline.estimators.deterministic.courses import DeterministicSignals
from imubench_pipeline.estimators.deterministic.means import assess_stationarity
from imubench_pipeline.estimators.deterministic.search import MAX_REGRESSORS
from imubench_pipeline.estimators.estimate import CURVE, SIGMAS, Estimate, Parameter
from imubench_pipeline.model.estimates import DeterministicRow
from imubench_pipeline.tables.findings import Finding, find
from imubench_pipeline.words.findings import changes
from imubench_pipeline.words.findings.base import SLOW, WHITE, FindingData

_KINDS = {
    kind.code: kind for kind in (changes.BiasStep, changes.WarmUpDrift, changes.PeriodicDrift)
}
_MIN_EFFECT = 0.1  # least effect, over the interval of a value or over the mean


@dataclass(frozen=True)
class Verdict:
    """Consequences of a nonstationary log for its estimates."""

    findings: tuple[Finding, ...]
    doubt: str | None = None  # why the slow terms are doubtful

    def apply(self, estimate: Estimate) -> Estimate:
        """Return an estimate in which the values that depend on slow terms are doubtful."""
        if self.doubt is None:
            return estimate

        def doubt(name: str, each: Parameter) -> Parameter:
            if name in ("B", "T_B", "K", *CURVE) and each.status in ("ok", "doubtful"):
                return replace(each, status="doubtful", reason=self.doubt)
            return each

        further = [
            {name: doubt(name, each) for name, each in group.items()} for group in estimate.further
        ]
        return replace(estimate.revised(doubt), further=further)


def assess_signals(
    channel: str, signals: DeterministicSignals, *, has_temperature: bool = False
) -> Verdict:
    """Return the findings of a channel, and the doubt about its slow terms."""
    if signals.means is None or signals.searched is None:
        return Verdict(())
    findings: list[Finding] = []
    for signal in signals.signals:
        size = (signal.size, signal.size_lower, signal.size_upper)
        time = (signal.time or 0.0, signal.time_lower or 0.0, signal.time_upper or 0.0)
        change: FindingData = changes.BiasStep(*size, signal.start, signal.place_error or 0.0)
        if signal.kind == "warm_up_drift":
            change = changes.WarmUpDrift(*size, *time)
        elif signal.kind == "periodic_drift":
            cycles = (signal.end - signal.start) / time[0]
            change = changes.PeriodicDrift(
                *size, *time, cycles=cycles, has_temperature=has_temperature
            )
        place = channel, signal.start, signal.end
        findings.append(find(change, "warning", signal.size, *place))
    steady = assess_stationarity(signals.means)
    if steady is not None and steady.has_trend:
        data = changes.NoiseTrend(steady.trend, SIGMAS * steady.trend_error)
        findings.append(find(data, "note", steady.trend, channel, steady.start, steady.end))
    if signals.telegraph:
        many = changes.TelegraphNoise(MAX_REGRESSORS)
        findings.append(find(many, "warning", float(MAX_REGRESSORS), channel))
        return Verdict(tuple(findings), findings[-1].detail)
    return Verdict(tuple(findings))


def state_effects(
    findings: Iterable[Finding], estimate: Estimate, without: Mapping[str, float], mean: float
) -> tuple[Finding, ...]:
    """Return findings with the change of each parameter if no signal is removed.

    A signal that changes no value by more than a tenth of its interval casts no doubt. ``without``
    are the values of `imubench_pipeline.estimators.robust.fit.fit_values` from the log with all
    signals; ``mean`` is the mean of the log, SI.
    """
    known = {**estimate.parameters, **estimate.curve}
    factors = {}
    for name in sorted(SLOW | WHITE):
        factor = _change_factor(known.get(name), without.get(name))
        if factor is not None:
            factors[name] = factor
    stated = []
    for finding in findings:
        kind = _KINDS.get(finding.finding)
        if kind is not None and finding.data is not None:
            data = replace(kind(**json.loads(finding.data)), factors=factors)
            of_bias = finding.finding != changes.PeriodicDrift.code and (
                abs(finding.value) > _MIN_EFFECT * abs(mean)
            )
            affects = (*factors, "bias") if of_bias else tuple(factors)
            place = finding.channel, finding.start, finding.end
            own = find(data, "warning" if affects else "note", finding.value, *place)
            finding = replace(own, affects=tuple(sorted(affects)))
        stated.append(finding)
    return tuple(stated)


def _change_factor(parameter: Parameter | None, without: float | None) -> float | None:
    """Return the value without the removal over the estimate, if it differs by a tenth of it."""
    if parameter is None or without is None or parameter.upper is None:
        return None
    if parameter.value is None:
        beyond = without > (1.0 + _MIN_EFFECT) * parameter.upper > 0.0
        return without / parameter.upper if beyond else None
    width = parameter.upper - (parameter.lower or 0.0)
    beyond = abs(without - parameter.value) > _MIN_EFFECT * width
    return without / parameter.value if beyond else None


def tabulate_signals(
    key: Mapping[str, str], unit: str, signals: DeterministicSignals
) -> Iterator[DeterministicRow]:
    """Yield the rows of the table ``deterministic``; the key is sensor, recording and channel."""
    for signal in signals.signals:
        columns = {**key, **vars(signal), "unit": unit}
        del columns["regressor"], columns["amplitudes"]
        yield DeterministicRow(**columns)
