import allantools
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from imubench_pipeline.allan import AllanCurve, allan_variance, cluster_sizes, of_phase
from imubench_pipeline.allan.phase import count_gaps, integrate


def by_definition(samples: np.ndarray, n: int) -> float:
    """Mean squared difference of adjacent cluster means, every start, written out plainly."""
    means = [samples[i : i + n].mean() for i in range(len(samples) - n + 1)]
    differences = [means[i + n] - means[i] for i in range(len(means) - n)]
    return float(np.mean(np.square(differences)) / 2)


@given(st.integers(0, 2**32 - 1), st.integers(2, 200), st.floats(-10, 10))
def test_agrees_with_its_definition(seed: int, length: int, offset: float) -> None:
    samples = np.random.default_rng(seed).standard_normal(length) + offset
    curve = allan_variance(samples, 10.0, cluster_sizes=np.arange(1, length // 2 + 1))
    expected = [by_definition(samples, n) for n in curve.cluster_size]
    np.testing.assert_allclose(curve.variance, expected, rtol=1e-9)
    np.testing.assert_allclose(curve.tau, curve.cluster_size / 10.0)


@pytest.mark.parametrize("offset", [0.0, 9.81])
def test_agrees_with_allantools(rng: np.random.Generator, offset: float) -> None:
    samples = 1e-3 * rng.standard_normal(200_000) + offset
    curve = allan_variance(samples, 100.0)
    tau, deviation, _, terms = allantools.oadev(
        samples, rate=100.0, data_type="freq", taus=curve.tau
    )
    sizes = np.rint(tau * 100).astype(int)
    chosen = np.isin(curve.cluster_size, sizes)
    assert chosen.sum() == len(sizes) > 40
    np.testing.assert_allclose(curve.deviation[chosen], deviation, rtol=1e-12)
    np.testing.assert_array_equal(terms, len(samples) - 2 * sizes + 1)


@pytest.mark.parametrize("loss", [0.0, 0.01])
def test_gravity_in_single_precision_costs_no_digits(rng, loss: float) -> None:
    samples = (9.81 + 1e-3 * rng.standard_normal(100_000)).astype(np.float32)
    samples[1:][rng.random(99_999) < loss] = np.nan
    exact = samples.astype(np.float64) - float(samples[0])
    np.testing.assert_allclose(
        allan_variance(samples, 100.0).variance, allan_variance(exact, 100.0).variance, rtol=1e-10
    )


def test_a_ramp_is_exact() -> None:
    curve = allan_variance(0.5 * np.arange(10_000) / 100.0, 100.0)
    np.testing.assert_allclose(curve.variance, 0.5**2 * curve.tau**2 / 2, rtol=1e-9)


def test_cores_do_not_change_a_bit(rng: np.random.Generator) -> None:
    samples = rng.standard_normal(300_000)
    for holes in (False, True):
        phase = integrate([samples], len(samples), holes=holes)
        one, two = (of_phase(phase, 1.0, threads=threads) for threads in (1, 2))
        np.testing.assert_array_equal(one.variance, two.variance)


def test_blocks_do_not_matter(rng: np.random.Generator) -> None:
    samples = rng.standard_normal(10_000)
    whole = integrate([samples], 10_000, holes=False)
    parts = integrate(np.split(samples, [3000, 3001, 7777]), 10_000, holes=False)
    np.testing.assert_allclose(
        of_phase(whole, 1.0).variance, of_phase(parts, 1.0).variance, rtol=1e-9
    )


# ------------------------------------------------------------------------- holes and segments


def needed_in_cluster(samples: np.ndarray, n: int) -> float:
    """Nine tenths of what is usual in a cluster of n samples between gaps that are long beside it.

    A gap is short up to the largest 2^k - 1 that is no more than n / 4.
    """
    missing = np.concatenate(([False], ~np.isfinite(samples), [False])).astype(int)
    edges = np.flatnonzero(np.diff(missing))
    gaps = edges[1::2] - edges[::2]
    longest = 2 ** int(np.log2(n // 4 + 1)) - 1
    short = gaps[gaps <= longest].sum()
    return 0.9 * n * (1 - short / (len(samples) - gaps[gaps > longest].sum()))


def by_definition_with_holes(samples: np.ndarray, n: int) -> float:
    """Means of the samples present, where enough are; differences may span holes."""
    length = len(samples)
    means = np.full(length - n + 1, np.nan)
    for i in range(length - n + 1):
        cluster = samples[i : i + n]
        present = np.isfinite(cluster)
        if present.sum() >= needed_in_cluster(samples, n) - 1e-9:
            means[i] = cluster[present].mean()
    differences = means[n:] - means[:-n]
    return float(np.nanmean(differences**2) / 2)


def test_holes_follow_the_rule(rng: np.random.Generator) -> None:
    samples = 9.81 + rng.standard_normal(600)
    samples[rng.random(600) < 0.03] = np.nan
    samples[200:235] = np.nan
    curve = allan_variance(samples, 1.0, cluster_sizes=[1, 2, 5, 10, 20, 40, 100])
    expected = [by_definition_with_holes(samples, n) for n in curve.cluster_size]
    np.testing.assert_allclose(curve.variance, expected, rtol=1e-9)


def test_the_samples_averaged_are_counted(rng: np.random.Generator) -> None:
    samples = rng.standard_normal(50_000)
    assert allan_variance(samples, 1.0, cluster_sizes=[3, 40]).averaged.tolist() == [3.0, 40.0]
    samples[rng.random(50_000) < 0.05] = np.nan
    curve = allan_variance(samples, 1.0, cluster_sizes=[40])
    assert 36.0 < curve.averaged[0] < 40.0
    # white noise of variance 1: the variance of a mean is one over the samples in it
    assert curve.variance[0] == pytest.approx(1 / curve.averaged[0], rel=0.1)


@pytest.mark.parametrize("loss", [0.1, 0.12, 0.3, 0.9])
def test_heavy_losses_end_the_curve_early(rng: np.random.Generator, loss: float) -> None:
    samples = rng.standard_normal(50_000)
    samples[rng.random(50_000) < loss] = np.nan
    curve = allan_variance(samples, 1.0)
    assert np.isfinite(curve.variance).all() and np.isfinite(curve.edf).all()


def test_one_missing_sample_spoils_nothing_after_it(rng: np.random.Generator) -> None:
    samples = rng.standard_normal(50_000)
    whole = allan_variance(samples, 1.0, cluster_sizes=[1, 10, 100])
    samples[3] = np.nan
    holed = allan_variance(samples, 1.0, cluster_sizes=[1, 10, 100])
    np.testing.assert_allclose(holed.variance, whole.variance, rtol=1e-2)


def test_valid_and_nan_mean_the_same(rng: np.random.Generator) -> None:
    samples = rng.standard_normal(5000)
    valid = rng.random(5000) > 0.02
    marked = np.where(valid, samples, np.nan)
    np.testing.assert_array_equal(
        allan_variance(samples, 1.0, valid=valid).variance, allan_variance(marked, 1.0).variance
    )


def test_no_difference_spans_segments(rng: np.random.Generator) -> None:
    first, second = rng.standard_normal(1000), 50.0 + rng.standard_normal(500)
    both = np.concatenate([first, second])
    sizes = [1, 10, 100]
    curve = allan_variance(both, 1.0, cluster_sizes=sizes, segments=[(0, 1000), (1000, 1500)])
    terms = [np.array([1000 - 2 * n + 1, 500 - 2 * n + 1]) for n in sizes]
    apart = [
        np.average([by_definition(first, n), by_definition(second, n)], weights=weight)
        for n, weight in zip(sizes, terms, strict=True)
    ]
    np.testing.assert_allclose(curve.variance, apart, rtol=1e-9)


@pytest.mark.parametrize("loss", [0.0, 0.02])
def test_each_segment_adds_what_it_has(rng: np.random.Generator, loss: float) -> None:
    log = rng.standard_normal(2060)
    log[rng.random(2060) < loss] = np.nan
    sizes = [10, 50, 100]
    first, second, both = (
        allan_variance(log[:stop], 10.0, cluster_sizes=sizes, segments=segments)
        for stop, segments in (
            (1000, None),
            (1060, [(0, 1000), (1000, 1060)]),  # shorter than two clusters of the longer sizes
            (2000, [(0, 1000), (1000, 2000)]),
        )
    )
    for name in ("variance", "edf", "averaged", "share"):
        np.testing.assert_allclose(getattr(second, name)[1:], getattr(first, name)[1:], rtol=1e-12)
    if not loss:
        np.testing.assert_allclose(both.edf, 2 * first.edf, rtol=1e-12)
        np.testing.assert_array_equal(both.share, 1.0)


# --------------------------------------------------------------------------------- grid, errors


def test_the_grid_is_of_whole_clusters() -> None:
    sizes = cluster_sizes(3_600_000, per_decade=10)
    assert sizes[0] == 1
    assert sizes[-1] <= 1_800_000
    assert (np.diff(sizes) > 0).all()
    assert np.abs(np.log10(sizes[20:]) * 10 % 1 - 0.5).min() > 0.4  # whole tenths of a decade
    assert cluster_sizes(900, longest=1 / 9)[-1] == 100
    assert len(cluster_sizes(1)) == 0


def test_only_taus_with_a_difference_are_returned() -> None:
    curve = allan_variance(np.arange(10.0), 1.0, cluster_sizes=[1, 5, 6])
    assert curve.cluster_size.tolist() == [1, 5]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"samples": []}, "size >= 2"),
        ({"samples": [[1.0, 2.0]]}, "one dimension"),
        ({"rate": 0.0}, "frequency above 0"),
        ({"cluster_sizes": [0]}, "whole numbers of 1 or more"),
        ({"overlap": "none"}, "expected 'full'"),
        ({"valid": [True]}, "shape"),
        ({"segments": [(0, 50), (40, 100)]}, "segment"),
        ({"segments": [(0, 101)]}, "segment"),
    ],
)
def test_wrong_arguments(arguments: dict, message: str) -> None:
    given = {"samples": np.arange(100.0), "rate": 1.0} | arguments
    with pytest.raises(ValueError, match=message):
        allan_variance(given.pop("samples"), given.pop("rate"), **given)


