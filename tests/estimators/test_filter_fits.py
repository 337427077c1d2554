"""Slow noise is told apart behind a filter before its cut-off is fitted."""

import numpy as np
import pytest
from scipy.signal import butter, sosfilt

from imubench_pipeline.estimators.filter_fits import FilterFits, FilterTrial
from imubench_pipeline.estimators.spectrum import spectra
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate

RATE, CUTOFF, OVER = 100.0, 10.0, 8


def slow_terms(model: NoiseModel, seed: int) -> list[float]:
    """The correlation times that are kept behind a first-order filter, s; inf: flicker or a walk.

    The filter works on eight times as many samples as are kept.
    """
    fine = simulate(model, OVER * RATE, OVER * 60_000, np.random.default_rng(seed))
    filtered = sosfilt(butter(1, CUTOFF, fs=OVER * RATE, output="sos"), fine)[::OVER][1000:]
    fits = FilterFits(spectra([filtered], len(filtered), RATE)[0])
    fits.choose_slow(FilterTrial(0.0, 0.0, "analogue", 1, CUTOFF, False))
    return [float(fits.times[place]) for place in fits.slow]


@pytest.mark.parametrize("seed", range(3))
def test_white_noise_alone_asks_for_no_other(seed: int) -> None:
    assert slow_terms(NoiseModel(N=1e-3), seed) == []


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("slow", [{"K": 1e-3}, {"B": 5e-3}], ids=["walk", "flicker"])
def test_a_term_of_one_parameter_is_taken_and_none_of_two(
    slow: dict[str, float], seed: int
) -> None:
    assert set(slow_terms(NoiseModel(N=1e-3, **slow), seed)) == {np.inf}


def test_a_process_is_taken_first_near_its_correlation_time() -> None:
    first, *_ = slow_terms(NoiseModel(N=1e-3, B=1e-2, T_B=3.0), 1)
    assert 2.0 < first < 4.5
