import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from imubench_pipeline.extensions.calibration.experiment import Dwell, Experiment, block_means
from imubench_pipeline.extensions.calibration.kalman import RateFilter
from imubench_pipeline.extensions.calibration.states import UNINFORMATIVE_SIGMA
from imubench_pipeline.extensions.earth_rate.bound import (
    choose_block_length,
    compute_cramer_rao_bounds,
)
from imubench_pipeline.extensions.earth_rate.simulation import (
    PAPER_MODEL,
    design_paper_run,
    simulate_runs,
)
from imubench_pipeline.noise import NoiseModel, WhiteNoise
from tests.earth_rate.brute import MODELS, of_blocks, of_samples
from tests.earth_rate.test_experiment import experiments

UNEVEN = Experiment(
    (
        Dwell(2, 12, -1),
        Dwell(15, 40, 1),
        Dwell(41, 42, -1),
        Dwell(90, 120, -1),
        Dwell(120, 129, 1),
        Dwell(400, 431, -1),
    ),
    4.0,
    -0.4,
)
"""Unequal dwells, turns of no time and of much, one that was missed."""


def conditioned(model, blocks, bias, rate_sigma, means):
    """Return rate and drift given means, by the covariance of all: (mean, sigma) each."""
    white = sum(t.N**2 for t in model.realised(1 / blocks.rate, blocks.duration)
                if isinstance(t, WhiteNoise))  # fmt: skip
    total = of_blocks(model, blocks) + bias**2
    slow = total - np.diag(white * blocks.rate / (blocks.stop - blocks.start))
    of_rate = rate_sigma**2 * blocks.seen
    seen = total + np.outer(of_rate, blocks.seen)
    rate_gain, drift_gain = np.linalg.solve(seen, of_rate), np.linalg.solve(seen, slow).T
    return (
        means @ rate_gain,
        math.sqrt(rate_sigma**2 - rate_gain @ of_rate),
        means @ drift_gain.T,
        np.sqrt(np.diag(slow - drift_gain @ slow)),
    )


