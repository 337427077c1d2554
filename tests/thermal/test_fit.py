import math
import re

import numpy as np
import pandas as pd
import pytest

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.estimators.thermal.fit import fit_temperature
from imubench_pipeline.estimators.thermal.path import estimate_temperature_path
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate

RATE = 5.0
SAMPLES = 90_000
TIME = np.arange(SAMPLES) / RATE
DAY = 22.0 + 6.0 * np.sin(2.0 * np.pi * TIME / 9_000.0 + 0.3)
NOISE = NoiseModel(N=1e-4, K=1e-6)


def behind(values, lag):
    decay = math.exp(-1.0 / (lag * RATE))
    result = np.empty_like(values)
    result[0] = values[0]
    for i in range(1, len(values)):
        result[i] = decay * result[i - 1] + (1.0 - decay) * values[i]
    return result


def fitted(log, readings, segments=None, rate=RATE):
    rng = np.random.default_rng(11)
    path = estimate_temperature_path([readings], segments or [(0, len(log))], rng)
    return fit_temperature([log], len(log), rate, path)


def test_what_temperature_adds_to_one_segment_is_not_taken_from_the_next():
    segments = [(0, 45_000), (45_000, SAMPLES)]
    off = DAY - DAY.mean() + np.where(TIME < 9_000.0, 0.0, 20.0)
    s = 1e-3
    log = simulate(NoiseModel(N=1e-4), RATE, SAMPLES, np.random.default_rng(12)) + s * off
    fit = fitted(log, 20.0 + off, segments)
    assert fit.compensated
    taken = log - np.concatenate(list(fit.compensate(np.array_split(log, 7))))
    truth = s * (off - off.mean())
    assert np.abs(taken - truth).max() < 0.005 * s * np.ptp(off)


def test_sensitivity_lag_and_bias_are_found_and_taken_out():
    rng = np.random.default_rng(3)
    s, lag, bias = 4e-5, 200.0, 3e-3
    log = simulate(NOISE, RATE, SAMPLES, rng) + bias + s * (behind(DAY, lag) - DAY.mean())
    fit = fitted(log, np.round(DAY))
    assert fit.compensated
    assert fit.quadratic.status == "absent"
    assert fit.sensitivity.lower < s < fit.sensitivity.upper
    assert fit.sensitivity.value == pytest.approx(s, rel=0.15)
    assert fit.lag.lower < lag < fit.lag.upper
    assert fit.bias.lower < bias < fit.bias.upper
    # The mean less what temperature adds on average; known as the mean of white noise and a walk.
    effect = fit.path.at(np.arange(SAMPLES), fit.effect).mean()
    assert fit.bias.value == pytest.approx(log.mean() - effect, abs=1e-7)
    known = math.sqrt(NOISE.N**2 / TIME[-1] + NOISE.K**2 * TIME[-1] / 3.0)
    assert 0.5 < (fit.bias.upper - fit.bias.lower) / 3.92 / known < 2.0
    assert fit.bias.upper - fit.bias.value == pytest.approx(fit.bias.value - fit.bias.lower)
    assert fit.relative_error == pytest.approx(
        (fit.sensitivity.upper - fit.sensitivity.lower) / 3.92 / fit.sensitivity.value
    )
    rest = np.concatenate(list(fit.compensate(np.array_split(log, 7))))
    size = np.array([int(2_000 * RATE)])
    before, after = (allan_variance(x, RATE, cluster_sizes=size).deviation for x in (log, rest))
    assert after < 0.5 * before


def test_a_lag_is_found_and_taken_out():
    rng = np.random.default_rng(3)
    day, s, lag, bias = DAY[::4], 1.6e-4, 50.0, 3e-3
    log = simulate(NOISE, RATE, len(day), rng) + bias + s * (behind(day, lag) - day.mean())
    fit = fitted(log, day)
    assert fit.compensated
    assert fit.quadratic.status == "absent"
    assert fit.sensitivity.lower < s < fit.sensitivity.upper
    assert fit.lag.lower < lag < fit.lag.upper
    assert fit.bias.lower < bias < fit.bias.upper
    rest = np.concatenate(list(fit.compensate(np.array_split(log, 7))))
    size = np.array([int(500 * RATE)])
    before, after = (allan_variance(x, RATE, cluster_sizes=size).deviation for x in (log, rest))
    assert after < 0.5 * before


