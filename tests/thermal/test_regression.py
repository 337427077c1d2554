"""Regression on a temperature for given noise, on a log whose ordinates all stay single."""

import numpy as np
import pytest
import scipy.fft

from imubench_pipeline.estimators.model_choice import Candidate, Goodness
from imubench_pipeline.estimators.spectrum import compute_spectra
from imubench_pipeline.estimators.thermal.path import TemperaturePath, apply_lag
from imubench_pipeline.estimators.thermal.regression import BlockSeries, Coefficients, Regressors
from imubench_pipeline.estimators.thermal.uncertainty import (
    _compute_explained_fraction,
    assess_fit,
    assess_lag,
    compute_mean_error,
    compute_path_errors,
    weigh_models,
)
from imubench_pipeline.estimators.whittle import Maximum, Terms, make_whittle
from imubench_pipeline.noise import NoiseModel

RATE, SAMPLES, REFERENCE = 2.0, 64, 20.0
TIMES = np.arange(SAMPLES) / RATE
SWING = 20.0 + 3.0 * np.sin(2.0 * np.pi * TIMES / 20.0 + 0.5) + 1.5 * np.cos(TIMES / 3.0)
RISING = 20.0 + 0.1 * TIMES
N = 0.05


def path_of(values, draws=None):
    knots = np.arange(float(SAMPLES))
    draws = values[None] if draws is None else draws
    whole = (slice(0, SAMPLES),)
    deviation = np.full(SAMPLES, 0.01)
    return TemperaturePath(knots, values, deviation, draws, whole, ((0, SAMPLES),), 0.0, 0.01)


class Log:
    """A log with what is asked of it."""

    def __init__(self, values, path, rate=RATE):
        series = BlockSeries([(0, SAMPLES)], 1)
        self.spectrum, _ = compute_spectra(series.watch([values]), SAMPLES, rate)
        used = np.ones(SAMPLES - 1, dtype=np.bool_)
        self.regressors = Regressors(
            Coefficients(self.spectrum, series), path, rate, REFERENCE, used
        )
        self.interval = 1.0 / rate
        self.coefficients = dct(values)


def dct(values):
    return scipy.fft.dct(np.asarray(values), type=2, norm="ortho")[..., 1:]


def means(knots):
    """Over a sample, of what is linear between samples and flat beyond."""
    wide = np.concatenate((knots[:1], knots, knots[-1:]))
    return (wide[:-2] + 6.0 * wide[1:-1] + wide[2:]) / 8.0


@pytest.fixture(scope="module")
def log():
    noise = N * np.sqrt(RATE) * np.random.default_rng(6).standard_normal(SAMPLES)
    return Log(0.2 * (apply_lag(TIMES, SWING, 1.5) - REFERENCE) + noise, path_of(SWING))


WEIGHTS = 1.0 / N**2 / (1.0 + 30.0 / np.arange(1, SAMPLES) ** 2)


@pytest.mark.parametrize(
    ("quadratic", "ramp", "settling"),
    [(False, False, 0.0), (True, False, 0.0), (True, True, 8.0), (False, False, 8.0)],
)
def test_a_fit_is_that_of_weighted_least_squares(log, quadratic, ramp, settling):
    regressors = log.regressors.also(quadratic=quadratic, ramp=ramp, settling=settling)
    lag = 1.0
    knots = apply_lag(TIMES, SWING, lag) - REFERENCE
    terms = [knots] + [knots**2] * quadratic
    if settling:
        # 8 s are 16 samples, beyond which nothing is added.
        terms.append(np.where(np.arange(SAMPLES) < 16, knots - knots[16], 0.0))
    thermal = len(terms)
    rows = [dct(means(term)) for term in terms] + [dct(TIMES)] * ramp
    X, y = np.array(rows), log.coefficients
    found = regressors.at(lag, WEIGHTS)
    root = np.sqrt(WEIGHTS * log.interval)
    beta, left, *_ = np.linalg.lstsq((X * root).T, y * root)
    np.testing.assert_allclose(found.beta, beta, rtol=1e-6)
    np.testing.assert_allclose(found.covariance, np.linalg.inv((X * root**2) @ X.T), rtol=1e-6)
    assert found.error == pytest.approx(np.sqrt(found.covariance[0, 0]))
    assert found.log_likelihood_gain == pytest.approx(0.5 * (np.sum((y * root) ** 2) - left[0]))
    assert regressors.thermal == thermal
    np.testing.assert_allclose(regressors.effect(found), beta[:thermal] @ np.array(terms))
    np.testing.assert_allclose(regressors.means(lag), [term.mean() for term in terms])
    # As the temperature rises a little, but for where the sensor settles to.
    step = 1e-6
    slope = np.full(SAMPLES, beta[0]) + (2.0 * beta[1] * knots if quadratic else 0.0)
    slope[:16] += beta[thermal - 1] if settling else 0.0
    np.testing.assert_allclose(regressors.slope(found), slope, atol=step)
    # What is left, and the freedom that the fit has taken.
    spectrum = regressors.without(log.spectrum, found, WEIGHTS)
    X = X[:thermal]
    rest = y - beta[:thermal] @ X
    inverse = np.linalg.inv(found.information[:thermal, :thermal])
    taken = np.einsum("ik,ij,jk->k", X * root, inverse, X * root)
    ordinates = np.maximum(1.0 - np.minimum(taken, 1.0), 0.02)
    np.testing.assert_allclose(spectrum.ordinates, ordinates)
    np.testing.assert_allclose(spectrum.density, rest**2 * log.interval / ordinates, rtol=1e-6)
    time = dct(TIMES)
    np.testing.assert_allclose(
        spectrum.cross, rest * time * log.interval / ordinates, rtol=1e-6, atol=1e-9
    )
    np.testing.assert_allclose(spectrum.ramp, time**2 * log.interval / ordinates, rtol=1e-6)


