"""Blocks of readings, the bit of a register, jumps and long stays, one by one."""

import numpy as np
import pytest

from imubench_pipeline.estimators.thermal.register import (
    MAX_BLOCKS,
    Readings,
    estimate_resolution,
    find_cell_stays,
    gather_readings,
    split_at_jumps,
)


def test_each_block_has_count_mean_and_range_of_its_own_readings(rng):
    samples = 2 * MAX_BLOCKS + 500  # blocks of three
    values = rng.integers(0, 40, samples) * 0.5
    values[rng.integers(0, samples, 4_000)] = np.nan
    values[3_000:3_010] = np.nan
    segments = [(2, 9_001), (9_010, samples)]
    read = gather_readings(np.array_split(values, 29), segments)
    edges = [(a, min(a + 3, stop)) for start, stop in segments for a in range(start, stop, 3)]
    assert list(zip(read.begin.tolist(), read.end.tolist(), strict=True)) == edges
    assert read.parts == (slice(0, 3_000), slice(3_000, len(edges)))
    assert read.pieces == read.parts
    blocks = [values[a:b][np.isfinite(values[a:b])] for a, b in edges]
    assert read.count.tolist() == [len(block) for block in blocks]
    for name, of in (("mean", np.mean), ("low", np.min), ("high", np.max)):
        expected = [of(block) if len(block) else np.nan for block in blocks]
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


def stepping(blocks, jump_at, size, samples=4_000, slope=0.0):
    """Readings in blocks of one sample of a level that jumps, and changes before it."""
    mean = 20.0 + slope * np.arange(blocks, dtype=float)
    mean[jump_at:] += size
    ones = np.ones(blocks, dtype=np.int64)
    place = np.arange(blocks, dtype=np.int64) * 10
    return Readings(
        place, place + 10, 10 * ones, mean, mean, mean, 0.5, (slice(0, blocks),),
        (slice(0, blocks),),
    )  # fmt: skip


@pytest.mark.parametrize(("size", "jumps"), [(0.76, 1), (0.74, 0)])
def test_a_jump_is_one_and_a_half_bits_at_least(size, jumps):
    read = stepping(100, 50, size)
    assert len(split_at_jumps(read).pieces) == 1 + jumps


@pytest.mark.parametrize(("slope", "jumps"), [(0.115, 1), (0.13, 0)])
def test_a_jump_is_eight_times_the_changes_around_it(slope, jumps):
    # Over two blocks the level changes by twice the slope.
    read = stepping(100, 50, 2.0 - 2.0 * slope, slope=slope)
    assert len(split_at_jumps(read).pieces) == 1 + jumps


@pytest.mark.parametrize(("at", "jumps"), [(4, 0), (5, 1), (95, 1), (96, 0)])
def test_a_level_between_jumps_has_five_blocks(at, jumps):
    assert len(split_at_jumps(stepping(100, at, 4.0)).pieces) == 1 + jumps


@pytest.mark.parametrize(("away", "jumps"), [(-4, 0), (4, 0), (20, 2)])
def test_what_changes_beside_a_jump_counts_and_what_is_far_away_does_not(away, jumps):
    read = stepping(100, 50, 4.0)
    mean = read.mean.copy()
    mean[50 + away :] += 2.0
    beside = Readings(**{**vars(read), "mean": mean, "low": mean, "high": mean})
    assert len(split_at_jumps(beside).pieces) == 1 + jumps


def test_a_spike_hides_no_jump_after_it():
    read = stepping(200, 150, 4.0)
    mean = read.mean.copy()
    mean[50] += 30.0
    spiked = Readings(**{**vars(read), "mean": mean, "low": mean, "high": mean})
    cut = split_at_jumps(spiked)
    assert [int(cut.begin[piece.start]) for piece in cut.pieces] == [0, 1_500]


def test_sixty_four_jumps_are_told_and_more_are_none():
    for number in (64, 65):
        blocks = 20 * (number + 1)
        read = stepping(blocks, blocks, 0.0)
        mean = 20.0 + 4.0 * ((np.arange(blocks) // 20) % 2)
        many = Readings(**{**vars(read), "mean": mean, "low": mean, "high": mean})
        assert len(split_at_jumps(many).pieces) == (65 if number == 64 else 1)


def test_a_jump_within_a_block_is_placed_by_its_mean():
    read = stepping(100, 50, 4.0)
    mean = read.mean.copy()
    mean[49] = 20.0 + 4.0 * 0.3  # three of ten samples are beyond
    cut = split_at_jumps(Readings(**{**vars(read), "mean": mean, "low": mean, "high": mean}))
    assert [int(cut.begin[piece.start]) for piece in cut.pieces] == [0, 497]
    around = (cut.begin >= 480) & (cut.begin < 510)
    assert cut.begin[around].tolist() == [480, 496, 497, 498]
    assert cut.end[around].tolist() == [496, 497, 498, 510]
    assert cut.count[around].tolist() == [16, 1, 1, 12]
    assert cut.mean[around].tolist() == [20.0, 20.0, 24.0, 24.0]
    assert len(cut.mean) == 101


def test_a_stay_is_long_from_three_crossing_times_on():
    # q t^3 / 3 is the square of a cell of 1 K after ten blocks.
    q = 3.0 / 10.0**3
    for blocks, number in ((30, 1), (29, 0)):
        level = np.concatenate([np.arange(5), np.full(blocks, 9.0), np.arange(20, 25)])
        stays = list(find_cell_stays(np.ones(len(level), dtype=bool), level, 0.5, q * (1.0 + 1e-9)))
        assert len(stays) == number
    outside = np.ones(120, dtype=bool)
    outside[60] = False
    first, last = find_cell_stays(outside, np.zeros(120), 0.5, q)
    assert (first[0], last[0]) == (slice(0, 60), slice(61, 120))
    np.testing.assert_allclose(first[1][-10:], 0.1 * np.arange(10)[::-1] + 0.05)
    np.testing.assert_allclose(last[1][:10], 0.1 * np.arange(10) + 0.05)
    assert first[1][0] == last[1][-1] == 1.0
