"""The parts of a signal's description, each by its definition."""

from dataclasses import replace

import numpy as np
import pytest

from imubench_pipeline.estimators.deterministic.courses import (
    DeterministicSignals,
    _describe,
    _find_limits,
)
from imubench_pipeline.estimators.deterministic.means import Means, Part
from imubench_pipeline.estimators.deterministic.ordinates import Ordinates, Regressor
from imubench_pipeline.estimators.deterministic.search import SearchResult
from tests.deterministic.logs import RATE


def test_a_course_has_limits_where_the_likelihood_has_lost_half_of_chi_squared() -> None:
    n = 4000
    blocks = np.arange(n)
    rng = np.random.default_rng(3)
    values = rng.standard_normal(n) + 3.0 * np.exp(-blocks / 500.0)
    ordinates = Ordinates(Means(10, RATE, (Part(0, values, np.ones(n)),)))
    warm = Regressor("exponential", 0, 500.0)
    fit = replace(ordinates.fit([warm]), density=np.full(n - 1, ordinates.means.interval))

    def gain(time: float) -> float:
        X = np.column_stack([np.exp(-blocks / time), np.ones(n)])
        return float(np.sum((values - values.mean()) ** 2) - np.linalg.lstsq(X, values)[1][0])

    low, high = _find_limits(ordinates, fit, warm)
    # In steps that grow by a half: the first beyond.
    for end in (low, high):
        assert gain(500.0) - gain(end) > 3.84
        assert gain(500.0) - gain(500.0 + (end - 500.0) / 1.5) < 3.84


def test_a_course_is_told_in_seconds_from_the_first_sample() -> None:
    n, block = 2000, 10
    rng = np.random.default_rng(5)
    kinds = [
        Regressor("step", 0, 700.25),
        Regressor("exponential", 0, 150.0),
        Regressor("sinusoid", 0, 0.005),
        Regressor("ramp", 0),
    ]
    sizes = np.array([8.0, 30.0, 3.0, 4.0, 1e-4])
    rows = np.concatenate([one.means(n) for one in kinds])
    values = sizes @ rows + rng.standard_normal(n)
    ordinates = Ordinates(Means(block, RATE, (Part(500, values, np.ones(n)),)))
    fit = ordinates.fit(kinds)
    searched = SearchResult(fit, (1.0, 2.0, 3.0, 4.0), False)
    step, warm, drift = _describe(ordinates, searched)
    interval, start = block / RATE, 500 / RATE
    covariance = fit.covariance
    assert [one.gain for one in (step, warm, drift)] == [1.0, 2.0, 3.0]
    assert step.start == step.end == pytest.approx(start + 700.25 * interval)
    assert (warm.start, warm.end) == pytest.approx((start, start + n * interval))
    assert warm.time == pytest.approx(150.0 * interval)
    assert drift.time == pytest.approx(interval / 0.005)
    for one, regressor in ((step, kinds[0]), (warm, kinds[1]), (drift, kinds[2])):
        low, high = _find_limits(ordinates, fit, regressor)
        if one is step:
            assert one.place_error == pytest.approx(0.5 * (high - low) * interval)
            assert one.time is None
        elif one is warm:
            ends = (low * interval, high * interval)
            assert (one.time_lower, one.time_upper) == pytest.approx(ends)
        else:
            ends = (interval / high, interval / low)
            assert (one.time_lower, one.time_upper) == pytest.approx(ends)
    assert (step.size, warm.size) == pytest.approx(tuple(fit.sizes[:2]))
    assert drift.size == pytest.approx(np.hypot(*fit.sizes[2:4]))
    # An interval is that of the covariance, and of the place where that was looked for.
    assert warm.size_upper - warm.size == pytest.approx(1.96 * covariance[1, 1] ** 0.5)
    assert warm.size - warm.size_lower == pytest.approx(1.96 * covariance[1, 1] ** 0.5)
    along = fit.sizes[2:4] / drift.size
    least = 1.96 * np.sqrt(along @ covariance[2:4, 2:4] @ along)
    spread = []
    for where in _find_limits(ordinates, fit, kinds[2]):
        moved = [replace(x, where=where) if x is kinds[2] else x for x in kinds]
        spread.append(np.hypot(*ordinates.solve(moved, fit.density)[0][2:4]))
    half = 0.5 * np.ptp([drift.size, *spread])
    assert drift.size_upper - drift.size == pytest.approx(np.hypot(least, half))
    # At samples: of its own part alone, a block's middle after half a block.
    other = Part(500 + (n + 50) * block, np.zeros(200), np.ones(200))
    means = replace(ordinates.means, parts=(*ordinates.means.parts, other))
    found = DeterministicSignals((step, warm, drift), means, searched)
    at = found.at(0, 25_000)
    assert not at[:500].any() and not at[other.start :].any()
    t = (np.arange(500, other.start) + 0.5 - 500) / block
    expected = fit.sizes[0] * (t >= 700.25) + fit.sizes[1] * np.exp(-t / 150.0)
    expected += fit.sizes[2:4] @ np.array([np.cos(0.01 * np.pi * t), np.sin(0.01 * np.pi * t)])
    np.testing.assert_allclose(at[500 : other.start], expected, atol=1e-9)
    np.testing.assert_allclose(found.at(1_234, 9_876), at[1_234:9_876])
    left = np.concatenate(list(found.subtract_from(np.array_split(np.ones(25_000), 9))))
    np.testing.assert_allclose(left, 1.0 - at)