def test_bins_that_are_not_used_do_not_count(log):
    low = np.arange(SAMPLES - 1) < 30
    found = log.regressors.also(used=low).at(1.0, WEIGHTS[low])
    weights = np.where(low, WEIGHTS, 0.0)
    np.testing.assert_allclose(found.beta, log.regressors.at(1.0, weights).beta)


def test_the_best_lag_is_that_of_the_greatest_likelihood(log):
    lags = log.regressors.lags()
    # Half a knot, and a twentieth of 32 s.
    np.testing.assert_allclose(lags, [0.0, *np.geomspace(0.25, 1.6, 16)])
    np.testing.assert_allclose(log.regressors.lags(8.0)[[0, 1, -1]], [0.0, 0.25, 8.0])
    assert log.regressors.lags(0.25).tolist() == [0.0]
    lags = log.regressors.lags(8.0)
    fine = np.linspace(0.0, 8.0, 401)
    gains = [log.regressors.at(lag, WEIGHTS).log_likelihood_gain for lag in fine]
    found = log.regressors.best(WEIGHTS, lags)
    assert found.lag == pytest.approx(fine[int(np.argmax(gains))], abs=0.02)
    assert found.log_likelihood_gain >= max(gains) - 1e-4
    assert log.regressors.best(WEIGHTS, np.array([0.0])).lag == 0.0


def test_the_longest_lag_is_half_an_hour(log):
    slow = Log(SWING, path_of(SWING), rate=RATE / 10_000.0)
    assert slow.regressors.lags().tolist() == [0.0]
    assert Log(SWING, path_of(SWING), rate=RATE / 500.0).regressors.lags()[-1] == 800.0
    assert slow.regressors.lags(90_000.0)[1] == pytest.approx(2_500.0)


def test_errors_of_the_path_move_the_fit_and_stay_in_the_log():
    rng = np.random.default_rng(9)
    draws = SWING + 0.1 * rng.standard_normal((5, SAMPLES))
    log = Log(0.2 * (apply_lag(TIMES, SWING, 1.0) - REFERENCE), path_of(SWING, draws))
    found = log.regressors.at(1.0, WEIGHTS)
    changes, residual = compute_path_errors(log.regressors, found, WEIGHTS)
    step = 0.25  # half of the distance of two knots
    by_lag = (
        found.beta[0] * (apply_lag(TIMES, SWING, 1.0 + step) - apply_lag(TIMES, SWING, 1.0)) / step
    )
    columns = [apply_lag(TIMES, SWING, 1.0) - REFERENCE, by_lag]
    root = np.sqrt(WEIGHTS)
    X = np.array([dct(means(column)) for column in columns])
    density = np.zeros(SAMPLES - 1)
    for moved, draw in zip(changes, draws, strict=True):
        error = dct(means(found.beta[0] * apply_lag(TIMES, draw - SWING, 1.0)))
        own = np.linalg.lstsq((X * root).T, error * root)[0]
        np.testing.assert_allclose(moved, own, rtol=1e-3)
        density += (error - own @ X) ** 2 * log.interval / len(draws)
    np.testing.assert_allclose(residual, density, rtol=1e-3, atol=1e-3 * density.max())


def candidate(terms, aic=0.0, share=1.0):
    powers = np.array([N**2] * (len(terms.linear) + terms.gauss_markov))
    maximum = Maximum(terms, powers, np.full(terms.gauss_markov, 5.0), 0.0, 0.0)
    return Candidate(maximum, aic, aic, share, share, Goodness(1.0, 1.0, "explained", ""))


