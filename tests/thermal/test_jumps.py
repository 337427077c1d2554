import numpy as np
import pytest

from imubench_pipeline.estimators.thermal.path import estimate_temperature_path
from imubench_pipeline.estimators.thermal.register import (
    estimate_resolution,
    gather_readings,
    split_at_jumps,
)

SAMPLES = 120_000
LEVELS = np.array([21.3, 17.8, 33.1, 24.6, 38.9, 12.2])


def stepping(jumps, levels=LEVELS, samples=SAMPLES):
    return levels[np.searchsorted(jumps, np.arange(samples), side="right")]


def path_of(values, segments=None):
    return estimate_temperature_path(
        [values], segments or [(0, len(values))], np.random.default_rng(3)
    )


def jumps_of(read):
    return [int(read.begin[piece.start]) for piece in read.pieces[1:]]


@pytest.mark.parametrize("step", [0.01, 1.0])
def test_the_sample_of_each_jump_is_found(step):
    # On the edge of a block of 15, at its first and last sample, and within it.
    jumps = np.array([15_000, 30_001, 45_014, 70_007, 90_008])
    read = gather_readings([np.round(stepping(jumps) / step) * step], [(0, SAMPLES)])
    cut = split_at_jumps(read)
    assert jumps_of(cut) == jumps.tolist()
    # The blocks still follow each other, and hold as many readings.
    assert np.array_equal(cut.end[:-1], cut.begin[1:])
    assert cut.begin[0] == 0
    assert cut.end[-1] == SAMPLES
    assert cut.count.sum() == pytest.approx(SAMPLES, rel=1e-3)


def test_jumps_belong_to_their_segments():
    segments = [(0, 50_000), (60_000, SAMPLES)]
    truth = stepping(np.array([20_000, 55_000, 80_000]), LEVELS[:4])
    cut = split_at_jumps(gather_readings([truth], segments))
    assert jumps_of(cut) == [20_000, 60_000, 80_000]
    assert [cut.begin[part.start] for part in cut.parts] == [0, 60_000]


@pytest.mark.parametrize("kind", ["day", "warm-up", "chamber", "noise", "spike", "end"])
def test_a_temperature_that_does_not_jump_is_left_as_it_is(kind):
    t = np.arange(SAMPLES) / SAMPLES
    noise = np.random.default_rng(7).standard_normal(SAMPLES)
    truth = {
        "day": 20.0 + 5.0 * np.sin(8.0 * t),
        "warm-up": 30.0 + 6.0 * (1.0 - np.exp(-t / 0.02)),
        # A chamber that needs minutes: a hundredth of the log.
        "chamber": np.where(t < 0.5, 20.0, 40.0 - 20.0 * np.exp(-(t - 0.5) / 0.01)),
        "noise": 20.0 + 3.0 * noise,
        "spike": np.where(np.arange(SAMPLES) == 60_000, 80.0, 20.0 + 0.1 * np.round(t)),
        "end": np.where(np.arange(SAMPLES) < SAMPLES - 20, 20.0, 30.0),
    }[kind]
    read = gather_readings([np.round(truth * 16.0) / 16.0], [(0, SAMPLES)])
    assert split_at_jumps(read) is read


@pytest.mark.release
def test_a_path_jumps_within_a_sample():
    jumps = np.array([20_003, 50_010, 90_000])
    truth = stepping(jumps, LEVELS[:4])
    path = path_of(np.round(truth * 100.0) / 100.0)
    error = path.at(np.arange(SAMPLES), path.value) - truth
    assert np.abs(error).max() < 0.01


@pytest.mark.parametrize("step", [0.5, 2.0])
def test_a_level_between_jumps_is_known_as_its_cell_is_wide(step):
    levels = step * np.array([40.2, 51.3, 33.9])
    read = np.round(stepping(np.array([1_000, 2_000]), levels, 3_000) / step) * step
    path = path_of(read)
    assert path.step == pytest.approx(step)
    assert path.deviation == pytest.approx(np.full(len(path.sample), step / np.sqrt(12.0)))
    off = path.draws - path.value
    assert np.abs(off).max() <= 0.5 * step and np.ptp(off, axis=1).max() < step
    assert off.min() < -0.3 * step and off.max() > 0.3 * step


@pytest.mark.release
def test_a_level_of_whole_degrees_may_lie_anywhere_in_its_cell():
    rng = np.random.default_rng(11)
    chances = []
    for _ in range(6):
        levels = np.array([20.0, 31.0, 14.0, 25.0, 38.0, 29.0]) + rng.uniform(-2.0, 2.0, 6)
        truth = stepping(np.arange(20_000, SAMPLES, 20_000), levels)
        path = path_of(np.round(truth))
        middle = path.at(np.arange(10_000, SAMPLES, 20_000), path.value)
        spread = path.at(np.arange(10_000, SAMPLES, 20_000), path.deviation)
        assert spread == pytest.approx(np.full(6, 1.0 / np.sqrt(12.0)))
        chances.append((middle - levels) / spread)
        drawn = np.array([path.at(np.array([10_000.0]), draw)[0] for draw in path.draws])
        assert np.all(np.abs(drawn - middle[0]) <= 0.5)
        assert drawn.std() > 0.15
    assert np.std(chances) == pytest.approx(1.0, abs=0.3)


def test_the_bit_of_a_register_is_found_of_few_levels():
    multiples = np.array([310, 317, 402, 388, 519, 700])
    assert estimate_resolution(np.sort(multiples) / 16.0, 10_000) == pytest.approx(1.0 / 16.0)
    levels = np.sort(np.random.default_rng(2).uniform(10.0, 40.0, 8))
    assert estimate_resolution(levels, 10_000) == 0.0
    # Two gaps that are measured to hundredths are multiples of something by chance.
    assert estimate_resolution(np.array([20.03, 27.51, 39.77]), 10_000) == 0.0
    assert estimate_resolution(np.array([20.0, 21.0]), 10_000) == pytest.approx(1.0)


@pytest.mark.release
def test_means_over_blocks_are_those_of_the_samples():
    jumps = np.array([20_003, 70_010])
    path = path_of(np.round(stepping(jumps, LEVELS[:3]) * 100.0) / 100.0)
    samples = path.at(np.arange(SAMPLES), path.value)
    means = path.means(7, 64, 1_800, path.value)
    assert means == pytest.approx(
        samples[7 : 7 + 64 * 1_800].reshape(-1, 64).mean(axis=1), abs=2e-4
    )
