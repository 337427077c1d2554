"""Samples that are read twice, and those that rounding makes equal."""

import numpy as np
import pytest

from imubench_pipeline.recordings.quality.columns import (
    _expect_rounded_changes,
    estimate_excess_repeats,
)
from imubench_pipeline.recordings.quality.summary import ColumnSummary


def beyond(log: np.ndarray) -> float:
    column = ColumnSummary()
    for piece in np.array_split(log, 7):
        column.add(piece)
    return estimate_excess_repeats(column)[0]


@pytest.mark.parametrize("deviation", [0.6, 1.0, 3.0])
def test_equal_neighbours_and_single_steps_of_rounded_noise(
    rng: np.random.Generator, deviation: float
) -> None:
    place = rng.uniform(size=400_000)
    change = np.round(place + deviation * rng.standard_normal(400_000)) - np.round(place)
    equal, single = _expect_rounded_changes(deviation)
    assert np.mean(change == 0) == pytest.approx(equal, abs=5e-3)
    assert np.mean(np.abs(change[change != 0]) == 1) == pytest.approx(single, abs=5e-3)


@pytest.mark.parametrize("length", [1, 5, 20])
@pytest.mark.parametrize("step", [0.1, 0.5, 1.0, 2.0, 5.0])
def test_rounding_repeats_nothing_that_was_read_twice(
    rng: np.random.Generator, length: int, step: float
) -> None:
    white = np.convolve(rng.standard_normal(60_000), np.full(length, length**-0.5), "valid")
    walk = np.cumsum(0.01 * rng.standard_normal(len(white)))
    for log in (white, white + walk):
        for place in (0.0, 0.3, 0.5):
            assert beyond(np.round(log / step + place) * step) < 0.05


@pytest.mark.parametrize("share", [0.2, 0.5, 0.75])
@pytest.mark.parametrize("step", [0.0, 0.1, 0.5, 1.0, 2.0])
def test_samples_that_were_read_twice_are_counted(
    rng: np.random.Generator, share: float, step: float
) -> None:
    log = rng.standard_normal(60_000)[(np.arange(60_000) * (1 - share)).astype(int)]
    if step:
        log = np.round(log / step) * step
    assert beyond(log) == pytest.approx(share, abs=0.05 if step < 1.5 else 0.15)


def test_a_column_that_tells_nothing() -> None:
    ramp = np.repeat(np.arange(150.0), 2)  # so slow that its steps explain it
    for log in (np.arange(50.0), np.full(300, np.nan), np.full(300, 2.0), ramp):
        assert beyond(log) == 0.0
