"""Findings and doubts of logs that change."""

import numpy as np
import pytest

from imubench_pipeline.estimators.deterministic.courses import find_deterministic_signals
from imubench_pipeline.estimators.deterministic.means import Stationarity
from imubench_pipeline.estimators.deterministic.verdict import (
    Verdict,
    assess_signals,
    tabulate_signals,
)
from imubench_pipeline.estimators.estimate import Estimate, Parameter
from imubench_pipeline.tables.schemas import TABLES
from tests.deterministic.logs import RATE, SIGMA, K, N, static_log, times


def verdict(log: np.ndarray) -> Verdict:
    return assess_signals("gyro_x", find_deterministic_signals(lambda: [log], len(log), RATE))


def names(of: Verdict) -> list[str]:
    return [finding.finding for finding in of.findings]


def test_a_steady_log_has_no_finding_and_no_doubt() -> None:
    of = verdict(static_log(1))
    assert names(of) == []
    assert of.doubt is None


def test_a_step_is_a_finding_and_a_row() -> None:
    log = static_log(2)
    log += 5.0 * SIGMA * (times(log) >= 3000.0)
    signals = find_deterministic_signals(lambda: [log], len(log), RATE)
    (finding,) = assess_signals("gyro_x", signals).findings
    assert finding.finding == "bias_step"
    assert finding.value == pytest.approx(5.0 * SIGMA, rel=0.3)
    key = {"sensor": "s", "recording": "r", "channel": "gyro_x"}
    (row,) = tabulate_signals(key, "rad/s", signals)
    assert set(row) == {column.name for column in TABLES["deterministic"]}


def test_noise_that_grows_is_a_note() -> None:
    log = static_log(3)
    of = verdict(log + 0.15 * times(log) / times(log)[-1] * (log - log.mean()))
    assert "noise_grows" in names(of)
    estimate = of.apply(Estimate("likelihood", {"N": Parameter(N), "K": Parameter(K)}))
    assert estimate.parameters["N"].status == "ok"
    assert estimate.parameters["N"].value == N
    assert estimate.parameters["K"].status == "ok"


def test_what_makes_b_doubtful_makes_the_curve_doubtful() -> None:
    curve = {name: Parameter(1.0) for name in ("B_curve", "sigma_min", "tau_min")}
    estimate = Estimate("likelihood", {"B": Parameter(1.0)}, curve=curve)
    found = Verdict((), "the halves differ").apply(estimate).curve
    assert {one.status for one in found.values()} == {"doubtful"}


@pytest.mark.parametrize(
    ("trend", "error", "grows"),
    [
        (0.1, 0.01, True),
        (-0.1, 0.01, True),
        (0.1, 0.05, False),  # by chance
        (0.01, 0.0005, False),  # significant, but too small to matter
    ],
)
def test_a_trend_of_noise_is_significant_and_matters(
    trend: float, error: float, grows: bool
) -> None:
    assert Stationarity(trend, error, 0.0, 3600.0).has_trend is grows
