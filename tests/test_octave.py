from collections.abc import Iterator

import numpy as np
import pytest

from imubench_pipeline.allan import AllanCurve, allan_variance, cluster_sizes, of_blocks
from imubench_pipeline.allan.octave import (
    MIN_DECIMATED_SAMPLES,
    MIN_STARTS_PER_CLUSTER,
    SECTION_SAMPLES,
    round_octave_sizes,
)
from tests.conftest import few


def standard_error(curve: AllanCurve) -> np.ndarray:
    return np.sqrt(2 / curve.edf) / 2 * curve.deviation


def make(rng: np.random.Generator, kind: str, samples: int) -> np.ndarray:
    white = rng.standard_normal(samples)
    return {
        "white": 9.81 + 1e-3 * white,
        "walk": white.cumsum(),
        "both": white + 0.01 * rng.standard_normal(samples).cumsum(),
    }[kind]


@pytest.mark.parametrize("kind", ["white", "walk", "both"])
@pytest.mark.parametrize(
    "samples", few([300, SECTION_SAMPLES, SECTION_SAMPLES + 6145], [3000, 5 * SECTION_SAMPLES + 17])
)
@pytest.mark.parametrize("loss", [0.0, 0.02])
def test_equal_to_full_overlap_within_a_tenth_of_its_error(rng, kind, samples, loss) -> None:
    log = make(rng, kind, samples)
    log[rng.random(samples) < loss] = np.nan
    sizes = round_octave_sizes(cluster_sizes(samples))
    full = allan_variance(log, 10.0, cluster_sizes=sizes)
    octave = allan_variance(log, 10.0, cluster_sizes=sizes, overlap="octave")
    together = min(len(full.tau), len(octave.tau))
    assert together >= len(full.tau) - 1
    difference = np.abs(octave.deviation - full.deviation[:together])
    assert (difference < 0.1 * standard_error(full)[:together]).all()
    np.testing.assert_allclose(octave.averaged, full.averaged[:together], rtol=2e-3)
    if samples < MIN_DECIMATED_SAMPLES:  # all clusters are used
        np.testing.assert_array_equal(octave.variance, full.variance)


def test_short_clusters_overlap_fully(rng: np.random.Generator) -> None:
    log = 9.81 + rng.standard_normal(200_000)
    sizes = np.arange(1, 2 * MIN_STARTS_PER_CLUSTER)
    full = allan_variance(log, 10.0, cluster_sizes=sizes)
    octave = allan_variance(log, 10.0, cluster_sizes=sizes, overlap="octave")
    np.testing.assert_allclose(octave.variance, full.variance, rtol=1e-9)


@pytest.mark.parametrize("missing", ["none", "everywhere", "in one place"])
def test_blocks_and_threads_do_not_change_a_bit(rng: np.random.Generator, missing: str) -> None:
    log = rng.standard_normal(500_000)
    if missing == "everywhere":
        log[rng.random(500_000) < 0.05] = np.nan
    elif missing == "in one place":
        log[200_000:200_100] = np.nan
    holes = missing != "none"
    whole = of_blocks([log], len(log), 1.0, holes=holes)
    random = np.sort(rng.integers(0, len(log), 200))
    for cuts in (
        [5, 100_000, 100_001, 333_333],
        [SECTION_SAMPLES + 6000],
        [SECTION_SAMPLES + 6144],
        random,
    ):
        for threads in (1, 3):
            parts = np.split(log, cuts)
            again = of_blocks(parts, len(log), 1.0, holes=holes, threads=threads)
            np.testing.assert_array_equal(whole.variance, again.variance)
            np.testing.assert_array_equal(whole.exponent, again.exponent)
            np.testing.assert_array_equal(whole.averaged, again.averaged)


def test_sections_without_a_hole_are_summed_as_in_a_log_without(rng: np.random.Generator) -> None:
    log = 9.81 + 1e-3 * rng.standard_normal(300_000)
    without = of_blocks([log], len(log), 1.0, holes=False)
    flagged = of_blocks([log], len(log), 1.0, holes=True)
    np.testing.assert_allclose(flagged.variance, without.variance, rtol=1e-9)
    np.testing.assert_allclose(flagged.averaged, without.averaged, rtol=1e-12)
    log[150_000] = np.nan
    holed = of_blocks([log], len(log), 1.0, holes=True)
    np.testing.assert_allclose(holed.variance, without.variance, rtol=1e-2)


