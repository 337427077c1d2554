import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.experiment import Experiment
from imubench_pipeline.extensions.calibration.kalman import RateFilter
from imubench_pipeline.extensions.earth_rate.bound import (
    choose_block_length,
    compute_cramer_rao_bounds,
    compute_information,
)
from imubench_pipeline.extensions.earth_rate.outlook import Outlook, prediction_rows
from imubench_pipeline.extensions.earth_rate.pairs import by_pairs
from imubench_pipeline.extensions.earth_rate.simulation import PAPER_MODEL, design_paper_run
from imubench_pipeline.navigation.error_budget.gyrocompass import Gyrocompass
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.tables.keys import Key
from tests.earth_rate.brute import MODELS
from tests.earth_rate.test_experiment import experiments

WHITE = NoiseModel(N=PAPER_MODEL.N)
KEY = Key("s", "run", "gyro_x")
LATITUDE = math.radians(-23.3)


@given(
    experiments(),
    st.sampled_from([one for name, one in MODELS.items()]),
    st.sampled_from([0.0, 0.1, math.inf]),
)
@settings(max_examples=60, deadline=None)
def test_nothing_is_better_than_white_noise_alone(experiment, model, bias):
    blocks = experiment.blocks(7)
    seconds = np.cumsum(blocks.count) / blocks.rate
    least = model.N / np.sqrt(seconds) / math.cos(blocks.latitude)
    assert np.all(compute_cramer_rao_bounds(blocks, model, bias) >= least * (1.0 - 1e-9))


def test_white_noise_and_a_known_bias_reach_that():
    blocks = design_paper_run(12.0).blocks(100)
    least = PAPER_MODEL.N / np.sqrt(blocks.time_in_blocks) / math.cos(LATITUDE)
    assert compute_cramer_rao_bounds(blocks, WHITE, 0.0)[-1] == pytest.approx(least, rel=1e-12)
    # As many dwells north as south: the bias does not matter.
    assert compute_cramer_rao_bounds(blocks, WHITE)[-1] == pytest.approx(least, rel=1e-9)


def test_one_position_tells_nothing_without_the_bias():
    blocks = Experiment.regular(dwell=60, turning=0, dwells=1, rate=4, latitude=0).blocks(40)
    assert np.all(np.isinf(compute_cramer_rao_bounds(blocks, PAPER_MODEL)))
    assert compute_cramer_rao_bounds(blocks, PAPER_MODEL, 1e-3)[-1] > 1e-3


def test_no_unbiased_weights_are_better():
    model, blocks = MODELS["N+F+K"], design_paper_run(4.0).blocks(448)
    assert (
        compute_cramer_rao_bounds(blocks, model)[-1]
        < by_pairs(np.zeros((1, len(blocks))), blocks, model).sigma[-1]
    )


@pytest.mark.parametrize("bias", [1e-4, 1.0])
def test_the_filter_reaches_the_bound(bias):
    model = NoiseModel(N=PAPER_MODEL.N, B=2 * PAPER_MODEL.B, K=8 * PAPER_MODEL.K)
    blocks = design_paper_run(10.0).blocks(300)
    found = RateFilter(blocks, model, turn_on_bias=bias).rate_sigma
    np.testing.assert_allclose(
        found[4:], compute_cramer_rao_bounds(blocks, model, bias)[4:], rtol=1e-5
    )


@pytest.mark.release
def test_a_longer_run_is_extrapolated_as_it_is():
    model = NoiseModel(N=PAPER_MODEL.N, B=PAPER_MODEL.B, T_B=238.1, K=10 * PAPER_MODEL.K)
    outlook = Outlook(model, LATITUDE, 2.0, 32.0)
    found = outlook.sigmas_after(28.0, 299)
    blocks = design_paper_run(150.0).blocks(choose_block_length(design_paper_run(150.0), model))
    last = np.flatnonzero(np.diff(blocks.dwell, append=-1))
    np.testing.assert_allclose(found, compute_cramer_rao_bounds(blocks, model)[last][1:], rtol=2e-3)
    assert outlook.run_time(28.0, 299) == pytest.approx(300 * 28 + 299 * 2)


@pytest.mark.parametrize("relative", [0.01, 0.1, 1.0])
def test_the_time_that_white_noise_needs(relative):
    # (N / (relative w cos(latitude)))^2 seconds in dwells; one dwell or two more for whole pairs.
    outlook = Outlook(WHITE, LATITUDE, 2.0, 32.0)
    seconds = (WHITE.N / (relative * EARTH_RATE * math.cos(LATITUDE))) ** 2
    turns = outlook.turns_needed(28.0, relative)
    assert seconds <= (turns + 1) * 28.0 * (1 + 1e-9)
    assert (turns + 1) * 28.0 < seconds * 1.001 + 2 * 28.0
    if turns > 1:
        sigma = outlook.sigmas_after(28.0, turns)
        assert sigma[-1] <= relative * EARTH_RATE * (1 + 1e-9) < sigma[-2]


