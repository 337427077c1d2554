import math

import numpy as np
import pytest
from scipy.stats import chi2

from imubench_pipeline.extensions.calibration.least_squares import NotObservableError
from imubench_pipeline.extensions.calibration.pointing import Pointing
from imubench_pipeline.extensions.calibration.rate_table import calibrate, fit_rate_table
from imubench_pipeline.extensions.calibration.schedule import Schedule
from imubench_pipeline.extensions.earth_rate.simulation import simulate_runs
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.simulate.model import SensorModel
from imubench_pipeline.simulate.simulation import simulate
from tests.conftest import few

RATES = (0.0, 0.5, -0.5, 1.0, -1.0, 0.0, 0.25)
STEPS = [(30.0 * i + 5.0, 30.0 * i + 30.0, rate) for i, rate in enumerate(RATES)]
SCHEDULE = Schedule.from_steps(STEPS, 8.0)
UP = Pointing(latitude=-0.4, heading=None, elevation=math.pi / 2)
MODELS = {
    "N": NoiseModel(N=1e-3),
    "N+GM+K": NoiseModel(N=1e-3, B=5e-4, T_B=40.0, K=5e-5),
    "N+F+K": NoiseModel(N=1e-3, B=5e-4, K=5e-5),
}


def runs_of(model, blocks, runs, seed=1, setting=0.0):
    rng = np.random.default_rng(seed)
    drawn = simulate_runs(model, blocks, earth_rate=0.0, turn_on_bias=0.0, runs=runs, rng=rng)
    wrong = setting * rng.standard_normal((runs, len(SCHEDULE.stretches)))
    return drawn.means + wrong[:, blocks.dwell]


@pytest.mark.parametrize("setting", [0.0, 2e-4])
@pytest.mark.parametrize("name", MODELS)
def test_intervals_cover_what_they_say(name, setting):
    model, blocks = MODELS[name], SCHEDULE.experiment.blocks(25)
    true = SCHEDULE.of_blocks(blocks) + UP.rate
    means = runs_of(model, blocks, 4000, setting=setting) + 0.03 + 0.99 * true
    found = fit_rate_table(SCHEDULE, blocks, means, model, UP, setting_sigma=setting)
    for at, one in (
        (0.03, found.bias),
        (0.99, found.scale_factor),
        (0.0, found.quadratic),
        (0.0, found.asymmetry),
    ):
        assert 0.935 < np.mean((one.lower < at) & (at < one.upper)) < 0.965
        assert (one.upper - one.lower)[0] == pytest.approx(2 * 1.96 * one.sigma, rel=1e-3)
        assert one.value.std() == pytest.approx(one.sigma, rel=0.05)
    for chance in (found.linearity.p_value, found.quadratic.p_value, found.asymmetry.p_value):
        assert np.mean(chance < 0.05) == pytest.approx(0.05, abs=0.015)
    assert found.not_observable == ()


def test_what_is_not_a_line_is_found():
    model, blocks = MODELS["N+GM+K"], SCHEDULE.experiment.blocks(25)
    rate, noise = SCHEDULE.of_blocks(blocks), runs_of(model, blocks, 2000)
    bent = fit_rate_table(SCHEDULE, blocks, noise + 1.02 * rate + 0.004 * rate**2, model)
    assert bent.quadratic.value.mean() == pytest.approx(0.004, abs=4e-5)
    assert np.mean(bent.quadratic.p_value < 0.05) > 0.95
    assert np.mean(bent.linearity.p_value < 0.05) > 0.9
    means = noise + np.where(rate > 0, 1.002, 0.998) * rate
    split = fit_rate_table(SCHEDULE, blocks, means, model)
    assert split.asymmetry.value.mean() == pytest.approx(0.004, abs=1e-4)
    assert split.scale_factor.value.mean() == pytest.approx(1.0, abs=1e-4)
    assert np.mean(split.linearity.p_value < 0.05) > 0.9


