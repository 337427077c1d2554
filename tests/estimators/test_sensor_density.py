"""N_sensor, the density before a low-pass or an interpolation, beside N."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from imubench_pipeline.estimators.likelihood import fit
from imubench_pipeline.typing import Array

N, RATE, SAMPLES = 1e-4, 100.0, 40_000


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
