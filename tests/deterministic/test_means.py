"""Block means, the power of fast noise, and its change over a log, from their definitions."""

import numpy as np
import pytest

from imubench_pipeline.estimators.deterministic.means import (
    Means,
    Part,
    Stationarity,
    assess_stationarity,
    average_blocks,
)
from tests.deterministic.logs import Array

RATE = 100.0


def by_block(values: Array, size: int) -> tuple[Array, Array]:
    """Mean and power of differences in each block, one by one."""
    rows = values[: len(values) // size * size].reshape(-1, size)
    mean = np.array([np.mean(row[np.isfinite(row)]) for row in rows])
    steps = [np.diff(row)[np.isfinite(np.diff(row))] for row in rows]
    power = np.array([np.mean(step**2) / 2.0 for step in steps])
    return mean, power


@pytest.mark.parametrize("missing", [False, True])
def test_means_and_powers_are_those_of_each_block(rng, missing: bool) -> None:
    values = 5.0 + np.cumsum(rng.standard_normal(20_007)) + rng.standard_normal(20_007)
    if missing:
        values[rng.integers(0, len(values), 1500)] = np.nan
    means = average_blocks(np.array_split(values, 13), len(values), RATE)
    (part,) = means.parts
    # 20,007 samples in blocks of 10, which are more than 512 and less than 16,384.
    assert (means.block, means.interval, part.start) == (10, 0.1, 0)
    mean, power = by_block(values, 10)
    np.testing.assert_allclose(part.mean, mean, rtol=1e-12)
    np.testing.assert_allclose(part.power, power, rtol=1e-9)


@pytest.mark.parametrize(
    ("samples", "size"), [(100, 1), (1023, 1), (1024, 2), (200_000, 13), (160_000, 10)]
)
def test_blocks_are_smaller_in_a_short_log_and_longer_in_a_long_one(
    samples: int, size: int
) -> None:
    assert average_blocks([np.arange(float(samples))], samples, RATE).block == size


def test_a_block_with_few_samples_has_none_of_its_own(rng) -> None:
    values = rng.standard_normal(10_000)
    values[5_001:5_007] = np.nan  # 4 of 10 are left
    values[6_001:6_006] = np.nan  # 5 of 10
    (part,) = average_blocks([values], len(values), RATE).parts
    assert np.flatnonzero(np.isnan(part.power)).tolist() == [500]
    assert part.mean[600] == pytest.approx(np.nanmean(values[6_000:6_010]))


def test_a_long_hole_divides_a_segment_and_a_short_one_is_bridged(rng) -> None:
    values = np.where(np.arange(10_000) < 8_200, 2.0, 3.0) + 1e-3 * rng.standard_normal(10_000)
    values[3_000:5_010] = np.nan  # 201 blocks of 1000
    values[8_000:8_400] = np.nan  # 40 blocks: 4 s
    means = average_blocks([values], len(values), RATE)
    assert [part.start for part in means.parts] == [0, 5_010]
    assert [len(part.mean) for part in means.parts] == [300, 499]
    assert means.longest is means.parts[1]
    second = means.parts[1]
    assert np.isnan(second.power[299:339]).all()
    # On the line between the means over a quarter of the hole on both sides, with the white noise
    # of a block, whose mean has a tenth of its variance.
    left, right = values[7_900:8_000].mean(), values[8_400:8_500].mean()
    scatter = second.mean[299:339] - left - np.arange(1, 41) / 41.0 * (right - left)
    assert np.std(scatter) == pytest.approx(1e-3 / np.sqrt(10.0), rel=0.3)
    assert abs(np.mean(scatter)) < 3.0 * 1e-3 / np.sqrt(400.0)


def test_a_hole_of_a_fifth_of_a_segment_does_not_divide_it(rng) -> None:
    values = rng.standard_normal(10_000)
    values[3_000:4_990] = np.nan
    assert len(average_blocks([values], len(values), RATE).parts) == 1


def test_parts_of_few_blocks_are_left_out(rng) -> None:
    values = rng.standard_normal(10_000)
    spans = [(0, 630), (630, 1_270), (1_270, 10_000)]
    means = average_blocks([values], len(values), RATE, spans)
    assert [(part.start, len(part.mean)) for part in means.parts] == [(630, 64), (1_270, 873)]


def steady(power: Array, block: int = 10, start: int = 0) -> Stationarity | None:
    part = Part(start, np.zeros(len(power)), power)
    return assess_stationarity(Means(block, RATE, (part,)))


def powers(rng, size: int, growth: float, spread: float = 0.0) -> Array:
    """Of white noise whose N grows by a part over 16 sections of blocks, and varies."""
    place = (np.arange(16) - 7.5) / 16.0
    N = np.exp(np.log1p(growth) * place) * np.exp(spread * np.where(np.arange(16) % 2, 1.0, -1.0))
    chance = rng.chisquare(9, (16, size)) / 9.0
    return (N[:, None] ** 2 * chance / chance.mean(axis=1, keepdims=True)).ravel()


def test_growth_of_n_is_read_off_with_its_error(rng) -> None:
    found = steady(powers(rng, 200, 0.3), start=500)
    assert found is not None
    assert found.trend == pytest.approx(0.3, rel=1e-6)
    assert (found.start, found.end) == pytest.approx((5.0, 5.0 + 3200 * 0.1))
    # Of a block's power the relative variance is 2 / 9; N has half the error of its power, and a
    # slope over 16 places those of their squares.
    place = (np.arange(16) - 7.5) / 16.0
    error = 0.5 * np.sqrt(2.0 / 9.0 / 200 / np.sum(place**2)) * 1.3
    assert found.trend_error == pytest.approx(error, rel=0.1)
    assert found.has_trend


def test_the_error_of_growth_is_that_of_its_scatter(rng) -> None:
    found = [steady(rng.chisquare(9, 3200) / 9.0) for _ in range(200)]
    trends = [one.trend for one in found if one]
    errors = [one.trend_error for one in found if one]
    assert np.std(trends) == pytest.approx(np.mean(errors), rel=0.15)


def test_missing_blocks_do_not_count(rng) -> None:
    power = powers(rng, 200, 0.3)
    place = (np.arange(16) - 7.5) / 16.0
    power[::3] = np.nan
    # What is left of a section has another mean.
    left = np.nanmean(power.reshape(16, 200), axis=1)
    slope = np.polyfit(place, np.log(left), 1)[0]
    found = steady(power)
    assert found is not None
    assert found.trend == pytest.approx(np.expm1(0.5 * slope), rel=1e-9)


def test_a_short_or_constant_log_tells_nothing(rng) -> None:
    power = powers(rng, 16, 0.3)
    assert steady(power) is not None
    assert steady(power[:-1]) is None
    assert steady(power, block=1) is None
    assert steady(power, block=2) is not None
    assert steady(np.zeros(256)) is None
    power[:9] = np.nan
    assert steady(power) is None
    power[8] = 1.0
    assert steady(power) is not None