def test_linearity_is_the_largest_deviation_over_full_scale():
    # Equal noise at rates r: the line of q r^2 is level, and leaves q (r^2 - mean of r^2).
    rates = (2.0, -2.0, 1.0, -1.0, 0.0)
    steps = [(30.0 * i + 5.0, 30.0 * i + 30.0, rate) for i, rate in enumerate(rates)]
    schedule = Schedule.from_steps(steps, 8.0)
    model, blocks = MODELS["N"], schedule.experiment.blocks(1000)
    rate, square = np.array(rates), np.array(rates) ** 2
    true = 0.01 * np.abs(square - square.mean()).max() / 2.0
    means = runs_of(model, blocks, 4000) + 1.5 * rate
    found = fit_rate_table(schedule, blocks, means + 0.01 * square, model).linearity
    assert found.value.mean() == pytest.approx(true, rel=0.02)
    assert np.mean((found.lower <= true) & (true <= found.upper)) > 0.95
    # A line: the lower limit is 0 in at least 95 of 100 runs, though the value never is.
    straight = fit_rate_table(schedule, blocks, means, model).linearity
    assert np.mean(straight.lower == 0.0) > 0.95 and straight.value.min() > 0.0


def test_asymmetry_is_a_fraction_of_the_scale_factor():
    blocks = SCHEDULE.experiment.blocks(1000)
    rate = SCHEDULE.of_blocks(blocks)[None, :]
    for gain in (1.0, 2.5):
        means = gain * np.where(rate > 0, 1.01, 0.99) * rate
        found = fit_rate_table(SCHEDULE, blocks, means, MODELS["N"]).asymmetry
        assert found.value[0] == pytest.approx(0.02, rel=1e-9)
    plain = fit_rate_table(SCHEDULE, blocks, rate, MODELS["N"]).asymmetry.sigma
    assert found.sigma == pytest.approx(plain / 2.5, rel=1e-9)
    dead = fit_rate_table(SCHEDULE, blocks, 0.0 * rate, MODELS["N"])
    assert dead.asymmetry is None and dead.linearity.value[0] == 0.0
    assert "does not follow the table" in dead.not_observable[-1].reason


def test_white_noise_gives_the_straight_line_of_ordinary_least_squares():
    blocks = SCHEDULE.experiment.blocks(1000)
    means = np.random.default_rng(1).standard_normal((1, len(blocks))) + 20.0 * np.array(RATES)
    found = fit_rate_table(SCHEDULE, blocks, means, MODELS["N"])
    slope, offset = np.polyfit(RATES, means[0], 1)
    assert found.scale_factor.value[0] == pytest.approx(slope, rel=1e-9)
    assert found.bias.value[0] == pytest.approx(offset, rel=1e-9)
    spread = np.sum((np.array(RATES) - np.mean(RATES)) ** 2)
    assert found.scale_factor.sigma == pytest.approx(1e-3 / math.sqrt(25.0 * spread), rel=1e-9)
    # The further terms are those of polynomial and two-slope regression.
    assert found.quadratic.value[0] == pytest.approx(np.polyfit(RATES, means[0], 2)[0], rel=1e-8)
    two = np.column_stack([np.ones(7), np.maximum(RATES, 0), np.minimum(RATES, 0)])
    positive, negative = np.linalg.lstsq(two, means[0], rcond=None)[0][1:]
    mean = (positive + negative) / 2.0
    assert found.asymmetry.value[0] == pytest.approx((positive - negative) / mean, rel=1e-7)
    # The largest deviation from the line, over the largest rate of 1 rad/s, and its standard error.
    levels, of, number = np.unique(RATES, return_inverse=True, return_counts=True)
    left = np.bincount(of, means[0] - slope * np.array(RATES) - offset) / number
    largest = int(np.abs(left).argmax())
    assert found.linearity.value[0] == pytest.approx(abs(left[largest]), abs=1e-9)
    taken = 1.0 / 7.0 + (levels - np.mean(RATES)) ** 2 / spread
    sigma = 1e-3 / 5.0 * np.sqrt(1.0 / number - taken)
    assert found.linearity.sigma == pytest.approx(sigma[largest], rel=1e-6)