def test_single_precision_is_the_same_log(rng: np.random.Generator) -> None:
    log = (9.81 + 1e-3 * rng.standard_normal(300_000)).astype(np.float32)
    double = of_blocks([log.astype(np.float64)], len(log), 1.0, holes=False)
    single = of_blocks(np.split(log, [100_000]), len(log), 1.0, holes=False)
    mixed = of_blocks([log[:90_000], log[90_000:].astype(float)], len(log), 1.0, holes=False)
    np.testing.assert_array_equal(single.variance, double.variance)
    np.testing.assert_array_equal(mixed.variance, double.variance)


def test_noise_types_are_those_of_full_overlap(rng: np.random.Generator) -> None:
    log = make(rng, "both", 1 << 20)
    octave = of_blocks([log], len(log), 1.0, holes=False)
    full = allan_variance(log, 1.0, cluster_sizes=octave.cluster_size)
    np.testing.assert_array_equal(octave.exponent[:5], 0)
    assert -2 in octave.exponent
    assert (octave.exponent == full.exponent).mean() > 0.9
    walk = make(rng, "walk", 1 << 17)
    assert (of_blocks([walk], len(walk), 1.0, holes=False).exponent[:20] == -2).all()


def test_what_goes_wrong_in_the_blocks_is_told(rng: np.random.Generator) -> None:
    def blocks() -> Iterator[np.ndarray]:
        yield rng.standard_normal(100_000)
        raise OSError("the disk is gone")

    for threads in (1, 2):
        with pytest.raises(OSError, match="disk is gone"):
            of_blocks(blocks(), 200_000, 1.0, holes=False, threads=threads)


def test_no_difference_spans_segments(rng: np.random.Generator) -> None:
    log = np.concatenate([rng.standard_normal(40_000), 100 + rng.standard_normal(30_000)])
    segments = [(0, 40_000), (40_000, 69_990)]
    full = allan_variance(log, 1.0, segments=segments)
    octave = allan_variance(log, 1.0, segments=segments, overlap="octave")
    for n, variance in zip(octave.cluster_size, octave.variance, strict=True):
        near = np.argmin(np.abs(full.cluster_size - n))
        assert variance * n == pytest.approx(full.variance[near] * full.cluster_size[near], rel=0.5)
    parts = np.split(log, [39_999, 40_001])
    again = of_blocks(parts, len(log), 1.0, holes=False, segments=segments)
    np.testing.assert_array_equal(again.variance, octave.variance)


def test_sizes_are_rounded_to_the_stride_of_their_octave() -> None:
    sizes = cluster_sizes(10_000_000)
    rounded = round_octave_sizes(sizes)
    assert np.isin(rounded, sizes)[rounded < 2 * MIN_STARTS_PER_CLUSTER].all()
    nearest = sizes[np.abs(np.log(sizes[:, None] / rounded)).argmin(axis=0)]
    assert (np.abs(rounded / nearest - 1) <= 0.5 / MIN_STARTS_PER_CLUSTER).all()
    for n in rounded:
        stride = 1 << max(0, int(np.log2(n / MIN_STARTS_PER_CLUSTER)))
        assert n % stride == 0
    np.testing.assert_array_equal(round_octave_sizes(rounded), rounded)


def test_tau_is_that_of_the_size_really_used(rng: np.random.Generator) -> None:
    curve = allan_variance(rng.standard_normal(5000), 50.0, cluster_sizes=[1001], overlap="octave")
    assert curve.cluster_size[0] % 16 == 0
    assert curve.tau[0] == curve.cluster_size[0] / 50.0


def test_wrong_blocks() -> None:
    with pytest.raises(ValueError, match="have 5 samples"):
        of_blocks([np.zeros(5)], 10, 1.0, holes=False)
    with pytest.raises(ValueError, match="end before sample 100000"):
        of_blocks([np.zeros(5)], 100_000, 1.0, holes=False)
    with pytest.raises(ValueError, match="missing or infinite"):
        of_blocks([np.array([0.0, np.nan, 1.0, 2.0])], 4, 1.0, holes=False)
    with pytest.raises(ValueError, match="missing or infinite"):
        of_blocks([np.full(100_000, np.nan)], 100_000, 1.0, holes=False)
    for position in (70_000, 100_002):
        log = np.zeros(100_003)
        log[position] = np.inf
        with pytest.raises(ValueError, match="infinite"):
            of_blocks([log], len(log), 1.0, holes=True)
        log[position] = np.nan
        with pytest.raises(ValueError, match="missing or infinite"):
            of_blocks([log], len(log), 1.0, holes=False)
    with pytest.raises(ValueError, match="end before sample 200000"):
        of_blocks(
            [np.zeros(150_000)],
            200_000,
            1.0,
            holes=False,
            segments=[(0, 100_000), (100_000, 200_000)],
        )
