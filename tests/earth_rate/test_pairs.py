import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from imubench_pipeline.extensions.calibration.experiment import Dwell, Experiment
from imubench_pipeline.extensions.earth_rate.pairs import by_pairs, by_triples
from imubench_pipeline.extensions.earth_rate.simulation import (
    PAPER_MODEL,
    design_paper_run,
    simulate_runs,
)
from imubench_pipeline.noise import NoiseModel, Ramp
from tests.earth_rate.brute import MODELS, of_blocks

WHITE = NoiseModel(N=0.1)


def of_time(blocks, signal):
    """Return block means of a signal over time, exactly, for one run."""
    times = [np.arange(a, b) / blocks.rate for a, b in zip(blocks.start, blocks.stop, strict=True)]
    return np.array([[signal(one).mean() for one in times]])


def test_equation_14_by_hand():
    blocks = Experiment(
        tuple(Dwell(i * 10, i * 10 + 8, (-1) ** i) for i in range(5)), 1.0, math.pi / 3
    ).blocks(8)
    found = by_pairs(np.array([[5.0, 3.0, 9.0, 4.0, 100.0]]), blocks, WHITE)
    np.testing.assert_allclose(found.rate, [[2.0, (2.0 + 5.0) / 2.0]])  # 2 cos(60 deg) = 1
    np.testing.assert_allclose(found.time, [18.0, 38.0])


def test_white_noise_gives_its_textbook_error():
    # N / sqrt(seconds in dwells) / cos(latitude).
    design = design_paper_run(12.0)
    found = by_pairs(np.zeros((1, 24)), design.blocks(1000), NoiseModel(N=PAPER_MODEL.N))
    seconds = 56.0 * np.arange(1, 13)
    expected = PAPER_MODEL.N / np.sqrt(seconds) / math.cos(design.latitude)
    np.testing.assert_allclose(found.sigma, expected, rtol=1e-12)


@pytest.mark.parametrize(
    "model",
    [
        NoiseModel(B=1e-4, T_B=20.0),
        NoiseModel(K=1e-5),
        NoiseModel(B=1e-4),
        NoiseModel(N=1e-3, B=1e-4, T_B=20.0, K=1e-5),
    ],
)
def test_a_pair_without_a_gap_has_half_the_allan_variance(model):
    # Var((a - b) / 2) is half of 1/2 Var(a - b); flicker noise by the ripple of its bank.
    blocks = Experiment.regular(dwell=30, turning=0, dwells=2, rate=4, latitude=0).blocks(120)
    found = by_pairs(np.zeros((1, 2)), blocks, model)
    tolerance = 0.02 if model.B and not model.T_B else 1e-9
    assert found.sigma[0] ** 2 == pytest.approx(
        float(model.allan_variance(30.0, 4.0)) / 2.0, rel=tolerance
    )


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("estimate", [by_pairs, by_triples])
def test_errors_are_those_of_the_covariance_of_the_samples(name, estimate):
    # The weights are read off by unit means; a dwell is made of several blocks, its mean of all.
    design = Experiment(
        tuple(Dwell(*one) for one in [(3, 13, 1), (15, 31, -1), (31, 40, 1), (44, 55, -1),
                                      (90, 99, 1)]), 2.0, 0.3)  # fmt: skip
    blocks = design.blocks(4)
    found = estimate(np.eye(len(blocks)), blocks, MODELS[name])
    covariance = of_blocks(MODELS[name], blocks)
    weights = found.rate
    np.testing.assert_allclose(weights.sum(axis=0), 0.0, atol=1e-15)  # the fixed bias
    np.testing.assert_allclose(weights.T @ blocks.seen, 1.0)  # the rate
    np.testing.assert_allclose(found.sigma**2, np.diag(weights.T @ covariance @ weights), rtol=1e-9)


@given(
    st.lists(st.tuples(st.integers(1, 9), st.integers(0, 5)), min_size=3, max_size=8),
    st.floats(-2.0, 2.0),
)
@settings(max_examples=40, deadline=None)
def test_triples_take_a_linear_drift_out(parts, slope):
    at, dwells = 0, []
    for i, (length, gap) in enumerate(parts):
        dwells.append(Dwell(at, at + length, (-1) ** i))
        at += length + gap
    blocks = Experiment(tuple(dwells), 3.0, 0.2).blocks(4)
    means = of_time(blocks, lambda t: 0.7 + slope * t) + 0.25 * blocks.seen
    found = by_triples(means, blocks, NoiseModel(R=slope or 1.0))
    np.testing.assert_allclose(found.rate, 0.25, atol=1e-12)
    assert np.all(found.sigma < 1e-6)


def test_pairs_keep_a_linear_drift():
    blocks = design_paper_run(2.0).blocks(1000)
    found = by_pairs(of_time(blocks, lambda t: 1e-3 * t), blocks, NoiseModel(N=1.0, R=1e-3))
    # North before south, 30 s apart: less by half of 30 ms.
    np.testing.assert_allclose(found.rate, -0.015 / math.cos(blocks.latitude))
    only_drift = by_pairs(np.zeros((1, 4)), blocks, NoiseModel(R=1e-3)).sigma
    np.testing.assert_allclose(only_drift, 0.015 / math.cos(blocks.latitude))
    assert Ramp(1e-3) in NoiseModel(R=1e-3).terms


def test_a_missed_turn_and_a_first_dwell_south():
    design = Experiment(
        tuple(Dwell(10 * i, 10 * i + 8, s) for i, s in enumerate([-1, 1, 1, -1, 1])), 1.0, 0.0
    )
    blocks = design.blocks(8)
    means = 0.3 * blocks.seen[None, :] + 5.0
    pairs = by_pairs(means, blocks, WHITE)
    np.testing.assert_allclose(pairs.rate, [[0.3, 0.3]])
    np.testing.assert_allclose(pairs.time, [18.0, 38.0])
    np.testing.assert_allclose(by_triples(means, blocks, WHITE).rate, [[0.3]])


@pytest.mark.parametrize("estimate", [by_pairs, by_triples])
def test_errors_of_simulated_runs_are_as_large_as_stated(estimate):
    model = NoiseModel(N=PAPER_MODEL.N, B=PAPER_MODEL.B, T_B=60.0, K=5 * PAPER_MODEL.K)
    blocks = design_paper_run(12.0).blocks(448)
    runs = simulate_runs(
        model, blocks, earth_rate=7e-5, turn_on_bias=1e-3, runs=4000, rng=np.random.default_rng(5)
    )
    found = estimate(runs.means, blocks, model)
    ratio = (found.rate - 7e-5).std(axis=0) / found.sigma
    np.testing.assert_allclose(ratio, 1.0, atol=0.05)


@pytest.mark.parametrize("estimate", [by_pairs, by_triples])
def test_one_position_gives_no_estimate(estimate):
    design = Experiment(tuple(Dwell(10 * i, 10 * i + 8, 1) for i in range(4)), 1.0, 0.0)
    with pytest.raises(ValueError, match="the experiment has no"):
        estimate(np.zeros((1, 4)), design.blocks(8), WHITE)
