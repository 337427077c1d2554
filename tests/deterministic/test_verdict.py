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
from imubench_pipeline.estimators.estimate import FAMILY, Estimate, JointDraws, Parameter, Status
from imubench_pipeline.tables.schemas import TABLES
from tests.deterministic.logs import RATE, SIGMA, K, N, static_log, times


def verdict(log: np.ndarray) -> Verdict:
    return assess_signals("gyro_x", find_deterministic_signals(lambda: [log], len(log), RATE))


def names(of: Verdict) -> list[str]:
    return [finding.finding for finding in of.findings]


def test_a_steady_log_has_no_finding_and_no_doubt() -> None:
    of = verdict(static_log(1))
    assert names(of) == []
    assert of.caveats == {}


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


def test_noise_that_grows_makes_n_doubtful() -> None:
    log = static_log(3)
    of = verdict(log + 0.15 * times(log) / times(log)[-1] * (log - log.mean()))
    assert "noise_grows" in names(of)
    estimate = of.apply(Estimate("likelihood", {"N": Parameter(N), "K": Parameter(K)}))
    assert estimate.parameters["N"].status == "doubtful"
    assert estimate.parameters["N"].value == N
    assert estimate.parameters["K"].status == "ok"


def test_heavy_tails_widen_the_interval_of_n_by_the_scatter_of_powers() -> None:
    rng = np.random.default_rng(4)
    of = verdict(N * np.sqrt(RATE) * rng.laplace(size=200_000))
    assert names(of) == ["heavy_tails"]
    # The excess kurtosis of a Laplace distribution is 3: variances scatter by (2 + 3) / 2.
    assert of.widening == pytest.approx(np.sqrt(2.5), rel=0.05)
    known = Estimate("likelihood", {"N": Parameter(N, lower=0.99 * N, upper=1.01 * N)})
    wider = of.apply(known).parameters["N"]
    assert wider.upper == pytest.approx(N * (1.0 + 0.01 * of.widening), rel=1e-3)


def of_draws(first_N: np.ndarray) -> Estimate:
    first = np.zeros((len(first_N), len(FAMILY)))
    first[:, FAMILY.index("N")] = first_N
    first[:, FAMILY.index("K")] = np.geomspace(1e-6, 2e-6, len(first_N))
    draws = JointDraws(first, np.empty((len(first_N), 0, 2)))
    return Estimate("likelihood", {"N": Parameter(N)}, draws=draws)


def drawn_white(of: Estimate) -> np.ndarray:
    assert of.draws is not None
    return of.draws.first[:, FAMILY.index("N")]


def test_the_draws_are_widened_as_the_interval_of_n_is() -> None:
    given = of_draws(N * np.exp(0.01 * np.linspace(-1.0, 1.0, 201)))
    wider = Verdict((), {}, widening=2.0).apply(given)
    assert np.ptp(np.log(drawn_white(wider))) == pytest.approx(0.04)
    assert given.draws is not None
    assert wider.draws is not None
    place = FAMILY.index("K")
    assert np.array_equal(wider.draws.first[:, place], given.draws.first[:, place])


def test_the_draws_have_n_of_all_the_log_where_it_grows_or_varies() -> None:
    doubt: dict[str, tuple[Status, str]] = {"N": ("doubtful", "it grows")}
    given = of_draws(np.append(np.full(200, N), 0.0))
    grown = drawn_white(Verdict((), doubt, growth=0.3).apply(given))
    assert grown[-1] == 0.0
    assert np.log(np.quantile(grown[:-1] / N, [0.0, 0.5, 1.0])) == pytest.approx(
        [-0.15, 0.0, 0.15], abs=2e-3
    )
    varied = drawn_white(Verdict((), doubt, scatter=0.2).apply(given))
    assert np.std(np.log(varied[:-1])) == pytest.approx(0.2, rel=0.02)


def test_a_walk_on_one_half_alone_is_a_finding() -> None:
    log = static_log(5, walk=3e-6)
    rng = np.random.default_rng(5)
    late = np.arange(len(log)) > len(log) // 2
    log += np.cumsum(late * rng.standard_normal(len(log))) * 4e-5 / np.sqrt(RATE)
    of = verdict(log)
    assert {"K_differs", "slow_noise_differs"} & set(names(of))
    assert of.caveats["K"][0] == "doubtful"


def test_what_makes_b_doubtful_makes_the_curve_doubtful() -> None:
    curve = {name: Parameter(1.0) for name in ("B_curve", "sigma_min", "tau_min")}
    estimate = Estimate("likelihood", {"B": Parameter(1.0)}, curve=curve)
    found = Verdict((), {"B": ("doubtful", "the halves differ")}).apply(estimate).curve
    assert {one.status for one in found.values()} == {"doubtful"}
    found = Verdict((), {"K": ("doubtful", "the halves differ")}).apply(estimate).curve
    assert [one.status for one in found.values()] == ["ok", "doubtful", "doubtful"]
    found = Verdict((), {"K": ("not_identified", "a drift is as good")}).apply(estimate).curve
    assert {one.status for one in found.values()} == {"ok"}


@pytest.mark.parametrize(
    ("trend", "error", "spread", "chi_squared", "grows", "varies"),
    [
        (0.1, 0.01, 0.1, 90.0, True, True),
        (-0.1, 0.01, 0.1, 90.0, True, True),
        (0.1, 0.05, 0.1, 20.0, False, False),  # by chance
        (0.01, 0.0005, 0.01, 90.0, False, False),  # surely, but by nothing that matters
    ],
)
def test_a_change_of_noise_is_told_if_it_is_sure_and_matters(
    trend: float, error: float, spread: float, chi_squared: float, grows: bool, varies: bool
) -> None:
    steady = Stationarity(trend, error, spread, chi_squared, 0.0, 3600.0)
    assert (steady.has_trend, steady.is_variable) == (grows, varies)
