import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import butter, lfilter, sosfilt

from imubench_pipeline.estimators.cutoff import refine_cutoff
from imubench_pipeline.estimators.filter_fits import get_highest_cutoff
from imubench_pipeline.estimators.frame import select_for_fit
from imubench_pipeline.estimators.likelihood import Likelihood, fit
from imubench_pipeline.estimators.low_pass import Filter
from imubench_pipeline.estimators.model_choice import PAPERS_MODEL, compare_models
from imubench_pipeline.estimators.spectrum import compute_spectra
from imubench_pipeline.noise import NoiseModel
from imubench_pipeline.noise.simulate import simulate
from tests.conftest import few

RATE = 100.0
SAMPLES = 150_000
N = 1e-3
T_B = 3.0
"""s: of a process whose density falls below that of the white noise a decade below the cut-off."""


def process(seed: int, samples: int = SAMPLES) -> np.ndarray:
    """A process of eight times the density of the white noise, and the white noise."""
    noise = NoiseModel(N=N, B=N * math.sqrt(8.0 / (2.316 * T_B)), T_B=T_B)
    return simulate(noise, RATE, samples, np.random.default_rng(seed))


@cache
def behind_a_filter(seed: int) -> Likelihood:
    sections = butter(3, 10.0, output="sos", fs=RATE)
    return fit(sosfilt(sections, process(seed, SAMPLES + 2000))[2000:], RATE)


@pytest.mark.release
@pytest.mark.parametrize("logs", [3])
def test_n_and_cutoff_are_unbiased_for_filtered_noise_with_a_process(logs):
    # Flicker noise in place of the process puts N low and the cut-off high by their intervals.
    N_off, cutoff_off = [], []
    for seed in range(logs):
        found = behind_a_filter(seed)
        white, low_pass = found.estimates[0].parameters["N"], found.low_pass
        assert (low_pass.kind, low_pass.order) == ("bilinear", 3)
        N_off.append(math.log(white.value / N) / (math.log(white.upper / white.lower) / 3.92))
        frequency = low_pass.frequency
        width = math.log(frequency.upper / frequency.lower) / 3.92
        cutoff_off.append(math.log(frequency.value / 10.0) / width)
    for off in (np.array(N_off), np.array(cutoff_off)):
        assert abs(off.mean()) < 3.0 / math.sqrt(len(off))
        assert (np.abs(off) < 2.8).all()


@pytest.mark.release
def test_each_model_of_the_noise_has_a_cutoff_of_its_own():
    found = behind_a_filter(0)
    models = found.low_pass.models
    assert PAPERS_MODEL in models and len(models) > 1
    chosen = found.candidates[0].terms
    for terms, of_model in models.items():
        assert of_model.gained >= -1e-3
        best = max(of_model.readings, key=lambda one: one.weight)
        assert best.above < best.at < best.below  # a higher cut-off leaves a lower N
        if terms == chosen:
            assert best.at == pytest.approx(0.0, abs=1e-9)
            assert of_model.gained == pytest.approx(0.0, abs=1e-9)


@pytest.mark.release  # test_cutoff.py finds a mean every day
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_mean_of_many_samples_is_found_between_its_nulls(seed):
    made = lfilter(np.full(14, 1.0 / 14.0), 1.0, process(seed, SAMPLES + 14))[14:]
    found = fit(made, RATE)
    white = found.estimates[0].parameters["N"]
    assert found.low_pass.kind == "boxcar"
    assert white.status == "ok"
    assert white.value == pytest.approx(N, rel=0.015)


# Every day test_low_pass.py has what the ends leave, and the first test here a steep filter.
@pytest.mark.release
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("order, cutoff", [(4, 19.0), (3, 5.8)])
def test_the_ends_of_a_log_do_not_hide_a_steep_digital_filter(seed, order, cutoff):
    sections = butter(order, cutoff, output="sos", fs=RATE)
    made = sosfilt(sections, process(seed, SAMPLES + 2000))[2000:]
    found = fit(made, RATE)
    low_pass, white = found.low_pass, found.estimates[0].parameters["N"]
    assert (low_pass.kind, low_pass.order) == ("bilinear", order)
    assert low_pass.frequency.in_model == pytest.approx(cutoff, rel=8e-3)
    assert (white.status, white.value) == ("ok", pytest.approx(N, rel=0.02))


@pytest.mark.release  # test_joint_cutoff_rules.py has a register every day
def test_a_register_leaves_n_before_the_filter_inside_its_interval():
    sections = butter(2, 10.0, output="sos", fs=RATE)
    made = sosfilt(sections, process(5, SAMPLES + 2000))[2000:]
    step = 0.3 * float(np.std(np.diff(made)))
    found = fit(np.round(made / step) * step, RATE, resolution=step)
    white = found.estimates[0].parameters["N"]
    assert white.lower < N < white.upper
    assert found.low_pass.floor == pytest.approx(step / math.sqrt(12.0 * RATE), rel=0.2)


@pytest.mark.parametrize("seed", few([0], [2, 7]))
def test_no_mean_is_shorter_than_of_two_samples(seed):
    # Of a short log the interval of its length goes beyond; a shorter one has no cut-off.
    rate, samples = 10.0, 1500
    log = simulate(
        NoiseModel(N=1e-4, B=3e-4, T_B=2.0), rate, samples + 1, np.random.default_rng(seed)
    )
    spectrum, lines = compute_spectra([0.5 * (log[1:] + log[:-1])], samples, rate)
    frame = select_for_fit(spectrum, lines)
    means = [one for one in frame.low_pass.allowed if one.filter.kind == "boxcar"]
    assert means
    candidates = compare_models(frame.whittle(spectrum), quantization=False)
    found = refine_cutoff(
        replace(frame.low_pass, allowed=means, kind="boxcar"), spectrum, frame.used, candidates[:2]
    )
    highest = Filter("boxcar", 1, get_highest_cutoff("boxcar", 1, rate)).half_power(rate)
    assert found.frequency.lower < found.frequency.upper <= highest * (1.0 + 1e-9)
