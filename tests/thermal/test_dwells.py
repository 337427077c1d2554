"""Long times in one cell of a register."""

from functools import cache

import numpy as np
import pytest

from imubench_pipeline.estimators.thermal.path import TemperaturePath, estimate_temperature_path
from imubench_pipeline.estimators.thermal.register import find_cell_stays
from tests.conftest import few

Q = 3e-3
"""K² per block³: such a path crosses a cell of a degree in ten blocks."""


def found(inside, level):
    return list(find_cell_stays(np.array(inside), np.array(level, dtype=float), 0.5, Q))


def test_a_long_stay_is_found_and_its_crossings_say_where_it_is():
    level = np.concatenate([np.arange(10), np.full(60, 10.0), np.arange(11, 20)])
    (dwell,) = found(np.ones(len(level), dtype=bool), level)
    assert (dwell[0].start, dwell[0].stop) == (10, 70)
    np.testing.assert_allclose(dwell[1][[0, 5, 30, -6, -1]], [0.05, 0.55, 1.0, 0.55, 0.05])


def test_no_crossing_at_the_end_of_a_log_says_where_it_is():
    (dwell,) = found(np.ones(60, dtype=bool), np.zeros(60))
    np.testing.assert_array_equal(dwell[1], 1.0)


def test_a_path_that_passes_through_its_cells_dwells_in_none():
    assert not found(np.ones(100, dtype=bool), np.arange(100) // 20)
    assert not found(np.zeros(100, dtype=bool), np.zeros(100))


@cache
def path_of_a_chamber(n: int) -> TemperaturePath:
    levels = np.array([12.3, 31.7, 22.4, 38.1, 15.8, 27.2, 33.6, 19.9])
    truth = np.empty(n)
    state, mix = levels[0], 1.0 - np.exp(-80.0 / n)
    for i in range(n):
        state += mix * (levels[8 * i // n] - state)
        truth[i] = state
    return estimate_temperature_path([np.round(truth)], [(0, n)], np.random.default_rng(1))


@pytest.mark.parametrize("part", few([1, 6], [0, 2, 3, 4, 5, 7]))
def test_a_level_of_a_chamber_may_lie_anywhere_in_its_cell(part):
    n = 40_000
    path = path_of_a_chamber(n)
    middle = (path.sample > (part + 0.55) * n / 8) & (path.sample < (part + 0.8) * n / 8)
    spread = np.std((path.draws - path.value)[:, middle].mean(axis=1))
    # 24 draws tell a standard deviation to 15 %.
    assert spread == pytest.approx(1.0 / np.sqrt(12.0), rel=0.45)
