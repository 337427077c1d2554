import math

import numpy as np
import pytest
from scipy import stats

from imubench_pipeline.model.comparisons import ErrorBudgetRow
from imubench_pipeline.navigation.verdicts.specimens import Spread, pool_spreads, predict_error
from tests.conftest import few
from tests.rows import typed
from tests.verdicts.budgets import HEADING, about, gyro, judge


def totals(logs: np.ndarray, error: float, limit: float = 1.0) -> list[ErrorBudgetRow]:
    """Errors of which the logarithms are these, known to within a standard deviation."""
    factor = math.exp(1.959964 * error)
    rows = [
        {"recording": str(i), "sigma": math.exp(y), "lower": math.exp(y) / factor,
         "upper": math.exp(y) * factor, "within": 0.3, "limit": limit}
        for i, y in enumerate(logs)
    ]  # fmt: skip
    return typed(ErrorBudgetRow, rows)


def each(rows: list[ErrorBudgetRow]) -> dict[str, str]:
    return {row.recording: row.recording for row in rows}


@pytest.mark.parametrize("count", [2, 3, 5])
def test_of_logs_without_error_it_is_the_next_value_by_student(count: int) -> None:
    logs = np.array([0.1, -0.3, 0.25, 0.0, -0.2])[:count]
    rows = totals(logs, 1e-7, limit=1.5)
    found = predict_error(rows, each(rows))
    mean, deviation = logs.mean(), logs.std(ddof=1) * math.sqrt(1 + 1 / count)
    low, high = stats.t.interval(0.95, count - 1, mean, deviation)
    assert found.sigma == pytest.approx(math.exp(mean))
    assert (found.lower, found.upper) == pytest.approx((math.exp(low), math.exp(high)))
    assert found.within == pytest.approx(stats.t.cdf(math.log(1.5), count - 1, mean, deviation))
    assert found.spread == Spread(pytest.approx(logs.var(ddof=1)), count - 1)
    assert (found.specimens, found.recordings, found.spread_of) == (count, count, "specimens")


@pytest.mark.parametrize("error", [0.05, 0.3])
@pytest.mark.parametrize("count", few([2, 5], [3]))
def test_the_interval_holds_the_next_specimen(
    count: int, error: float, rng: np.random.Generator
) -> None:
    """A spread of 30 %, errors of the logs below it or as large; +-1.96 spreads hold 64-85 %."""
    sets = 500  # a standard deviation of 1 % about 95 %
    held = 0
    for _ in range(sets):
        *specimens, following = rng.normal(1.0, 0.3, count + 1)
        rows = totals(rng.normal(specimens, error), error)
        found = predict_error(rows, each(rows))
        assert found.lower is not None and found.upper is not None
        held += found.lower < math.exp(following) < found.upper
    assert held / sets >= 0.92
    if error < 0.1:
        assert held / sets <= 0.99  # and it is no wider than it must be


def test_single_unit_has_no_spread_if_none_is_known() -> None:
    (row,) = totals(np.array([0.2]), 0.1)
    found = predict_error([row], {"0": "unit"})
    assert (found.sigma, found.lower, found.upper, found.within) == (
        row["sigma"], row["lower"], row["upper"], 0.3,
    )  # fmt: skip
    assert (found.specimens, found.spread, found.spread_of) == (1, None, None)


def test_one_specimen_has_the_spread_of_other_sensors() -> None:
    (row,) = totals(np.array([0.2]), 0.1)
    found = predict_error([row], {"0": "unit"}, Spread(0.04, 4))
    # It differs from the mean of its kind as the next one does.
    half = stats.t.ppf(0.975, 4) * math.sqrt(2 * 0.04 + 0.1**2)
    assert found.sigma == pytest.approx(row["sigma"])
    assert found.upper == pytest.approx(row["sigma"] * math.exp(half))
    assert found.spread_of == "other sensors"


def test_recordings_of_one_unit_give_only_the_spread_of_recordings() -> None:
    rows = totals(np.array([0.0, 0.2, 0.4]), 1e-7)
    found = predict_error(rows, dict.fromkeys(each(rows), "unit"))
    assert (found.specimens, found.recordings, found.spread_of) == (1, 3, "recordings")
    # With another specimen, each counts once.
    two = predict_error(rows, {"0": "a", "1": "a", "2": "b"})
    assert (two.specimens, two.recordings, two.spread_of) == (2, 3, "specimens")
    assert two.spread is not None and two.spread.freedom == 1


def test_a_usual_spread_weighs_sensors_by_what_they_tell() -> None:
    assert pool_spreads([Spread(0.01, 2)]) is None
    found = pool_spreads([Spread(0.01, 3), Spread(0.09, 1)])
    assert found == Spread(pytest.approx(0.03), 4)


def test_verdicts_are_about_the_next_specimen_and_not_the_worst_log() -> None:
    logs = {str(i): gyro(margin, 1e-3) for i, margin in enumerate((1.3, 1.5, 1.1, 1.4, 1.2))}
    (row,), _ = judge({"s": logs}, {"robot": HEADING})
    margins = np.log([1.3, 1.5, 1.1, 1.4, 1.2])
    assert row["margin"] == pytest.approx(math.exp(margins.mean()), rel=1e-3)
    scale = margins.std(ddof=1) * math.sqrt(1.2)
    chance = stats.t.cdf(margins.mean() / scale, 4)
    assert 0.5 < chance < 0.975  # though each of the five passes
    assert row["chance"] == pytest.approx(chance, rel=1e-3)
    assert (row["verdict"], row["specimens"]) == ("likely_meets", 5)
    assert row["spread"] == pytest.approx(margins.std(ddof=1), rel=1e-2)


def test_a_spread_is_borrowed_from_measured_sensors_for_measured_ones_alone() -> None:
    several = {str(i): gyro(margin, 1e-3) for i, margin in enumerate((1.5, 2.0, 2.5, 3.0))}
    sensors = {"one": {"a": gyro(2.0)}, "made": {"a": gyro(2.0)}, "many": several}
    logs = [about("one", "a"), about("made", "a", simulated=True)]
    logs += [about("many", name) for name in several]
    rows, _ = judge(sensors, {"robot": HEADING}, logs)
    found = {row["sensor"]: (row["spread_of"], row["evidence_reasons"]) for row in rows}
    assert found["one"][0] == "other sensors" and found["made"][0] is None
    assert "one_specimen" in found["one"][1] and "one_specimen" in found["made"][1]
