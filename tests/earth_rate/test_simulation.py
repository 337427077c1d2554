import math

import numpy as np
import pytest

from imubench_pipeline.extensions.calibration.experiment import Dwell, Experiment, block_means
from imubench_pipeline.extensions.calibration.kalman import RateFilter
from imubench_pipeline.extensions.earth_rate.simulation import (
    PAPER_MINUTES,
    PAPER_MODEL,
    PAPER_RATE,
    design_paper_run,
    simulate_log,
    simulate_runs,
)
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.settings.yaml_files import read_yaml
from imubench_pipeline.simulate.model import SensorModel
from imubench_pipeline.units import parse_quantity
from tests.conftest import PROJECT
from tests.earth_rate.brute import MODELS, of_blocks

DESIGN = Experiment((Dwell(0, 9, 1), Dwell(12, 30, -1), Dwell(50, 51, 1)), 2.0, 0.5)


@pytest.mark.parametrize("name", MODELS)
def test_block_means_have_the_covariance_of_the_samples(name):
    blocks = DESIGN.blocks(6)
    runs = simulate_runs(
        MODELS[name],
        blocks,
        earth_rate=0.7,
        turn_on_bias=0.2,
        runs=40_000,
        rng=np.random.default_rng(7),
    )
    covariance = of_blocks(MODELS[name], blocks) + 0.04
    found = np.cov(runs.means.T)
    variance = np.diag(covariance)
    error = np.sqrt((np.outer(variance, variance) + covariance**2) / 40_000)
    assert np.all(np.abs(found - covariance) < 5.0 * error)
    np.testing.assert_allclose(
        runs.means.mean(axis=0), 0.7 * blocks.seen, atol=5 * np.sqrt(variance.max() / 40_000)
    )


def test_a_log_without_noise_shows_the_rate_and_the_turns():
    design = Experiment((Dwell(4, 40, -1), Dwell(50, 80, 1), Dwell(90, 99, 1)), 4.0, math.pi / 3)
    log = simulate_log(
        SensorModel(bias=0.5),
        design,
        earth_rate=0.2,
        transient=[3.0, -1.0],
        rng=np.random.default_rng(0),
    )
    np.testing.assert_allclose(log[:40], 0.5 - 0.1)
    np.testing.assert_allclose(log[50:80], 0.5 + 0.1)
    np.testing.assert_allclose(log[90:], 0.5 + 0.1)
    assert log[40:50].max() == pytest.approx(3.5, abs=0.15)
    assert log[80:90].min() == pytest.approx(-0.4, abs=0.15)
    assert len(log) == 99


@pytest.mark.release
def test_logs_of_the_simulator_are_what_the_filter_expects():
    # Whole logs come of another program, sample by sample: their NIS must be right, too.
    model = NoiseModel(N=0.02, B=0.05, T_B=8.0, K=0.01)
    design = Experiment.regular(dwell=6.0, turning=1.0, dwells=6, rate=8.0, latitude=0.4)
    one = RateFilter(design.blocks(12), model, turn_on_bias=0.1)
    rng = np.random.default_rng(11)
    means = [
        block_means(
            [
                simulate_log(
                    SensorModel(noise=model, bias=0.1 * rng.standard_normal()),
                    design,
                    earth_rate=0.05,
                    transient=9.0,
                    rng=rng,
                )
            ],
            design,
            12,
        ).means[0]
        for _ in range(400)
    ]
    found = one.run(np.array(means))
    after = slice(5, None)
    assert found.nis[:, after].mean() == pytest.approx(1.0, abs=0.06)
    assert found.rate_nees(0.05)[:, -1].mean() == pytest.approx(1.0, abs=0.25)
    assert found.rate[:, -1].mean() == pytest.approx(
        0.05, abs=4.0 * found.rate_sigma[-1] / math.sqrt(400)
    )


def test_the_runs_of_the_paper():
    listed = read_yaml(PROJECT / "config/simulated.yaml")["recordings"]
    entry = next(one for one in listed if one["sensor"] == "sirrs01_03")
    printed = entry["channels"]["gyro_x"]
    dimensions = {"N": "gyro_density", "B": "angular_rate", "T_B": "time", "K": "gyro_random_walk"}
    for name, text in printed.items():
        if name in dimensions:
            si = parse_quantity(text, dimensions[name])
            assert getattr(PAPER_MODEL, name) == pytest.approx(si, rel=1e-12)
    assert parse_quantity(entry["rate"], "frequency") == PAPER_RATE
    assert [len(design_paper_run(minutes).dwells) for minutes in PAPER_MINUTES.values()] == [
        240, 24, 50, 120, 26]  # fmt: skip
    design = design_paper_run(12.0)
    assert design.dwells[1].start == 30 * 32
    assert design.dwells[0].sense == 1
