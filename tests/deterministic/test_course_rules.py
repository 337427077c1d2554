"""The parts of a course's description, each by its definition."""

from dataclasses import replace

import numpy as np
import pytest

from imubench_pipeline.estimators.deterministic.courses import (
    _change_point,
    _leverage_on_walk,
    _limits,
    _place_steps,
)
from imubench_pipeline.estimators.deterministic.means import Means, Part, means_of
from imubench_pipeline.estimators.deterministic.ordinates import Fit, Ordinates
from imubench_pipeline.estimators.deterministic.regressors import Regressor
from tests.deterministic.logs import RATE


@pytest.mark.parametrize("at", [1, 7, 30, 39])
def test_the_first_sample_of_the_second_level_is_found_by_its_squares(at: int) -> None:
    samples = np.random.default_rng(at).standard_normal(40) + 3.0 * (np.arange(40) >= at)
    samples[[2, 9, 20]] = np.nan

    def left(place: int) -> float:
        halves = samples[:place], samples[place:]
        if not all(np.isfinite(half).any() for half in halves):
            return np.inf
        return float(sum(np.nansum((half - np.nanmean(half)) ** 2) for half in halves))

    squares = [left(place) for place in range(1, 40)]
    assert left(_change_point(samples)) == pytest.approx(min(squares))


@pytest.mark.parametrize(("size", "placed"), [(8.5, True), (7.5, False)])
def test_a_step_is_placed_to_the_sample_from_eight_errors_of_a_block_on(
    size: float, placed: bool
) -> None:
    rng = np.random.default_rng(1)
    log = rng.standard_normal(40_000)
    means = means_of([log], len(log), RATE)
    white = np.sqrt(np.median(means.parts[0].power) / means.block)
    log += size * white * (np.arange(40_000) >= 20_003)
    fit = Ordinates(means_of([log], len(log), RATE)).fit([Regressor("step", 0, 2000.0)])
    fit = replace(fit, sizes=np.array([size * white]))
    (step,) = _place_steps(lambda: np.array_split(log, 7), means, fit)
    assert (step.where != 2000.0) is placed


def test_a_course_has_limits_where_the_likelihood_has_lost_half_of_chi_squared() -> None:
    n = 4000
    blocks = np.arange(n)
    rng = np.random.default_rng(3)
    values = rng.standard_normal(n) + 3.0 * np.exp(-blocks / 500.0)
    ordinates = Ordinates(Means(10, RATE, (Part(0, values, np.ones(n), 0.0),)))
    warm = Regressor("exponential", 0, 500.0)
    fit = replace(ordinates.fit([warm]), density=np.full(n - 1, ordinates.means.interval))

    def gain(time: float) -> float:
        X = np.column_stack([np.exp(-blocks / time), np.ones(n)])
        return float(np.sum((values - values.mean()) ** 2) - np.linalg.lstsq(X, values)[1][0])

    low, high = _limits(ordinates, fit, warm)
    # In steps that grow by a half: the first beyond.
    for end in (low, high):
        assert gain(500.0) - gain(end) > 3.84
        assert gain(500.0) - gain(500.0 + (end - 500.0) / 1.5) < 3.84
    pause = Regressor("restart", 0, 100.0, 8.0)
    assert _limits(ordinates, fit, pause) == (96.0, 104.0)


def test_what_regressors_take_of_the_lowest_ordinates_they_take_of_a_walk() -> None:
    nothing = np.empty(0)
    density = np.array([1e4, 1e4, 1.0, 1.0, 1.0, 1.0, 1.0])
    leverage = np.array([0.9, 0.3, 1.0, 1.0, 0.0, 0.0, 0.0])
    fit = Fit((), nothing, nothing, None, density, nothing, leverage, 0.0)  # type: ignore[arg-type]
    assert _leverage_on_walk(fit) == pytest.approx(0.6, rel=1e-3)
