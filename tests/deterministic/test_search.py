"""The parts of the search, each by what it should come to."""

from dataclasses import replace

import numpy as np
import pytest

from imubench_pipeline.estimators.deterministic.means import Means, Part, average_blocks
from imubench_pipeline.estimators.deterministic.ordinates import Ordinates, Regressor
from imubench_pipeline.estimators.deterministic.search import Gain, polish, search_signals
from tests.deterministic.logs import RATE, SIGMA, static_log, times


@pytest.fixture(scope="module")
def log() -> np.ndarray:
    return static_log(1, hours=0.5)


def of(log: np.ndarray) -> Ordinates:
    return Ordinates(average_blocks([log], len(log), RATE))


@pytest.mark.parametrize(
    ("right", "off"),
    [
        (Regressor("step", 0, 1400.3), 0.75),
        (Regressor("exponential", 0, 300.0), 40.0),
        (Regressor("sinusoid", 0, 0.0031), 3e-5),
    ],
)
def test_a_place_is_moved_to_where_it_fits_best(right: Regressor, off: float) -> None:
    n = 3600
    signal = 50.0 * (np.array([1.0, 0.7])[: right.columns] @ right.means(n))
    values = signal + np.random.default_rng(4).standard_normal(n)
    ordinates = Ordinates(Means(10, RATE, (Part(0, values, np.ones(n)),)))
    density = np.full(n - 1, ordinates.means.interval)
    beside = Regressor("ramp", 0)
    start = replace(right, where=right.where - off)
    first, moved = polish(ordinates, (beside, start), 1, density)
    assert first == beside
    # Steps are halved five times.
    fine = {"step": 1 / 32, "exponential": 0.12 * start.where / 16, "sinusoid": 0.125 / n / 16}
    assert abs(moved.where - right.where) < 2.0 * fine[right.kind]
    gain = Gain(ordinates, (beside,), density, 0)
    near = [gain.of(replace(moved, where=moved.where + s * fine[right.kind])) for s in (-1, 1)]
    assert gain.of(moved) >= max(near)
    assert polish(ordinates, (beside, start), 0, density) == (beside, start)


def test_each_regressor_that_is_kept_is_needed_beside_the_others(log: np.ndarray) -> None:
    t = times(log)
    spoilt = log + 6.0 * SIGMA * (t >= 700.0) + 12.0 * SIGMA * np.exp(-t / 100.0)
    ordinates = of(spoilt)
    found = search_signals(ordinates)
    kinds = sorted(x.kind for x in found.fit.regressors)
    assert kinds == ["exponential", "step"]
    for which, gain in enumerate(found.gains):
        others = tuple(x for i, x in enumerate(found.fit.regressors) if i != which)
        without = ordinates.fit(others, found.fit.density)
        lost = 2.0 * (found.fit.log_likelihood - without.log_likelihood)
        assert gain == pytest.approx(lost)
    assert not found.many
