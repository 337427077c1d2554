from collections.abc import Callable

import numpy as np
import pytest

from imubench_pipeline.readers import RecordingError
from imubench_pipeline.recordings.timebase import (
    TimeBase,
    assume_stated_rate,
    fit_time_base,
    locate_samples,
)
from imubench_pipeline.settings.quality import QualitySettings
from imubench_pipeline.words.numbers import number_text

SETTINGS = QualitySettings()


def found(stamps: np.ndarray, stated: float | None = None) -> tuple[TimeBase, np.ndarray]:
    def blocks():
        yield from np.array_split(stamps, 7)

    base = fit_time_base(blocks, stated, SETTINGS)
    return base, np.concatenate(list(locate_samples(base, blocks, SETTINGS)))


def names(base: TimeBase) -> list[str]:
    return [finding.finding for finding in base.findings]


GRID = np.arange(50_000) / 100.0


def test_uniform_stamps() -> None:
    base, points = found(GRID + 7.0)
    assert base.uniform and base.stamped and base.missing == 0
    assert base.rate == pytest.approx(100.0, rel=1e-12)
    assert base.segments == ((0, 50_000),)
    np.testing.assert_array_equal(points, np.arange(50_000))
    assert base.findings == ()


@pytest.mark.parametrize("jitter", [0.01, 0.1, 0.25])
def test_small_jitter_stays_on_the_grid(rng: np.random.Generator, jitter: float) -> None:
    base, points = found(GRID + rng.uniform(-jitter, jitter, len(GRID)) / 100.0)
    assert base.uniform
    assert base.rate == pytest.approx(100.0, rel=2 * jitter / len(GRID))
    np.testing.assert_array_equal(points, np.arange(50_000))


@pytest.mark.parametrize("rate", [512.0, 64.0, 333.3, 700.0, 800.0, 833.0, 900.0])
def test_stamps_rounded_to_milliseconds(rate: float) -> None:
    base, _ = found(np.round(np.arange(100_000) / rate, 3))
    assert base.uniform, names(base)
    assert base.rate == pytest.approx(rate, rel=5e-6)


@pytest.mark.parametrize("every", [3, 5, 10])
def test_coarse_stamps_are_reported_unless_a_rate_is_stated(every: int) -> None:
    stamps = np.delete(GRID, np.s_[every::every])
    base, _ = found(stamps)
    assert "coarse_stamps" in names(base)
    base, points = found(stamps, 100.0)
    assert "coarse_stamps" not in names(base)
    assert base.rate == pytest.approx(100.0, rel=1e-9)
    np.testing.assert_array_equal(points, np.round(stamps * 100.0))
    rate = 100.0 * (every - 1) / every
    rounded = np.floor(np.arange(20_000) / rate * 100.0) / 100.0
    assert "coarse_stamps" in names(found(rounded)[0])
    base, _ = found(rounded, rate)
    assert "coarse_stamps" not in names(base)
    assert base.rate == pytest.approx(rate, rel=1e-4)


def test_stamps_in_single_precision_far_from_zero() -> None:
    base, _ = found((1e5 + GRID).astype(np.float32).astype(np.float64))
    assert base.missing == 0
    assert base.rate == pytest.approx(100.0, rel=1e-4)


@pytest.mark.parametrize("spread", [0.2, 0.3, 0.5, 2.0])
def test_strong_jitter_gives_up_the_grid_and_nothing_else(
    rng: np.random.Generator, spread: float
) -> None:
    base, _ = found(GRID + spread / 100.0 * rng.standard_normal(len(GRID)))
    assert base.missing == 0 and len(base.segments) == 1
    assert base.rate == pytest.approx(100.0, rel=1e-4)


def test_losses_with_jitter(rng: np.random.Generator) -> None:
    kept = rng.random(len(GRID)) > 0.1
    kept[[0, -1]] = True
    _, points = found((GRID + 1e-3 * rng.uniform(-1, 1, len(GRID)))[kept])
    np.testing.assert_array_equal(points, np.flatnonzero(kept))


@pytest.mark.parametrize("spread", [0.1, 0.15])
def test_no_sample_is_lost_to_jitter(rng: np.random.Generator, spread: float) -> None:
    base, points = found(GRID + spread / 100.0 * rng.standard_normal(len(GRID)))
    np.testing.assert_array_equal(points, np.arange(len(GRID)))
    assert base.uniform