def test_a_temperature_that_does_nothing_is_left_in():
    rng = np.random.default_rng(4)
    fit = fitted(simulate(NOISE, RATE, SAMPLES, rng), np.round(DAY))
    assert not fit.compensated
    assert fit.sensitivity.lower < 0.0 < fit.sensitivity.upper
    assert fit.lag.status == "not_identified"
    assert not fit.effect.any()


def test_temperature_that_cannot_be_told_from_time_is_said():
    samples = SAMPLES // 4
    readings = 20.0 + 8.0 * TIME[:samples] / TIME[samples]
    rng = np.random.default_rng(5)
    log = simulate(NOISE, RATE, samples, rng) + 4e-5 * readings
    fit = fitted(log, readings)
    assert fit.sensitivity.status == "not_identified"
    assert fit.sensitivity.value is None
    said = re.search(r"close to a ramp: time alone explains (\d+) %", fit.sensitivity.reason)
    assert said is not None and 95 <= int(said[1]) <= 100
    assert not fit.compensated


def test_a_constant_temperature_has_no_effect():
    rng = np.random.default_rng(13)
    samples = SAMPLES // 4
    log = simulate(NOISE, RATE, samples, rng) + 3e-3
    log[rng.random(samples) < 0.03] = np.nan
    fit = fitted(log, np.full(samples, 21.0))
    assert "changes" in fit.sensitivity.reason
    assert fit.bias.lower < 3e-3 < fit.bias.upper


@pytest.mark.parametrize("samples", [10, 70])
def test_a_short_log_has_no_sensitivity(samples):
    fit = fitted(simulate(NOISE, RATE, samples, np.random.default_rng(1)), DAY[:samples])
    assert fit.sensitivity.status == "not_identified"


def test_holes_and_segments_leave_the_sensitivity():
    rng = np.random.default_rng(6)
    log = simulate(NOISE, RATE, SAMPLES, rng) + 6e-5 * (DAY - DAY.mean())
    log[rng.random(SAMPLES) < 0.03] = np.nan
    log[20_000:20_400] = np.nan
    fit = fitted(log, np.round(DAY, 2), [(0, 50_000), (50_000, SAMPLES)])
    assert fit.compensated
    assert fit.sensitivity.lower < 6e-5 < fit.sensitivity.upper


def test_a_square_is_found_where_there_is_one():
    rng = np.random.default_rng(7)
    day = DAY[: SAMPLES // 2 : 2]
    off = day - day.mean()
    log = simulate(NoiseModel(N=1e-4), RATE, len(day), rng) + 2e-5 * off + 3e-6 * off**2
    fit = fitted(log, day)
    assert fit.quadratic.lower < 3e-6 < fit.quadratic.upper
    assert fit.sensitivity.lower < 2e-5 < fit.sensitivity.upper
    assert re.search(r"by ([\d.]+)$", fit.reason)


def test_a_sensor_that_settles_has_another_sensitivity_at_first():
    rng = np.random.default_rng(8)
    off = DAY - DAY.mean()
    warm = np.where(TIME < TIME[-1] / 32.0, off - off[SAMPLES // 32], 0.0)
    log = simulate(NOISE, RATE, SAMPLES, rng) + 6e-5 * off - 3e-4 * warm
    fit = fitted(log, DAY)
    assert fit.compensated and "follow the temperature differently" in fit.reason
    assert fit.sensitivity.lower < 6e-5 < fit.sensitivity.upper
    taken = log - np.concatenate(list(fit.compensate([log])))
    truth = 6e-5 * off - 3e-4 * warm
    error = taken - truth - (taken - truth).mean()
    assert np.abs(error).max() < 0.3 * np.ptp(truth[: SAMPLES // 32])


@pytest.mark.release
def test_gyro_y_of_the_tag_follows_its_temperature(shared):
    log = pd.read_csv(shared / "logs/cats/day1.csv.gz")
    values = log["gyro_y_mrad_s"].to_numpy() * 1e-3
    fit = fitted(values, log["temperature_degC"].to_numpy(), rate=1.0)
    s = fit.sensitivity
    assert s.value == pytest.approx(0.46e-3, abs=0.01e-3)
    assert 0.35e-3 < s.lower < s.value < s.upper < 0.55e-3
    rest = np.concatenate(list(fit.compensate([values])))
    for size, times in ((1_000, 1.5), (3_000, 3.0), (10_000, 6.0)):
        n = np.array([size])
        before, after = (allan_variance(x, 1.0, cluster_sizes=n).deviation for x in (values, rest))
        assert before > times * after
