import math
import re

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import toeplitz

from imubench_pipeline.allan import allan_variance
from imubench_pipeline.estimators.spectrum import choose_block_size, compute_spectra
from imubench_pipeline.estimators.thermal.fit import fit_temperature
from imubench_pipeline.estimators.thermal.path import estimate_temperature_path
from imubench_pipeline.estimators.thermal.regression import BlockSeries, Coefficients, Regressors
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


def fitted(log, readings, segments=None, rate=RATE, **options):
    rng = np.random.default_rng(11)
    path = estimate_temperature_path([readings], segments or [(0, len(log))], rng)
    # A band that is stated: no filter is looked for, which takes longest.
    options = {"band": 0.5 * rate} | options
    return fit_temperature(lambda: [log], len(log), rate, path, rng=rng, **options)


def test_products_with_the_log_itself_are_its_spectrum():
    # Long enough for block means, in two segments.
    rng = np.random.default_rng(1)
    samples, spans = 300_000, [(0, 140_000), (150_000, 300_000)]
    log = rng.standard_normal(samples).cumsum()
    series = BlockSeries(spans, choose_block_size(spans))
    spectrum, _ = compute_spectra(series.watch(np.array_split(log, 11)), samples, 100.0, spans)
    coefficients = Coefficients(spectrum, series)
    low = spectrum.block > 1
    assert low.sum() > 64
    assert coefficients.density()[low] == pytest.approx(spectrum.density[low], rel=1e-9)
    ramp = coefficients.products([coefficients.of_time(100.0)])
    assert ramp.gram[low, 0, 0] == pytest.approx(spectrum.ramp[low], rel=1e-6, abs=1e-12)
    assert ramp.cross[low, 0] == pytest.approx(
        spectrum.cross[low], abs=1e-6 * float(np.abs(spectrum.cross).max())
    )


def test_a_temperature_that_steps_between_segments_is_no_regressor():
    # Equal within each segment: the coefficients, which leave the means out, are 0.
    segments = [(0, 45_000), (45_000, SAMPLES)]
    readings = np.where(TIME < 9_000.0, 20.0, 30.0)
    log = simulate(NOISE, RATE, SAMPLES, np.random.default_rng(9))
    path = estimate_temperature_path([readings], segments, np.random.default_rng(10))
    series = BlockSeries(segments, choose_block_size(segments))
    spectrum, _ = compute_spectra(series.watch([log]), SAMPLES, RATE, segments)
    coefficients = Coefficients(spectrum, series)
    levels = np.where(path.sample < 45_000, 20.0, 30.0)
    assert np.abs(coefficients.of_knots(path, [levels])).max() < 1e-9


@pytest.mark.release
def test_what_temperature_adds_to_one_segment_is_not_taken_from_the_next():
    segments = [(0, 45_000), (45_000, SAMPLES)]
    off = DAY - DAY.mean() + np.where(TIME < 9_000.0, 0.0, 20.0)
    s = 1e-3
    log = simulate(NoiseModel(N=1e-4), RATE, SAMPLES, np.random.default_rng(12)) + s * off
    fit = fitted(log, 20.0 + off, segments, longest_lag=0.0, quadratic=False)
    assert fit.compensated
    taken = log - np.concatenate(list(fit.compensate(np.array_split(log, 7))))
    truth = s * (off - off.mean())
    assert np.abs(taken - truth).max() < 0.005 * s * np.ptp(off)