@pytest.mark.parametrize("longest", [1, 7, 100])
@pytest.mark.parametrize("name", MODELS)
def test_filter_and_smoother_are_the_conditional_distribution(name, longest):
    model, bias, rate_sigma = MODELS[name], 0.3, 0.5
    blocks = UNEVEN.blocks(longest)
    means = np.random.default_rng(1).standard_normal((3, len(blocks)))
    one = RateFilter(blocks, model, turn_on_bias=bias, rate_sigma=rate_sigma)
    filtered = one.run(means)
    smoothed_drift, smoothed_sigma = one.smooth(filtered)
    rate, sigma, drift, drift_sigma = conditioned(model, blocks, bias, rate_sigma, means)
    np.testing.assert_allclose(filtered.rate[:, -1], rate, rtol=1e-7)
    assert filtered.rate_sigma[-1] == pytest.approx(sigma, rel=1e-8)
    np.testing.assert_allclose(smoothed_drift, drift, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(smoothed_sigma, drift_sigma, rtol=1e-6)


def test_what_the_filter_knows_on_the_way_is_of_the_data_so_far():
    model, blocks = MODELS["N+GM+K"], UNEVEN.blocks(8)
    means = np.random.default_rng(2).standard_normal((2, len(blocks)))
    filtered = RateFilter(blocks, model, turn_on_bias=0.3, rate_sigma=0.5).run(means)
    for k in (0, 3, 7):
        part = blocks.chosen(slice(0, k + 1))
        rate, sigma, drift, drift_sigma = conditioned(model, part, 0.3, 0.5, means[:, : k + 1])
        np.testing.assert_allclose(filtered.rate[:, k], rate, rtol=1e-8)
        assert filtered.rate_sigma[k] == pytest.approx(sigma, rel=1e-9)
        np.testing.assert_allclose(filtered.drift[:, k], drift[:, -1], rtol=1e-8)
        assert filtered.drift_sigma[k] == pytest.approx(drift_sigma[-1], rel=1e-8)


def test_the_innovations_whiten_the_means():
    model, blocks = MODELS["N+F+K"], UNEVEN.blocks(8)
    one = RateFilter(blocks, model, turn_on_bias=0.3, rate_sigma=0.5)
    found = one.run(np.eye(len(blocks)))
    whitener = (found.innovation / found.innovation_sigma).T
    covariance = of_blocks(model, blocks) + 0.09 + 0.25 * np.outer(blocks.seen, blocks.seen)
    np.testing.assert_allclose(whitener @ covariance @ whitener.T, np.eye(len(blocks)), atol=1e-9)


@pytest.mark.parametrize("scale", [1.0, 1e-4])
def test_no_knowledge_at_the_start_costs_no_digits(scale):
    # The paper's sensor, and one ten thousand times as good: 1 rad/s is wide beside both.
    p = PAPER_MODEL
    model = NoiseModel(N=p.N * scale, B=p.B * scale, T_B=p.T_B, K=p.K * scale)
    blocks = design_paper_run(12.0).blocks(448)
    one = RateFilter(blocks, model)
    bound = compute_cramer_rao_bounds(blocks, model)
    assert one.rate_sigma[0] == pytest.approx(UNINFORMATIVE_SIGMA, rel=0.5)
    np.testing.assert_allclose(one.rate_sigma[4:], bound[4:], rtol=1e-6)
    _, drift_sigma = one.smooth(one.run(np.zeros((1, len(blocks)))))
    assert np.all(drift_sigma < 1e-3 * scale)


def test_block_means_tell_as_much_as_samples():
    model = NoiseModel(N=2e-4, B=1e-4, T_B=15.0, K=2e-5)
    design = Experiment.regular(dwell=20.0, turning=2.0, dwells=6, rate=4.0, latitude=-0.4)
    longest = choose_block_length(design, model)
    assert 1 < longest < 80
    of_samples = RateFilter(design.blocks(1), model).rate_sigma[-1]
    of_means = RateFilter(design.blocks(longest), model).rate_sigma[-1]
    of_dwells = RateFilter(design.blocks(80), model).rate_sigma[-1]
    assert 1.0 <= of_means / of_samples < 1.005 < of_dwells / of_samples


@pytest.mark.parametrize("name", ["N+GM+K", "N+F+K", "Q+N+K"])
def test_errors_and_innovations_are_as_large_as_the_filter_says(name):
    model, blocks = MODELS[name], UNEVEN.blocks(10)
    runs = simulate_runs(
        model, blocks, earth_rate=0.02, turn_on_bias=0.3, runs=2000, rng=np.random.default_rng(3)
    )
    one = RateFilter(blocks, model, turn_on_bias=0.3)
    found = one.run(runs.means)
    after = slice(int(np.flatnonzero(blocks.sense != blocks.sense[0])[0]) + 1, None)
    freedom = runs.states.shape[2] + 1
    assert found.nis[:, after].mean() == pytest.approx(1.0, abs=0.03)
    assert found.rate_nees(0.02)[:, -1].mean() == pytest.approx(1.0, abs=0.13)
    assert found.nees(0.02, runs.states)[:, after].mean() == pytest.approx(freedom, rel=0.05)
    drift, sigma = one.smooth(found)
    error = (drift - runs.drift) / sigma
    np.testing.assert_allclose(error.std(axis=0), 1.0, atol=0.08)


@pytest.mark.release
@given(experiments(), st.sampled_from([*MODELS.values()]), st.sampled_from([0.0, 0.1, 1.0]))
@settings(max_examples=40, deadline=None)
def test_it_never_claims_more_than_white_noise_allows(experiment, model, bias):
    blocks = experiment.blocks(9)
    least = model.N / np.sqrt(np.cumsum(blocks.count) / blocks.rate) / math.cos(blocks.latitude)
    claimed = RateFilter(blocks, model, turn_on_bias=bias, rate_sigma=1e4).rate_sigma
    assert np.all(claimed >= least * (1.0 - 1e-6))


@pytest.mark.parametrize(
    ("name", "tolerance"), [("N+GM+K", 0.005), ("N+F+K", 0.01), ("N+GM+GM", 0.03)]
)
def test_missing_samples_do_not_make_it_too_sure(name, tolerance):
    # The weights of the estimate, on means over the samples present, have an exact variance. A
    # third is missing; the last model has a process of 0.4 s, at four samples a second.
    model = MODELS[name]
    rng = np.random.default_rng(9)
    log = np.zeros(431)
    log[rng.random(431) < 0.3] = np.nan
    log[94:110] = np.nan
    blocks = block_means([log], UNEVEN, 10).blocks
    one = RateFilter(blocks, model)
    weights = one.run(np.eye(len(blocks))).rate[:, -1]
    rows = np.zeros((len(blocks), 431))
    for row, start, stop in zip(rows, blocks.start, blocks.stop, strict=True):
        row[start:stop] = np.isfinite(log[start:stop])
    rows /= rows.sum(axis=1, keepdims=True)
    by_samples = weights @ rows[:, blocks.start[0] :]
    exact = by_samples @ of_samples(model, len(by_samples), 4.0, blocks.duration) @ by_samples
    assert one.rate_sigma[-1] == pytest.approx(math.sqrt(exact), rel=tolerance)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: RateFilter(UNEVEN.blocks(9), PAPER_MODEL, turn_on_bias=-1.0), "turn_on_bias"),
        (lambda: RateFilter(UNEVEN.blocks(9), PAPER_MODEL, rate_sigma=math.inf), "rate_sigma"),
        (lambda: RateFilter(UNEVEN.blocks(9), PAPER_MODEL).run(np.zeros((1, 3))), "columns"),
        (
            lambda: RateFilter(UNEVEN.blocks(99), PAPER_MODEL).run(np.full((1, 6), np.nan)),
            "not finite",
        ),
    ],
)
def test_what_cannot_be_filtered_is_refused(make, says):
    with pytest.raises(ValueError, match=says):
        make()