def test_a_goal_out_of_reach_has_no_row():
    noisy = Outlook(NoiseModel(N=1e28), LATITUDE, 2.0, 32.0)
    assert noisy.turns_needed(28.0, 0.1) is None
    rows = list(prediction_rows(KEY, noisy, 28.0, [0.1], 600.0))
    assert {row.of for row in rows} == {"time", "dwell"}


@pytest.mark.parametrize("turns", [1, 5, 63, 64, 300])
def test_what_is_reached_is_the_end_of_the_course(turns):
    outlook = Outlook(PAPER_MODEL, LATITUDE, 2.0, 8.0)
    assert outlook.sigma_after(28.0, turns) == pytest.approx(
        outlook.sigmas_after(28.0, turns)[-1], rel=0.01
    )


@pytest.mark.release
def test_long_dwells_reach_more_than_was_asked_for():
    outlook = Outlook(PAPER_MODEL, LATITUDE, 2.0, 8.0)
    rows = list(prediction_rows(KEY, outlook, 3600.0, [1.0], 1e4))
    (goal,) = (row for row in rows if row.of == "goal")
    assert goal.turns == 1 and goal.sigma == pytest.approx(rows[1].sigma, rel=0.01)
    assert goal.sigma < 0.5 * EARTH_RATE


def test_with_white_noise_one_turn_is_best():
    curve = Outlook(WHITE, LATITUDE, 2.0, 32.0).over_dwell(600.0)
    assert curve.dwells[curve.best] == 2
    assert curve.dwell[curve.best] == 299.0
    assert curve.sigma[0] == pytest.approx(
        WHITE.N / math.sqrt(598.0) / math.cos(LATITUDE), rel=1e-9
    )


@pytest.mark.release
def test_drift_asks_for_turns_and_turns_cost_time():
    drifting = NoiseModel(N=PAPER_MODEL.N, K=20 * PAPER_MODEL.K)
    curve = Outlook(drifting, LATITUDE, 2.0, 32.0).over_dwell(600.0)
    assert 0 < curve.best < len(curve.dwell) - 1
    near = curve.dwell[curve.nearly_best]
    assert near.min() < curve.dwell[curve.best] < near.max()
    np.testing.assert_array_equal(curve.nearly_best, curve.sigma <= 1.01 * curve.sigma.min())
    slower = Outlook(drifting, LATITUDE, 10.0, 32.0).over_dwell(600.0)
    assert slower.dwell[slower.best] > curve.dwell[curve.best]
    np.testing.assert_allclose(curve.dwells * curve.dwell + (curve.dwells - 1) * 2.0, 600.0)


def test_two_positions_of_white_noise_are_the_gyrocompass():
    rows = prediction_rows(KEY, Outlook(WHITE, LATITUDE, 0.0, 32.0), 60.0, [1e9], 600.0)
    goal = next(rows)
    two = Gyrocompass(gyro=WHITE, latitude=LATITUDE, positions=2).heading(120.0)
    assert (goal.turns, goal.time) == (1, 120.0)
    assert goal.heading == pytest.approx(two.total, rel=1e-9)


@pytest.mark.release
def test_longest_blocks_where_nothing_is_lost():
    design = design_paper_run(12.0)
    assert choose_block_length(design, WHITE) == 896
    for fast in (NoiseModel(N=1e-4, B=1e-3, T_B=3.0), NoiseModel(N=1e-5, B=1e-3, T_B=3.0)):
        short = Experiment.regular(dwell=28.0, turning=2.0, dwells=4, rate=16.0, latitude=0.4)
        longest = choose_block_length(short, fast)
        assert longest < 448
        assert compute_cramer_rao_bounds(short.blocks(longest), fast)[-1] == pytest.approx(
            compute_cramer_rao_bounds(short.blocks(1), fast)[-1], rel=5e-3
        )


def test_what_cannot_be_is_refused():
    outlook = Outlook(WHITE, LATITUDE, 2.0, 32.0)
    with pytest.raises(ValueError, match="expected a number above 0"):
        outlook.turns_needed(28.0, 0.0)
    with pytest.raises(ValueError, match="is too short for two dwells"):
        outlook.over_dwell(2.0)
    with pytest.raises(ValueError, match="turn_on_bias"):
        compute_information(design_paper_run(1.0).blocks(9), WHITE, -1.0)
