import numpy as np
import pytest
from scipy.special import ndtr

from imubench_pipeline.estimators.thermal.path import (
    TemperaturePath,
    _Evidence,
    estimate_temperature_path,
)
from imubench_pipeline.estimators.thermal.path_kernels import compute_cell_moments
from imubench_pipeline.estimators.thermal.register import (
    MAX_BLOCKS,
    Readings,
    estimate_resolution,
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


@pytest.mark.parametrize(
    "m, v, low, high, noise",
    [
        (0.3, 0.5, 0.0, 1.0, 0.01),
        (-4.0, 0.2, 0.0, 1.0, 0.1),
        (6.0, 1.0, 0.0, 1.0, 1e-4),
    ],
)
def test_moments_in_a_cell_are_those_of_quadrature(m, v, low, high, noise):
    def weight(x):
        spread = np.sqrt(noise)
        there = ndtr((high - x) / spread) - ndtr((low - x) / spread)
        return there * np.exp(-((x - m) ** 2) / (2 * v)) / np.sqrt(2 * np.pi * v)

    # The integrand and all its slopes vanish at the ends: the sum over a grid is exact.
    x = np.linspace(low - 20 * np.sqrt(noise), high + 20 * np.sqrt(noise), 200_001)
    total, first, second = (np.sum(x**k * weight(x)) * (x[1] - x[0]) for k in range(3))
    log_p, mean, variance = compute_cell_moments(m, v, low, high, noise)
    assert log_p == pytest.approx(np.log(total), abs=1e-6)
    assert mean == pytest.approx(first / total, abs=1e-6)
    assert variance == pytest.approx(second / total - (first / total) ** 2, rel=1e-4)


@pytest.mark.release
@pytest.mark.parametrize("truth", few([WARM_UP], [(DAY,)]), ids=["warm-up", "day"])
def test_whole_degrees_are_smoothed_within_their_cells(truth):
    path = path_of(np.round(truth))
    assert path.step == pytest.approx(1.0)
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
    assert path.noise == pytest.approx(0.1, rel=0.4)
    error = error_of(path, truth)
    assert error.std() < 0.05
    assert np.mean((error / path.deviation) ** 2) < 2.0


def test_fine_steps_with_noise_are_averaged():
    rng = np.random.default_rng(4)
    read = np.round((DAY + 0.05 * rng.standard_normal(SAMPLES)) * 340.0) / 340.0
    path = path_of(read)
    assert path.step == pytest.approx(1.0 / 340.0, rel=1e-6)
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
    assert path.noise == pytest.approx(0.05, rel=0.15)
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
    path = TemperaturePath(knots, knots, knots, knots[None], parts, segments, 0.0, 0.0)
    values = np.random.default_rng(first).standard_normal((2, 5))
    part = parts[first >= 100]
    for row, means in zip(values, path.means(first, block, count, values), strict=True):
        for i, mean in enumerate(means):
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
        assert np.array_equal(getattr(whole, name), getattr(parts, name), equal_nan=True)
    assert np.allclose(whole.mean, parts.mean, equal_nan=True, rtol=1e-14)
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


def test_the_evidence_of_means_is_that_of_a_wandering_temperature(rng):
    # Means of ten readings without a register: the marginal normal density of all of them.
    n, level, spread = 40, 20.0, 4.0
    mean = (
        level + np.cumsum(np.cumsum(0.05 * rng.standard_normal(n))) + 0.1 * rng.standard_normal(n)
    )
    place = 10 * np.arange(n)
    whole = (slice(0, n),)
    read = Readings(
        place, place + 10, np.full(n, 10), mean, mean - 1.0, mean + 1.0, 0.0, whole, whole
    )
    evidence = _Evidence(read, level, spread)
    t = np.arange(float(n))
    first, last = np.minimum.outer(t, t), np.maximum.outer(t, t)

    def marginal(q, noise):
        covariance = (
            1e3 * spread**2 * (1.0 + np.outer(t, t)) + q * first**2 * (3 * last - first) / 6
        )
        # A reading has the noise; ten of them, and what is left where there is none.
        covariance += (noise**2 / 10.0 + (1e-6 * spread) ** 2) * np.eye(n)
        off = mean - level
        return -0.5 * (np.linalg.slogdet(covariance)[1] + off @ np.linalg.solve(covariance, off))

    pairs = [(2.5e-3, 0.3), (1e-2, 0.3), (2.5e-3, 0.6), (1e-3, 0.2)]
    found = [evidence.part(whole[0], *pair)[2] for pair in pairs]
    expected = [marginal(*pair) for pair in pairs]
    np.testing.assert_allclose(np.diff(found), np.diff(expected), atol=1e-4)
    np.testing.assert_allclose(evidence.steps(whole[0]), 1.0)
    q, noise, best = evidence.best()
    # The best of all: within what the search is stopped at.
    grid = [
        marginal(a, b) for a in np.geomspace(1e-4, 1e-1, 31) for b in np.geomspace(0.05, 1.5, 31)
    ]
    assert marginal(q, noise) > max(grid) - 0.2
    assert best - found[0] == pytest.approx(marginal(q, noise) - expected[0], abs=1e-3)


def test_a_piece_that_stays_in_a_cell_is_between_jumps(rng):
    n = 12
    place = 10 * np.arange(n)
    level = np.where(place < 60, 20.0, 25.0)
    whole, pieces = (slice(0, n),), (slice(0, 6), slice(6, 12))
    read = Readings(place, place + 10, np.full(n, 10), level, level, level, 1.0, whole, pieces)
    evidence = _Evidence(read, 22.0, 5.0)
    assert [evidence.stays_in_a_cell(piece) for piece in pieces] == [True, True]
    assert not evidence.stays_in_a_cell(whole[0])
    other = np.where(place == 30, 21.0, level)
    moved = Readings(place, place + 10, np.full(n, 10), other, other, other, 1.0, whole, pieces)
    assert [_Evidence(moved, 22.0, 5.0).stays_in_a_cell(piece) for piece in pieces] == [False, True]
    # Of ten readings in a cell the path keeps clear of its edges by the greatest of ten normals.
    greatest = np.median(np.max(rng.standard_normal((20_000, 10)), axis=1))
    half = evidence._compute_half_width(pieces[0], 0.1)
    np.testing.assert_allclose(half, 0.5 - 0.1 * greatest, rtol=0.01)
    np.testing.assert_allclose(evidence._compute_half_width(pieces[0], 10.0), 0.05)
