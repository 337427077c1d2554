"""Dwells of other lengths than the paper's: what all estimates say of themselves must hold."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.experiment import Dwell, Experiment
from imubench_pipeline.extensions.calibration.kalman import RateFilter
from imubench_pipeline.extensions.earth_rate.bound import (
    choose_block_length,
    compute_cramer_rao_bounds,
)
from imubench_pipeline.extensions.earth_rate.outlook import Outlook
from imubench_pipeline.extensions.earth_rate.pairs import by_pairs, by_triples
from imubench_pipeline.extensions.earth_rate.simulation import (
    ASSUMED_LATITUDE,
    PAPER_MODEL,
    simulate_runs,
)
from imubench_pipeline.noise import NoiseModel

RATE = 8.0
BIAS = math.radians(0.05)
RUNS = 3000
LONGEST = 240
"""Samples of a block, 30 s: estimates are consistent with any."""


def regular(dwell, dwells):
    return Experiment.regular(
        dwell=dwell, turning=2.0, dwells=dwells, rate=RATE, latitude=ASSUMED_LATITUDE
    )


def unequal(seconds, turning):
    at, dwells = 0, []
    for i, (length, gap) in enumerate(zip(seconds, turning, strict=True)):
        start = at + round(gap * RATE)
        at = start + round(length * RATE)
        dwells.append(Dwell(start, at, (-1) ** i))
    return Experiment(tuple(dwells), RATE, ASSUMED_LATITUDE)


DESIGNS = {
    "7 s": regular(7.0, 40),
    "120 s": regular(120.0, 8),
    "600 s": regular(600.0, 4),
    "unequal": unequal(
        [7.0, 120.0, 30.0, 600.0, 11.0, 45.0, 300.0, 2.0], [0.0, 1.0, 4.0, 0.0, 60.0, 2.0, 2.0, 9.0]
    ),
}
MODELS = {
    "paper": PAPER_MODEL,
    "flicker": NoiseModel(N=PAPER_MODEL.N, B=2.0 * PAPER_MODEL.B, K=5.0 * PAPER_MODEL.K),
    "GM 15 s": NoiseModel(N=PAPER_MODEL.N, B=3.0 * PAPER_MODEL.B, T_B=15.0, K=PAPER_MODEL.K),
}


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
@pytest.mark.parametrize("design", DESIGNS.values(), ids=DESIGNS)
def test_estimates_are_consistent(design, model):
    blocks = design.blocks(LONGEST)
    one = RateFilter(blocks, model, turn_on_bias=BIAS)
    drawn = simulate_runs(
        model,
        blocks,
        earth_rate=EARTH_RATE,
        turn_on_bias=BIAS,
        runs=RUNS,
        rng=np.random.default_rng(7),
    )
    found = one.run(drawn.means)
    freedom = drawn.states.shape[2] + 1
    after = np.flatnonzero(blocks.dwell >= 1)[1:]
    # The sum over runs at an epoch is chi-squared; a bound for a hundred epochs and designs.
    tail = 1e-6
    for mean, degrees in (
        (found.rate_nees(EARTH_RATE)[:, after].mean(axis=0), 1),
        (found.nees(EARTH_RATE, drawn.states)[:, after].mean(axis=0), freedom),
        (found.nis[:, after].mean(axis=0), 1),
    ):
        lower, upper = chi2.ppf([tail, 1.0 - tail], RUNS * degrees) / RUNS
        assert np.all((lower < mean) & (mean < upper))
    inside = found.rate_nees(EARTH_RATE)[:, -1] < chi2.ppf(0.95, 1)
    assert inside.mean() == pytest.approx(0.95, abs=0.02)
    for other in (by_pairs, by_triples):
        estimate = other(drawn.means, blocks, model)
        error = (estimate.rate[:, -1] - EARTH_RATE) / estimate.sigma[-1]
        assert np.mean(error**2) == pytest.approx(1.0, abs=5.0 * math.sqrt(2.0 / RUNS))
        assert one.rate_sigma[-1] <= estimate.sigma[-1] * (1.0 + 1e-6)


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
@pytest.mark.parametrize("design", DESIGNS.values(), ids=DESIGNS)
def test_the_filter_reaches_the_bound(design, model):
    blocks = design.blocks(LONGEST)
    found = RateFilter(blocks, model, turn_on_bias=BIAS).rate_sigma
    bound = compute_cramer_rao_bounds(blocks, model, BIAS)
    there = blocks.dwell >= 1
    np.testing.assert_allclose(found[there], bound[there], rtol=1e-5)


@pytest.mark.parametrize("design", DESIGNS.values(), ids=DESIGNS)
def test_blocks_lose_nothing(design):
    longest = choose_block_length(design, PAPER_MODEL)
    found = compute_cramer_rao_bounds(design.blocks(longest), PAPER_MODEL, BIAS)[-1]
    finer = compute_cramer_rao_bounds(design.blocks(-(-longest // 8)), PAPER_MODEL, BIAS)[-1]
    assert 1.0 - 1e-9 <= found / finer < 1.003


@pytest.mark.parametrize("dwell", [7.0, 120.0, 600.0])
def test_the_outlook_is_the_bound_at_every_dwell(dwell):
    outlook = Outlook(PAPER_MODEL, ASSUMED_LATITUDE, 2.0, RATE, BIAS)
    design = regular(dwell, 9)
    blocks = design.blocks(choose_block_length(design, PAPER_MODEL))
    last = np.flatnonzero(np.diff(blocks.dwell, append=-1))
    found = outlook.sigmas_after(dwell, 8)
    np.testing.assert_allclose(
        found, compute_cramer_rao_bounds(blocks, PAPER_MODEL, BIAS)[last][1:], rtol=2e-3
    )
    turns = outlook.turns_needed(dwell, 0.1)
    sigma = outlook.sigmas_after(dwell, turns)
    assert sigma[-1] <= 0.1 * EARTH_RATE * (1 + 1e-9)
    assert turns == 1 or sigma[-2] > 0.1 * EARTH_RATE
