"""Blocks of readings, and the bit of a register."""

import numpy as np
import pytest

from imubench_pipeline.estimators.thermal.path import (
    MAX_BLOCKS,
    estimate_resolution,
    gather_readings,
)


def test_each_block_has_count_mean_and_range_of_its_own_readings(rng):
    samples = 2 * MAX_BLOCKS + 500  # blocks of three
    values = rng.integers(0, 40, samples) * 0.5
    values[rng.integers(0, samples, 4_000)] = np.nan
    values[3_000:3_010] = np.nan
    segments = [(2, 9_001), (9_010, samples)]
    read = gather_readings(np.array_split(values, 29), segments)
    edges = [(a, min(a + 3, stop)) for start, stop in segments for a in range(start, stop, 3)]
    edges = [(a, b) for a, b in edges if np.isfinite(values[a:b]).any()]
    assert read.centre.tolist() == [0.5 * (a + b - 1) for a, b in edges]
    first = sum(a < 9_001 for a, _ in edges)
    assert read.parts == (slice(0, first), slice(first, len(edges)))
    blocks = [values[a:b][np.isfinite(values[a:b])] for a, b in edges]
    assert read.count.tolist() == [len(block) for block in blocks]
    for name, of in (("mean", np.mean), ("low", np.min), ("high", np.max)):
        expected = [of(block) for block in blocks]
        np.testing.assert_allclose(getattr(read, name), expected, rtol=1e-14)
    np.testing.assert_array_equal(read.centre[:2], [3.0, 6.0])
    assert read.step == pytest.approx(0.5)


def test_a_log_of_few_samples_has_blocks_of_one():
    assert len(gather_readings([np.arange(100.0)], [(0, 100)]).mean) == 100
    assert (
        len(gather_readings([np.arange(float(MAX_BLOCKS))], [(0, MAX_BLOCKS)]).mean) == MAX_BLOCKS
    )
    assert (
        len(gather_readings([np.arange(MAX_BLOCKS + 1.0)], [(0, MAX_BLOCKS + 1)]).mean)
        == (MAX_BLOCKS + 2) // 2
    )


def test_a_register_is_one_whose_readings_repeat():
    levels = np.arange(50) * 0.25
    assert estimate_resolution(levels, 8 * 50) == pytest.approx(0.25)
    assert estimate_resolution(levels, 8 * 50 - 1) == 0.0


def test_levels_that_miss_the_multiples_of_a_step_have_none(rng):
    steps = np.arange(60.0)
    # Rounded by up to a tenth of the step either way, and by up to a third.
    for part, found in ((0.1, 1.0), (0.33, 0.0)):
        off = part * (2.0 * rng.random(len(steps)) - 1.0)
        assert estimate_resolution(np.sort(steps + off), 10_000) == pytest.approx(found, rel=0.01)


def test_a_step_in_gaps_that_are_no_multiples_of_the_smallest_is_found():
    # Gaps of 4, 6 and 9 steps: the smallest is no divisor, its quarter is.
    levels = np.cumsum([0, 4, 6, 9, 6, 9, 4, 6, 9, 6, 4, 9]) * 0.1 + 20.0
    assert estimate_resolution(levels, 10_000) == pytest.approx(0.1)


def test_the_bit_of_a_register_is_found_of_few_levels():
    multiples = np.array([310, 317, 402, 388, 519, 700])
    assert estimate_resolution(np.sort(multiples) / 16.0, 10_000) == pytest.approx(1.0 / 16.0)
    levels = np.sort(np.random.default_rng(2).uniform(10.0, 40.0, 8))
    assert estimate_resolution(levels, 10_000) == 0.0
    # Two gaps that are measured to hundredths are multiples of something by chance.
    assert estimate_resolution(np.array([20.03, 27.51, 39.77]), 10_000) == 0.0
    assert estimate_resolution(np.array([20.0, 21.0]), 10_000) == pytest.approx(1.0)


def test_a_segment_without_readings_has_the_mean_of_the_others():
    values = np.full(300, np.nan)
    values[:100] = 20.0
    values[200:] = 22.0
    read = gather_readings([values], [(0, 100), (100, 200), (200, 300)])
    assert read.parts == (slice(0, 100), slice(100, 101), slice(101, 201))
    assert read.mean[100] == pytest.approx(21.0)
