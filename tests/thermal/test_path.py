from functools import cache

import numpy as np
import pytest

from imubench_pipeline.estimators.thermal.path import (
    MAX_BLOCKS,
    TemperaturePath,
    _Spline,
    estimate_resolution,
    estimate_temperature_path,
    gather_readings,
)
from tests.conftest import few

SAMPLES = 60_000
TIME = np.arange(SAMPLES) / SAMPLES
DAY = 20.0 + 5.0 * np.sin(2.0 * np.pi * 1.3 * TIME + 0.4)
WARM_UP = 30.0 + 6.0 * (1.0 - np.exp(-TIME / 0.1))


def path_of(values, segments=None):
    return estimate_temperature_path(
        [values], segments or [(0, len(values))], np.random.default_rng(5)
    )


def error_of(path, truth):
    return path.value - np.interp(path.sample, np.arange(len(truth)), truth)


@pytest.mark.release
@pytest.mark.parametrize("truth", few([WARM_UP], [(DAY,)]), ids=["warm-up", "day"])
def test_whole_degrees_are_smoothed_within_their_cells(truth):
    path = path_of(np.round(truth))
    nearest = np.round(np.interp(path.sample, np.arange(SAMPLES), truth))
    there = np.interp(path.sample, np.arange(SAMPLES), np.round(truth))
    plain = there == nearest
    assert np.abs(path.value - there)[plain].max() <= 0.5 + 1e-9
    error = error_of(path, truth)
    # Rounding alone has 1 / sqrt(12) = 0.29 K.
    assert error.std() < 0.12
    assert np.mean((error / path.deviation) ** 2) < 2.0
    assert np.abs(error / path.deviation).max() < 4.5


@pytest.mark.parametrize("truth", few([DAY], [(WARM_UP,)]), ids=["day", "warm-up"])
def test_noise_of_the_sensor_dithers_whole_degrees(truth):
    rng = np.random.default_rng(3)
    path = path_of(np.round(truth + 0.1 * rng.standard_normal(SAMPLES)))
    error = error_of(path, truth)
    assert error.std() < 0.05
    assert np.mean((error / path.deviation) ** 2) < 2.0


def test_fine_steps_with_noise_are_averaged():
    rng = np.random.default_rng(4)
    read = np.round((DAY + 0.05 * rng.standard_normal(SAMPLES)) * 340.0) / 340.0
    path = path_of(read)
    error = error_of(path, DAY)
    assert error.std() < 0.05 / np.sqrt(8.0)
    assert 0.5 < np.mean((error / path.deviation) ** 2) < 1.6


def test_a_temperature_without_steps_passes():
    assert np.abs(error_of(path_of(DAY), DAY)).max() < 1e-3


def test_the_noise_of_readings_far_apart_is_found():
    # No two blocks beside each other have a reading.
    rng = np.random.default_rng(8)
    values = np.full(4_000, np.nan)
    values[::10] = DAY[::150] + 0.05 * rng.standard_normal(400)
    path = path_of(values)
    assert np.abs(error_of(path, DAY[::15]))[:-9].max() < 0.1


def test_between_segments_nothing_is_interpolated():
    segments = [(0, 30_000), (30_500, SAMPLES)]
    path = path_of(np.where(TIME < 0.505, 20.0, 30.0), segments)
    values = np.where(path.sample < 30_250, 1.0, 2.0)
    points = np.arange(SAMPLES)
    expected = np.where(points < 30_500, 1.0, 2.0)
    assert np.array_equal(path.at(points, values), expected)
    parts = [path.at(part, values) for part in np.array_split(points, 97)]
    assert np.array_equal(np.concatenate(parts), expected)
    within = path.at(np.array([29_998.5, 30_500.5]), path.sample)
    assert within == pytest.approx([29_995.5, 30_503.5])


@pytest.mark.parametrize("first, block, count", [(0, 3, 10), (0, 30, 1), (7, 1, 5), (103, 7, 2)])
def test_means_over_blocks_are_integrals_of_lines_between_knots(first, block, count):
    parts, segments = (slice(0, 3), slice(3, 5)), ((0, 30), (100, 120))
    knots = np.array([4.5, 14.5, 24.5, 104.5, 114.5])
    path = TemperaturePath(knots, knots, knots[None], parts, segments)
    values = np.random.default_rng(first).standard_normal((2, 5))
    part = parts[first >= 100]
    for row in values:
        for i, mean in enumerate(path.means(first, block, count, row)):
            begin = first - 0.5 + i * block
            inside = knots[(knots > begin) & (knots < begin + block)]
            places = np.concatenate(([begin], inside, [begin + block]))
            heights = np.interp(places, knots[part], row[part])
            assert mean == pytest.approx(np.trapezoid(heights, places) / block, rel=1e-12)