def judged(temperature, s=0.2, gained=30.0, noise=1.0, seed=1, slope=0.0, quadratic=False):
    rng = np.random.default_rng(seed)
    values = s * (temperature - REFERENCE) + slope * TIMES
    log = Log(
        values + noise * N * np.sqrt(RATE) * rng.standard_normal(SAMPLES), path_of(temperature)
    )
    flat = np.full(SAMPLES - 1, 1.0 / N**2)
    regressors = log.regressors.also(quadratic=quadratic)
    found = regressors.at(0.0, flat)
    left = regressors.without(log.spectrum, found, flat)
    whittle = make_whittle(left, RATE / 2.0, 4)
    lags = np.array([0.0])
    verdict = assess_fit(
        regressors, found, whittle, [candidate(Terms("N"))], lags, gained=gained,
        rng=np.random.default_rng(2),
    )  # fmt: skip
    return found, verdict, left


def test_the_interval_of_a_sensitivity_is_that_of_its_error():
    found, verdict, left = judged(SWING)
    s = verdict.sensitivity
    assert (s.status, s.value) == ("ok", found.beta[0])
    # With the noise that the log has, which is not known well: two per cent more.
    error = found.error * float(np.sqrt(np.average(left.density, weights=left.ordinates))) / N
    assert s.upper - s.lower == pytest.approx(2.0 * 1.98 * error, rel=0.06)
    assert 0.5 * (s.lower + s.upper) == pytest.approx(found.beta[0], abs=0.2 * error)
    assert verdict.compensated and verdict.lag.status == "absent"
    off = np.mean(SWING - REFERENCE)
    assert verdict.temperature_error == pytest.approx(abs(off) * error, rel=0.06)


def test_temperature_is_taken_out_where_it_is_sure():
    assert not judged(SWING, gained=3.9)[1].compensated
    assert judged(SWING, gained=4.1)[1].compensated
    _, verdict, _ = judged(SWING, s=0.0)
    assert not verdict.compensated
    assert verdict.reason == "the 95 % interval of the temperature sensitivity includes 0"


def test_a_temperature_that_is_time_is_told_by_neither():
    _, verdict, _ = judged(RISING)
    assert verdict.sensitivity.status == "not_identified"
    assert "close to a ramp: time alone explains 100 %" in verdict.reason
    assert "close to a ramp" in judged(RISING, quadratic=True)[1].reason
    # A rise with a bend is told from a ramp, but not where a ramp explains as much.
    bent = 20.0 + 3.0 * (1.0 - np.exp(-TIMES / 6.0))
    assert judged(bent)[1].sensitivity.status == "ok"
    _, verdict, _ = judged(bent, s=0.0, slope=0.004)
    assert "only rises or only falls" in verdict.reason
    # Back near where it began it rises and falls.
    assert "only rises" not in judged(SWING, s=0.01, slope=0.004)[1].reason


def test_a_temperature_is_told_from_time_whatever_its_square_is_like():
    # Odd about the middle of the log: its square, which is even, has nothing of time.
    middle = TIMES - TIMES.mean()
    for lean in (0.01, -0.01):
        odd = 0.1 * middle + 2.0 * np.sin(0.6 * middle) + lean * np.cos(0.2 * middle)
        _, verdict, _ = judged(REFERENCE + odd, quadratic=True)
        assert verdict.sensitivity.status == "ok"


def test_a_lag_that_is_no_number_has_its_interval_alone():
    draws = np.linspace(0.0, 10.0, 1001)
    assert assess_lag(3.0, draws, 0.0, True).status == "absent"
    assert assess_lag(3.0, draws, 99.0, False).status == "not_identified"
    # From 0: one limit, of the whole 5 %.
    found = assess_lag(0.0, draws, 99.0, True)
    assert (found.status, found.lower, found.upper) == ("not_identified", 0.0, pytest.approx(9.5))
    assert "includes 0" in (found.reason or "")
    # The shortest interval of 95 % leaves out the sparse end.
    skew = np.concatenate([np.linspace(5.0, 6.0, 96), np.linspace(20.0, 30.0, 4)])
    found = assess_lag(5.5, skew, 99.0, True)
    assert (found.status, found.value) == ("ok", 5.5)
    assert (found.lower, found.upper) == pytest.approx((5.0, 6.0), abs=0.03)
    for value in (4.0, 7.0):
        found = assess_lag(value, skew, 99.0, True)
        assert min(value, 5.02) >= (found.lower or 0.0) and max(value, 5.98) <= (found.upper or 0.0)
    # More than half of what was looked for says nothing.
    found = assess_lag(5.5, skew, 1.9, True)
    assert found.status == "not_identified" and "lags from 5" in (found.reason or "")
    assert assess_lag(5.5, skew, 2.1, True).status == "ok"