@pytest.mark.parametrize("rate", [256.0, 400.0, 512.0])
@pytest.mark.parametrize("loss", [0.01, 0.05])
def test_losses_with_stamps_rounded(rng: np.random.Generator, rate: float, loss: float) -> None:
    kept = rng.random(100_000) > loss
    kept[[0, -1]] = True
    base, points = found(np.round(np.flatnonzero(kept) / rate, 3))
    assert base.rate == pytest.approx(rate, rel=1e-5)
    assert base.missing == pytest.approx((~kept).sum(), abs=3)
    assert np.mean(points[points >= 0] != np.flatnonzero(kept)[points >= 0]) < 0.001


@pytest.mark.parametrize("rate", [50.0, 100.0, 400.0])
def test_the_rate_of_samples_that_share_stamps(rate: float) -> None:
    base, _ = found(np.floor(np.arange(20_000) / rate))
    assert len(base.segments) == 1
    assert base.rate == pytest.approx(rate, rel=1e-9)
    packets, _ = found(np.repeat(np.arange(200) * 1.5, 150))
    assert packets.rate == pytest.approx(100.0)
    assert len(packets.segments) == 1


@pytest.mark.parametrize("repeated", [0.005, 0.02, 0.05])
def test_repeated_records_are_no_samples(rng: np.random.Generator, repeated: float) -> None:
    twice = 1 + (rng.random(len(GRID)) < repeated)
    base, points = found(np.repeat(GRID, twice))
    assert base.rate == pytest.approx(100.0)
    assert (points == -1).sum() == (twice == 2).sum()


@pytest.mark.parametrize("length", [100, 5000])
def test_stamps_missing_at_an_end_do_not_bias_the_rate(length: int) -> None:
    for missing in (slice(None, length), slice(-length, None)):
        stamps = GRID.copy()
        stamps[missing] = np.nan
        base, _ = found(stamps)
        assert base.rate == pytest.approx(100.0)


def test_a_step_of_the_rate_is_followed() -> None:
    stamps = np.concatenate([GRID, GRID[-1] + 0.0101 * np.arange(1, 20_001)])
    base, points = found(stamps)
    assert base.uniform and points[-1] == len(stamps) - 1


def test_swapped_neighbours_are_counted_and_divide_nothing() -> None:
    stamps = GRID.copy()
    stamps[1000:1002] = stamps[[1001, 1000]]
    base, points = found(stamps)
    assert len(base.segments) == 1
    assert (points == -1).sum() == 1
    assert base.missing == 1 and base.grid == len(GRID)


def test_one_stamp_astray_divides_nothing() -> None:
    stamps = GRID.copy()
    stamps[1000] += 50.0
    stamps[2000] -= 50.0
    base, points = found(stamps)
    assert len(base.segments) == 1
    np.testing.assert_array_equal(points, np.arange(len(GRID)))
    assert names(base) == ["missing_stamps"]


def test_missing_stamps_are_consecutive() -> None:
    stamps = GRID.copy()
    stamps[[5, 700, 701]] = np.nan
    base, points = found(stamps)
    np.testing.assert_array_equal(points, np.arange(len(GRID)))
    assert names(base) == ["missing_stamps"]


def test_a_rate_that_drifts_is_followed() -> None:
    base, points = found(GRID * (1 + 2e-5 * GRID / GRID[-1]))
    assert base.uniform
    assert points[-1] == 49_999


@pytest.mark.parametrize("loss", [0.001, 0.01, 0.1])
def test_random_losses_are_holes(rng: np.random.Generator, loss: float) -> None:
    kept = rng.random(len(GRID)) >= loss
    kept[[0, -1]] = True
    base, points = found(GRID[kept])
    assert not base.uniform
    assert base.missing == (~kept).sum()
    assert len(base.segments) == 1
    np.testing.assert_array_equal(points, np.flatnonzero(kept))
    assert names(base) == ["missing_samples"]


@pytest.mark.parametrize("length", [1, 100, 20_000])
def test_one_hole_of_any_length_is_placed(length: int) -> None:
    kept = np.ones(len(GRID), dtype=bool)
    kept[10_000 : 10_000 + length] = False
    base, points = found(GRID[kept])
    np.testing.assert_array_equal(points, np.flatnonzero(kept))
    finding = base.findings[0]
    assert finding.value == length
    assert (finding.start, finding.end) == pytest.approx((100.0, 100.0 + length / 100.0))


def test_the_longest_of_many_holes_is_placed(rng: np.random.Generator) -> None:
    kept = rng.random(len(GRID)) >= 0.01
    kept[[0, -1]] = True
    kept[31_000:31_400] = False
    base, _ = found(GRID[kept])
    (finding,) = base.findings
    first = 1 + int(np.flatnonzero(kept[:31_000])[-1])
    last = 31_400 + int(np.flatnonzero(kept[31_400:])[0])
    assert (finding.start, finding.end) == pytest.approx((first / 100.0, last / 100.0))
    assert f"the longest {number_text((last - first) / 100.0, 3)} s, from 3" in finding.detail


