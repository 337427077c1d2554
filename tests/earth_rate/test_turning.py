import math

import numpy as np
import pytest
from scipy.signal import lfilter

from imubench_pipeline.extensions.calibration.experiment import Dwell
from imubench_pipeline.extensions.earth_rate.choice_of_turns import compute_interval_log_density
from imubench_pipeline.extensions.earth_rate.turning import find_turning
from imubench_pipeline.extensions.earth_rate.turns import (
    CLEAR_LOG_LIKELIHOOD,
    Turning,
    average_log_blocks,
    detect_transients,
    estimate_alternation,
    split_at_turns,
)
from imubench_pipeline.noise import NoiseModel
from tests.conftest import few
from tests.earth_rate.runs import DEGREE, EARTH, PAPER, RATE, TURN, bump, turned

EVERY_30 = 30.0 * np.arange(1, 20)
GOOD = NoiseModel(N=PAPER.N / 50.0, B=PAPER.B / 50.0, T_B=PAPER.T_B, K=PAPER.K / 50.0)


def times(found: Turning) -> list[float]:
    return [turn.time - TURN / 2 for turn in found.turns]


def ways(found: Turning) -> set[str]:
    return {turn.found_by for turn in found.turns}


@pytest.mark.parametrize("first", [1, -1])
@pytest.mark.parametrize("model", [None, PAPER])
def test_turns_that_are_sensed_are_found_and_left_out(first: int, model: NoiseModel | None) -> None:
    log = turned(EVERY_30, 600.0, first=first)
    found = find_turning(log, RATE, 30.0, first_sense=first, model=model)
    assert times(found) == pytest.approx(EVERY_30, abs=0.3)
    assert ways(found) == {"transient"} and found.doubts == ()
    assert all(turn.doubts == () for turn in found.turns)
    assert [dwell.sense for dwell in found.dwells] == [first * (-1) ** k for k in range(20)]
    assert all(dwell.doubts == () for dwell in found.dwells)
    first = found.dwells[0]
    begin, end = math.ceil(RATE * first.start), math.ceil(RATE * first.stop)
    assert first.in_samples(RATE) == Dwell(begin, end, first.sense)
    assert [turn.peak for turn in found.turns] == pytest.approx([3.0 * DEGREE] * 19, rel=0.1)
    used = found.senses(len(log), RATE)
    time = np.arange(len(log)) / RATE
    turning = np.any([(time >= s) & (time < s + TURN) for s in EVERY_30], axis=0)
    assert np.all(used[turning] == 0)
    assert np.mean(used[~turning] != 0) > 0.95
    assert abs(found.alternation.value - EARTH) < 4.0 * found.alternation.sigma


@pytest.mark.parametrize("first", [1, -1])
def test_the_known_rate_does_not_choose_the_first_sense(first: int) -> None:
    log = turned(30.0 * np.arange(1, 40), 1200.0, first=first)
    assumed = find_turning(log, RATE, 30.0)
    assert assumed.ambiguous and assumed.dwells[0].sense == 1
    assert any("assumed" in doubt for doubt in assumed.doubts)
    assert np.sign(assumed.alternation.value) == first


def test_dwells_may_be_unequal() -> None:
    starts = np.cumsum([22.0, 38.0, 27.0, 24.0, 41.0, 33.0, 19.0, 36.0, 30.0, 25.0, 39.0, 21.0])
    found = find_turning(turned(starts, 390.0), RATE, 30.0, first_sense=1)
    assert times(found) == pytest.approx(starts, abs=0.3)


def test_a_missed_turn_makes_a_dwell_twice_as_long() -> None:
    starts = np.delete(EVERY_30, 8)
    found = find_turning(turned(starts, 600.0), RATE, 30.0, first_sense=1)
    assert times(found) == pytest.approx(starts, abs=0.3)
    (long,) = [dwell for dwell in found.dwells if dwell.stop - dwell.start > 45.0]
    assert long.start < 270.0 < long.stop
    assert any("missed" in doubt for doubt in long.doubts)


@pytest.mark.parametrize("pause", [0.5, 2.0, 4.0])
def test_an_overshoot_belongs_to_its_turn(pause: float) -> None:
    log = turned(EVERY_30, 600.0)
    for start in EVERY_30[[3, 9]]:
        bump(log, start + TURN + pause, 0.7, -2.5)
    found = find_turning(log, RATE, 30.0, first_sense=1)
    assert len(found.turns) == 19
    for k in (3, 9):
        assert found.turns[k].start < EVERY_30[k]
        assert found.turns[k].stop > EVERY_30[k] + TURN + pause + 0.7
    assert len({dwell.sense for dwell in found.dwells[10::2]}) == 1