def test_the_mean_of_a_log_is_known_as_its_noise_lets_it():
    spectrum = Log(SWING, path_of(SWING)).spectrum
    D, K, B, T_B = SAMPLES / RATE, 0.01, 0.03, 4.0
    variance = B**2 * np.log(2.0) / np.pi / 0.4365**2
    process = 2.0 * variance * T_B / D * (1.0 - T_B / D * (1.0 - np.exp(-D / T_B)))
    for model, expected in (
        (NoiseModel(N=N), N**2 / D),
        (NoiseModel(N=N, K=K), N**2 / D + K**2 * D / 3.0),
        (NoiseModel(N=N, R=0.2), N**2 / D + (0.2 * D / 2.0) ** 2),
        (NoiseModel(N=N, B=B, T_B=T_B), N**2 / D + process),
    ):
        assert compute_mean_error([(model, 1.0)], spectrum) == pytest.approx(
            np.sqrt(expected), rel=0.02
        )
    both = [(NoiseModel(N=N), 0.75), (NoiseModel(N=3.0 * N), 0.25)]
    assert compute_mean_error(both, spectrum) == pytest.approx(N * np.sqrt(3.0 / D))


def test_a_walk_has_three_tenths_of_the_models_at_least():
    plain, walk = candidate(Terms("N"), share=0.9), candidate(Terms("NK"), share=0.01)
    slow = candidate(Terms("N", 1), share=0.06)
    weak, ramp = candidate(Terms("NF"), share=0.04), candidate(Terms("N", 0, True), share=0.5)
    found = weigh_models([plain, ramp, slow, weak, walk])
    assert [one.terms for one, _ in found] == [plain.terms, slow.terms, walk.terms]
    least = 0.3 * (0.9 + 0.06 + 0.01)
    total = 0.9 + 0.06 + least
    assert [share for _, share in found] == pytest.approx(
        [0.9 / total, 0.06 / total, least / total]
    )
    assert weigh_models([walk, plain])[0][1] == pytest.approx(0.3 * 0.91 / (0.9 + 0.3 * 0.91))
    assert [share for _, share in weigh_models([plain])] == [1.0]


def test_what_temperature_follows_is_its_squared_correlation(log):
    found = log.regressors.at(0.0, WEIGHTS)
    x, y = dct(means(SWING - REFERENCE)), log.coefficients
    # In eight ordinates, and more where less than 19 parts of 20 of its power are in them.
    assert np.sum(x[:8] ** 2) > 0.95 * np.sum(x**2)
    x, y = x[:8], y[:8]
    expected = (x @ y) ** 2 / (x @ x) / (y @ y)
    assert _compute_explained_fraction(log.regressors, found) == pytest.approx(expected)


def test_what_a_fast_temperature_explains_is_where_most_of_it_is():
    fast = 20.0 + 3.0 * np.sin(2.0 * np.pi * TIMES / 4.0 + 0.5)
    noise = np.random.default_rng(6).standard_normal(SAMPLES)
    made = Log(0.2 * (fast - REFERENCE) + noise, path_of(fast))
    found = made.regressors.at(0.0, WEIGHTS)
    x, y = dct(means(apply_lag(TIMES, fast, 0.0) - REFERENCE)), made.coefficients
    upto = int(np.argmax(np.cumsum(x**2) >= 0.95 * np.sum(x**2))) + 1
    assert 12 < upto < 40
    x, y = x[:upto], y[:upto]
    expected = (x @ y) ** 2 / (x @ x) / (y @ y)
    assert _compute_explained_fraction(made.regressors, found) == pytest.approx(expected)


def test_lags_are_drawn_by_their_likelihood(log):
    flat = np.full(SAMPLES - 1, 1.0 / N**2)
    lags = log.regressors.lags(8.0)
    found = log.regressors.best(flat, lags)
    left = log.regressors.without(log.spectrum, found, flat)
    models = [candidate(Terms("N"))]
    whittle = make_whittle(left, RATE / 2.0, 4)
    told = assess_fit(
        log.regressors, found, whittle, models, lags, gained=30.0, rng=np.random.default_rng(2)
    ).lag
    fine = np.linspace(0.0, 4.0, 400)
    # For the noise that is left.
    scale = float(np.average(left.density, weights=left.ordinates)) / N**2
    gains = [log.regressors.at(lag, flat).log_likelihood_gain for lag in fine]
    mass = np.cumsum(np.exp((np.array(gains) - max(gains)) / scale))
    low, high = np.interp([0.025, 0.975], mass / mass[-1], fine)
    assert told.upper - told.lower == pytest.approx(high - low, rel=0.1)
    assert 0.5 * (told.upper + told.lower) == pytest.approx(0.5 * (high + low), abs=0.1)
