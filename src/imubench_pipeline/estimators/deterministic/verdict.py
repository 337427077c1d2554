"""Findings from the deterministic signals of a channel, and doubts about its parameters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from imubench_pipeline.estimators.deterministic.courses import DeterministicSignals
from imubench_pipeline.estimators.deterministic.means import assess_stationarity
from imubench_pipeline.estimators.deterministic.search import MAX_REGRESSORS
from imubench_pipeline.estimators.estimate import CURVE, SIGMAS, Estimate, Parameter
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
    doubt: str | None = None  # why the slow terms are doubtful

    def apply(self, estimate: Estimate) -> Estimate:
        """Return an estimate in which the values that depend on slow terms are doubtful."""
        if self.doubt is None:
            return estimate

        def of(parameters: Mapping[str, Parameter]) -> dict[str, Parameter]:
            return {
                name: replace(each, status="doubtful", reason=self.doubt)
                if name in ("B", "T_B", "K", *CURVE) and each.status in ("ok", "doubtful")
                else each
                for name, each in parameters.items()
            }

        return replace(
            estimate,
            parameters=of(estimate.parameters),
            further=[of(group) for group in estimate.further],
            curve=of(estimate.curve),
        )


def assess_signals(channel: str, signals: DeterministicSignals) -> Verdict:
    """Return the findings of a channel, and the doubt about its slow terms."""
    if signals.means is None or signals.searched is None:
        return Verdict(())
    findings: list[Finding] = []
    for signal in signals.signals:
        size = (signal.size, signal.size_lower, signal.size_upper)
        time = (signal.time or 0.0, signal.time_lower or 0.0, signal.time_upper or 0.0)
        change: FindingData = BiasStep(*size, signal.start, signal.place_error or 0.0)
        if signal.kind != "bias_step":
            kind = WarmUpDrift if signal.kind == "warm_up_drift" else PeriodicDrift
            change = kind(*size, *time)
        place = channel, signal.start, signal.end
        findings.append(find(change, "warning", signal.size, *place))
    steady = assess_stationarity(signals.means)
    if steady is not None and steady.has_trend:
        data = NoiseTrend(steady.trend, SIGMAS * steady.trend_error)
        findings.append(find(data, "note", steady.trend, channel, steady.start, steady.end))
    if signals.telegraph:
        many = TelegraphNoise(MAX_REGRESSORS)
        findings.append(find(many, "warning", float(MAX_REGRESSORS), channel))
        return Verdict(tuple(findings), findings[-1].detail)
    return Verdict(tuple(findings))


def tabulate_signals(
    key: Mapping[str, str], unit: str, signals: DeterministicSignals
) -> Iterator[DeterministicRow]:
    """Yield the rows of the table ``deterministic``; the key is sensor, recording and channel."""
    for signal in signals.signals:
        columns = {**key, **vars(signal), "unit": unit}
        del columns["regressor"], columns["amplitudes"]
        yield DeterministicRow(**columns)
