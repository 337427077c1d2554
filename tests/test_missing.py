import numpy as np
import pytest
from scipy.linalg import solveh_banded

from imubench_pipeline.estimators.missing import (
    BLOCK_SAMPLES,
    BlockMeans,
    average_blocks,
    draw_slow_part,
    fill_missing,
    split_at_gaps,
)
from imubench_pipeline.estimators.spectrum import compute_spectra
from imubench_pipeline.estimators.whittle import Shapes
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate

RATE = 50.0
MODEL = NoiseModel(N=1e-3, B=1.5e-3, T_B=30.0, K=3e-4)
VARIANCE = np.log(2) / (np.pi * 0.4365**2)
"""Of a Gauss-Markov process of B = 1."""


def complete(
    log: np.ndarray, model: NoiseModel, rng: np.random.Generator, segments=None
) -> np.ndarray:
    spans = segments or ((0, len(log)),)
    means = average_blocks([log], spans)
    path = draw_slow_part(means, split_at_gaps(means, spans), model, RATE, rng)
    return np.concatenate(list(fill_missing([log], path, model, RATE, rng)))


def of_blocks(mean: np.ndarray, count: np.ndarray) -> BlockMeans:
    begin = np.arange(len(mean)) * BLOCK_SAMPLES
    return BlockMeans(begin, begin + BLOCK_SAMPLES, np.where(count > 0, mean, 0.0), count)


def drawn_at_blocks(means: BlockMeans, parts, model: NoiseModel, rng) -> np.ndarray:
    path = draw_slow_part(means, parts, model, RATE, rng)
    middle = 0.5 * (means.begin + means.end - 1)
    return np.interp(middle, path.sample, path.value)


def singles(samples: int, rng: np.random.Generator) -> np.ndarray:
    return rng.random(samples) < 0.1