@pytest.mark.parametrize("missed", [False, True])
def test_a_knock_is_no_turn_and_is_left_out(missed: bool) -> None:
    starts = np.delete(EVERY_30, 8) if missed else EVERY_30
    log = turned(starts, 600.0)
    knocks = [43.0, 255.0, 281.0, 500.0]
    lone = round(380.0 * RATE)
    log[lone : lone + 2] += [0.6 * DEGREE, -0.6 * DEGREE]
    for at in knocks:
        bump(log, at, 0.12, 20.0)
    # As long as a turn, but far from the schedule.
    bump(log, 404.0, 1.2, 4.0)
    found = find_turning(log, RATE, 30.0, first_sense=1)
    assert times(found) == pytest.approx(starts, abs=0.3)
    used = found.senses(len(log), RATE)
    for at in [*knocks, 404.5]:
        assert np.all(used[round(at * RATE) : round((at + 0.12) * RATE)] == 0)
    assert np.mean(used != 0) > 0.8
    assert np.all(used[lone : lone + 2] == 0) and np.all(used[lone + 9 : lone + 99] != 0)


def test_samples_may_be_missing() -> None:
    rng = np.random.default_rng(5)
    log = turned(EVERY_30, 600.0)
    log[rng.uniform(size=len(log)) < 0.05] = np.nan
    for at in (30.7, 100.0, 151.0, 331.2):
        log[round(at * RATE) : round((at + 4.0) * RATE)] = np.nan
    found = find_turning(log, RATE, 30.0, first_sense=1)
    assert times(found) == pytest.approx(EVERY_30, abs=0.7)


def test_a_turn_whose_samples_are_all_missing_is_the_schedules() -> None:
    log = turned(EVERY_30, 600.0)
    log[round(205.0 * RATE) : round(245.0 * RATE)] = np.nan
    log[round(320.0 * RATE) : round(520.0 * RATE)] = np.nan
    found = find_turning(log, RATE, 30.0, first_sense=1)
    assert times(found) == pytest.approx(EVERY_30, abs=1.0)
    by = {k for k, turn in enumerate(found.turns) if turn.found_by == "schedule"}
    assert by == {6, 7, 10, 11, 12, 13, 14, 15, 16}
    assert found.dwells[-1].sense == -1


@pytest.mark.parametrize("rate", [4.0, 200.0])
def test_any_rate_will_do(rate: float) -> None:
    found = find_turning(turned(EVERY_30, 600.0, rate=rate), rate, 30.0, first_sense=1)
    assert times(found) == pytest.approx(EVERY_30, abs=0.4)


@pytest.mark.parametrize("low_high", [(-1.0, 1.0), (0.0, 180.0)])
def test_a_position_column_decides(low_high: tuple[float, float]) -> None:
    low, high = low_high
    starts = np.delete(EVERY_30, [4, 5]) + 7.0
    log = turned(starts, 600.0, peak=0.0)
    bump(log, 300.0, 1.5, 5.0)
    time = np.arange(len(log)) / RATE
    angle = np.interp(time, *zip(*_path(starts, high, low), strict=True))
    angle[500:700] = np.nan
    found = find_turning(log, RATE, 30.0, position=angle, first_sense=None if low else 1)
    assert ways(found) == {"column"}
    assert times(found) == pytest.approx(starts, abs=0.3)
    assert found.dwells[0].sense == 1 and not found.ambiguous
    assert np.all(found.senses(len(log), RATE)[round(300.2 * RATE) : round(301.3 * RATE)] == 0)
    if low:
        other = find_turning(log, RATE, 30.0, position=angle, first_sense=-1)
        assert other.dwells[0].sense == 1
        assert any("by the column" in doubt for doubt in other.doubts)


def _path(starts: np.ndarray, high: float, low: float) -> list[tuple[float, float]]:
    places = [high, low]
    path = [(0.0, high)]
    for k, start in enumerate(starts):
        path += [(start, places[k % 2]), (start + TURN, places[(k + 1) % 2])]
    return path


@pytest.mark.parametrize("column", [np.ones(19200), np.full(19200, np.nan)])
def test_a_column_that_says_nothing_is_refused(column: np.ndarray) -> None:
    with pytest.raises(ValueError, match="position"):
        find_turning(turned(EVERY_30, 600.0), RATE, 30.0, position=column)


