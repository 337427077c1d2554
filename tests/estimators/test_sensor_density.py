"""N_sensor, the density before a low-pass or an interpolation, beside N."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from imubench_pipeline.estimators.likelihood import fit
from imubench_pipeline.typing import Array

N, RATE, SAMPLES = 1e-4, 100.0, 200_000


def white(samples: int, rate: float, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    return np.asarray(N * np.sqrt(rate) * rng.standard_normal(samples))


def test_behind_an_analogue_filter_the_folds_are_in_n_and_not_in_n_sensor() -> None:
    # White noise behind a first-order filter is an AR(1) sequence of variance N^2 pi f_c.
    cutoff = 40.0
    x = np.pi * cutoff / RATE
    decay = np.exp(-2.0 * x)
    driven = N * np.sqrt(np.pi * cutoff * (1.0 - decay**2)) * white(SAMPLES, 1.0, 1) / N
    estimate = fit(lfilter([1.0], [1.0, -decay], driven), RATE).estimates[0]
    in_the_log, sensor = estimate.parameters["N"], estimate.parameters["N_sensor"]
    assert in_the_log.value == pytest.approx(N * np.sqrt(x / np.tanh(x)), rel=0.02)
    assert sensor.lower is not None and sensor.upper is not None
    assert sensor.lower < N < sensor.upper
    assert estimate.model.N == in_the_log.value


def test_without_a_filter_there_is_no_n_sensor() -> None:
    estimate = fit(white(SAMPLES, RATE, 2), RATE).estimates[0]
    assert "N_sensor" not in estimate.parameters
    assert estimate.parameters["N"].value == pytest.approx(N, rel=0.02)


def test_of_an_interpolated_log_n_is_on_the_curve() -> None:
    # Every second sample is the mean of its neighbours: white noise beside a mean of two.
    log = np.empty(2 * SAMPLES)
    log[::2] = white(SAMPLES, RATE, 3)
    log[1::2] = 0.5 * (log[::2] + np.roll(log[::2], -1))
    found = fit(log, 2.0 * RATE)
    in_the_log = found.estimates[0].parameters["N"]
    assert found.stretch is not None
    assert in_the_log.value == pytest.approx(found.stretch.level, rel=0.03)
    assert in_the_log.value == pytest.approx(N, rel=0.03)
    assert in_the_log.status == "ok"
