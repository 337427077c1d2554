import math

import numpy as np
import pytest

from imubench_pipeline.earth import EARTH_RATE
from imubench_pipeline.experiments.earth_rate.known_rate import track
from imubench_pipeline.experiments.earth_rate.simulation import PAPER_MODEL, paper_run, simulate_log
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.simulate.model import SensorModel

DESIGN = paper_run(12.0)


def log_of(earth_rate):
    model = SensorModel(noise=PAPER_MODEL, bias=math.radians(0.05))
    return simulate_log(
        model, DESIGN, earth_rate=earth_rate, transient=0.0, rng=np.random.default_rng(1)
    )


@pytest.mark.parametrize("true", [EARTH_RATE, 0.0, -3 * EARTH_RATE])
def test_it_finds_what_it_is_given_whatever_the_truth(true):
    log = log_of(true)
    nothing = track(log, DESIGN, PAPER_MODEL, 0.0).mean[-1]
    assert abs(nothing) < 0.3 * EARTH_RATE
    for given in (EARTH_RATE, 2 * EARTH_RATE, -EARTH_RATE):
        found = track(log, DESIGN, PAPER_MODEL, given).mean[-1]
        assert found - nothing == pytest.approx(given, rel=1e-4)


def test_it_is_the_filter_of_equations_15_and_16():
    rng = np.random.default_rng(3)
    log = rng.standard_normal(DESIGN.dwells[-1].stop) * 1e-3
    log[100] = np.nan
    found = track(log, DESIGN, PAPER_MODEL, EARTH_RATE)
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