def test_without_a_transient_the_schedule_decides_and_the_result_says_so() -> None:
    starts = 30.0 * np.arange(1, 120)
    log = turned(starts, 3600.0, peak=0.0)
    found = find_turning(log, RATE, 30.0, turning=TURN, first_sense=1)
    assert times(found) == pytest.approx(starts, abs=1e-9)
    assert ways(found) == {"schedule"}
    assert {dwell.found_by for dwell in found.dwells} == {"schedule"}
    assert all("schedule" in dwell.doubts[0] for dwell in found.dwells)
    assert any("the schedule is used" in doubt for doubt in found.doubts)
    assert found.turns[0].stop - found.turns[0].start == pytest.approx(2.0 * 3.0 + TURN)


@pytest.mark.release
def test_the_level_says_when_the_schedule_began_where_it_alternates_clearly() -> None:
    starts = 30.0 * np.arange(1, 240) + 6.0
    log = turned(starts, 7200.0, peak=0.0)
    found = find_turning(log, RATE, 30.0, turning=TURN, first_sense=1)
    assert ways(found) == {"step"}
    assert times(found) == pytest.approx(starts, abs=1.5)
    given = find_turning(log, RATE, 30.0, start=6.0, turning=TURN, first_sense=1)
    assert ways(given) == {"schedule"}


def test_a_good_gyro_shows_the_steps_alone() -> None:
    starts = np.delete(EVERY_30 + 2.0 * np.sin(EVERY_30), 6)
    found = find_turning(turned(starts, 600.0, peak=0.0, noise=GOOD), RATE, 30.0, first_sense=1)
    assert ways(found) == {"step"}
    assert times(found) == pytest.approx(starts, abs=0.5)


def test_turns_among_sensed_ones_that_are_not_seen_are_filled_in() -> None:
    log = turned(EVERY_30, 600.0, peak=0.0)
    for k, start in enumerate(EVERY_30):
        bump(log, start, TURN, 0.0 if k in (0, 5, 12, 18) else 0.11)
    found = find_turning(log, RATE, 30.0, first_sense=1)
    assert times(found) == pytest.approx(EVERY_30, abs=1.0)
    assert found.turns[5].found_by == "schedule"
    assert found.dwells[5].found_by == found.dwells[6].found_by == "schedule"
    assert any("are from the schedule" in doubt for doubt in found.doubts)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_log_that_never_turns_is_refused(seed: int) -> None:
    log = turned([], 1800.0, seed=seed)
    bump(log, 400.0, 0.1, 20.0)
    bump(log, 700.0, 1.0, 3.0)
    with pytest.raises(ValueError, match="nothing shows that the log was turned every 30 s"):
        find_turning(log, RATE, 30.0)
    trusted = find_turning(log, RATE, 30.0, trust_schedule=True)
    assert len(trusted.dwells) == 60


@pytest.mark.parametrize("number", few([30], [100]))
def test_hardly_a_log_at_rest_alternates_with_the_schedule(number: int) -> None:
    noise, taken = NoiseModel(N=PAPER.N), []
    for seed in range(number):
        log = turned([], 600.0, noise=noise, rate=8.0, seed=seed)
        try:
            taken.append(find_turning(log, 8.0, 30.0, first_sense=1))
        except ValueError as error:
            assert "standard errors" in str(error)
    assert len(taken) <= 1
    assert all(abs(found.alternation.z) > 2.8 for found in taken)


@pytest.mark.parametrize("duration", [59.0, 20.0, 0.0])
def test_a_log_shorter_than_two_dwells_is_refused(duration: float) -> None:
    with pytest.raises(ValueError, match="less than two dwells of 30 s"):
        find_turning(np.zeros(round(duration * RATE)), RATE, 30.0)


def test_two_dwells_are_enough() -> None:
    found = find_turning(turned([30.0], 60.0), RATE, 30.0, first_sense=-1)
    assert [dwell.sense for dwell in found.dwells] == [-1, 1]


@pytest.mark.parametrize("log", [np.zeros(6400), np.full(6400, np.nan)])
def test_a_dead_log_is_refused(log: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"all samples of the log are equal|too few"):
        find_turning(log, RATE, 30.0)


@pytest.mark.parametrize("declared", [45.0, 60.0, 90.0])
def test_turns_at_a_quicker_pace_than_declared_are_taken(declared: float) -> None:
    found = find_turning(turned(EVERY_30, 600.0), RATE, declared, first_sense=1)
    assert times(found) == pytest.approx(EVERY_30, abs=0.3)
    assert found.knocks == ()
    assert f"the usual dwell is 30.0 s, not {declared:g} s" in found.doubts


def test_handling_that_keeps_no_pace_makes_no_dwell_shorter() -> None:
    starts = 60.0 * np.arange(1, 20)
    log = turned(starts, 1200.0)
    for start, after in zip(starts[:-1], np.tile([15.0, 31.0, 44.0], 6), strict=True):
        bump(log, start + after, TURN, 3.0)
    found = find_turning(log, RATE, 60.0, first_sense=1)
    assert not [doubt for doubt in found.doubts if "usual dwell" in doubt]