def test_a_gap_beyond_the_longest_hole_divides() -> None:
    stamps = np.concatenate([GRID, GRID + 5000.0])
    base, points = found(stamps)
    assert base.segments == ((0, 50_000), (50_000, 100_000))
    assert base.missing == 0
    assert base.rate == pytest.approx(100.0)
    np.testing.assert_array_equal(points, np.arange(100_000))
    assert names(base) == ["segments"]
    (finding,) = base.findings
    assert (finding.start, finding.end) == pytest.approx((500.0, 500.0))
    assert "once, by 4500 s forward, after 500 s of samples" in finding.detail


def test_a_restarted_clock_divides() -> None:
    base, _ = found(np.concatenate([GRID, GRID[:20_000]]))
    assert base.segments == ((0, 50_000), (50_000, 70_000))
    assert "once, by 499.99 s backwards, after 500 s" in base.findings[0].detail


def test_the_longest_pause_of_jittered_stamps_is_placed(rng: np.random.Generator) -> None:
    stamps = GRID + 0.02 * rng.standard_normal(len(GRID))
    stamps[20_000:] += 40.0
    stamps[35_000:] += 300.0
    base, _ = found(stamps)
    (jittered, segments) = base.findings
    assert (jittered.finding, segments.finding) == ("jittered_stamps", "segments")
    assert segments.start == pytest.approx(350.0, abs=0.1)
    assert "2 times, by up to 299.94 s forward, after 350" in segments.detail
    assert jittered.value < 0.2 and 0.0 <= (jittered.start or 0.0) <= 500.0


def test_repeated_stamps_are_left_out_and_counted() -> None:
    stamps = np.insert(GRID, [100, 5000], GRID[[99, 4999]])
    base, points = found(stamps)
    assert (points == -1).sum() == 2
    np.testing.assert_array_equal(points[points >= 0], np.arange(50_000))
    assert names(base) == ["repeated_stamps"]


def test_stamps_at_arrival_give_the_mean_rate(rng: np.random.Generator) -> None:
    # ten samples at a time, 2 ms apart, when the host gets round to it
    bursts = np.repeat(np.arange(5000) * 0.1, 10) + np.tile(np.arange(10) * 2e-3, 5000)
    base, points = found(bursts + rng.uniform(0, 1e-3, len(bursts)))
    assert not base.stamped and not base.uniform
    assert base.rate == pytest.approx(100.0, rel=1e-3)
    np.testing.assert_array_equal(points, np.arange(50_000))
    assert names(base) == ["jittered_stamps"]
    assert base.findings[0].severity == "warning"


def test_whole_seconds_shared_by_many_samples() -> None:
    base, _ = found(np.floor(GRID))
    assert not base.stamped
    assert base.rate == pytest.approx(100.0, rel=0.003)


def test_a_rate_that_contradicts_the_stamps_is_a_finding() -> None:
    base, _ = found(GRID, stated=200.0)
    assert base.rate == pytest.approx(100.0)
    assert names(base) == ["rate_contradicts_stamps"]
    assert names(found(GRID, stated=100.5)[0]) == []


@pytest.mark.parametrize("factor", [1e-6, 1e-3, 1e3])
def test_a_wrong_unit_of_time_is_told(factor: float) -> None:
    with pytest.raises(
        RecordingError, match="'unit' of 'time' in the sensor file is probably wrong"
    ):
        found(GRID * factor, stated=100.0)


def test_stamps_that_do_not_advance() -> None:
    with pytest.raises(RecordingError, match="do not advance"):
        found(np.zeros(100))


def test_no_stamps() -> None:
    base = assume_stated_rate(10, 5.0)
    assert base.uniform and base.segments == ((0, 10),) and base.source == "stated"


@pytest.mark.parametrize("jittered", [False, True])
def test_ten_thousand_segments_are_taken_and_no_more(
    rng: np.random.Generator, jittered: bool
) -> None:
    steps = rng.uniform(0.001, 0.02, 50_005) if jittered else np.full(50_005, 0.01)
    steps[5::10], steps[10::10] = 4000.0, -4000.0
    clock = np.cumsum(steps)
    base, _ = found(clock[:-5])
    assert len(base.segments) == 10_000
    assert ("jittered_stamps" in names(base)) == jittered
    with pytest.raises(RecordingError, match="10001 segments; expected at most 10000"):
        found(clock)