def test_blocks_must_be_as_long_as_stated() -> None:
    with pytest.raises(ValueError, match="more samples than"):
        integrate([np.zeros(5)], 4, holes=False)
    with pytest.raises(ValueError, match="have 5 samples"):
        integrate([np.zeros(5)], 6, holes=False)
    with pytest.raises(ValueError, match="missing or infinite"):
        integrate([np.array([0.0, np.nan, 1.0])], 3, holes=False)
    with pytest.raises(ValueError, match="infinite"):
        integrate([np.array([0.0, np.inf, 1.0])], 3, holes=True)


def test_a_curve_without_its_log_is_of_two_of_its_largest_clusters() -> None:
    sizes = np.array([1, 4, 16])
    curve = AllanCurve(sizes / 100.0, sizes, np.ones(3), np.full(3, 9.0))
    assert curve.samples == 32


def test_gaps_are_the_same_however_the_log_is_cut(rng: np.random.Generator) -> None:
    log = np.where(rng.random(5000) < 0.3, np.nan, 1.0)
    log[1000:1700] = np.nan
    whole = count_gaps([log])
    assert whole.missing.sum() == np.isnan(log).sum()
    assert whole.missing[9] >= 700  # 512 to 1023 samples
    parts = count_gaps(np.split(log, [1, 999, 1200, 1201, 4999]))
    assert (parts.missing == whole.missing).all()
    # The long gap does not lower what a cluster of 100 needs; the short ones do.
    assert whole.enough(np.array([100]))[0] == pytest.approx(0.9 * 0.7 * 100, abs=3)