def bursts(samples: int, rng: np.random.Generator) -> np.ndarray:
    missing = np.zeros(samples, dtype=bool)
    for start in rng.integers(0, samples - 100, samples // 700):
        missing[start : start + 100] = True
    return missing


def one_long_hole(samples: int, rng: np.random.Generator) -> np.ndarray:
    missing = np.zeros(samples, dtype=bool)
    start = rng.integers(2000, samples - 7000)
    missing[start : start + 5000] = True
    return missing


@pytest.mark.parametrize("lose", [singles, bursts, one_long_hole])
def test_a_filled_log_has_the_spectrum_of_a_complete_one(rng, lose) -> None:
    samples, logs = 24_000, 40
    total, expected = 0.0, 0.0
    for _ in range(logs):
        log = 2.0 + simulate(MODEL, RATE, samples, rng)
        log[lose(samples, rng)] = np.nan
        spectrum = compute_spectra([complete(log, MODEL, rng)], samples, RATE)[0]
        total = total + spectrum.density / logs
    shapes = Shapes(spectrum)
    expected = MODEL.N**2 + MODEL.B**2 * shapes.gauss_markov(30.0)
    expected = expected + MODEL.K**2 * shapes.random_walk()
    wrong = (total / expected - 1) * np.sqrt(logs * spectrum.ordinates / 2)
    assert np.abs(wrong).max() < 4.5
    assert wrong.std() == pytest.approx(1.0, abs=0.25)
    f = spectrum.frequency
    for low, high in ((0.0, 0.01), (0.01, 0.1), (0.1, 1.0), (1.0, 10.0), (10.0, 25.0)):
        chosen = (f > low) & (f <= high)
        nu = spectrum.ordinates[chosen]
        ratio = np.average((total / expected)[chosen], weights=nu)
        assert ratio == pytest.approx(1.0, abs=4 * np.sqrt(2 / logs / nu.sum()))


@pytest.mark.parametrize("lose", [singles, bursts, one_long_hole])
def test_no_sample_that_is_present_is_changed(rng, lose) -> None:
    log = 9.81 + simulate(MODEL, RATE, 20_000, rng)
    missing = lose(len(log), rng)
    log[missing] = np.nan
    before = log.copy()
    result = complete(log, MODEL, rng)
    np.testing.assert_array_equal(result[~missing], log[~missing])
    np.testing.assert_array_equal(log, before)
    assert np.isfinite(result).all()
    assert len(np.unique(result[missing])) == missing.sum()


def test_a_filled_log_does_not_depend_on_how_it_is_cut(rng) -> None:
    log = simulate(MODEL, RATE, 5000, rng)
    log[bursts(5000, rng)] = np.nan
    pieces = np.split(log, np.sort(rng.integers(0, 5000, 30)))
    whole = average_blocks([log], [(0, 5000)])
    cut = average_blocks(pieces, [(0, 5000)])
    np.testing.assert_array_equal(cut.count, whole.count)
    np.testing.assert_allclose(cut.mean, whole.mean, rtol=1e-9)
    path = draw_slow_part(whole, [(0, 5000)], MODEL, RATE, np.random.default_rng(1))
    one = fill_missing([log], path, MODEL, RATE, np.random.default_rng(2))
    other = fill_missing(pieces, path, MODEL, RATE, np.random.default_rng(2))
    np.testing.assert_array_equal(np.concatenate(list(one)), np.concatenate(list(other)))


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_the_unit_of_a_log_does_not_matter(rng, unit: float) -> None:
    mean = 1e-3 * np.cumsum(rng.standard_normal(300))
    count = np.where(rng.random(300) < 0.3, 0, BLOCK_SAMPLES)
    other = NoiseModel(N=unit * 1e-3, B=unit * 1.5e-3, T_B=30.0, K=unit * 3e-4)
    one, scaled = (
        drawn_at_blocks(
            of_blocks(of, count), [(0, 300 * BLOCK_SAMPLES)], model, np.random.default_rng(1)
        )
        for of, model in ((mean, MODEL), (unit * mean, other))
    )
    np.testing.assert_allclose(scaled, unit * one, rtol=1e-6, atol=unit * 1e-9)


def test_block_means_are_those_of_the_samples_present(rng) -> None:
    log = rng.standard_normal(1000)
    log[rng.random(1000) < 0.3] = np.nan
    log[3 * BLOCK_SAMPLES : 5 * BLOCK_SAMPLES] = np.nan
    means = average_blocks([log], [(0, 1000)])
    assert len(means.mean) == 16
    for k in range(16):
        part = log[k * BLOCK_SAMPLES : (k + 1) * BLOCK_SAMPLES]
        assert means.count[k] == np.isfinite(part).sum()
        if means.count[k]:
            assert means.mean[k] == pytest.approx(np.nanmean(part))
    assert (means.mean[3:5] == 0).all()
    assert means.count.sum() == np.isfinite(log).sum()


def test_a_long_hole_divides_and_a_shorter_one_does_not() -> None:
    def parts(hole: int, *segments: tuple[int, int]) -> tuple[tuple[int, int], ...]:
        log = np.zeros(200_000)
        log[64_000 : 64_000 + hole] = np.nan
        spans = segments or ((0, 200_000),)
        return split_at_gaps(average_blocks([log], spans), spans)

    assert parts(60_000) == ((0, 200_000),)
    # A hole of more than 1024 whole blocks; the ends go to the ends of blocks.
    assert parts(1025 * 64) == ((0, 64_000), (64_000 + 1025 * 64, 200_000))
    assert parts(80_010) == ((0, 64_000), (144_000, 200_000))
    # Segments have blocks of their own, are trimmed, and go where they have no sample.
    assert parts(80_000, (10, 70_000), (70_000, 199_990)) == ((10, 64_010), (143_984, 199_990))
    assert parts(80_000, (0, 64_000), (64_100, 140_000), (145_001, 145_003)) == (
        (0, 64_000),
        (145_001, 145_003),
    )
    assert parts(0, (0, 100_001), (100_001, 200_000)) == ((0, 100_001), (100_001, 200_000))


def test_the_path_goes_through_means_without_white_noise(rng) -> None:
    model = NoiseModel(N=1e-9, B=1.0, T_B=30.0, K=0.1)
    mean = 5.0 + np.cumsum(rng.standard_normal(300))
    count = np.full(300, BLOCK_SAMPLES)
    count[100:150] = 0
    means = of_blocks(mean, count)
    path = drawn_at_blocks(means, [(0, 300 * BLOCK_SAMPLES)], model, rng)
    there = count > 0
    np.testing.assert_allclose(path[there], mean[there], atol=1e-6)
    assert np.abs(path[~there] - mean[~there]).max() > 1e-3


def test_a_drawn_path_differs_from_the_truth_as_draws_from_each_other(rng) -> None:
    n, logs, step = 200, 60, BLOCK_SAMPLES / RATE
    model = NoiseModel(N=4e-2, B=6e-2, T_B=12.0, K=8e-3)
    decay = np.exp(-step / 12.0)
    errors, spreads = [], []
    for _ in range(logs):
        slow = model.K * np.sqrt(step) * np.cumsum(rng.standard_normal(n))
        state = np.sqrt(VARIANCE) * model.B * rng.standard_normal()
        for i in range(n):
            slow[i] += state
            drive = np.sqrt(VARIANCE * (1.0 - decay**2)) * model.B
            state = decay * state + drive * rng.standard_normal()
        count = rng.integers(1, BLOCK_SAMPLES + 1, n)
        count[rng.random(n) < 0.2] = 0
        count[90:110] = 0
        white = model.N * np.sqrt(RATE / np.maximum(count, 1))
        means = of_blocks(9.81 + slow + white * rng.standard_normal(n), count)
        one, other = (
            drawn_at_blocks(means, [(0, n * BLOCK_SAMPLES)], model, rng) for _ in range(2)
        )
        errors.append(one - 9.81 - slow)
        spreads.append(one - other)
    # Both in the gap and where samples are present; the smoother is the best for a walk alone.
    for inside in (slice(92, 108), slice(10, 80)):
        ratio = np.mean(np.square(errors)[:, inside]) / np.mean(np.square(spreads)[:, inside])
        assert ratio == pytest.approx(1.0, abs=0.2)


def test_the_path_of_a_walk_has_the_conditional_distribution(rng) -> None:
    # A random walk in white noise: the inverse of its covariance is tridiagonal.
    n, draws, step = 9000, 60, BLOCK_SAMPLES / RATE
    model = NoiseModel(N=5e-2, K=2e-2)
    count = np.full(n, BLOCK_SAMPLES)
    count[4080:4110] = 0
    there = count > 0
    white = model.N**2 * RATE / BLOCK_SAMPLES
    walk = model.K * np.sqrt(step) * np.cumsum(rng.standard_normal(n))
    log = 9.81 + walk + np.sqrt(white) * rng.standard_normal(n)
    inverse = np.zeros((2, n))
    inverse[1] = np.where(there, 1 / white, 0.0) + 2 / (model.K**2 * step)
    inverse[1, [0, -1]] -= 1 / (model.K**2 * step)
    inverse[0, 1:] = -1 / (model.K**2 * step)
    middle = solveh_banded(inverse, np.where(there, log / white, 0.0))
    places = np.r_[0:4, 4070:4120, 5110:5130, 8180:8200, n - 4 : n]
    unit = np.zeros((n, len(places)))
    unit[places, np.arange(len(places))] = 1.0
    spread = solveh_banded(inverse, unit)[places]
    means = of_blocks(log, count)
    paths = np.array(
        [drawn_at_blocks(means, [(0, n * BLOCK_SAMPLES)], model, rng)[places] for _ in range(draws)]
    )
    root = np.linalg.cholesky(spread)
    whitened = np.linalg.solve(root, (paths - middle[places]).T)
    assert np.abs(whitened.mean(axis=1)).max() < 4.5 / np.sqrt(draws)
    assert np.mean(whitened**2) == pytest.approx(1.0, abs=4.5 * np.sqrt(2 / whitened.size))


def test_each_part_has_its_own_level(rng) -> None:
    mean = np.repeat([0.0, 500.0], 200) + rng.standard_normal(400)
    count = np.full(400, BLOCK_SAMPLES)
    count[[3, 150, 250, 390]] = 0
    means = of_blocks(mean, count)
    parts = [(0, 200 * BLOCK_SAMPLES), (200 * BLOCK_SAMPLES, 400 * BLOCK_SAMPLES)]
    path = drawn_at_blocks(means, parts, NoiseModel(N=0.1, B=1.0, T_B=5.0), rng)
    assert np.abs(path[:200]).max() < 8
    assert np.abs(path[200:] - 500).max() < 8


def test_a_model_without_slow_noise_is_filled_with_its_level(rng) -> None:
    N = 1e-2
    log = 3.0 + N * np.sqrt(RATE) * rng.standard_normal(20_000)
    missing = rng.random(len(log)) < 0.2
    log[missing] = np.nan
    drawn = complete(log, NoiseModel(N=N), rng)[missing]
    assert drawn.mean() == pytest.approx(3.0, abs=5 * N * np.sqrt(RATE / len(drawn)))
    assert drawn.std() == pytest.approx(N * np.sqrt(RATE), rel=0.05)


def test_the_ends_of_a_long_hole_stay_at_the_level_of_the_log(rng) -> None:
    log = 9.81 + simulate(MODEL, RATE, 200_000, rng)
    log[50_010:130_030] = np.nan
    parts = split_at_gaps(average_blocks([log], [(0, len(log))]), [(0, len(log))])
    result = complete(log, MODEL, rng)
    for start, stop in parts:
        assert np.abs(result[start:stop] - 9.81).max() < 0.5


@pytest.mark.parametrize("limit", [5000, 78 * BLOCK_SAMPLES])
def test_missing_samples_beside_a_restart_are_filled_from_their_own_side(rng, limit: int) -> None:
    log = simulate(MODEL, RATE, 10_000, rng)
    log[limit:] += 100.0
    log[[limit - 30, limit - 10, limit - 1, limit, limit + 1, limit + 20]] = np.nan
    result = complete(log, MODEL, rng, segments=((0, limit), (limit, 10_000)))
    assert np.abs(result[:limit]).max() < 1
    assert np.abs(result[limit:] - 100).max() < 1


def test_a_ramp_is_followed_through_holes(rng) -> None:
    model = NoiseModel(N=1e-3, R=1e-2)
    log = simulate(model, RATE, 20_000, rng)
    truth = 1e-2 * np.arange(20_000) / RATE
    log[rng.random(20_000) < 0.1] = np.nan
    assert np.abs(complete(log, model, rng) - truth).max() < 0.1


def test_parts_that_touch_have_each_their_own_level(rng) -> None:
    mean = np.where(np.arange(40) < 20, 0.0, 10.0)
    means = of_blocks(mean, np.full(40, BLOCK_SAMPLES))
    edge, end = 20 * BLOCK_SAMPLES, 40 * BLOCK_SAMPLES
    path = draw_slow_part(means, [(0, edge), (edge, end)], NoiseModel(N=1e-6), RATE, rng)
    assert (np.diff(path.sample) > 0.0).all()
    levels = path.at(np.array([0, edge - 1, edge, end - 1]))
    np.testing.assert_allclose(levels, [0.0, 0.0, 10.0, 10.0], atol=1e-4)