def test_sensitivity_for_known_noise_is_generalised_least_squares():
    # The dense covariance of white noise, a process and a walk, and a free level.
    n = 600
    rng = np.random.default_rng(2)
    noise = NoiseModel(N=1e-4, K=2e-5)
    t = np.arange(n) / RATE
    temperature = 20.0 + 3.0 * np.sin(2.0 * np.pi * t / 50.0) + 0.01 * t
    log = simulate(noise, RATE, n, rng) + 2e-4 * temperature
    steps = np.minimum.outer(np.arange(n), np.arange(n)) / RATE * noise.K**2
    covariance = toeplitz(np.r_[noise.N**2 * RATE, np.zeros(n - 1)]) + steps
    columns = np.column_stack([temperature, np.ones(n)])
    weighted = np.linalg.solve(covariance, columns)
    information = columns.T @ weighted
    exact = np.linalg.solve(information, weighted.T @ log)[0]
    bound = math.sqrt(np.linalg.inv(information)[0, 0])

    spans = [(0, n)]
    path = estimate_temperature_path([temperature], spans, rng)
    series = BlockSeries(spans, choose_block_size(spans))
    spectrum, _ = compute_spectra(series.watch([log]), n, RATE, spans)
    used = np.ones(len(spectrum.density), dtype=np.bool_)
    regressors = Regressors(Coefficients(spectrum, series), path, RATE, path.mean, used)
    weights = (
        spectrum.ordinates
        / noise.sampled_spectrum(2.0 * np.pi * spectrum.frequency / RATE, RATE)
        * RATE
    )
    found = regressors.at(0.0, weights)
    assert math.sqrt(found.covariance[0, 0]) == pytest.approx(bound, rel=0.02)
    assert found.beta[0] == pytest.approx(exact, abs=0.15 * bound)
    # What the fit takes from the log is the freedom of its one parameter.
    left = regressors.without(spectrum, found, weights)
    assert spectrum.ordinates.sum() - left.ordinates.sum() == pytest.approx(1.0, abs=0.01)
    # A ramp is in all of the ordinates as it was.
    ramp = left.ramp * left.ordinates
    assert ramp == pytest.approx(spectrum.ramp * spectrum.ordinates)


# Test_compensation.py takes a sensitivity out and the next test a lag every day.
@pytest.mark.release
def test_sensitivity_lag_and_bias_are_found_and_taken_out():
    rng = np.random.default_rng(3)
    s, lag, bias = 4e-5, 200.0, 3e-3
    log = simulate(NOISE, RATE, SAMPLES, rng) + bias + s * (behind(DAY, lag) - DAY.mean())
    fit = fitted(log, np.round(DAY), quadratic=False, band=None)
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
    plain = fit.plain.estimates[0].parameters["K"]
    left = fit.without_temperature.estimates[0].parameters["K"]
    assert plain.lower > NOISE.K  # temperature passes for a walk
    assert left.lower < NOISE.K < left.upper
    rest = np.concatenate(list(fit.compensate(np.array_split(log, 7))))
    size = np.array([int(2_000 * RATE)])
    before, after = (allan_variance(x, RATE, cluster_sizes=size).deviation for x in (log, rest))
    assert after < 0.5 * before


@pytest.mark.release
def test_a_lag_is_found_and_taken_out():
    rng = np.random.default_rng(3)
    day, s, lag, bias = DAY[::4], 1.6e-4, 50.0, 3e-3
    log = simulate(NOISE, RATE, len(day), rng) + bias + s * (behind(day, lag) - day.mean())
    fit = fitted(log, day, quadratic=False, band=None)
    assert fit.compensated
    assert fit.quadratic.status == "absent"
    assert fit.sensitivity.lower < s < fit.sensitivity.upper
    assert fit.lag.lower < lag < fit.lag.upper
    assert fit.bias.lower < bias < fit.bias.upper
    rest = np.concatenate(list(fit.compensate(np.array_split(log, 7))))
    size = np.array([int(500 * RATE)])
    before, after = (allan_variance(x, RATE, cluster_sizes=size).deviation for x in (log, rest))
    assert after < 0.5 * before


def half_bic(likelihood, ordinates):
    """Of the chosen model, the ordinates of the log counted, those that a fit has taken too."""
    left, density = likelihood.spectrum, likelihood.fitted
    data = left.density * left.ordinates / ordinates
    cost = 0.5 * np.sum(ordinates * (np.log(density) + data / density))
    return cost + 0.5 * likelihood.candidates[0].terms.parameters * math.log(len(density))


@pytest.mark.release  # test_compensation.py has such a log every day
def test_a_temperature_that_does_nothing_is_left_in():
    rng = np.random.default_rng(4)
    fit = fitted(simulate(NOISE, RATE, SAMPLES, rng), np.round(DAY), band=None)
    assert not fit.compensated
    assert fit.sensitivity.lower < 0.0 < fit.sensitivity.upper
    assert fit.lag.status == "not_identified"
    assert fit.without_temperature is fit.plain
    assert not fit.effect.any()


@pytest.mark.release
def test_temperature_that_cannot_be_told_from_time_is_said():
    samples = SAMPLES // 4
    readings = 20.0 + 8.0 * TIME[:samples] / TIME[samples]
    rng = np.random.default_rng(5)
    log = simulate(NOISE, RATE, samples, rng) + 4e-5 * readings
    fit = fitted(log, readings)
    assert fit.sensitivity.status == "not_identified"
    assert fit.sensitivity.value is None
    said = re.search(r"too close to a ramp.* explain (\d+) %", fit.sensitivity.reason)
    assert said is not None and 95 <= int(said[1]) <= 100
    assert not fit.compensated


