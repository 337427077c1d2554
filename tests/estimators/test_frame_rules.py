"""The part of a spectrum that is fitted, without and with a low-pass."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from imubench_pipeline.estimators.cutoff import Cutoff
from imubench_pipeline.estimators.estimate import Parameter
from imubench_pipeline.estimators.frame import Band, FitSelection, select_for_fit
from imubench_pipeline.estimators.intervals import make_ideal_spectrum
from imubench_pipeline.estimators.likelihood import fit
from imubench_pipeline.estimators.low_pass import Filter
from imubench_pipeline.estimators.spectrum import Spectrum
from imubench_pipeline.typing import Array

RATE = 100.0
FLAT = make_ideal_spectrum(RATE, 1000.0, RATE / 2.0)
EVERY = np.ones(len(FLAT.density), dtype=np.bool_)


def drawn(gain: Array) -> Spectrum:
    density = gain * np.random.default_rng(1).chisquare(FLAT.ordinates) / FLAT.ordinates
    return replace(FLAT, density=density)


def test_quantization_shows_in_a_wide_band_without_a_filter() -> None:
    low_pass = Cutoff(Parameter(20.0), "analogue", 1, Parameter(1.0), gain=np.ones(len(EVERY)))
    frame = FitSelection([], EVERY, EVERY, Band(10.0, "whole"))
    assert frame.shows_quantization(RATE)
    assert not replace(frame, band=Band(9.9, "set")).shows_quantization(RATE)
    assert not replace(frame, low_pass=low_pass).shows_quantization(RATE)


def test_a_band_that_is_asked_for_is_used() -> None:
    spectrum = drawn(np.ones(len(EVERY)))
    found = select_for_fit(spectrum, [], band=20.0)
    assert (found.band.highest, found.low_pass) == (20.0, None)
    assert (found.used == (spectrum.upper <= 20.0 * (1.0 + 1e-9))).all()
    whole = select_for_fit(spectrum, [])
    assert whole.used.all() and whole.band == Band(50.0, "whole")
    assert whole.low_pass is not None and whole.low_pass.gain is None


def test_behind_a_filter_the_band_ends_where_the_bias_of_n_is_half_its_error() -> None:
    white = Filter("analogue", 2, 30.0).white(np.append(0.0, FLAT.frequency), RATE)
    gain = white[1:] / white[0]
    found = select_for_fit(drawn(gain), [])
    assert found.band.source == "attenuated"
    assert found.low_pass is not None
    assert found.low_pass.frequency.in_model == pytest.approx(30.0, rel=0.05)
    used = found.used
    bias = np.average(gain[used] - 1.0, weights=FLAT.ordinates[used])
    error = np.sqrt(2.0 / FLAT.ordinates[used].sum())
    assert 0.2 * error < abs(bias) < 0.7 * error


def test_n_behind_a_steep_filter_is_that_of_the_log_at_low_frequencies() -> None:
    rng = np.random.default_rng(3)
    white = 1e-3 * np.sqrt(RATE) * rng.standard_normal(102_000)
    found = fit(sosfilt(butter(4, 19.0, output="sos", fs=RATE), white)[2000:], RATE)
    assert found.frame.low_pass is not None
    assert (found.frame.low_pass.kind, found.frame.low_pass.order) == ("bilinear", 4)
    for name in ("N", "N_sensor"):
        parameter = found.estimates[0].parameters[name]
        assert parameter.value == pytest.approx(1e-3, rel=0.02)
        assert parameter.lower is not None and parameter.upper is not None
        assert parameter.lower < 1e-3 < parameter.upper
