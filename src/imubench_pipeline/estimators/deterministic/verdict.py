"""Findings from the deterministic signals of a channel, and caveats on its parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from imubench_pipeline.estimators.deterministic.courses import (
    DeterministicSignal,
    DeterministicSignals,
)
from imubench_pipeline.estimators.deterministic.means import assess_stationarity
from imubench_pipeline.estimators.deterministic.search import MAX_REGRESSORS
from imubench_pipeline.estimators.estimate import SIGMAS, Estimate, Parameter, Status
from imubench_pipeline.model.estimates import DeterministicRow
from imubench_pipeline.tables.findings import Finding, find
from imubench_pipeline.words.findings.base import FindingData
from imubench_pipeline.words.findings.changes import (
    BiasStep,
    NoiseTrend,
    PeriodicDrift,
    TelegraphNoise,
    WarmUpDrift,
)


@dataclass(frozen=True)
class Verdict:
    """Consequences of a nonstationary log for its estimates."""

    findings: tuple[Finding, ...]
    caveats: Mapping[str, tuple[Status, str]]
    """Status and reason of the unreliable parameters."""

    def apply(self, estimate: Estimate) -> Estimate:
        """Return an estimate with the caveats on the parameters that have a value."""
        if not self.caveats:
            return estimate
        slow = [self.caveats[name] for name in ("B", "K") if name in self.caveats]
        # The lowest point of the curve depends on its slow terms.
        lowest = next((caveat for caveat in slow if caveat[0] == "doubtful"), None)
        of_curve = {"B_curve": self.caveats.get("B"), "sigma_min": lowest, "tau_min": lowest}

        def of(parameters: Mapping[str, Parameter]) -> dict[str, Parameter]:
            return {
                name: _add_caveat(parameter, of_curve.get(name, self.caveats.get(name)))
                for name, parameter in parameters.items()
            }

        return replace(
            estimate,
            parameters=of(estimate.parameters),
            further=[of(group) for group in estimate.further],
            curve=of(estimate.curve),
        )


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


def assess_signals(channel: str, signals: DeterministicSignals) -> Verdict:
    """Return the findings of a channel, and the caveats on its parameters."""
    if signals.means is None or signals.searched is None:
        return Verdict((), {})
    findings = [_describe_signal(channel, signal) for signal in signals.signals]
    caveats: dict[str, tuple[Status, str]] = {}
    steady = assess_stationarity(signals.means)
    if steady is not None and steady.has_trend:
        data = NoiseTrend(steady.trend, SIGMAS * steady.trend_error)
        findings.append(find(data, "note", steady.trend, channel, steady.start, steady.end))
    if signals.telegraph:
        many = TelegraphNoise(MAX_REGRESSORS)
        findings.append(find(many, "warning", float(MAX_REGRESSORS), channel))
        caveats |= {name: ("doubtful", findings[-1].detail) for name in ("B", "T_B", "K")}
    return Verdict(tuple(findings), caveats)


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