@pytest.mark.parametrize("rate", [10.0, 50.0, 100.0, 200.0, 1000.0])
@pytest.mark.parametrize("length", [20.0, 60.0, 600.0])
@pytest.mark.parametrize("step", [-1.0, -1.5, -3600.0, -604_800.0, 3600.1])
def test_a_step_of_the_clock_divides_and_leaves_the_rate(
    rate: float, length: float, step: float
) -> None:
    stamps = np.arange(round(rate * length)) / rate
    middle = len(stamps) // 2
    stamps[middle:] += step
    for written in (stamps, np.round(stamps, 3)):
        base, points = found(written)
        assert base.rate == pytest.approx(rate, rel=2e-5)
        assert names(base) == ["segments"]
        assert base.segments == ((0, middle), (middle, len(stamps)))
        np.testing.assert_array_equal(points, np.arange(len(stamps)))


def test_several_steps_of_the_clock_leave_the_rate() -> None:
    stamps = np.arange(4000) / 100.0
    for begin in (1000, 2000, 3000):
        stamps[begin:] -= 1.0
    base, _ = found(stamps)
    assert base.rate == pytest.approx(100.0, rel=1e-9)
    assert [start for start, _ in base.segments] == [0, 1000, 2000, 3000]
    stamps[1000:] += 2.0  # a second forward looks like a hole
    base, _ = found(stamps)
    assert base.rate == pytest.approx(100.0, rel=1e-9)
    assert (base.missing, len(base.segments)) == (100, 3)


@pytest.mark.parametrize("step", [-0.05, -0.3])
def test_a_short_step_back_leaves_the_rate_and_is_said(step: float) -> None:
    stamps = np.arange(2000) / 100.0
    stamps[1000:] += step
    base, _ = found(stamps)
    assert base.rate == pytest.approx(100.0, rel=1e-9)
    assert base.repeated == round(-100 * step)
    assert "or the clock was set back" in base.findings[0].detail


def test_stamps_that_scatter_are_no_clock_that_is_set_back(rng: np.random.Generator) -> None:
    arrival = GRID + rng.uniform(0.0, 0.9, len(GRID))
    base, _ = found(arrival)
    assert len(base.segments) == 1
    assert base.rate == pytest.approx(100.0, rel=5e-3)
    late = GRID.copy()
    late[[10_000, 20_000]] -= 0.7
    base, _ = found(late)
    assert base.segments == ((0, 50_000),)
    assert base.rate == pytest.approx(100.0, rel=1e-6)


@pytest.mark.parametrize("rate", [10.0, 33.3, 100.0, 200.0])
@pytest.mark.parametrize("length", [20.0, 600.0])
def test_a_second_that_whole_seconds_count_twice_leaves_the_rate(
    rate: float, length: float
) -> None:
    stamps = np.arange(round(rate * length)) / rate
    stamps[len(stamps) // 2 :] -= 1.0
    base, _ = found(np.floor(stamps + 1e-9))
    assert base.rate == pytest.approx(rate, rel=0.1 / length)
    assert "irregular_stamps" in names(base)


@pytest.mark.parametrize("phase", [0.0, 0.003, 0.00999])
def test_stamps_as_coarse_as_their_interval_lose_little(phase: float) -> None:
    base, _ = found(np.floor((GRID[:6000] + phase) * 100.0) / 100.0)
    assert base.rate == pytest.approx(100.0, rel=2e-4)
    assert base.repeated < 0.005 * 6000


def test_a_clock_that_is_slewed_in_a_short_log_is_said() -> None:
    stamps = GRID[:20_000].copy()
    stamps[10_000:] += 1e-3 * (stamps[10_000:] - stamps[10_000])
    base, _ = found(stamps)
    assert base.uniform and names(base) == ["rate_drifts"]
    assert base.findings[0].value == pytest.approx(1e-3, rel=0.1)


@pytest.mark.parametrize("true", [1030.0, 1100.0, 1125.0, 1190.0])
@pytest.mark.parametrize("rounded", [np.round, np.floor])
def test_a_rate_above_the_resolution_of_the_stamps_loses_no_sample(
    true: float, rounded: Callable[[np.ndarray], np.ndarray]
) -> None:
    stamps = rounded(1000.0 * np.arange(20_000) / true) / 1000.0
    base = fit_time_base(lambda: iter([stamps]), None, QualitySettings())
    assert base.rate == pytest.approx(true, rel=1e-3)
    assert base.samples >= 0.999 * len(stamps)
    assert any(found.severity == "warning" for found in base.findings)


def test_records_written_twice_at_regular_distances_are_left_out_where_the_rate_is_stated() -> None:
    stamps = np.sort(np.concatenate([np.arange(8000) / 100.0, np.arange(0, 8000, 8) / 100.0]))
    base = fit_time_base(lambda: iter([stamps]), 100.0, QualitySettings())
    assert base.rate == pytest.approx(100.0) and base.repeated == 1000
