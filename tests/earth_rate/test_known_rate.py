import math

import numpy as np
import pytest

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.extensions.calibration.experiment import Experiment
from imubench_pipeline.extensions.earth_rate.known_rate import (
    STARTS,
    as_printed,
    mean_sigma,
    settled,
    track,
)
from imubench_pipeline.extensions.earth_rate.simulation import (
    PAPER_MODEL,
    design_paper_run,
    simulate_log,
)
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.simulate.model import SensorModel

DESIGN = design_paper_run(12.0)


def log_of(earth_rate):
    model = SensorModel(noise=PAPER_MODEL, bias=math.radians(0.05))
    return simulate_log(
        model, DESIGN, earth_rate=earth_rate, transient=0.0, rng=np.random.default_rng(1)
    )


@pytest.mark.parametrize(("start", "part"), [("radians", 1e-4), ("degrees", 5e-4)])
@pytest.mark.parametrize("true", [EARTH_RATE, 0.0, -3 * EARTH_RATE])
def test_it_finds_what_it_is_given_whatever_the_truth(true, start, part):
    log = log_of(true)
    nothing = track(log, DESIGN, PAPER_MODEL, 0.0, STARTS[start]).mean[-1]
    assert abs(nothing) < 0.3 * EARTH_RATE
    for given in (EARTH_RATE, 2 * EARTH_RATE, -EARTH_RATE):
        found = track(log, DESIGN, PAPER_MODEL, given, STARTS[start]).mean[-1]
        assert found - nothing == pytest.approx(given, rel=part)


def test_its_start_has_no_unit_in_print():
    assert STARTS["radians"] / STARTS["degrees"] == pytest.approx(3283, abs=1)


@pytest.mark.parametrize("start", STARTS.values())
def test_its_mean_scatters_as_is_said_whatever_it_is_given(start):
    # 200 runs of 70 s, drawn from the model in discrete time, against the exact recursion.
    samples, runs, bias, model = 2240, 200, math.radians(0.3), PAPER_MODEL
    rng = np.random.default_rng(2)
    design = Experiment.regular(dwell=70.0, turning=0.0, dwells=1, rate=32.0, latitude=0.0)
    decay = math.exp(-1 / 32.0 / model.T_B)
    spread = model.B**2 * math.log(2) / (math.pi * 0.4365**2)  # S_B T_B / 2
    ends = []
    for _ in range(runs):
        drive = math.sqrt(spread * (1 - decay**2)) * rng.standard_normal(samples)
        process = np.empty(samples)
        at = math.sqrt(spread) * rng.standard_normal()
        for k in range(samples):
            process[k] = at
            at = decay * at + drive[k]
        walk = np.cumsum(model.K / math.sqrt(32.0) * rng.standard_normal(samples))
        white = model.N * math.sqrt(32.0) * rng.standard_normal(samples)
        log = process + walk + white + bias * rng.standard_normal()
        given = rng.standard_normal() * EARTH_RATE
        mean = track(log + given, design, model, given, start).mean
        ends.append(mean[[99, 999, 2239]] - given)
    sigma = mean_sigma(model, 32.0, samples, start, bias)[[99, 999, 2239]]
    np.testing.assert_allclose(np.std(ends, axis=0) / sigma, 1.0, atol=0.15)


def test_at_a_thousand_samples_its_mean_is_not_within_a_tenth():
    # What the paper calls converged after some 10^3 samples, in deg/h: of 15.04.
    at = {
        name: math.degrees(mean_sigma(PAPER_MODEL, 32.0, 1000, start, 0.0)[-1]) * 3600.0
        for name, start in STARTS.items()
    }
    assert at["radians"] == pytest.approx(7.35, abs=0.01)
    assert at["degrees"] == pytest.approx(3.50, abs=0.01)


def test_a_mean_has_settled_after_its_last_time_outside():
    mean = np.array([0.0, 1.05, 1.2, 1.0, 0.95])
    assert settled(mean, 2.0, 1.0) == 1.5
    assert settled(mean[1:2], 2.0, 1.0) == 0.0
    assert settled(mean[:3], 2.0, 1.0) == math.inf


def test_equation_13_as_printed_grows_without_bound():
    # (I - K H)^-1 P, by the inverse itself, as far as its digits reach.
    start, T = STARTS["degrees"], 1 / 32.0
    traces = as_printed(PAPER_MODEL, 32.0, 20, start)
    S_B = 2 * PAPER_MODEL.B**2 * math.log(2) / (math.pi * 0.4365**2 * 238.1)
    F, Q = np.diag([math.exp(-T / 238.1), 1.0]), T * np.diag([S_B, PAPER_MODEL.K**2])
    H, P = np.ones((1, 2)), start * np.eye(2)
    for k in range(2):
        gain = P @ H.T / (H @ P @ H.T + PAPER_MODEL.N**2 / T)
        P = np.linalg.inv(np.eye(2) - gain @ H) @ P
        assert traces[k] == pytest.approx(np.trace(P), rel=1e-6)
        P = F @ P @ F.T + Q
    finite = traces[np.isfinite(traces)]
    assert len(finite) == 7 and np.all(np.diff(finite) > 0.0)
    # As it is meant, the first measurement alone makes it smaller.
    assert traces[0] > 2.0 * start


def test_it_is_the_filter_of_equations_15_and_16():
    rng = np.random.default_rng(3)
    log = rng.standard_normal(DESIGN.dwells[-1].stop) * 1e-3
    log[100] = np.nan
    found = track(log, DESIGN, PAPER_MODEL, EARTH_RATE, 0.1)
    assert 100 not in found.sample
    T = 1 / 32.0
    S_B = 2 * PAPER_MODEL.B**2 * math.log(2) / (math.pi * 0.4365**2 * 238.1)
    F, Q = np.diag([math.exp(-T / 238.1), 1.0]), T * np.diag([S_B, PAPER_MODEL.K**2])
    H, P, x = np.ones(2), 0.1 * np.eye(2), np.zeros(2)
    for k in range(2000):
        i = found.sample[k]
        gain = P @ H / (H @ P @ H + PAPER_MODEL.N**2 / T)
        x = x + gain * (log[i] - EARTH_RATE - H @ x)
        P = P - np.outer(gain, H @ P)
        assert found.drift[k] == pytest.approx(x.sum(), rel=1e-6, abs=1e-12)
        x, P = F @ x, F @ P @ F.T + Q


@pytest.mark.parametrize("model", [NoiseModel(K=1.0), NoiseModel(N=1.0, B=1.0)])
def test_it_needs_the_parameters_of_the_paper(model):
    with pytest.raises(ValueError, match="needs N"):
        track(np.zeros(30000), DESIGN, model, 0.0)