@pytest.mark.release
@pytest.mark.parametrize("logs", few([10], [40]))
def test_logs_of_the_simulator_give_their_scale_factor(logs):
    noise = MODELS["N+GM+K"]
    model = SensorModel(noise=noise, bias=0.02, scale_error=0.003)
    table = np.interp(
        np.arange(1680) / 8.0,
        np.concatenate([(start, stop) for start, stop, _ in STEPS]),
        np.repeat(RATES, 2),
    )
    true = table + UP.rate
    errors = []
    for seed in range(logs):
        log = simulate(model, 8.0, 1680, np.random.default_rng(seed), true=lambda a, b: true[a:b])
        log[100:103] = np.nan
        found, measured = calibrate(log, SCHEDULE, noise, UP)
        errors.append((found.scale_factor.value[0] - 1.003) / found.scale_factor.sigma)
        # SensorModel has the bias behind the scale factor.
        errors.append((found.bias.value[0] - 0.02) / found.bias.sigma)
    assert measured.missing == 3
    low, high = chi2(2 * logs).ppf([0.0025, 0.9975])
    assert low < np.sum(np.square(errors)) < high
    by_column = Schedule.from_column(table, 8.0, tolerance=1e-9, shortest=20.0)
    again, _ = calibrate(log, by_column, noise, UP)
    assert again.scale_factor.value == pytest.approx(found.scale_factor.value, abs=1e-4)


def test_the_direction_of_the_axis_is_in_the_bias():
    blocks = SCHEDULE.experiment.blocks(1000)
    model = NoiseModel(N=1e-6)
    means = np.zeros((1, len(blocks)))
    sure, unsure = (
        fit_rate_table(
            SCHEDULE,
            blocks,
            means,
            model,
            Pointing(latitude=0.4, heading=0.9, heading_sigma=sigma),
        )
        for sigma in (0.0, 0.3)
    )
    assert unsure.bias.sigma > 10 * sure.bias.sigma
    assert unsure.bias.noise_sigma == pytest.approx(sure.bias.sigma)
    assert unsure.scale_factor.sigma == pytest.approx(sure.scale_factor.sigma)
    left_out = fit_rate_table(SCHEDULE, blocks, means, model)
    assert [one.quantity for one in left_out.not_observable] == ["bias", "asymmetry"]


def test_one_rate_tells_no_scale_factor():
    one = Schedule.from_steps([(0, 20, 0.5), (25, 50, 0.5)], 8.0)
    with pytest.raises(
        NotObservableError, match=r"one rate only, 0\.5 rad/s: scale factor and bias cannot"
    ):
        calibrate(np.zeros(400), one, MODELS["N"])


def test_two_rates_tell_no_more_than_a_line():
    two = Schedule.from_steps([(0, 20, 0.5), (25, 50, -0.5)], 8.0)
    found, _ = calibrate(np.zeros(400), two, MODELS["N"], UP)
    assert found.quadratic is None and found.linearity is None and found.asymmetry is None
    assert {one.quantity for one in found.not_observable} == {
        "quadratic",
        "linearity",
        "asymmetry",
    }
    same_sense = Schedule.from_steps([(0, 20, 0.5), (25, 50, 1.0), (55, 80, 2.0)], 8.0)
    found, _ = calibrate(np.zeros(640), same_sense, MODELS["N"], UP)
    assert found.asymmetry is None
    assert found.quadratic is not None


def test_what_cannot_be_is_refused():
    blocks = SCHEDULE.experiment.blocks(1000)
    means = np.zeros((1, len(blocks)))
    with pytest.raises(ValueError, match="setting_sigma"):
        fit_rate_table(SCHEDULE, blocks, means, MODELS["N"], setting_sigma=-1.0)
    with pytest.raises(ValueError, match="heading of the table's axis"):
        fit_rate_table(SCHEDULE, blocks, means, MODELS["N"], Pointing(latitude=0.4, heading=None))
    with pytest.raises(ValueError, match="the log has 10 samples, expected"):
        calibrate(np.zeros(10), SCHEDULE, MODELS["N"])
