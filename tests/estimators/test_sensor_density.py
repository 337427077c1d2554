"""N_sensor, the density before a low-pass or an interpolation, beside N."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from imubench_pipeline.estimators.cutoff import Cutoff
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.frame import Band, FitSelection, estimate_sensor_density
from imubench_pipeline.estimators.intervals import make_ideal_spectrum
from imubench_pipeline.estimators.likelihood import fit
from imubench_pipeline.estimators.posterior import Posterior
from imubench_pipeline.estimators.whittle import Behind, Maximum, Terms
from imubench_pipeline.typing import Array

N, RATE, SAMPLES = 1e-4, 100.0, 40_000

# For the rules alone: no log is fitted, and N is 1.
SPECTRUM = make_ideal_spectrum(10.0, 4000.0, 5.0)
ONES = np.ones(len(SPECTRUM.frequency))


def white(samples: int, rate: float, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    return np.asarray(N * np.sqrt(rate) * rng.standard_normal(samples))


def test_behind_an_analogue_filter_the_folds_are_in_n_and_not_in_n_sensor() -> None:
    # White noise behind a first-order filter is an AR(1) sequence of variance N^2 pi f_c.
    cutoff = 20.0
    x = np.pi * cutoff / RATE
    decay = np.exp(-2.0 * x)
    driven = N * np.sqrt(np.pi * cutoff * (1.0 - decay**2)) * white(SAMPLES, 1.0, 2) / N
    estimate = fit(lfilter([1.0], [1.0, -decay], driven), RATE).estimates[0]
    in_the_log, sensor = estimate.parameters["N"], estimate.parameters["N_sensor"]
    # Its folds add up to x coth x of the density at no frequency.
    assert in_the_log.value == pytest.approx(N * np.sqrt(x / np.tanh(x)), rel=0.02)
    assert estimate.model.N == in_the_log.value
    for parameter, truth in ((in_the_log, N * np.sqrt(x / np.tanh(x))), (sensor, N)):
        assert parameter.status == "ok"
        assert parameter.lower is not None and parameter.upper is not None
        assert parameter.lower < truth < parameter.upper
    # Of an AR(1) sequence both its parameters are unknown, and the logarithm of the variance
    # s^2 / (1 - a)^2 at no frequency has the variance 2 / n + 4 (1 + a) / (1 - a) / n.
    error = 0.5 * np.sqrt((2.0 + 4.0 * (1.0 + decay) / (1.0 - decay)) / SAMPLES)
    stated = np.log(in_the_log.upper / in_the_log.lower) / (2.0 * 1.96)
    assert stated == pytest.approx(error, rel=0.2)


def test_without_a_filter_there_is_no_n_sensor() -> None:
    estimate = fit(white(SAMPLES, RATE, 2), RATE).estimates[0]
    assert "N_sensor" not in estimate.parameters
    assert estimate.parameters["N"].value == pytest.approx(N, rel=0.02)


@pytest.mark.release  # to twice the rate every day
def test_of_a_log_interpolated_at_any_place_n_sensor_is_doubtful_and_n_on_the_curve() -> None:
    # Variance 2/3 and covariance 1/4 of neighbours, so 7/6 of the density at no frequency.
    place = np.random.default_rng(3).uniform(size=60_000)
    samples = white(len(place) + 1, RATE, 2)
    found = fit((1.0 - place) * samples[:-1] + place * samples[1:], RATE)
    in_the_log, sensor = (found.estimates[0].parameters[name] for name in ("N", "N_sensor"))
    for parameter, truth, status in (
        (in_the_log, N * np.sqrt(7.0 / 6.0), "ok"),
        (sensor, N, "doubtful"),
    ):
        assert parameter.status == status
        assert parameter.lower is not None and parameter.upper is not None
        assert parameter.lower < truth < parameter.upper
    assert "interpolated" in (sensor.reason or "")


def test_of_a_log_interpolated_to_twice_the_rate_n_is_on_the_curve() -> None:
    # Every second sample is the mean of its neighbours: white noise beside a mean of two.
    log = np.empty(2 * SAMPLES)
    log[::2] = white(SAMPLES, RATE, 3)
    log[1::2] = 0.5 * (log[::2] + np.roll(log[::2], -1))
    found = fit(log, 2.0 * RATE)
    in_the_log = found.estimates[0].parameters["N"]
    assert in_the_log.value == pytest.approx(N, rel=0.03)
    assert in_the_log.status == "ok"


def low_pass(floor: float = 0.0, **more: object) -> Cutoff:
    return Cutoff(
        Parameter(2.0), 2, Parameter(1.0), floor, 30.0, kind="analogue",
        **{"behind": Behind(ONES, ONES, ONES), **more},
    )  # fmt: skip


def of_rules(
    low_pass: Cutoff | None, terms: Terms | None = None, *times: float
) -> Parameter | None:
    """N_sensor of a fit with N = 1 from 0.9 to 1.1, and processes of B = 1."""
    every, powers = ONES > 0.0, np.ones(1 + len(times))
    frame = FitSelection([], every, every, Band(5.0, "whole"), low_pass, shortest=0.3)
    terms = terms or Terms("N", len(times))
    drawn = np.column_stack([np.linspace(0.9, 1.1, 4001), *np.ones((len(times), 4001))])
    posterior = Posterior(drawn, np.tile(times, (4001, 1)), np.zeros(4001), 4001.0)
    maximum = Maximum(terms, powers, np.array(times), 0.0, 0.0)
    return estimate_sensor_density(frame, maximum, posterior, SPECTRUM, np.random.default_rng(0))


def told(found: Parameter | None) -> Parameter:
    assert found is not None
    return found


def test_without_a_low_pass_or_white_noise_nothing_is_said() -> None:
    assert of_rules(None) is None
    assert of_rules(low_pass(), Terms("K")) is None
    assert of_rules(low_pass(behind=None)) is None


@pytest.mark.parametrize(("share", "status"), [(0.04, "doubtful"), (0.02, "ok")])
def test_white_noise_beside_a_low_pass_may_be_of_the_same_sensor(share: float, status: str) -> None:
    # That of rounding, a tenth, is known, and none of it.
    found = told(of_rules(low_pass(np.sqrt(share + 0.1), rounded=0.1)))
    assert (found.value, found.status) == (1.0, status)
    widened = np.sqrt(1.0 + share) if status == "doubtful" else 1.0
    assert (found.lower, found.upper) == pytest.approx((0.905, 1.095 * widened))


def test_a_process_that_may_be_a_filter_leaves_n_sensor_between_both() -> None:
    found = told(of_rules(low_pass(behind=None, or_process="alike", N_behind=3.0)))
    assert (found.value, found.status, found.reason) == (None, "not_identified", "alike")
    assert found.upper is not None and found.upper >= 3.0


def test_a_process_of_a_few_samples_may_be_a_filter_before_all_noise() -> None:
    assert of_rules(low_pass(behind=None), None, 1.2) is None
    found = told(of_rules(low_pass(behind=None), None, 0.8))
    assert (found.value, found.status) == (None, "not_identified")
    # Its density at no frequency is that of white noise: B^2 = 1 makes 2 sigma^2 T_B of it.
    sigma = np.sqrt(np.log(2.0) / np.pi) / 0.4365
    assert found.upper == pytest.approx(np.sqrt(1.0 + 2.0 * sigma**2 * 0.8), rel=0.02)
    # Only the fastest may be a filter.
    assert told(of_rules(low_pass(behind=None), None, 0.8, 70.0)).upper == found.upper


@pytest.mark.parametrize("process", [True, False])
def test_between_a_process_and_a_filter_the_error_of_the_fit_is_in_the_limits(
    process: bool,
) -> None:
    doubt = {"or_process": "alike", "N_behind": 3.0} if process else {}
    times = () if process else (0.8,)
    found = told(of_rules(low_pass(behind=None, **doubt), None, *times))
    # N without the filter is known from 0.905 to 1.095 with 95 %.
    assert found.lower == pytest.approx(0.905, abs=0.005)