def test_handling_at_the_ends_is_no_turn() -> None:
    log = turned(EVERY_30, 600.0)
    bump(log, 0.5, 2.0, 6.0)
    bump(log, 597.0, 2.0, 6.0)
    found = find_turning(log, RATE, 30.0, first_sense=1)
    assert times(found) == pytest.approx(EVERY_30, abs=0.3)
    assert found.dwells[0].start > 2.5 and found.dwells[-1].stop < 597.0
    assert any("handling at the ends" in doubt for doubt in found.doubts)


def test_a_knock_at_an_end_is_left_out_within_the_log() -> None:
    log = turned(EVERY_30, 600.0)
    bump(log, 0.0, 0.5, 6.0)
    bump(log, 599.5, 0.5, 6.0)
    found = find_turning(log, RATE, 30.0, first_sense=1)
    assert found.knocks[0][0] == 0.0 and found.knocks[-1][1] == 600.0


def test_noise_has_no_handling_at_the_ends() -> None:
    noise = NoiseModel(N=PAPER.N)
    for seed in range(60):
        log = turned([], 300.0, noise=noise, seed=seed)
        events = detect_transients(average_log_blocks(log, RATE, 30.0, noise), log, RATE)
        assert not [event for event in events if event.likelihood > CLEAR_LOG_LIKELIHOOD], seed


def test_noise_that_is_not_the_models_is_a_doubt() -> None:
    model = NoiseModel(N=10.0 * PAPER.N)
    found = find_turning(turned(EVERY_30, 600.0), RATE, 30.0, first_sense=1, model=model)
    assert len(found.turns) == 19
    assert any("noise of the log" in doubt for doubt in found.doubts)


@pytest.mark.release
def test_an_odd_number_of_turns_too_many_is_a_doubt() -> None:
    starts = 20.0 * np.arange(1, 200)
    log = turned(np.delete(starts, 100), 4000.0, peak=3.0, noise=GOOD)
    bump(log, starts[100], TURN, 3.0)
    found = find_turning(log, RATE, 20.0, first_sense=1)
    assert len(found.turns) == 199
    (doubt,) = [doubt for doubt in found.doubts if "the other way" in doubt]
    assert "from 202" in doubt or "from 204" in doubt


def test_noise_alone_has_hardly_a_transient() -> None:
    log = turned([], 7200.0)
    assert len(detect_transients(average_log_blocks(log, RATE, 30.0), log, RATE)) < 25
    slow = lfilter([1.0], [1.0, -0.9], np.random.default_rng(1).standard_normal(len(log)))
    found = detect_transients(average_log_blocks(slow, RATE, 30.0), slow, RATE)
    assert sum(event.likelihood > CLEAR_LOG_LIKELIHOOD for event in found) < 15
    assert max(event.likelihood for event in found) < 2.0 * CLEAR_LOG_LIKELIHOOD


def test_the_density_of_intervals_is_one_in_all() -> None:
    interval = np.arange(0.0, 3000.0, 0.01)
    density = np.exp(compute_interval_log_density(interval, 30.0, 3.0))
    assert density.sum() * 0.01 == pytest.approx(1.0 - 0.07 + 0.07 / (1.0 - 0.35), rel=0.02)


def test_hundreds_of_dwells_without_a_turn_are_none() -> None:
    with np.errstate(divide="raise"):
        assert compute_interval_log_density(np.array([10.0, 9000.0]), 10.0, 2.0)[1] == -math.inf


def test_the_alternation_is_that_of_the_level() -> None:
    log = turned(EVERY_30, 600.0, peak=0.0, noise=NoiseModel(N=1e-8))
    log += 1e-6 * np.arange(len(log)) / RATE
    found = estimate_alternation(
        average_log_blocks(log, RATE, 30.0), split_at_turns(EVERY_30 + TURN / 2, 2.0, 600.0)
    )
    assert found.value == pytest.approx(EARTH, rel=1e-3)


def test_dwells_without_samples_leave_the_alternation_no_surer() -> None:
    rng = np.random.default_rng(15)
    stretches = split_at_turns(EVERY_30[:9], 0.0, 300.0)
    z = []
    for _ in range(200):
        log = rng.standard_normal(2400)
        log[8 * 90 :] = np.nan  # three of ten dwells are left
        z.append(estimate_alternation(average_log_blocks(log, 8.0, 30.0), stretches).z)
    assert np.std(z) == pytest.approx(1.0, abs=0.2)