@pytest.mark.release
def test_draws_spread_as_the_deviation_says():
    path = path_of(np.round(DAY))
    spread = np.sqrt(np.mean((path.draws - path.value) ** 2, axis=0) / path.deviation**2)
    assert np.mean(spread) == pytest.approx(1.0, abs=0.2)


@pytest.mark.release
def test_knots_are_bounded_and_blocks_do_not_matter():
    values = np.round(DAY, 1)
    values[100:3000] = np.nan
    segments = [(0, 30_001), (35_000, SAMPLES)]
    whole = gather_readings([values], segments)
    parts = gather_readings(np.array_split(values, 37), segments)
    assert len(whole.mean) <= MAX_BLOCKS + len(segments)
    for name in ("count", "low", "high"):
        assert np.array_equal(getattr(whole, name), getattr(parts, name))
    assert np.allclose(whole.mean, parts.mean, rtol=1e-14)
    path = path_of(values, segments)
    assert np.isfinite(path.value).all()


def test_steps_are_found_through_printed_decimals():
    levels = np.unique(np.round(np.arange(300) / 340.0 + 12.0, 3))
    assert estimate_resolution(levels, 100_000) == pytest.approx(1.0 / 340.0, rel=1e-3)
    assert estimate_resolution(np.sort(np.random.default_rng(1).random(1000)), 1000) == 0.0
    assert estimate_resolution(np.array([21.0]), 1000) == 0.0


def test_no_reading_is_refused():
    with pytest.raises(ValueError, match="temperature"):
        path_of(np.full(100, np.nan))


def test_the_spline_is_the_most_likely_integrated_walk(rng):
    # Against dense matrices, with blocks at unequal distances.
    n, density = 30, 0.02
    centre = np.cumsum(rng.choice([1.0, 1.0, 1.0, 3.0], n))
    variance = rng.uniform(0.1, 2.0, n)
    measured = 20.0 + np.sin(centre / 8.0) + np.sqrt(variance) * rng.standard_normal(n)
    spline = _Spline(centre, measured, variance)
    step = np.diff(centre / np.median(np.diff(centre)))
    bend = np.zeros((n - 2, n))
    for i in range(n - 2):
        bend[i, i : i + 3] = 1 / step[i], -1 / step[i] - 1 / step[i + 1], 1 / step[i + 1]
    walk = np.diag(0.5 * (step[:-1] + step[1:]))
    precision = np.diag(1.0 / variance) + bend.T @ np.linalg.inv(density * walk) @ bend
    expected = np.linalg.solve(precision, measured / variance)
    np.testing.assert_allclose(spline.smooth(density), expected, rtol=1e-9)
    total = density * walk + bend @ np.diag(variance) @ bend.T
    off = bend @ measured
    cost = 0.5 * (np.linalg.slogdet(total)[1] + off @ np.linalg.solve(total, off))
    assert spline.cost(density) == pytest.approx(cost, rel=1e-9)
    noise = np.sqrt(variance) * rng.standard_normal((4_000, n))
    errors = spline.draw_errors(density, noise, rng)
    np.testing.assert_allclose(errors.var(axis=0), np.diag(np.linalg.inv(precision)), rtol=0.15)


def test_few_readings_have_a_path():
    for number in (1, 2, 3):
        path = path_of(np.arange(20.0, 20.0 + number))
        assert path.value == pytest.approx(np.arange(20.0, 20.0 + number), abs=1e-3)


@pytest.mark.parametrize("step", [0.5, 2.0])
def test_a_level_between_jumps_is_known_as_its_cell_is_wide(step):
    levels = step * np.array([40.2, 51.3, 33.9])
    truth = np.repeat(levels, 2_000)
    path = path_of(np.round(truth / step) * step)
    middle = (path.sample % 2_000 > 500) & (path.sample % 2_000 < 1_500)
    assert np.abs(error_of(path, truth))[middle].max() <= 0.5 * step
    # A jump makes the walk rough, and the error of a level larger than its rounding error.
    assert 0.8 * step / np.sqrt(12.0) < np.median(path.deviation[middle]) < step


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
