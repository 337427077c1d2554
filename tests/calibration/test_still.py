import math

import numpy as np
import pytest

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.experiment import Dwell, Experiment
from imubench_pipeline.extensions.calibration.pointing import Pointing
from imubench_pipeline.extensions.calibration.still import (
    bias_at_rest,
    fit_bias_at_rest,
    not_observable,
)
from imubench_pipeline.extensions.earth_rate.simulation import PAPER_MODEL, simulate_runs
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.simulate.model import SensorModel
from imubench_pipeline.simulate.simulation import simulate
from tests.earth_rate.brute import MODELS, of_blocks

RUN = Experiment((Dwell(0, 240, 1),), 4.0, 0.0)
PLACE = {"latitude": -0.4, "elevation": 0.2}


@pytest.mark.parametrize("name", ["N+GM+K", "N+F+K", "N+R+S"])
def test_present_bias_is_the_conditional_mean_of_the_last_block(name):
    # Of the covariance of all means, with a fixed bias of 1 rad/s: as good as not known.
    blocks, model = RUN.blocks(24), MODELS[name]
    means = np.random.default_rng(1).standard_normal((2, len(blocks))) * 0.1
    found = fit_bias_at_rest(blocks, means, model, Pointing(heading=0.3, **PLACE))
    white = np.diag([sum(t.state_space(0.25).measurement_noise
                         for t in model.realised(0.25, blocks.duration)) / 24] * 10)  # fmt: skip
    total = of_blocks(model, blocks) + 1.0
    gain = np.linalg.solve(total, (total - white)[:, -1])
    error = means - Pointing(heading=0.3, **PLACE).rate
    np.testing.assert_allclose(found.present.value, error @ gain, rtol=1e-6)
    variance = (total - white)[-1, -1] - gain @ (total - white)[:, -1]
    assert found.present.noise_sigma == pytest.approx(math.sqrt(variance), rel=1e-6)


@pytest.mark.parametrize("heading", [0.0, 1.2, None])
def test_intervals_of_both_biases_hold(heading):
    rng = np.random.default_rng(2)
    blocks, runs = RUN.blocks(12), 4000
    model = NoiseModel(N=2e-5, B=2e-5, T_B=9.0, K=2e-6)
    known = Pointing(heading=heading, heading_sigma=0.2 if heading else 0.0, **PLACE)
    if heading is None:
        headings = rng.uniform(-np.pi, np.pi, runs)
    else:
        headings = heading + known.heading_sigma * rng.standard_normal(runs)
    true = [Pointing(heading=one, **PLACE).rate for one in headings.tolist()]
    drawn = simulate_runs(model, blocks, earth_rate=0.0, turn_on_bias=0.0, runs=runs, rng=rng)
    means = drawn.means + 0.02 + np.array(true)[:, None]
    found = fit_bias_at_rest(blocks, means, model, known)
    for one, at in ((found.fixed, 0.02), (found.present, drawn.drift[:, -1] + 0.02)):
        assert (one.value - at).std() == pytest.approx(one.sigma, rel=0.05)
        inside = np.mean((one.lower < at) & (at < one.upper))
        if heading is None:  # whatever the heading is: never less than asked
            assert inside > 0.95
        else:
            assert 0.93 < inside < 0.97


def test_an_interval_without_heading_counts_the_elevation():
    # The worst heading of all, an elevation that is off: little noise beside it.
    rng = np.random.default_rng(6)
    blocks, tilt = RUN.blocks(60), 0.3
    open_heading = Pointing(latitude=-0.9, heading=None, elevation=0.4, elevation_sigma=tilt)
    rates = [
        Pointing(latitude=-0.9, heading=heading, elevation=0.4 + tilt * one).rate
        for one in rng.standard_normal(2000).tolist()
        for heading in (0.0, math.pi)
    ]
    means = 0.02 + np.array(rates)[:, None] + np.zeros(len(blocks))
    found = fit_bias_at_rest(blocks, means, NoiseModel(N=1e-6), open_heading).fixed
    inside = ((found.lower < 0.02) & (0.02 < found.upper)).reshape(-1, 2).mean(axis=0)
    assert np.all(inside > 0.95)
    assert (found.upper - found.lower)[0] < 2.0 * 3.0 * EARTH_RATE


def test_a_log_of_the_simulator_gives_its_bias():
    model = SensorModel(noise=PAPER_MODEL, bias=math.radians(0.3))
    pointing = Pointing(latitude=-0.4, heading=0.5)
    error = []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        rate = pointing.rate
        log = simulate(model, 32.0, 6400, rng, true=lambda a, b, w=rate: np.full(b - a, w))
        log[500:520] = np.nan
        found = bias_at_rest(log, 32.0, PAPER_MODEL, pointing)
        error.append((found.fixed.value[0] - model.bias) / found.fixed.sigma)
    # A chi-squared of 30 degrees of freedom is between 12 and 58 in 99.8 of 100 cases.
    assert 12.0 < np.sum(np.square(error)) < 58.0


def test_white_noise_gives_the_mean_and_its_error():
    log = np.full(400, 0.01)
    pointing = Pointing(latitude=0.0, heading=0.0)
    found = bias_at_rest(log, 4.0, NoiseModel(N=1e-3), pointing)
    assert found.fixed.value[0] == pytest.approx(0.01 - EARTH_RATE)
    assert found.fixed.sigma == pytest.approx(1e-3 / 10.0)
    assert math.isnan(found.p_value[0])
    blocks = Experiment((Dwell(0, 400, 1),), 4.0, 0.0).blocks(100)
    shorter = fit_bias_at_rest(blocks, np.full((1, 4), 0.01), NoiseModel(N=1e-3), pointing)
    assert shorter.p_value[0] == pytest.approx(1.0)


def test_bias_and_rate_are_one_sum():
    # What a rate that was not known would do to the bias: all of it, and nothing else shows it.
    model, pointing = NoiseModel(N=5e-5), Pointing(latitude=0.3, heading=0.0)
    blocks = RUN.blocks(24)
    means = np.random.default_rng(1).standard_normal((1, len(blocks))) * 2e-5
    one = fit_bias_at_rest(blocks, means, model, pointing)
    other = fit_bias_at_rest(blocks, means + pointing.rate, model, pointing)
    assert other.fixed.value - one.fixed.value == pytest.approx(pointing.rate)
    assert other.p_value == pytest.approx(one.p_value)


def test_what_one_position_does_not_tell_is_listed():
    known = not_observable(Pointing(latitude=0.5, heading=1.0))
    assert [one.quantity for one in known] == ["earth_rate", "scale_factor"]
    last = not_observable(Pointing(latitude=0.5, heading=None, elevation=0.3))[-1]
    assert last.quantity == "heading"
    assert last.half_width == pytest.approx(EARTH_RATE * math.cos(0.5) * math.cos(0.3))
    # A vertical axis sees the same at every heading.
    upright = not_observable(Pointing(latitude=0.5, heading=None, elevation=math.pi / 2))
    assert [one.quantity for one in upright] == ["earth_rate", "scale_factor"]