@pytest.mark.release
def test_a_constant_temperature_is_refused_before_holes_are_filled_again(monkeypatch):
    rng = np.random.default_rng(13)
    samples = SAMPLES // 4
    log = simulate(NOISE, RATE, samples, rng) + 3e-3
    log[rng.random(samples) < 0.03] = np.nan

    def never(*_):
        raise AssertionError("a joint fit")

    monkeypatch.setattr("imubench_pipeline.estimators.thermal.fit._Fit.settle", never)
    fit = fitted(log, np.full(samples, 21.0), holes=True)
    assert "changes" in fit.sensitivity.reason
    # The likeliest noise has a ramp: so does its walk look here, which carries the mean.
    assert fit.plain.estimates[0].parameters["R"].value is not None
    assert fit.bias.lower < 3e-3 < fit.bias.upper


@pytest.mark.release
def test_holes_and_segments_leave_the_sensitivity():
    rng = np.random.default_rng(6)
    log = simulate(NOISE, RATE, SAMPLES, rng) + 6e-5 * (DAY - DAY.mean())
    log[rng.random(SAMPLES) < 0.03] = np.nan
    log[20_000:20_400] = np.nan
    fit = fitted(log, np.round(DAY, 2), [(0, 50_000), (50_000, SAMPLES)], holes=True)
    assert fit.compensated
    assert fit.sensitivity.lower < 6e-5 < fit.sensitivity.upper


@pytest.mark.release
@pytest.mark.parametrize("missing", [0, 2_000])
def test_steps_of_a_temperature_are_no_lines_of_the_noise_that_it_leaves(missing):
    rng = np.random.default_rng(31)
    readings = rng.uniform(10.0, 40.0, 8)[np.minimum(TIME * 8 // TIME[-1], 7).astype(int)]
    vibration = 3e-5 * np.sin(2.0 * np.pi * 0.7 * TIME)
    log = simulate(NoiseModel(N=1e-4, B=3e-5), RATE, SAMPLES, rng) + 1e-4 * readings + vibration
    log[rng.integers(0, SAMPLES, missing)] = np.nan
    fit = fitted(log, readings, holes=missing > 0)
    assert fit.compensated
    (line,) = fit.without_temperature.lines
    assert line.frequency == pytest.approx(0.7, abs=1e-3)


@pytest.mark.release
def test_a_square_is_found_where_there_is_one():
    rng = np.random.default_rng(7)
    day = DAY[: SAMPLES // 2 : 2]
    off = day - day.mean()
    log = simulate(NoiseModel(N=1e-4), RATE, len(day), rng) + 2e-5 * off + 3e-6 * off**2
    fit = fitted(log, day, longest_lag=0.0)
    assert fit.quadratic.lower < 3e-6 < fit.quadratic.upper
    assert fit.sensitivity.lower < 2e-5 < fit.sensitivity.upper
    # What it gains is what the likelihood does, less two parameters more.
    ordinates = fit.plain.spectrum.ordinates
    gained = half_bic(fit.plain, ordinates) - half_bic(fit.without_temperature, ordinates)
    told = float(re.search(r"by ([\d.]+)$", fit.reason)[1])
    assert told == pytest.approx(2.0 * (gained - math.log(len(ordinates))), abs=0.2)


@pytest.mark.release
def test_gyro_y_of_the_tag_follows_its_temperature(shared):
    log = pd.read_csv(shared / "logs/cats/day1.csv.gz")
    values = log["gyro_y_mrad_s"].to_numpy() * 1e-3
    fit = fitted(values, log["temperature_degC"].to_numpy(), rate=1.0, band=None)
    s = fit.sensitivity
    assert s.value == pytest.approx(0.46e-3, abs=0.01e-3)
    assert 0.35e-3 < s.lower < s.value < s.upper < 0.55e-3
    rest = np.concatenate(list(fit.compensate([values])))
    for size, times in ((1_000, 1.5), (3_000, 3.0), (10_000, 6.0)):
        n = np.array([size])
        before, after = (allan_variance(x, 1.0, cluster_sizes=n).deviation for x in (values, rest))
        assert before > times * after
